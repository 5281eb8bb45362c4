"""Tables of any length, progress and colours; the only module that imports rich."""

from __future__ import annotations

import io
import os
import re
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

from postproc import _native
from postproc.arrays import Cells, format_texts
from postproc.diagnostics import Code
from postproc.exceptions import printable

# Tables: aligned, row by row, never held whole.
#
# The first rows set the widths; a later cell that is wider widens its column from the
# next row on. The width of a column at a row is thus the longest cell before it, which
# is one running maximum.

PAGE_WIDTH = 80  # columns of a terminal that does not tell
PLAIN_WIDTH = 200  # of a table with a column that folds
MEASURED = 1000  # rows that the widths of the columns are taken from
GAP = "  "
CODES = {"bold": "1", "faint": "2", "red": "31", "yellow": "33", "magenta": "35"}
ARROWS = {1: "↑", -1: "↓", 0: "·", 2: "↕"}  # 2: arrivals from both sides
STATUS_COLOURS = {"conflict": "red", "rejected": "yellow", "runtime": "magenta"}

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
        rows: How many.
        cells: What stands in every column; coloured in a last column on the left, where
            colours are wanted.
        single: Rows that are given as texts instead, which may be of any kind.
    """

    rows: int
    cells: Sequence[Cells]
    single: Mapping[int, Sequence[str]] = field(default_factory=dict)

    @classmethod
    def of(cls, rows: Sequence[Sequence[str]], coloured: bool) -> Block:
        """Take rows of texts; those that must be looked at by themselves stay texts."""
        single = {
            k: row
            for k, row in enumerate(rows)
            if coloured or not "".join(row).isprintable()
        }
        each = np.arange(len(rows))
        cells = [format_texts(texts, each, str) for texts in zip(*rows, strict=True)]
        return cls(len(rows), cells, single)


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
        rows += block.rows
    titles = [c.title for c in columns]
    left = [c.justify == "left" for c in columns]
    layout = _Layout(left, [shown.get(t) for t in titles])
    widths = layout.measure_widths(titles, first)
    bold = [(lambda _: "bold") if coloured else None for _ in titles]
    print(_Layout(left, bold).line(titles, widths), file=out)
    for block in chain(first, given):
        text, widths = layout.text(block, widths)
        put(text, out)


def put(text: bytes, out: TextIO) -> None:
    """Write UTF-8, without a way round where a stream takes it as it is."""
    if isinstance(out, io.TextIOWrapper) and out.encoding.lower() == "utf-8":
        out.flush()
        out.buffer.write(text)
    else:
        out.write(text.decode())


def table_text(columns: Sequence[Column], rows: Iterable[Sequence[str]]) -> str:
    """Return a table as text."""
    out = io.StringIO()
    print_table(columns, rows, out=out)
    return out.getvalue().removesuffix("\n")


def fold_cells(
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

    def measure_widths(
        self, titles: Sequence[str], blocks: Sequence[Block]
    ) -> list[int]:
        """Return the widths that titles and the first rows ask for."""
        widths, most = [*map(len, titles)], MEASURED
        widths[-1] *= not self.left[-1]
        for block in blocks:
            _, widths = self.text(block, widths, most)
            most = max(most - block.rows, 0)
        return widths

    def text(
        self, block: Block, widths: Sequence[int], most: int | None = None
    ) -> tuple[bytes, list[int]]:
        """Write rows, or so many of them; return the widths from there on, too."""
        return _native.aligned(
            block.rows,
            block.rows if most is None else most,
            block.cells,
            self.left,
            GAP.encode(),
            widths,
            {k: self.cells(row) for k, row in block.single.items()},
        )

    def cells(self, row: Sequence[str]) -> list[tuple[bytes, int]]:
        """Write the cells of a row, and how many characters each shows."""
        texts = [printable(cell) for cell in row]
        return [
            (paint(text, colour(text) if colour else "").encode(), len(text))
            for text, colour in zip(texts, self.colours, strict=True)
        ]

    def line(self, row: Sequence[str], widths: Sequence[int]) -> str:
        """Write one row of texts."""
        block = Block(1, [Cells()] * len(row), {0: row})
        return self.text(block, widths)[0].decode().removesuffix("\n")


# Messages, as a person reads them on a terminal.

SEVERITY_COLOURS = {"error": "red", "warning": "yellow", "note": "faint"}
HANGING = " " * 4  # before what goes on of a message
_PLACED = re.compile(r"(\S[^|]*?): ([a-z]+(?:-[a-z]+)+): ")
_CODES = {str(code.value): code for code in Code}
_LEADS = {"postproc: ": "red", "warning: ": "yellow", "next: ": "bold"}


def lay_out_message(text: str, out: TextIO) -> str:
    """Fold the lines of a message at words, and colour what they begin with.

    Lines that begin with a blank are excerpts of programs, and stay as they are.

    Args:
        text: The message.
        out: The terminal; NO_COLOR holds.
    """
    width, coloured = max(_columns(out), 40), is_coloured(out)
    found = []
    for line in text.split("\n"):
        if line[:1].isspace() or not line:
            found.append(line)
            continue
        folded = textwrap.wrap(
            line, width, subsequent_indent=HANGING, break_long_words=False,
            break_on_hyphens=False, drop_whitespace=True,
        )  # fmt: skip
        found.append("\n".join(folded))
        if coloured:
            found[-1] = _colour_lead(found[-1])
    return "\n".join(found)


def _colour_lead(line: str) -> str:
    """Colour the code of a finding by its severity, and the word of a message."""
    for word, colour in _LEADS.items():
        if line.startswith(word):
            return paint(word, colour) + line[len(word) :]
    placed = _PLACED.match(line)
    code = None if placed is None else _CODES.get(placed[2])
    if placed is None or code is None:
        return line
    colour = SEVERITY_COLOURS[code.severity]
    lead = f"{paint(placed[1], 'bold')}: {paint(placed[2], colour)}: "
    return lead + line[placed.end() :]


def _columns(out: TextIO) -> int:
    """Return how wide a terminal is, 80 where it does not tell."""
    try:
        return os.get_terminal_size(out.fileno()).columns or PAGE_WIDTH
    except (OSError, ValueError):
        return PAGE_WIDTH


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
    """Show the stage of a job, how far all of it is, and the time that is left.

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
    columns = (
        BarColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}", markup=False),
    )
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
