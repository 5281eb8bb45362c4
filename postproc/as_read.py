"""The numbers of a corrected program as they will be read from its text."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.language.source import Replacements
from postproc.language.visits import Literals, Visits


def numbers_as_read(
    visits: Visits, edited: Ints, edits: Sequence[Replacements]
) -> Floats:
    """Give the numbers of all visits once the edits are made, (n, 6).

    Those of edited literals come out bit by bit, those of targets computed from them
    but for what adding constants rounds off.

    Args:
        visits: The program as it was.
        edited: Its literals that are edited, ascending, (m,).
        edits: The edits of their numbers, file by file.
    """
    values = np.array(visits.values)
    new, changed = edited_numbers(visits.literals, edited, edits)
    rows, at = _among(visits.literal, edited)
    values[rows] = np.where(changed[at], new[at], values[rows])
    moved = np.zeros((len(edited), 6))
    moved[at] = values[rows] - visits.values[rows]
    rows, at = _among(visits.follows, edited)
    values[rows] += moved[at]
    return values


def edited_numbers(
    literals: Literals, edited: Ints, edits: Sequence[Replacements]
) -> tuple[Floats, Bools]:
    """Read the new numbers of some literals, (m, 6), and tell which there are.

    Args:
        literals: All literals of a program.
        edited: Those to look at, (m,).
        edits: The edits of numbers, file by file.
    """
    new = np.zeros((len(edited), 6))
    changed = np.zeros((len(edited), 6), dtype=bool)
    for file, own in enumerate(edits):
        mine = np.flatnonzero(literals.file[edited] == file)
        if len(own) == 0:
            continue
        start = literals.start[edited[mine]]
        at = np.minimum(np.searchsorted(own.start, start), len(own) - 1)
        hit = own.start[at] == start
        numbers = np.zeros(at.shape)
        numbers[hit] = own.new[at[hit]].astype(float)
        changed[mine], new[mine] = hit, numbers
    return new, changed


def _among(column: Ints, edited: Ints) -> tuple[Ints, Ints]:
    """Find the visits of edited literals, and which each has."""
    if len(edited) == 0:
        none = np.empty(0, dtype=np.int64)
        return none, none
    at = np.minimum(np.searchsorted(edited, column), len(edited) - 1)
    rows = np.flatnonzero(edited[at] == column)
    return rows, at[rows]
