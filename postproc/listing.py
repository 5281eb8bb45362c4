"""Long listings for a terminal or a pager: aligned, row by row, never held whole."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain, islice
from typing import TextIO

from postproc.console import Column
from postproc.exceptions import printable

MEASURED = 1000  # rows that the widths of the columns are taken from
BATCH = 500  # lines that are written at a time
GAP = "  "
CODES = {"bold": "1", "faint": "2", "red": "31", "yellow": "33", "magenta": "35"}
ARROWS = {1: "↑", -1: "↓", 0: "·", 2: "↕"}  # 2: arrivals from both sides
STATUS_COLOURS = {"unsafe": "red", "guarded": "yellow", "display": "magenta"}

Colours = Mapping[str, Callable[[str], str]]


def print_listing(
    columns: Sequence[Column],
    rows: Iterable[Sequence[str]],
    colours: Colours | None = None,
    out: TextIO | None = None,
) -> None:
    """Print an aligned table of any length.

    The first rows set the widths; a later cell that is wider widens its column from
    there on.

    Args:
        columns: Its columns; the last one is not padded.
        rows: The texts of its cells.
        colours: Which colour a cell of a column (by title) has; "" for none. Used on
            a terminal only, and not where NO_COLOR is set.
        out: Where to; default: stdout.
    """
    out = out or sys.stdout
    shown = (colours or {}) if is_coloured(out) else {}
    given = iter(rows)
    first = list(islice(given, MEASURED))
    titles = [c.title for c in columns]
    head = _Layout(columns, {title: lambda _: "bold" for title in titles if shown})
    body = _Layout(columns, shown)
    for row in (titles, *first):
        head.widen(row)
        body.widen(row)
    _write(out, chain([head.line(titles)], map(body.line, chain(first, given))))


def is_coloured(out: TextIO) -> bool:
    """Tell whether colours are wanted there (see https://no-color.org)."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    return out.isatty() and not plain


def arrows(direction: Iterable[int]) -> str:
    """Show the direction in which every joint arrives.

    >>> arrows([1, -1, 0, 2])
    '↑↓·↕'
    """
    return "".join(ARROWS[int(d)] for d in direction)


def status_colour(cell: str) -> str:
    """Choose the colour of a cell that begins with a status."""
    return STATUS_COLOURS.get(cell.partition(":")[0], "")


def paint(text: str, colour: str) -> str:
    """Colour a text; "" leaves it as it is."""
    return f"\x1b[{CODES[colour]}m{text}\x1b[0m" if colour else text


class _Layout:
    """Widths of the columns, and rows written in them."""

    def __init__(self, columns: Sequence[Column], colours: Colours) -> None:
        self._left = [c.justify == "left" for c in columns]
        self._colours = [colours.get(c.title) for c in columns]
        self._plain = not any(self._colours)
        self._widths = [0] * len(columns)
        self.widen([""] * len(columns))

    def widen(self, row: Sequence[str]) -> None:
        """Make room for a row."""
        lengths = [len(cell) for cell in row[:-1]]
        self._widths = [*map(max, self._widths, lengths), 0]  # the last is not padded
        signs = ["-" if left else "" for left in self._left]
        fields = zip(signs, self._widths, strict=True)
        self._fields = [f"%{sign}{width}s" for sign, width in fields]
        self._template = GAP.join(self._fields)
        self._length = len(self._template % (("",) * len(row)))

    def line(self, row: Sequence[str]) -> str:
        """Write a row."""
        line = self._template % tuple(row)
        if not line.isprintable():
            row = [printable(cell) for cell in row]
            line = self._template % tuple(row)
        if len(line) - len(row[-1]) > self._length:  # a cell sticks out
            self.widen(row)
        return line.rstrip() if self._plain else self._coloured(row)

    def _coloured(self, row: Sequence[str]) -> str:
        """Write a row with its colours."""
        parts = zip(self._fields, row, self._colours, strict=True)
        return GAP.join(
            paint(field % cell, colour(cell)) if colour else field % cell
            for field, cell, colour in parts
        ).rstrip()


def _write(out: TextIO, lines: Iterator[str]) -> None:
    """Write lines, some at a time."""
    while batch := list(islice(lines, BATCH)):
        out.write("\n".join(batch) + "\n")
