"""The table of a second opinion, in the terminal and on pages."""

from __future__ import annotations

import sys
from dataclasses import dataclass

from postproc.exceptions import printable
from postproc.report.terminal import Column, print_table
from postproc.verify.opinion import COUNTED, Opinion, OpinionRow

ROUNDING = 1e-3  # of a bound: what is less is the rounding of a machine
TITLES = ("second opinion", "compared", "largest", "bound", "where")


@dataclass(frozen=True)
class OpinionTable:
    """What people read of a second opinion.

    Attributes:
        verdict: Whether it agrees, and how long it took.
        agrees: Whether it does.
        titles: Of the columns.
        rows: Their cells, and whether a difference is beyond its bound.
        lost: What was not compared, and why.
    """

    verdict: str
    agrees: bool
    titles: tuple[str, ...]
    rows: tuple[tuple[tuple[str, ...], bool], ...]
    lost: tuple[str, ...]


def opinion_table(opinion: Opinion | None) -> OpinionTable | None:
    """Write a second opinion as text, None where there is none."""
    if opinion is None:
        return None
    rows = tuple((cells(row), row.beyond > 0) for row in opinion.rows)
    lost = tuple(
        f"not compared, {row.what}: {count} ({why})"
        for row in opinion.rows
        for why, count in row.skipped.items()
    )
    return OpinionTable(verdict_of(opinion), opinion.agrees, TITLES, rows, lost)


def verdict_of(opinion: Opinion) -> str:
    """Say whether it agrees, and of how many approach directions it says so."""
    word = "agrees" if opinion.agrees else "disagrees"
    compared, every = opinion.directions
    if opinion.empty:
        word = "nothing was compared"
    elif every:
        word += f", {compared:,} of {every:,} approach directions compared"
    return f"second opinion: {word} ({opinion.seconds:.1f} s)"


def print_opinion(opinion: Opinion) -> None:
    """Print what was compared, and what was not, on stderr."""
    columns = [
        Column(title, "left" if title in (TITLES[0], TITLES[-1]) else "right")
        for title in TITLES
    ]
    table = opinion_table(opinion)
    assert table is not None
    print_table(columns, [row for row, _ in table.rows], out=sys.stderr)
    for line in (*table.lost, table.verdict):
        print(printable(line), file=sys.stderr)


def cells(row: OpinionRow) -> tuple[str, ...]:
    """Write one row: how many differ, where nothing is measured."""
    large = row.beyond > 0 or row.largest >= ROUNDING * row.bound > 0
    size = f"{row.largest:.2g}" if large else f"< {ROUNDING * row.bound:.0e}"
    largest, bound = f"{size} {row.unit}".strip(), f"{row.bound:.3g}"
    if row.bound == 0.0:
        largest, bound = f"{row.beyond} differ", ""
    if row.unit == COUNTED or not row.compared:
        largest = ""
    return row.what, str(row.compared), largest, bound, row.where if large else ""
