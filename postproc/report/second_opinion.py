"""The table of a second opinion in the terminal."""

from __future__ import annotations

import sys

from postproc.report.terminal import Column, print_table
from postproc.verify.opinion import Opinion, OpinionRow

TITLES = ("second opinion", "compared", "largest", "bound", "where")


def print_opinion(opinion: Opinion) -> None:
    """Print what was compared, and what was not, on stderr."""
    columns = [Column(t, "left" if t in (TITLES[0], TITLES[-1]) else "right")
               for t in TITLES]  # fmt: skip
    print_table(columns, map(cells, opinion.rows), out=sys.stderr)
    for line in not_compared(opinion):
        print(line, file=sys.stderr)
    verdict = "agrees" if opinion.agrees else "disagrees"
    print(f"second opinion: {verdict} ({opinion.seconds:.1f} s)", file=sys.stderr)


def cells(row: OpinionRow) -> tuple[str, ...]:
    """Write one row: yes or no for what is not measured."""
    if row.bound == 0.0:
        largest, bound = f"{row.beyond} differ", ""
    else:
        largest, bound = f"{row.largest:.2g} {row.unit}", f"{row.bound:g}"
    told = row.where if row.largest > 0 or row.beyond else ""
    return row.what, str(row.compared), largest.strip(), bound, told


def not_compared(opinion: Opinion) -> list[str]:
    """Say what was not compared, and why."""
    return [
        f"not compared, {row.what}: {count} ({why})"
        for row in opinion.rows
        for why, count in row.skipped.items()
    ]
