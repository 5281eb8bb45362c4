"""Tables for a terminal; the only module that imports rich."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal, TextIO

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

from postproc.exceptions import printable

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
