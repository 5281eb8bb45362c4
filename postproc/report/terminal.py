"""Tables and long listings for a terminal; the only module that imports rich."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import chain, islice
from typing import Literal, TextIO

import numpy as np
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from postproc.arrays import Ints
from postproc.byte_columns import ByteColumn as Bytes
from postproc.byte_columns import joined
from postproc.exceptions import printable

# Tables for a terminal; the only module that imports rich.

PLAIN_WIDTH = 200  # of a table that goes to a file or a pipe


@dataclass(frozen=True)
class Column:
    """A column: its title, and on which side its cells stand."""

    title: str
    justify: Literal["left", "right"] = "right"
    fold: bool = False


def print_table(
    columns: Sequence[Column],
    rows: Iterable[Sequence[str]],
    out: TextIO | None = None,
) -> None:
    """Print an aligned table, coloured only on a terminal.

    Args:
        columns: Its columns.
        rows: The texts of its cells; they are printed as they are, never as markup.
        out: Where to; default: stdout.
    """
    out = out or sys.stdout
    table = Table(box=None, pad_edge=False, header_style="bold")
    for c in columns:
        overflow: Literal["fold", "ellipsis"] = "fold" if c.fold else "ellipsis"
        table.add_column(
            Text(c.title), justify=c.justify, no_wrap=not c.fold, overflow=overflow
        )
    for row in rows:
        table.add_row(*(Text(printable(cell)) for cell in row))
    width = None if out.isatty() else PLAIN_WIDTH
    Console(file=out, width=width, highlight=False).print(table)


def table_text(columns: Sequence[Column], rows: Iterable[Sequence[str]]) -> str:
    """Return a table as text."""
    out = io.StringIO()
    print_table(columns, rows, out)
    return "\n".join(line.rstrip() for line in out.getvalue().splitlines())


def show_status(
    out: TextIO, text: str
) -> tuple[Callable[[str], None], Callable[[], None]]:
    """Show a line that moves; return how to change its text, and how to end it."""
    status = Console(file=out).status(text)
    status.start()
    return status.update, status.stop


@contextmanager
def progress_bar(
    title: str, out: TextIO | None = None
) -> Iterator[Callable[[int, int], None]]:
    """Show how far a job is, its rate and the time it still takes, on a terminal only.

    Args:
        title: What is being done.
        out: Where to; default: stderr.

    Yields:
        A function to be told how many are done, of how many.
    """
    out = out or sys.stderr
    if not out.isatty():
        yield lambda done, of: None
        return
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        _Rate(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(file=out), transient=True) as progress:
        bar = progress.add_task(printable(title), total=None)
        yield lambda done, of: progress.update(bar, completed=done, total=of)


@contextmanager
def stage_bar(out: TextIO | None = None) -> Iterator[Callable[[str, float], None]]:
    """Show the stage of a job and how far all of it is, on a terminal only.

    Args:
        out: Where to; default: stderr.

    Yields:
        A function to be told the name of every stage, and the share that is done.
    """
    out = out or sys.stderr
    if not out.isatty():
        yield lambda stage, share: None
        return
    columns = (BarColumn(), TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=Console(file=out), transient=True) as progress:
        bar = progress.add_task("starting", total=1.0)
        yield lambda stage, share: progress.update(
            bar, description=printable(stage), completed=share
        )


class _Rate(ProgressColumn):
    """How many are done in a second."""

    def render(self, task: Task) -> Text:
        """Return the cell."""
        return Text(f"{task.speed:.1f}/s" if task.speed else "")


# Long listings for a terminal or a pager: aligned, row by row, never held whole.

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


# The listing of `postproc.listing` from columns of bytes: the same text, no loop.
#
# `print_listing` lets a cell that sticks out widen its column from the next row on. The
# width of a column at a row is thus the longest cell before it, which is one running
# maximum.


@dataclass(frozen=True)
class Block:
    """Some rows of a listing.

    Attributes:
        cells: The texts of every column as UTF-8, (k, w) each; coloured in the last
            column where colours are wanted.
        lengths: How many characters they have, (k, columns).
        single: Rows that are given as texts instead, which may be of any kind.
    """

    cells: Sequence[Bytes]
    lengths: Ints
    single: Mapping[int, Sequence[str]] = field(default_factory=dict)


def print_blocks(
    columns: Sequence[Column],
    blocks: Iterable[Block],
    colours: Colours | None = None,
    out: TextIO | None = None,
) -> None:
    """Print an aligned table of any length as `print_listing` does.

    Args:
        columns: Its columns; the last one is not padded.
        blocks: Its rows.
        colours: Which colour a cell of a column (by title) has. Used on a terminal
            only.
        out: Where to; default: stdout.
    """
    out = out or sys.stdout
    shown = (colours or {}) if is_coloured(out) else {}
    given = iter(blocks)
    first, rows = [], 0
    while rows < MEASURED and (block := next(given, None)):
        first.append(block)
        rows += len(block.lengths)
    titles = [c.title for c in columns]
    layout = _ColumnLayout(
        [c.justify == "left" for c in columns], [shown.get(t) for t in titles]
    )
    widths = _measured(titles, first)
    bold = [(lambda _: "bold") if shown else None for _ in titles]
    print(_ColumnLayout(layout.left, bold).line(titles, widths), file=out)
    for block in chain(first, given):
        text, widths = layout.text(block, widths)
        out.write(text)


def _measured(titles: Sequence[str], blocks: Sequence[Block]) -> Ints:
    """Return the widths that titles and the first rows ask for."""
    lengths = [np.array([[len(title) for title in titles]])]
    for block in blocks:
        lengths.append(block.lengths.copy())
        for k, row in block.single.items():
            lengths[-1][k] = [len(cell) for cell in row]
    widths: Ints = np.concatenate(lengths)[: MEASURED + 1].max(axis=0)
    widths[-1] = 0  # the last column is not padded
    return widths


@dataclass(frozen=True)
class _ColumnLayout:
    """On which side cells stand, and which colour they have."""

    left: Sequence[bool]
    colours: Sequence[Callable[[str], str] | None]

    def text(self, block: Block, widths: Ints) -> tuple[str, Ints]:
        """Write rows; return the widths from there on, too."""
        lengths = block.lengths.copy()
        for k, row in block.single.items():
            lengths[k] = [len(printable(cell)) for cell in row]
        lengths[:, -1] = 0
        wide = np.maximum.accumulate(np.concatenate([widths[None], lengths]))
        parts: list[Bytes | bytes] = []
        for number, cells in enumerate(block.cells):
            parts += [GAP.encode()] if number else []
            blanks = _blanks(wide[:-1, number] - lengths[:, number])
            if number == len(block.cells) - 1:
                parts += [cells]
            else:
                parts += [cells, blanks] if self.left[number] else [blanks, cells]
        text = joined([*parts, b"\n"]).decode()
        if block.single or " \n" in text:
            lines = [*map(str.rstrip, text.split("\n"))]
            for k, row in block.single.items():
                lines[k] = self.line(row, wide[k])
            text = "\n".join(lines)
        return text, wide[-1]

    def line(self, row: Sequence[str], widths: Ints) -> str:
        """Write a row of texts."""
        texts = [printable(cell) for cell in row]
        cells = []
        for text, width, left, colour in zip(
            texts, widths.tolist(), self.left, self.colours, strict=True
        ):
            cell = text.ljust(width) if left else text.rjust(width)
            cells.append(paint(cell, colour(text)) if colour else cell)
        return GAP.join(cells).rstrip()


def _blanks(count: Ints) -> Bytes:
    """Return so many blanks a row; none for less than one."""
    most = int(count.max(initial=0))
    return np.where(np.arange(most) < count[:, None], 32, 0).astype(np.uint8)
