"""The table of a second opinion in the terminal."""

from __future__ import annotations

import sys

from postproc.exceptions import printable
from postproc.report.terminal import Column, print_table
from postproc.verify.opinion import COUNTED, Opinion, OpinionRow

ROUNDING = 1e-3  # of a bound: what is less is the rounding of a machine
TITLES = ("second opinion", "compared", "largest", "bound", "where")


def print_opinion(opinion: Opinion) -> None:
    """Print what was compared, and what was not, on stderr."""
    columns = [
        Column(title, "left" if title in (TITLES[0], TITLES[-1]) else "right")
        for title in TITLES
    ]
    print_table(columns, map(cells, opinion.rows), out=sys.stderr)
    verdict = "agrees" if opinion.agrees else "disagrees"
    last = f"second opinion: {verdict} ({opinion.seconds:.1f} s)"
    for line in (*not_compared(opinion), last):
        print(printable(line), file=sys.stderr)


def cells(row: OpinionRow) -> tuple[str, ...]:
    """Write one row: how many differ, where nothing is measured."""
    large = row.beyond > 0 or row.largest >= ROUNDING * row.bound > 0
    size = f"{row.largest:.2g}" if large else f"< {ROUNDING * row.bound:.0e}"
    largest, bound = f"{size} {row.unit}".strip(), f"{row.bound:.3g}"
    if row.bound == 0.0:
        largest, bound = f"{row.beyond} differ", ""
    if row.unit == COUNTED:
        largest = ""
    return row.what, str(row.compared), largest, bound, row.where if large else ""


def not_compared(opinion: Opinion) -> list[str]:
    """Say what was not compared, and why."""
    return [
        f"not compared, {row.what}: {count} ({why})"
        for row in opinion.rows
        for why, count in row.skipped.items()
    ]
