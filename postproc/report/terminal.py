"""Tables of any length, progress and colours; the only module that imports rich."""

from __future__ import annotations

import io
import os
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import chain, islice
from time import monotonic
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
from rich.text import Text

from postproc.arrays import Ints
from postproc.byte_columns import ByteColumn as Bytes
from postproc.byte_columns import joined
from postproc.exceptions import printable

# Tables: aligned, row by row, never held whole.
#
# The first rows set the widths; a later cell that is wider widens its column from the
# next row on. The width of a column at a row is thus the longest cell before it, which
# is one running maximum.

PLAIN_WIDTH = 200  # of a table with a column that folds
MEASURED = 1000  # rows that the widths of the columns are taken from
GAP = "  "
CODES = {"bold": "1", "faint": "2", "red": "31", "yellow": "33", "magenta": "35"}
ARROWS = {1: "↑", -1: "↓", 0: "·", 2: "↕"}  # 2: arrivals from both sides
STATUS_COLOURS = {"unsafe": "red", "guarded": "yellow", "display": "magenta"}

Colours = Mapping[str, Callable[[str], str]]


@dataclass(frozen=True)
class Column:
    """A column: its title, and on which side its cells stand."""

    title: str
    justify: Literal["left", "right"] = "right"


@dataclass(frozen=True)
class Block:
    """Some rows of a table.

    Attributes:
        cells: The texts of every column as UTF-8, (k, w) each; coloured in the last
            column where colours are wanted.
        lengths: How many characters they have, (k, columns).
        single: Rows that are given as texts instead, which may be of any kind.
    """

    cells: Sequence[Bytes]
    lengths: Ints
    single: Mapping[int, Sequence[str]] = field(default_factory=dict)

    @classmethod
    def of(cls, rows: Sequence[Sequence[str]], coloured: bool) -> Block:
        """Take rows of texts; those that must be looked at by themselves stay texts."""
        single = {
            k: row
            for k, row in enumerate(rows)
            if coloured or not "".join(row).isprintable()
        }
        plain = [[""] * len(row) if k in single else row for k, row in enumerate(rows)]
        columns = [*zip(*plain, strict=True)]
        encoded = [np.array([t.encode() for t in texts]) for texts in columns]
        cells = [texts.view(np.uint8).reshape(len(rows), -1) for texts in encoded]
        lengths = np.array([[*map(len, texts)] for texts in columns]).T
        return cls(cells, lengths, single)


def print_table(
    columns: Sequence[Column],
    rows: Iterable[Sequence[str]],
    colours: Colours | None = None,
    out: TextIO | None = None,
) -> None:
    """Print an aligned table of any length; as `print_blocks`.

    Args:
        columns: Its columns.
        rows: The texts of its cells.
        colours: See `print_blocks`.
        out: Where to; default: stdout.
    """
    out = out or sys.stdout
    coloured, given = bool(colours) and is_coloured(out), iter(rows)
    parts = iter(lambda: list(islice(given, MEASURED)), [])
    print_blocks(columns, (Block.of(part, coloured) for part in parts), colours, out)


def print_blocks(
    columns: Sequence[Column],
    blocks: Iterable[Block],
    colours: Colours | None = None,
    out: TextIO | None = None,
) -> None:
    """Print an aligned table of any length.

    Args:
        columns: Its columns.
        blocks: Its rows.
        colours: Which colour a cell of a column (by title) has; "" for none. Used on
            a terminal only, and not where NO_COLOR is set.
        out: Where to; default: stdout.
    """
    out = out or sys.stdout
    coloured = is_coloured(out)
    shown = (colours or {}) if coloured else {}
    given = iter(blocks)
    first, rows = [], 0
    while rows < MEASURED and (block := next(given, None)):
        first.append(block)
        rows += len(block.lengths)
    titles = [c.title for c in columns]
    left = [c.justify == "left" for c in columns]
    layout = _Layout(left, [shown.get(t) for t in titles])
    widths = layout.measured(titles, first)
    bold = [(lambda _: "bold") if coloured else None for _ in titles]
    print(_Layout(left, bold).line(titles, widths), file=out)
    for block in chain(first, given):
        text, widths = layout.text(block, widths)
        out.write(text)


def table_text(columns: Sequence[Column], rows: Iterable[Sequence[str]]) -> str:
    """Return a table as text."""
    out = io.StringIO()
    print_table(columns, rows, out=out)
    return out.getvalue().removesuffix("\n")


def folded(
    columns: Sequence[Column], rows: Sequence[Sequence[str]], title: str
) -> list[Sequence[str]]:
    """Fold the cells of a column at words, so that rows are `PLAIN_WIDTH` wide at most.

    Args:
        columns: The columns of the table.
        rows: The texts of its cells.
        title: The column.

    Returns:
        The rows; what a cell has no room for stands alone in rows below it.
    """
    at = [c.title for c in columns].index(title)
    texts = [[c.title for c in columns], *rows]
    widest = [max(map(len, column)) for column in zip(*texts, strict=True)]
    others = sum(widest) - widest[at] + len(GAP) * (len(columns) - 1)
    width = min(widest[at], max(PLAIN_WIDTH - others, 1))
    found: list[Sequence[str]] = []
    for row in rows:
        first, *more = textwrap.wrap(row[at], width, break_on_hyphens=False) or [""]
        found.append([*row[:at], first.ljust(width), *row[at + 1 :]])
        behind = [""] * (len(columns) - at - 1)
        found += [[*[""] * at, text, *behind] for text in more]
    return found


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


@dataclass(frozen=True)
class _Layout:
    """On which side cells stand, and which colour they have.

    A last column whose cells stand on the left has no width: nothing is behind it.
    """

    left: Sequence[bool]
    colours: Sequence[Callable[[str], str] | None]

    def measured(self, titles: Sequence[str], blocks: Sequence[Block]) -> Ints:
        """Return the widths that titles and the first rows ask for."""
        lengths = [np.array([[len(title) for title in titles]])]
        for block in blocks:
            lengths.append(block.lengths.copy())
            for k, row in block.single.items():
                lengths[-1][k] = [len(cell) for cell in row]
        widths: Ints = np.concatenate(lengths)[: MEASURED + 1].max(axis=0)
        widths[-1] *= not self.left[-1]
        return widths

    def text(self, block: Block, widths: Ints) -> tuple[str, Ints]:
        """Write rows; return the widths from there on, too."""
        lengths = block.lengths.copy()
        for k, row in block.single.items():
            lengths[k] = [len(printable(cell)) for cell in row]
        lengths[:, -1] *= not self.left[-1]
        wide = np.maximum.accumulate(np.concatenate([widths[None], lengths]))
        parts: list[Bytes | bytes] = []
        for number, cells in enumerate(block.cells):
            parts += [GAP.encode()] if number else []
            blanks = _blanks(wide[:-1, number] - lengths[:, number])
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


# How far something is.


class _Steady(Console):
    """A terminal whose cursor stays: a signal ends us at once, and it would be gone."""

    def show_cursor(self, show: bool = True) -> bool:
        """Leave the cursor as it is."""
        return False


def show_status(
    out: TextIO, text: str
) -> tuple[Callable[[str], None], Callable[[], None]]:
    """Show a line that moves; return how to change its text, and how to end it."""
    status = _Steady(file=out).status(text)
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
    with Progress(*columns, console=_Steady(file=out), transient=True) as progress:
        bar = progress.add_task(printable(title), total=None)
        yield lambda done, of: progress.update(bar, completed=done, total=of)


LASTING = 20.0  # [s] from which a log is told the stages of a job


class StageLog:
    """Stages of a job as lines of a log, once the job lasts."""

    def __init__(self, out: TextIO) -> None:
        self._out, self._begun = out, monotonic()

    def __call__(self, stage: str) -> None:
        """Tell a stage that begins, where the job lasts."""
        passed = monotonic() - self._begun
        if passed >= LASTING:
            with suppress(OSError):  # a log that takes nothing is no reason to stop
                self._out.write(f"{passed:.0f} s: {printable(stage)}\n")
                self._out.flush()


@contextmanager
def stage_bar(out: TextIO | None = None) -> Iterator[Callable[[str, float], None]]:
    """Show the stage of a job and how far all of it is.

    Without a terminal a line tells every stage of a job that lasts.

    Args:
        out: Where to; default: stderr.

    Yields:
        A function to be told the name of every stage, and the share that is done.
    """
    out = out or sys.stderr
    if not out.isatty():
        log = StageLog(out)
        yield lambda stage, share: log(stage)
        return
    columns = (BarColumn(), TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=_Steady(file=out), transient=True) as progress:
        bar = progress.add_task("starting", total=1.0)
        yield lambda stage, share: progress.update(
            bar, description=printable(stage), completed=share
        )


class _Rate(ProgressColumn):
    """How many are done in a second."""

    def render(self, task: Task) -> Text:
        """Return the cell."""
        return Text(f"{task.speed:.1f}/s" if task.speed else "")
