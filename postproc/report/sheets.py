"""Tables of a page as CSV and as a workbook: what `--table` writes."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path

from postproc.calibration.workbooks import write_workbook
from postproc.files import Content, spreadsheet_text

Cell = str | int | float
CSV, WORKBOOK = ".csv", ".xlsx"
MARK = "\ufeff"  # a spreadsheet takes the text for UTF-8
LONGEST = 27  # characters of a sheet's name, which has 31 at the most
PLAIN = re.compile(r"-?\d+(\.\d+)?")
DASH = "–"  # what is not known, on a page
HEADINGS = ("caption", "h2", "h3")


@dataclass(frozen=True)
class Sheet:
    """A table.

    Attributes:
        title: What it holds.
        rows: Its cells, row by row, the heading first.
    """

    title: str
    rows: Sequence[Sequence[Cell]]

    @property
    def safe_rows(self) -> list[list[Cell]]:
        """Return the rows so that no text becomes a formula."""
        return [
            [spreadsheet_text(cell) if isinstance(cell, str) else cell for cell in row]
            for row in self.rows
        ]

    def to_csv(self) -> bytes:
        """Write it as CSV."""
        out = io.StringIO()
        csv.writer(out).writerows(self.safe_rows)
        return (MARK + out.getvalue()).encode()


class _TableFinder(HTMLParser):
    """Finds the tables of a page that have rows and are no copies of others."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[Sheet] = []
        self._main = False
        self._heading = self._within = ""
        self._rows: list[list[Cell]] | None = None
        self._given: dict[str, str | None] = {}
        self._cell: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Begin a part of the page."""
        if tag == "main":
            self._main = True
        elif tag == "section":
            self._heading = ""
        elif tag in HEADINGS:
            self._within, self._cell = tag, []
        elif tag == "table":
            self._given, self._rows = dict(attrs), []
        elif tag == "tr" and self._rows is not None:
            self._rows.append([])
        elif tag in ("td", "th"):
            self._cell = []

    def handle_data(self, data: str) -> None:
        """Collect a text."""
        self._cell.append(data)

    def handle_endtag(self, tag: str) -> None:
        """End a part of the page."""
        text = re.sub(r"\s+", " ", "".join(self._cell)).strip()
        if tag == "main":
            self._main = False
        elif tag in HEADINGS and tag == self._within:
            self._heading, self._within = text, ""
        elif tag in ("td", "th") and self._rows:
            self._rows[-1].append(_value(text))
        elif tag == "table":
            self._end_table()

    def _end_table(self) -> None:
        rows = [row for row in self._rows or () if row]
        if len(rows) > 1 and self._main and "data-copy" not in self._given:
            title = self._given.get("data-sheet") or self._heading or "table"
            self.found.append(Sheet(title, rows))
        self._rows = None


def _value(text: str) -> Cell:
    """Return a number where a cell is one; what is not known is empty.

    >>> _value("−0.5"), _value("–"), _value("1.2 mm")
    (-0.5, '', '1.2 mm')
    """
    plain = text.replace("−", "-")
    if plain == DASH:
        return ""
    if not PLAIN.fullmatch(plain):
        return plain
    return float(plain) if "." in plain else int(plain)


def sheets_of_page(page: str) -> list[Sheet]:
    """List the tables that stand on a page without its scripts."""
    reader = _TableFinder()
    reader.feed(page)
    return reader.found


def table_files(place: Path, sheets: Sequence[Sheet]) -> dict[Path, Content]:
    """Write sheets: one workbook, or a CSV file each.

    Args:
        place: FILE.xlsx or FILE.csv. Of several tables, each but the first goes to
            FILE-TITLE.csv.
        sheets: The tables.

    Raises:
        OutputError: openpyxl, which writes workbooks, is not installed.
    """
    titles = _name_sheets(sheets)
    if place.suffix.lower() == WORKBOOK:
        named = zip(titles, (sheet.safe_rows for sheet in sheets), strict=True)
        return {place: write_workbook(place, dict(named))}
    files: dict[Path, Content] = {}
    for k, (title, sheet) in enumerate(zip(titles, sheets, strict=True)):
        word = re.sub(r"\W+", "-", title.lower()).strip("-")
        own = place.with_name(f"{place.stem}-{word}{place.suffix}") if k else place
        files[own] = sheet.to_csv()
    return files


def _name_sheets(sheets: Sequence[Sheet]) -> list[str]:
    """Name sheets as Excel allows it, no name twice."""
    names: list[str] = []
    for sheet in sheets:
        base = re.sub(r"[\[\]:*?/\\']", " ", sheet.title)[:LONGEST].strip() or "table"
        name, k = base, 2
        while name.lower() in map(str.lower, names):
            name, k = f"{base} {k}", k + 1
        names.append(name)
    return names
