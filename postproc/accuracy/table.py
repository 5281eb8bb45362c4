"""Reading a table of numbers as people export them.

Comma, semicolon or tab; decimal point or comma; UTF-8, UTF-16 or Latin-1.
"""

from __future__ import annotations

import hashlib
import io
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.exceptions import MeasurementError

MAX_BYTES = 500_000_000
NUMBER = re.compile(r"^\s*[-+]?\d+([.,]\d+)?([eE][-+]?\d+)?\s*$")
FEW_NUMBERS = 3  # a first line with as many numbers is no header
DECIMAL_COMMA = re.compile(r"^\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*$")


@dataclass(frozen=True, eq=False)
class Table:
    """Text cells with their place in the file.

    Attributes:
        path: The file.
        columns: Header names, stripped.
        cells: Text of all cells, (n, k).
        line: 1-based line of every row, (n,).
        decimal: "." or ",".
        sha256: Hash of the file's bytes.
    """

    path: Path
    columns: tuple[str, ...]
    cells: NDArray[np.object_]
    line: NDArray[np.int64]
    decimal: str
    sha256: str

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.line)

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
        if missing:
            raise MeasurementError(
                self.path,
                f"column {', '.join(missing)} is missing",
                f"The header has: {', '.join(self.columns)}",
                line=1,
            )

    def _number(self, row: int, name: str, text: str, empty: bool) -> float:
        """Convert one cell."""
        if empty and text == "":
            return float("nan")
        plain = text.replace(",", ".") if self.decimal == "," else text
        try:
            value = float(plain)
        except ValueError:
            value = float("nan")
        if not np.isfinite(value):
            raise MeasurementError(
                self.path,
                f"{text!r} in column {name} is not a number",
                "Correct the cell or remove the row",
                line=int(self.line[row]),
            )
        return value


def read_table(
    path: str | Path,
    encoding: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
    comment: str | None = None,
    header: bool = True,
) -> Table:
    """Read a table; what is not given is detected.

    Args:
        path: The file.
        encoding: Name of a Python codec.
        delimiter: Between cells.
        decimal: "." or ",".
        comment: Lines that begin with it are no data.
        header: Whether the first line names the columns; else they are 0, 1, ..

    Raises:
        MeasurementError: The file cannot be read, is empty, or its lines differ.
    """
    path = Path(path)
    raw = _read(path)
    lines = _decode(raw, encoding, path).splitlines()
    kept = [
        (i + 1, text)
        for i, text in enumerate(lines)
        if text.strip() and not (comment and text.lstrip().startswith(comment))
    ]
    if len(kept) < 1 + header:
        cure = "Expected a header and one row per measurement"
        raise MeasurementError(path, "has no measurements", cure)
    split = delimiter or _delimiter(kept[0][1])
    cells = _cells(path, [text for _, text in kept], split)
    names = [str(c).strip() for c in cells[0]] if header else _numbered(cells)
    if len(set(names)) < len(names):
        twice = next(n for n in names if names.count(n) > 1)
        raise MeasurementError(path, f"column {twice!r} appears twice", line=kept[0][0])
    body = cells[1:] if header else cells
    line = np.array([i for i, _ in kept][int(header) :], dtype=np.int64)
    sign = decimal or _decimal(body, split)
    digest = hashlib.sha256(raw).hexdigest()
    return Table(path, tuple(names), body, line, sign, digest)


def read_headed(path: str | Path, **options: Any) -> Table:
    """Read a table that may have no header; its columns are then 1, 2, ..

    Raises:
        MeasurementError: See `read_table`.
    """
    table = read_table(path, header=False, **options)
    numbers = sum(bool(NUMBER.match(str(cell))) for cell in table.cells[0])
    if numbers >= FEW_NUMBERS and len(table.cells):
        return table
    return read_table(path, **options)


def _read(path: Path) -> bytes:
    """Read the bytes of a file."""
    try:
        raw = path.read_bytes()
    except OSError as exc:
        problem = f"cannot be read ({exc.strerror})"
        raise MeasurementError(path, problem, "Check the path") from None
    if len(raw) > MAX_BYTES:
        raise MeasurementError(path, "is too large for a survey", "Check the path")
    return raw


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


def _delimiter(header: str) -> str:
    """Take the separator that cuts the header into most cells."""
    best = max((";", "\t", ","), key=header.count)
    return best if header.count(best) else r"\s+"


def _cells(path: Path, lines: list[str], split: str) -> NDArray[np.object_]:
    """Cut lines into cells."""
    try:
        frame = pd.read_csv(
            io.StringIO("\n".join(lines)),
            sep=split, header=None, dtype=str, keep_default_na=False,
            skipinitialspace=True, engine="python" if len(split) > 1 else "c",
        )  # fmt: skip
    except (pd.errors.ParserError, pd.errors.EmptyDataError, ValueError) as exc:
        problem = f"is not a regular table ({str(exc).strip()})"
        cure = "Every row needs as many cells as the header"
        raise MeasurementError(path, problem, cure) from None
    return np.asarray(frame.to_numpy(dtype=object, na_value=""))


def _decimal(cells: NDArray[np.object_], split: str) -> str:
    """Tell a decimal comma from a decimal point by the cells."""
    if split == "," or len(cells) == 0:
        return "."
    comma = sum(bool(DECIMAL_COMMA.match(str(v))) for v in cells[:20].reshape(-1))
    return "," if comma else "."


def _numbered(cells: NDArray[np.object_]) -> list[str]:
    """Name columns by their number, from 1."""
    return [str(k + 1) for k in range(cells.shape[1])]
