"""The listing of `diff`: a row a line, then what was left alone, then a summary."""

from __future__ import annotations

from typing import TextIO

from postproc.changed_lines import Row
from postproc.compared import VARIABLES
from postproc.console import Column
from postproc.diff import Difference
from postproc.listing import arrows, print_listing, status_colour

NUMBER = "%.4f"
STATUS = "status"
PLACE = (Column("file", "left"), Column("line"), Column("target", "left"))
NUMBERS = (Column("original"), Column("", "left"), Column("compensated"))
TOLD = (Column("J1-6", "left"), Column(STATUS, "left"))


def print_difference(found: Difference, out: TextIO | None = None) -> None:
    """Print a row for every line that differs, the targets left alone, a summary."""
    names = {row.file for row in (*found.rows, *found.left)}
    skip = 0 if len(names) > 1 or any(n.endswith(VARIABLES) for n in names) else 1
    told = bool(found.counts)
    if found.rows:
        size = Column("|c| mm" if told else "change mm")
        columns = [*PLACE[skip:], *NUMBERS, size, *(TOLD if told else ())]
        cells = (_cells(row, told)[skip:] for row in found.rows)
        print_listing(columns, cells, {STATUS: status_colour}, out)
    if found.left:
        print("\nleft as they were:", file=out)
        alone = ([*_place(row), *_told(row)][skip:] for row in found.left)
        columns = [*PLACE[skip:], *TOLD]
        print_listing(columns, alone, {STATUS: status_colour}, out)
    print(found.summary(), file=out)


def _cells(row: Row, told: bool) -> list[str]:
    """Write a row that differs."""
    size = row.correction_mm if told and row.status else row.change_mm
    old, new = _numbers(row)
    length = "" if size is None else f"{size:.3f}"
    cells = [*_place(row), old, "->" if new else "", new, length]
    return [*cells, *_told(row)] if told else cells


def _place(row: Row) -> list[str]:
    """Say where a row stands."""
    return [row.file, str(row.line or ""), row.target]


def _told(row: Row) -> list[str]:
    """Say how the target of a row is reached, and what came of it."""
    status = f"{row.status}: {row.why}" if row.why else row.status
    return [arrows(row.direction), status]


def _numbers(row: Row) -> tuple[str, str]:
    """Write the numbers that changed, or the text."""
    if row.text or not row.original:
        return row.text, ""
    pairs = zip(row.original, row.compensated, strict=True)
    moved = [pair for pair in pairs if pair[0] != pair[1]]
    if not moved:
        return "", ""
    written = ", ".join([NUMBER] * len(moved))
    old, new = zip(*moved, strict=True)
    return written % old, written % new
