"""One literal, several arrivals: do their corrections agree?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints

LEVER_MM = 100.0  # from the TCP, by which turns count where arrivals must agree


@dataclass(frozen=True)
class Agreement:
    """What the arrivals at m literals have in common.

    Attributes:
        literal: The literals that are visited, (m,), ascending.
        group: Index into `literal` of every visit, (n,), -1 where it has none.
        usable: Every arrival can be corrected, (m,).
        spread_mm: Largest distance between two arrivals' corrections, (m,) [mm],
            bounded from above by the diagonal of their bounding box.
        values: The mean of the arrivals' corrected numbers, (m, w).
        change_mm: The mean of what must agree, (m, 3) [mm].
        arrivals: Number of arrivals, (m,).
    """

    literal: Ints
    group: Ints
    usable: Bools
    spread_mm: Floats
    values: Floats
    change_mm: Floats
    arrivals: Ints


def agree(
    literal: Ints, usable: Bools, corrected: Floats, correction_mm: Floats
) -> Agreement:
    """Compare the corrections of all arrivals at every literal.

    Args:
        literal: Literal of every visit, (n,), -1 where it has none.
        usable: The visit can be corrected, (n,).
        corrected: Numbers that this visit would write, (n, w) in the file's units.
        correction_mm: What must agree: the change of the target in its own frame,
            (n, k) [mm], of which the first three are that of its place.
    """
    rows = np.flatnonzero(literal >= 0)
    names, inverse, count = _count_distinct(literal[rows])
    group = np.full(len(literal), -1, dtype=np.int64)
    group[rows] = inverse
    m = len(names)
    if m == len(rows):  # every literal has one arrival: nothing to compare
        order = np.empty(m, dtype=np.int64)
        order[inverse] = rows
        mean, change = corrected.take(order, axis=0), correction_mm.take(order, axis=0)
        spread = 0.0 * np.einsum("nk->n", np.abs(change))  # NaN where one is not known
        mean += 0.0  # no -0.0, as in a mean
        change = change[:, :3] + 0.0
        return Agreement(names, group, usable[order], spread, mean, change, count)
    all_usable = np.ones(m, dtype=bool)
    np.logical_and.at(all_usable, inverse, usable[rows])
    width = (m, correction_mm.shape[1])
    low, high = np.full(width, np.inf), np.full(width, -np.inf)
    np.minimum.at(low, inverse, correction_mm[rows])
    np.maximum.at(high, inverse, correction_mm[rows])
    total, moved = np.zeros((m, corrected.shape[1])), np.zeros((m, 3))
    np.add.at(total, inverse, corrected[rows])
    np.add.at(moved, inverse, correction_mm[rows, :3])
    spread = np.linalg.norm(high - low, axis=1)
    mean, change = total / count[:, None], moved / count[:, None]
    return Agreement(names, group, all_usable, spread, mean, change, count)


def _count_distinct(literals: Ints) -> tuple[Ints, Ints, Ints]:
    """Return what differs, ascending, where it stands, and how often it does."""
    if (np.diff(literals) > 0).all():  # in the order of the program, each once
        once = np.ones(len(literals), dtype=np.int64)
        return literals, np.arange(len(literals)), once
    return np.unique(literals, return_inverse=True, return_counts=True)
