"""One literal, several arrivals: do their corrections agree?"""

from __future__ import annotations

from dataclasses import dataclass, replace

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
        weights: Share of every visit in what its literal gets, (n,), where arrivals
            differ and one correction still helps each of them; else NaN.
        radius_mm: The most that such a correction is off what an arrival needs, (m,)
            [mm]; 0 where arrivals agree.
    """

    literal: Ints
    group: Ints
    usable: Bools
    spread_mm: Floats
    values: Floats
    change_mm: Floats
    arrivals: Ints
    weights: Floats
    radius_mm: Floats

    def find_apart(self, agree_mm: float) -> Bools:
        """Tell which literals no correction fits, (m,)."""
        return np.asarray(~((self.spread_mm <= agree_mm) | (self.radius_mm > 0.0)))

    def share_out(self, needed: Floats) -> Floats:
        """Return what n visits get of what they need (n, 3), in one frame for all."""
        rows = np.flatnonzero(~np.isnan(self.weights))
        if len(rows) == 0:
            return needed
        total, out = np.zeros((len(self.literal), 3)), np.array(needed)
        np.add.at(total, self.group[rows], self.weights[rows, None] * needed[rows])
        out[rows] = total[self.group[rows]]
        return out


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
    weights = np.broadcast_to(np.nan, literal.shape)
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
        every = names, group, usable[order], spread, mean, change, count
        return Agreement(*every, weights, np.zeros(m))
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
    every = names, group, all_usable, spread, mean, change, count
    return Agreement(*every, weights, np.zeros(m))


def _count_distinct(literals: Ints) -> tuple[Ints, Ints, Ints]:
    """Return what differs, ascending, where it stands, and how often it does."""
    if (np.diff(literals) > 0).all():  # in the order of the program, each once
        once = np.ones(len(literals), dtype=np.int64)
        return literals, np.arange(len(literals)), once
    return np.unique(literals, return_inverse=True, return_counts=True)


# One correction for arrivals that need different ones.

STEPS = 1_000  # towards the farthest arrival: the middle is then known to 0.1 %
BOUND = 1.96  # standard errors that 95 % of errors are within


def average(
    agreement: Agreement,
    corrected: Floats,
    correction_mm: Floats,
    among: Bools,
    std_mm: Floats,
) -> Agreement:
    """Give arrivals that differ one correction, where it helps each of them.

    It is the one whose worst arrival is best: the centre of the smallest ball round
    the corrections. It helps an arrival if the error that it leaves, with its 95 %
    bound, is below the error without a correction.

    Args:
        agreement: Of all literals.
        corrected: Numbers that every visit would write, (n, w).
        correction_mm: What must agree, (n, k) [mm].
        among: Literals whose arrivals may get one correction, (m,).
        std_mm: Standard errors of the errors of visits, (n,) [mm], of these literals.
    """
    order = np.argsort(agreement.group, kind="stable")
    ends = np.searchsorted(agreement.group[order], np.arange(len(among)), "right")
    values, change = np.array(agreement.values), np.array(agreement.change_mm)
    weights, radius = np.array(agreement.weights), np.array(agreement.radius_mm)
    for k in np.flatnonzero(among & agreement.usable).tolist():
        rows = order[ends[k] - agreement.arrivals[k] : ends[k]]
        needed = correction_mm[rows]
        share = weigh_middle(needed)
        off = np.linalg.norm(needed - share @ needed, axis=1)
        bound = off + BOUND * std_mm[rows]
        if (bound < np.linalg.norm(needed, axis=1)).all():
            weights[rows], radius[k] = share, off.max()
            values[k], change[k] = share @ corrected[rows], share @ needed[:, :3]
    return replace(
        agreement, values=values, change_mm=change, weights=weights, radius_mm=radius
    )


def weigh_middle(points: Floats) -> Floats:
    """Weigh points (n, k) so that their mean is the centre of their smallest ball.

    Steps towards the farthest point, ever shorter ones (Badoiu and Clarkson, Smaller
    core-sets for balls, 2003), from the middle of two points that lie far apart.

    >>> weigh_middle(np.array([[0.0], [3.0], [2.0], [4.0]])).tolist()
    [0.5, 0.0, 0.0, 0.5]
    """
    one = np.linalg.norm(points - points[0], axis=1).argmax()
    two = np.linalg.norm(points - points[one], axis=1).argmax()
    share = np.zeros(len(points))
    share[[one, two]] = 0.5
    for step in range(2, STEPS):
        off = np.linalg.norm(points - share @ points, axis=1)
        far = off.argmax()
        if off[far] <= off[share > 0].min() * (1.0 + 1e-9):
            break  # all that count are equally far, and none is farther
        share *= step / (step + 1.0)
        share[far] += 1.0 / (step + 1.0)
    return share
