"""Along a continuous path: no steps of the correction, no lone point left behind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.eligibility import Reasons
from postproc.language.visits import Visits
from postproc.robot.arm import Arm
from postproc.robot.pose import MM, lengths
from postproc.robot.trajectory import Motion

LEAST_STEP = 0.1 * MM  # [m] a step that is never too large
PER = 100.0 * MM  # [m] of path that `step_mm` is for
TURNED = 0.5  # change of a side by which a joint has turned
ARC = "its arc is left as a whole: its other point cannot be corrected"
STEP = "the correction steps by more than step_mm = {:g} for 100 mm of the path"
BENT = (
    "its neighbour on the path is left: correcting this one alone would bend the path "
    "by more than step_mm = {:g} for 100 mm"
)

# Which visits follow each other on a continuous path.


def on_path(visits: Visits) -> Ints:
    """Return the visit before on a continuous path, (n,), -1 where there is none.

    A line or an arc goes on from a fly point. Nothing runs along a JOINT move: where it
    stops, and how it swings round its fly points, is no path.
    """
    return np.where(visits.motion != Motion.JOINT, visits.run_mates, -1)


# How much the correction may change on the way.


@dataclass(frozen=True)
class PathCorrection:
    """What n visits would be corrected by, and how far they lie apart.

    Attributes:
        before: The visit before on the path, (n,), -1 where there is none.
        correction: Of the TCP, (n, 3) [m], NaN where not known.
        allowed: Most that it may change since the visit before, (n,) [m].
        flanks: What it may change beyond that as joints change their flanks, (n,) [m].
    """

    before: Ints
    correction: Floats
    allowed: Floats
    flanks: Floats

    @property
    def steps(self) -> Bools:
        """Tell where the correction steps by too much, (n,)."""
        last = np.maximum(self.before, 0)
        step = lengths(self.correction - self.correction[last])
        with np.errstate(invalid="ignore"):
            far = step > self.allowed + self.flanks
        return np.asarray((self.before >= 0) & far)

    def bent(self, left: Bools, free: Bools) -> Bools:
        """Tell which visits must stay since others do, (n,).

        A visit that would bend the path to a neighbour that is left by more than is
        allowed stays too, and so on along the path.

        Args:
            left: Visits that are not corrected, (n,).
            free: Visits that are, (n,).
        """
        if not left.any():
            return np.zeros_like(left)
        size, n = lengths(self.correction), len(self.before)
        inner = np.flatnonzero(self.before >= 0)
        pairs = np.concatenate([inner, self.before[inner]])
        others = np.concatenate([self.before[inner], inner])
        with np.errstate(invalid="ignore"):
            bends = free[others] & (size[others] > np.tile(self.allowed[inner], 2))
        pairs, others = pairs[bends], others[bends]
        order = np.argsort(pairs, kind="stable")
        start = np.searchsorted(pairs[order], np.arange(n + 1)).tolist()
        to: list[int] = others[order].tolist()
        found = np.zeros(n, dtype=bool)
        work: list[int] = np.unique(pairs[left[pairs]]).tolist()
        while work:
            v = work.pop()
            for other in to[start[v] : start[v + 1]]:
                if not found[other]:
                    found[other] = True
                    work.append(other)
        return found


def path_correction(
    visits: Visits,
    arm: Arm,
    q: Floats,
    tcp: Floats,
    tool: Floats,
    correction: Floats,
    side: Floats,
    gap: Floats,
    step_mm: float,
) -> PathCorrection:
    """Say how much the correction may change along the path.

    Args:
        visits: n visits.
        arm: The arm.
        q: Joint angles there, (n, 6) [rad].
        tcp: TCP poses, (n, 4, 4) [m], base frame.
        tool: TCP in the flange frame, (n, 3) [m].
        correction: Change of the commanded TCP, (n, 3) [m].
        side: Where joints lie in their play, (n, 6) from -1 to 1.
        gap: Half the fitted gap between the flanks of every joint, (6,) [rad]; 0 where
            the model does not tell: a change of that joint's flank is not limited.
        step_mm: Most that it may change along 100 mm [mm].
    """
    before = on_path(visits)
    last = np.maximum(before, 0)
    way = lengths(tcp[:, :3, 3] - tcp[last, :3, 3])
    allowed = np.maximum(step_mm * MM * way / PER, LEAST_STEP)
    flanks = np.zeros(len(before))
    with np.errstate(invalid="ignore"):
        far = lengths(correction - correction[last]) > allowed
    rows = np.flatnonzero((before >= 0) & far)
    turned = np.abs(side[rows] - side[last[rows]])
    levers = np.linalg.norm(arm.jacobian(q[rows], tool[rows])[:, :3], axis=1)
    flanks[rows] = (turned * gap * levers).sum(axis=1)
    unknown = ((turned >= TURNED) & (gap == 0.0)).any(axis=1)
    flanks[rows[unknown]] = np.inf
    return PathCorrection(before, correction, allowed, flanks)


def keep_whole(
    reasons: Reasons, path: PathCorrection, visits: Visits, given: Bools, step_mm: float
) -> None:
    """Mark steps, what would be left lonely between, and the other points of arcs.

    Args:
        reasons: Collects the first reason of every visit.
        path: The corrections along the path.
        visits: n visits; behind the point on the way of an arc comes its end.
        given: Visits that had a reason before any guard spoke, (n,): they do not
            move, or not by us.
        step_mm: See `path_correction`.
    """
    steps = path.steps & reasons.none
    steps[path.before[steps]] = True
    reasons.mark(steps, STEP.format(step_mm))
    via, along = np.flatnonzero(visits.via), visits.follows >= 0
    while True:
        moves = reasons.none | along
        one = via[moves[via] != moves[via + 1]]
        half = np.zeros(len(along), dtype=bool)
        half[one] = half[one + 1] = True
        reasons.mark(half, ARC)
        free = reasons.none
        lonely = path.bent(~free & ~given, free)
        if not lonely.any():
            return
        reasons.mark(lonely, BENT.format(step_mm))
