"""Excel workbooks: their sheets as lines of text, and tables as a workbook."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from postproc.exceptions import MeasurementError, OutputError

ZIP, OLD = b"PK\x03\x04", b"\xd0\xcf\x11\xe0"  # first bytes of .xlsx and of .xls
INSTALL = 'pip install "postproc[xlsx]"'
SAVE = "Open it in Excel and save it as .xlsx, or as CSV text"
SIGN = "\t"  # between cells


def is_workbook(raw: bytes) -> bool:
    """Return True if bytes are those of a workbook, of whatever age."""
    return raw.startswith((ZIP, OLD))


def sheet_text(path: Path, raw: bytes, sheet: str | None) -> tuple[str, str]:
    """Return the name of the sheet with measurements, and its rows as lines.

    Args:
        path: The file, for messages.
        raw: Its bytes.
        sheet: The sheet to read; None: the only one with a table.

    Raises:
        MeasurementError: The workbook cannot be read, or several sheets hold tables.
    """
    sheets = _sheets(path, raw)
    if sheet is not None:
        if sheet not in sheets:
            cure = f"Its sheets are {', '.join(map(repr, sheets))}"
            raise MeasurementError(path, f"has no sheet {sheet!r}", cure)
        return sheet, _lines(sheets[sheet])
    tables = [name for name, rows in sheets.items() if _is_table(rows)]
    if len(tables) > 1:
        cure = f"Name one: --set measurements.sheet={tables[0]!r}"
        problem = f"sheets {', '.join(map(repr, tables))} all hold tables"
        raise MeasurementError(path, problem, cure)
    if not tables:
        cure = "Expected a header and one row per measurement"
        raise MeasurementError(path, "has no measurements", cure)
    return tables[0], _lines(sheets[tables[0]])


Rows = list[list[Any]]


def _sheets(path: Path, raw: bytes) -> dict[str, Rows]:
    """Read all cells of all sheets.

    Raises:
        MeasurementError: Nothing here can read the workbook.
    """
    if raw.startswith(OLD):
        raise MeasurementError(path, "is a workbook of the old form .xls", SAVE)
    try:
        from openpyxl import load_workbook
    except ImportError:
        cure = f"Install it ({INSTALL}), or save the sheet as CSV text"
        raise MeasurementError(path, "needs openpyxl to be read", cure) from None
    try:
        book = load_workbook(io.BytesIO(raw), read_only=True, data_only=True)
        return {
            page.title: [list(row) for row in page.iter_rows(values_only=True)]
            for page in book.worksheets
        }
    except Exception:  # of a damaged file the library raises what its parts do
        raise MeasurementError(path, "is no workbook as Excel saves it", SAVE) from None


def _is_table(rows: Rows) -> bool:
    """Return True if two rows have three cells or more."""
    return sum(sum(v is not None for v in row) > 2 for row in rows) > 1


def _lines(rows: Rows) -> str:
    """Write the rows as lines. Numbers get the decimal sign of those that are text."""
    texts = [str(v).strip() for row in rows for v in row if isinstance(v, str)]
    comma = any(_has_decimal_comma(text) for text in texts)
    return "\n".join(SIGN.join(_cell(v, comma) for v in row) for row in rows)


def _has_decimal_comma(text: str) -> bool:
    """Return True if a text is a number with a decimal comma."""
    whole, _, fraction = text.lstrip("+-").partition(",")
    return whole.isdigit() and fraction.isdigit()


def _cell(value: Any, comma: bool) -> str:
    """Write the value of a cell without the signs that part cells and rows."""
    if value is None:
        return ""
    if isinstance(value, float):
        text = repr(int(value) if value.is_integer() else value)
        return text.replace(".", ",") if comma else text
    return _join(str(value).split())


def _join(words: Iterable[str]) -> str:
    """Join words by blanks, without quotation marks."""
    return " ".join(words).replace('"', "")


def write_workbook(path: Path, sheets: Mapping[str, Sequence[Sequence[Any]]]) -> bytes:
    """Write tables as a workbook, a sheet each.

    Args:
        path: The file, for messages.
        sheets: Rows of cells by the names of the sheets.

    Raises:
        OutputError: openpyxl is not installed.
    """
    try:
        from openpyxl import Workbook
    except ImportError:
        cure = f"Install it with {INSTALL}, or write FILE.csv"
        raise OutputError(path, "needs openpyxl to be written", cure) from None
    book, out = Workbook(write_only=True), io.BytesIO()
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(list(row))
    book.save(out)
    return out.getvalue()
