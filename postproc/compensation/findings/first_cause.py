"""What to declare first in the cell, and how many targets that frees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from postproc.compensation.program import ParsedProgram, read_program
from postproc.diagnostics import Code
from postproc.language.visits import Diagnostic, Visits
from postproc.robot.cell import Cell

CAUSES = (Code.MOTION_UNKNOWN, Code.UNKNOWN_ROUTINE)


def read_with_cause(files: Mapping[str, bytes], cell: Cell) -> ParsedProgram:
    """Read a program, and say first where it is first not known.

    Args:
        files: As in `read_program`.
        cell: The cell.

    Raises:
        ProgramError: A file is no program text.
    """
    reading = read_program(files, cell)
    cause = first_cause(files, cell, reading)
    return replace(reading, diagnostics=(*cause, *reading.diagnostics))


def first_cause(
    files: Mapping[str, bytes], cell: Cell, reading: ParsedProgram
) -> tuple[Diagnostic, ...]:
    """Say where a program is first not known, and how many targets that leaves.

    The program is read once more as if all routines that no file holds were still.

    Args:
        files: As in `read_program`.
        cell: The cell.
        reading: The program as the cell describes it.
    """
    causes = sorted(one for one in reading.diagnostics if one.code in CAUSES)
    if not causes or not reading.visits.reason.any():
        return ()
    free = read_program(files, replace(cell, motionless=("*",))).visits
    freed = _count_known(free) - _count_known(reading.visits)
    if freed <= 0:
        return ()
    first, total = causes[0], max(map(_count_targets, (free, reading.visits)))
    text = (
        f"{freed} of {total} targets are not corrected because it is not known what "
        "this statement, and others after it, do. Declare under [routines] of the cell "
        'the routines that no file holds (name = "motionless" or "moves"), or give '
        "their files"
    )
    return (Diagnostic(first.file, first.line, Code.FIRST_CAUSE, text),)


def _count_targets(visits: Visits) -> int:
    """Count the targets that hold numbers."""
    return int((visits.target.literal >= 0).sum())


def _count_known(visits: Visits) -> int:
    """Count the targets that nothing unknown leaves."""
    return int(np.sum((visits.target.literal >= 0) & (visits.reason == 0)))
