"""A table of numbers as people export it: text cells with their places."""

from __future__ import annotations

import csv
import hashlib
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.calibration.headers import is_unit
from postproc.calibration.workbooks import SIGN, is_workbook, sheet_text
from postproc.exceptions import MeasurementError
from postproc.files import NamedText

# Reading a table of numbers as people export them.
#
# Comma, semicolon or tab; decimal point or comma; UTF-8, UTF-16 or Latin-1; a sheet of
# a workbook.

MAX_BYTES = 500_000_000
NUMBER = re.compile(
    r"^\s*[-+−]?\d+(?:[ \u00a0\u202f\u2009'’.,]\d{3})*([.,]\d+)?([eE][-+]?\d+)?\s*$"
)
FEW_NUMBERS = 3  # a first line with as many numbers is no header
BLANKS = r"\s+"  # the separator of tables in columns
SEPARATOR = re.compile(r'^\s*"?sep=(.)"?[;,\t]*\s*$', re.I)  # Excel's first line
COMMENTS = ("#", "//", "%")
SAMPLE = 50  # lines that show what parts the cells
EMPTY_CURE = "Expected a header and one row per measurement"
DECIMAL_COMMA = re.compile(r"^\s*[-+−]?\d*,\d+([eE][-+]?\d+)?\s*$", re.M)
DECIMAL_POINT = re.compile(r"^\s*[-+−]?\d*\.\d+([eE][-+]?\d+)?\s*$", re.M)
POINT_LAST = re.compile(r"^\s*[-+−]?\d{1,3}(,\d{3})+\.\d*\s*$", re.M)
COMMA_LAST = re.compile(r"^\s*[-+−]?\d{1,3}(\.\d{3})+,\d*\s*$", re.M)
# Three digits behind one comma, which may be thousands as well as a fraction.
THOUSANDS = {
    ",": re.compile(r"^\s*[-+−]?[1-9]\d{0,2}(,\d{3})+\s*$"),
    ".": re.compile(r"^\s*[-+−]?[1-9]\d{0,2}(\.\d{3})+\s*$"),
}
BETWEEN = re.compile(r"(?<=\d)[ \u00a0\u202f\u2009'’](?=\d{3}(?!\d))")


@dataclass(frozen=True, eq=False)
class TextTable:
    """Text cells with their place in the file.

    Attributes:
        path: The file.
        columns: Header names, stripped.
        cells: Text of all cells, (n, k).
        line: 1-based line of every row, (n,).
        decimal: "." or ",".
        sha256: Hash of the file's bytes.
        headed: Whether the file names its columns; else they are 1, 2, ..
        delimiter: What parts the cells, as `read_table` takes it.
        sheet: Of a workbook: the name of its sheet.
        notes: Comments and titles above the rows.
    """

    path: Path
    columns: tuple[str, ...]
    cells: NDArray[np.object_]
    line: NDArray[np.int64]
    decimal: str
    sha256: str
    headed: bool = True
    delimiter: str = ","
    sheet: str = ""
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.line)

    @property
    def top(self) -> int:
        """Return the line before the first row, which is that of the header."""
        return max(int(self.line[0]) - 1, 1) if len(self) else 1

    def has(self, *names: str) -> bool:
        """Tell whether all columns are there."""
        return all(name in self.columns for name in names)

    def text(self, name: str) -> list[str]:
        """Return a column as stripped text.

        Raises:
            MeasurementError: There is no such column.
        """
        self.require(name)
        return [str(v).strip() for v in self.cells[:, self.columns.index(name)]]

    def numbers(self, name: str, empty: bool = False) -> Floats:
        """Return a column as numbers, (n,).

        Args:
            name: Header name.
            empty: Whether an empty cell is allowed; it becomes NaN.

        Raises:
            MeasurementError: A cell is no finite number; line and column are named.
        """
        out = np.empty(len(self))
        for i, text in enumerate(self.text(name)):
            out[i] = self._number(i, name, text, empty)
        return out

    def block(self, names: tuple[str, ...]) -> Floats:
        """Return several columns as numbers, (n, k)."""
        return np.stack([self.numbers(name) for name in names], axis=1)

    def require(self, *names: str) -> None:
        """Check that columns are there.

        Raises:
            MeasurementError: Naming the missing columns and those that are there.
        """
        missing = [name for name in names if name not in self.columns]
        if missing and not self.headed:
            raise MeasurementError(
                self.path,
                f"has no header: its columns are 1 to {len(self.columns)}, column "
                f"{', '.join(missing)} is missing",
                "Write a header, or name the columns by number in a column map "
                '(measurements.columns) with lines as q1_deg = "8"',
                line=int(self.line[0]),
            )
        if missing:
            raise MeasurementError(
                self.path,
                f"column {', '.join(missing)} is missing",
                f"The header has: {', '.join(self.columns)}. Rename one of these, or "
                "map it (measurements.columns)",
                line=1,
            )

    def _number(self, row: int, name: str, text: str, empty: bool) -> float:
        """Convert one cell."""
        if empty and text == "":
            return float("nan")
        other = "." if self.decimal == "," else ","
        problem, cure = "is not a number", "Correct the cell or remove the row"
        if THOUSANDS[other].match(text):
            fraction, whole = text.replace(",", "."), text.replace(other, "")
            problem = f"may be {fraction} or {whole}"
            cure = (
                f"The decimal sign of the file is {self.decimal!r}. Write the cell so"
            )
        elif np.isfinite(value := number_of(text, self.decimal)):
            return value
        problem = f"{text!r} in column {name} {problem}"
        raise MeasurementError(self.path, problem, cure, line=int(self.line[row]))


def number_of(text: str, decimal: str) -> float:
    """Return the number that a cell holds, NaN where it holds none.

    Blanks and apostrophes between thousands, and the sign that is not the decimal one
    where both are there, part thousands.

    >>> number_of("1 884,225", ","), number_of("-1.884,5", ","), number_of("x", ".")
    (1884.225, -1884.5, nan)
    """
    if not text.isascii() or " " in text or "'" in text:
        text = BETWEEN.sub("", text.strip()).replace("−", "-")
    if "," in text:
        both = COMMA_LAST if decimal == "," else POINT_LAST
        if both.match(text):
            text = text.replace("." if decimal == "," else ",", "")
        text = text.replace(",", ".") if decimal == "," else text
    try:
        return float(text)
    except ValueError:
        return float("nan")


def read_table(
    path: str | Path | NamedText,
    encoding: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
    comment: str | None = None,
    header: bool | None = True,
    sheet: str | None = None,
) -> TextTable:
    """Read a table; what is not given is detected.

    A line ``sep=;`` names the separator, as Excel writes it. Comment lines, a title
    above the header, empty rows and empty cells at the ends of rows are no data.

    Args:
        path: The file, or its text.
        encoding: Name of a Python codec.
        delimiter: Between cells.
        decimal: "." or ",".
        comment: Lines that begin with it are no data; default: # and // and %.
        header: Whether the first line names the columns; else they are 1, 2, ..; None:
            it does unless it holds numbers.
        sheet: Of a workbook: the sheet to read; default: the only one with a table.

    Raises:
        MeasurementError: The file cannot be read, is empty, or its lines differ.
    """
    path, raw = _read(path)
    if is_workbook(raw):
        sheet, content = sheet_text(path, raw, sheet)
        delimiter = SIGN
    else:
        sheet, content = "", _decode(raw, encoding, path)
    lines = [(i + 1, s) for i, s in enumerate(content.splitlines()) if s.strip()]
    separator = SEPARATOR.match(lines[0][1]) if lines else None
    if separator is not None:
        delimiter, lines = delimiter or separator.group(1), lines[1:]
    lines, comments = _without_comments(lines, comment)
    if not lines:
        raise MeasurementError(path, "has no measurements", EMPTY_CURE)
    split = delimiter or _delimiter([text for _, text in lines])
    every = _cut(path, lines, split)
    rows = _without_title(every)
    titles = [" ".join(row).strip() for _, row in every[: len(every) - len(rows)]]
    headed = _is_header(rows[0][1]) if header is None else header
    names_of_columns = _header_in(comments, split, rows) if not headed else None
    if header is not False and names_of_columns is not None:
        rows, headed = [names_of_columns, *rows], True
    if len(rows) < 1 + headed:
        raise MeasurementError(path, "has no measurements", EMPTY_CURE)
    body = rows[1:] if headed else rows
    names = _strip_end(rows[0][1])
    if headed and len(body) > 1 and _is_row_of_units(body[0][1]):
        names, body = _with_units(names, body[0][1]), body[1:]
    if not headed:
        width = int(np.median([len(_strip_end(cells)) for _, cells in body]))
        names = [str(k + 1) for k in range(max(width, len(names)))]
    cells, names = _block(path, names, body, rows[0][0], headed)
    line = np.array([i for i, _ in body], dtype=np.int64)
    sign = decimal or _decimal(path, cells)
    digest = hashlib.sha256(raw).hexdigest()
    notes = (*(text for _, text in comments), *titles)
    found = TextTable(
        path, tuple(names), cells, line, sign, digest, headed, split, sheet, notes
    )
    if decimal is None and split == ",":
        _check_commas(found)
    return found


def read_headed(path: str | Path | NamedText, **options: Any) -> TextTable:
    """Read a table that may have no header; its columns are then 1, 2, ..

    Raises:
        MeasurementError: See `read_table`.
    """
    return read_table(path, **{"header": None, **options})


def _read(file: str | Path | NamedText) -> tuple[Path, bytes]:
    """Read a file, unless its bytes are given; return its path and its bytes."""
    path = Path(file.name if isinstance(file, NamedText) else file)
    try:
        raw = file.data if isinstance(file, NamedText) else path.read_bytes()
    except OSError as exc:
        problem = f"cannot be read ({exc.strerror})"
        raise MeasurementError(path, problem, "Check the path") from None
    if len(raw) > MAX_BYTES:
        raise MeasurementError(path, "is too large for a survey", "Check the path")
    return path, raw


def _decode(raw: bytes, encoding: str | None, path: Path) -> str:
    """Decode bytes: the given codec, UTF-16 by its mark, UTF-8, else Latin-1."""
    marks = (b"\xff\xfe", b"\xfe\xff")
    if encoding is None and b"\0" in raw and not raw.startswith(marks):
        cure = "Export the measurements as CSV text"
        raise MeasurementError(path, "is not a text file", cure)
    for codec in [encoding or ("utf-16" if raw.startswith(marks) else "utf-8-sig")]:
        try:
            return raw.decode(codec)
        except (UnicodeDecodeError, LookupError):
            if encoding is not None:
                problem = f"cannot be decoded as {encoding}"
                raise MeasurementError(path, problem, "Try another") from None
    return raw.decode("latin-1")


Lines = list[tuple[int, str]]  # 1-based line and its text
Row = tuple[int, list[str]]  # 1-based line and its cells


def _without_comments(lines: Lines, comment: str | None) -> tuple[Lines, Lines]:
    """Part the rows from comment lines; return both.

    Where most lines begin with the sign, it belongs to the names of the points.
    """
    signs = (comment,) if comment else COMMENTS
    noted = [text.lstrip(' "').startswith(signs) for _, text in lines]
    if comment is None and 2 * sum(noted) > len(lines) + 4:
        return lines, []
    pairs = list(zip(lines, noted, strict=True))
    return [t for t, is_note in pairs if not is_note], [t for t, note in pairs if note]


def _header_in(comments: Lines, split: str, rows: list[Row]) -> Row | None:
    """Find a header in the last comment above the rows, as numpy.savetxt writes it."""
    above = [line for line in comments if line[0] < rows[0][0]]
    if not above:
        return None
    number, text = above[-1]
    cells = _strip_end(_cells_of(text.lstrip().lstrip("#/% "), split))
    fits = len(cells) == len(_strip_end(rows[0][1])) and len(set(cells)) == len(cells)
    return (number, cells) if fits and _is_header(cells) else None


def _is_header(cells: list[str]) -> bool:
    """Return True if cells name columns: few numbers, or the columns' own numbers."""
    cells = _strip_end(cells)
    numbers = sum(bool(NUMBER.match(cell)) for cell in cells)
    counted = [[str(k + first) for k in range(len(cells))] for first in (0, 1)]
    return numbers < FEW_NUMBERS or cells in counted


def _without_title(rows: list[Row]) -> list[Row]:
    """Leave out lines of text above the header, which have fewer cells than rows."""
    widths = [sum(cell != "" for cell in cells) for _, cells in rows]
    usual = float(np.median(widths))
    for k, (_, cells) in enumerate(rows):
        numbers = sum(bool(NUMBER.match(cell)) for cell in cells)
        if 2 * widths[k] >= usual or numbers > 1:
            return rows[k:]
    return rows


def _delimiter(lines: list[str]) -> str:
    """Find what parts the cells: a semicolon, tab, stroke, comma, or blanks.

    A comma may be a decimal sign wherever one of the others parts the cells.
    """
    sample = [re.sub(r'"[^"]*"', "", text) for text in lines[:SAMPLE]]
    usual = {s: np.median([text.count(s) for text in sample]) for s in ";\t|,"}
    for sign in ";\t|":
        ends = sum(text.count("," + sign) for text in sample)
        if usual[sign] >= 1 and 2 * ends < sum(text.count(sign) for text in sample):
            return sign
    cells = lines[min(1, len(lines) - 1)].split()
    if sum(bool(DECIMAL_COMMA.match(cell)) for cell in cells) >= FEW_NUMBERS:
        return BLANKS
    return "," if usual[","] >= 1 else BLANKS


def _cut(path: Path, lines: Lines, split: str) -> list[Row]:
    """Cut lines into cells, stripped; rows of empty cells are left out."""
    if split == BLANKS or len(split) > 1 or sum(t.count('"') for _, t in lines) % 2:
        rows = [(number, _cells_of(text, split)) for number, text in lines]
    else:  # a quoted cell may go over several lines
        reader = csv.reader(
            (text + "\n" for _, text in lines), delimiter=split, skipinitialspace=True
        )
        rows, before = [], 0
        try:
            for cells in reader:
                number = lines[before][0]
                rows.append((number, [" ".join(c.split()) for c in cells]))
                before = reader.line_num
        except csv.Error:
            problem = "holds a cell of more than 100,000 characters"
            cure = "Export the measurements as CSV text"
            raise MeasurementError(path, problem, cure, line=lines[before][0]) from None
    rows = [row for row in rows if any(row[1])]
    if not rows:
        raise MeasurementError(path, "has no measurements", EMPTY_CURE)
    return rows


def _cells_of(text: str, split: str) -> list[str]:
    """Cut one line into cells."""
    if split == BLANKS:
        return [cell.strip('"') for cell in re.findall(r'"[^"]*"|\S+', text)]
    if len(split) > 1:
        return [cell.strip().strip('"') for cell in re.split(split, text.strip())]
    return [cell.strip().strip('"').strip() for cell in text.split(split)]


def _strip_end(cells: list[str]) -> list[str]:
    """Leave out empty cells at the end."""
    count = len(cells)
    while count and cells[count - 1] == "":
        count -= 1
    return cells[:count]


def _block(
    path: Path, names: list[str], body: list[Row], top: int, headed: bool
) -> tuple[NDArray[np.object_], list[str]]:
    """Put rows under the names of their columns; columns without a name are left out.

    Raises:
        MeasurementError: A row has more cells than there are names, or a name is twice.
    """
    twice = next((n for n in names if n and names.count(n) > 1), None)
    if twice is not None:
        cure = "Give every column a name of its own"
        problem = f"column {twice!r} appears twice"
        raise MeasurementError(path, problem, cure, line=top)
    width = len(names)
    cells = np.full((len(body), width), "", dtype=object)
    for k, (line, row) in enumerate(body):
        used = _strip_end(row)
        if len(used) > width:
            what = "the header names" if headed else "the first row has"
            raise MeasurementError(
                path,
                f"has {len(used)} cells, {what} {width}",
                "Every row needs as many cells as the header. A decimal comma needs "
                "another separator (measurements.delimiter), a separator in a cell "
                "needs quotes",
                line=line,
            )
        cells[k, : len(used)] = used
    named = [k for k, name in enumerate(names) if name]
    return cells[:, named], [names[k] for k in named]


def _is_row_of_units(cells: list[str]) -> bool:
    """Return True if the cells under a header hold nothing but units."""
    filled = [cell for cell in cells if cell]
    units = sum(is_unit(cell) for cell in filled)
    return units >= FEW_NUMBERS and units + 1 >= len(filled)


def _with_units(names: list[str], units: list[str]) -> list[str]:
    """Write the units of a row of their own behind the names of the columns."""
    units = [cell.strip("[]() ") for cell in units] + [""] * len(names)
    pairs = zip(names, units, strict=False)
    return [f"{name} [{unit}]" if is_unit(unit) else name for name, unit in pairs]


def _decimal(path: Path, cells: NDArray[np.object_]) -> str:
    """Find the decimal sign by the cells.

    Raises:
        MeasurementError: Every comma may part thousands as well as be a decimal sign.
    """
    text = "\n".join(map(str, cells.reshape(-1)))
    if "," not in text:
        return "."
    commas = [m.group() for m in DECIMAL_COMMA.finditer(text)]
    sure = next((c for c in commas if not THOUSANDS[","].match(c)), None)
    if sure is not None or COMMA_LAST.search(text):
        return ","
    if not commas or DECIMAL_POINT.search(text) or POINT_LAST.search(text):
        return "."
    one = commas[0].strip()
    raise MeasurementError(
        path,
        f"{one} may be {one.replace(',', '.')} or {one.replace(',', '')}",
        "State the decimal sign: --set measurements.decimal=, for the former, "
        "--set measurements.decimal=. for the latter",
    )


def _check_commas(table: TextTable) -> None:
    """Refuse rows of whole numbers between commas, which may be decimal commas.

    Raises:
        MeasurementError: Both readings fit: no header counts the cells.
    """
    text = "\n".join(map(str, table.cells.reshape(-1)))
    if table.headed or "." in text or table.cells.shape[1] < 2 * FEW_NUMBERS:
        return
    raise MeasurementError(
        table.path,
        "its commas may part cells of whole numbers, or be decimal commas",
        "Export the file again with a semicolon between cells, or state "
        "--set measurements.decimal=. if its numbers are whole",
        line=int(table.line[0]),
    )
