"""Moves that a program never comes to: their targets keep their values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.language import pdl2 as ast
from postproc.language.diagnostic import Diagnostic
from postproc.language.program import Program
from postproc.language.visits import Visits

NEVER_REACHED = "never-reached"


def never_reached(programs: Sequence[Program], visits: Visits) -> list[Diagnostic]:
    """List the files with moves to targets that no way from the start leads to.

    Such a move stands in a routine that nobody calls, or behind a jump. From where it
    is reached cannot be known, so that it is not compensated; a program that calls
    the routine from elsewhere would run it uncompensated.

    Args:
        programs: The files of a job.
        visits: Every arrival in them.
    """
    found = []
    for program in programs:
        name = program.lines.source.name
        moves = program.statements.which(_has_target)
        lines = program.lines.line[moves[program.lines.shape]]
        own = visits.file == visits.files.index(name)
        missed = lines[~np.isin(lines, visits.line[own])]
        if len(missed):
            text = (
                f"{len(missed)} moves, the first here, are never reached from the "
                "start: they are not compensated. Give the program that calls them, "
                "or remove them"
            )
            found.append(Diagnostic(name, int(missed[0]), NEVER_REACHED, text))
    return found


def _has_target(statement: ast.Statement) -> bool:
    """Tell whether a line moves to a target, and not to a system variable.

    A move that names its arm may be one of another arm, and does not count.
    """
    move = ast.action(statement)
    if not isinstance(move, ast.Move) or move.how != "TO" or move.arm:
        return False
    where = move.where[0] if move.where else None
    return not (isinstance(where, ast.Reference) and where.name.startswith("$"))
