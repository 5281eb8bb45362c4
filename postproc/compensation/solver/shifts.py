"""Targets that are shifted from points: what the numbers of a shift must make up for.

The point keeps its own correction, or none, and the numbers in the move absorb the
difference. So what they should be is told by what the point's numbers become.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.solver.agreement import LEVER_MM, Agreement, agree
from postproc.diagnostics import Code, Reason
from postproc.language.shifts import ANGLES, NUMBERS, Shifts
from postproc.language.visits import Visits

TURNS = Reason(
    Code.ARRIVALS_DIFFER,
    "its shift keeps the orientation of the point, and the correction needs another "
    "orientation",
)
FLAGS = Reason(
    Code.ARRIVALS_DIFFER,
    "it would need other configuration flags than the point that it is shifted from",
)


@dataclass(frozen=True)
class Absorbed:
    """What the shifts of a program are to be.

    Attributes:
        change: What must agree at every visit, (n, k) [mm].
        agreement: What arrivals have in common at all literals, those of shifts too.
        stay: Why the numbers of shifts cannot do it, and which of the m literals of the
            agreement have each reason, (m,).
    """

    change: Floats
    agreement: Agreement
    stay: dict[Reason, Bools]


def own_shifts(visits: Visits) -> Bools:
    """Tell which visits have a literal that holds the numbers of a shift, (n,)."""
    return np.asarray((visits.target.shift >= 0) & (visits.target.literal >= 0))


def origins(shifts: Shifts, literals: Ints, values: Floats) -> Floats:
    """Return the numbers that the points of shifts get, (k, w).

    Args:
        shifts: k shifts.
        literals: Literals that get new numbers, ascending, (m,).
        values: Their numbers, (m, w).
    """
    out = np.array(shifts.origin)
    if len(literals) == 0:
        return out
    at = np.minimum(np.searchsorted(literals, shifts.follows), len(literals) - 1)
    rows = np.flatnonzero(literals[at] == shifts.follows)
    out[rows] = np.where(np.isnan(values[at[rows]]), out[rows], values[at[rows]])
    return out


def absorb(
    visits: Visits,
    usable: Bools,
    numbers: Floats,
    change: Floats,
    points: Agreement,
    chosen: Bools,
    agree_mm: float,
) -> Absorbed:
    """Let the numbers of shifts make up for what their points do not.

    Args:
        visits: n arrivals.
        usable: Those that can be corrected, (n,).
        numbers: Corrected numbers of the targets, (n, w).
        change: What must agree at a literal, (n, k) [mm].
        points: What arrivals have in common at the points.
        chosen: Literals of it that get new numbers, (m,).
        agree_mm: Changes that differ less are the same.
    """
    shifts = visits.shifted
    new = origins(shifts, points.literal[chosen], points.values[chosen])
    needed, off = shifts.find_shift(new, numbers[shifts.rows])
    own = shifts.literal >= 0
    rows, numbers = shifts.rows[own], np.array(numbers)
    flags = list(shifts.dialect.flag_columns)
    other = shifts.carry(new, needed) != numbers[shifts.rows]
    stay = {TURNS: ~(off * LEVER_MM <= agree_mm), FLAGS: other[:, flags].any(axis=1)}
    numbers[rows] = 0.0
    numbers[rows, :NUMBERS] = needed[own]
    # Visits with shifts agree on the shifts' numbers, turns beside them.
    moved = needed[own] - shifts.numbers[own]
    change = np.concatenate([change, np.zeros((len(change), 3))], axis=1)
    change[rows] = 0.0
    change[rows, :3] = moved[:, :3] + 0.0
    change[rows, -3:] = np.deg2rad(moved[:, ANGLES]) * LEVER_MM
    found = agree(visits.target.literal, usable, numbers, change)
    at = {why: np.isin(found.literal, shifts.literal[own & bad])
          for why, bad in stay.items()}  # fmt: skip
    return Absorbed(change, found, {why: k for why, k in at.items() if k.any()})


def shift_values(
    visits: Visits, literals: Ints, values: Floats, numbers: Floats, own: bool = True
) -> Floats:
    """Give the numbers of all visits once points and shifts are written, (n, w).

    Args:
        visits: n arrivals.
        literals: Literals that get new numbers, ascending, (m,).
        values: Their numbers, (m, w); NaN where one stays what it is.
        numbers: Numbers of every visit that count where nothing is shifted, (n, w).
        own: Shifts get new numbers too; False: they stay, and only points do.
    """
    shifts = visits.shifted
    if len(shifts) == 0 or len(literals) == 0:
        return numbers
    new = origins(shifts, literals, values)
    at = np.minimum(np.searchsorted(literals, shifts.literal), len(literals) - 1)
    mine = (literals[at] == shifts.literal) & own
    by = np.array(shifts.numbers)
    written = values[at[mine], :NUMBERS]
    by[mine] = np.where(np.isnan(written), by[mine], written)
    moved = mine | (new != shifts.origin).any(axis=1)
    out = np.array(numbers)
    out[shifts.rows[moved]] = shifts.carry(new, by)[moved]
    return out
