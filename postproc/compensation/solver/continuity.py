"""Along a continuous path: no steps of the correction, no lone point left behind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.eligibility.reasons import Reasons
from postproc.compensation.solver.arc_angles import ArcAngles
from postproc.diagnostics import Code, Reason
from postproc.language.visits import Visits
from postproc.robot.arm import Arm
from postproc.robot.pose import MM, lengths
from postproc.robot.trajectory import Motion

LEAST_STEP = 0.1 * MM  # [m] a step that is never too large
PER = 100.0 * MM  # [m] of path that `correction_step_mm` is for
TURNED = 0.5  # change of a side by which a joint has turned
ARC = Reason(
    Code.PATH_BENT,
    "all points of its arc are corrected or none: another of them cannot be corrected",
)
ANGLED = Reason(
    Code.PATH_BENT,
    "its arc ends at an angle, so that all its points are corrected or none: another "
    "of its points cannot be corrected",
)
CURVE = Reason(
    Code.PATH_BENT,
    "all points of its curve, and the point before it, are corrected or none: another "
    "of them cannot be corrected",
)
STEP = (
    "the correction steps by more than correction_step_mm = {:g} for 100 mm of the path"
)
BENT = (
    "its neighbour on the path is not corrected: correcting this target alone would "
    "bend the path by more than correction_step_mm = {:g} for 100 mm"
)

# Which visits follow each other on a continuous path.


def on_path(visits: Visits) -> Ints:
    """Return the visit before on a continuous path, (n,), -1 where there is none.

    A line or an arc goes on from a fly point. Nothing runs along a JOINT move: where it
    stops, and how it swings round its fly points, is no path.
    """
    return np.where(visits.motion.kind != Motion.JOINT, visits.run_mates, -1)


# How much the correction may change on the way.


@dataclass(frozen=True)
class PathLimits:
    """How much corrections may change along continuous paths, n visits.

    Attributes:
        before: The visit before on the path, (n,), -1 where there is none.
        allowed: Most that the correction may change since then, (n,) [m].
    """

    before: Ints
    allowed: Floats

    @classmethod
    def of(cls, visits: Visits, tcp: Floats, step_mm: float) -> PathLimits:
        """Find them.

        Args:
            visits: n visits.
            tcp: TCP poses, (n, 4, 4) [m], base frame.
            step_mm: Most that the correction may change along 100 mm [mm].
        """
        before = on_path(visits)
        way = lengths(tcp[:, :3, 3] - tcp[np.maximum(before, 0), :3, 3])
        return cls(before, np.maximum(step_mm * MM * way / PER, LEAST_STEP))


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

    def find_bent(self, left: Bools, free: Bools) -> Bools:
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
    limits: PathLimits,
    arm: Arm,
    q: Floats,
    tool: Floats,
    correction: Floats,
    side: Floats,
    gap: Floats,
) -> PathCorrection:
    """Say how much the correction changes along the path, and how much it may.

    Args:
        limits: Where n visits follow each other.
        arm: The arm.
        q: Joint angles there, (n, 6) [rad].
        tool: TCP in the flange frame, (n, 3) [m].
        correction: Change of the commanded TCP, (n, 3) [m].
        side: Where joints lie in their play, (n, 6) from -1 to 1.
        gap: Half the fitted gap between the flanks of every joint, (6,) [rad]; 0 where
            the model does not tell: a change of that joint's flank is not limited.
    """
    before, allowed = limits.before, limits.allowed
    last, flanks = np.maximum(before, 0), np.zeros(len(before))
    with np.errstate(invalid="ignore"):
        far = lengths(correction - correction[last]) > allowed
    rows = np.flatnonzero((before >= 0) & far)
    turned = np.abs(side[rows] - side[last[rows]])
    levers = np.linalg.norm(arm.jacobian(q[rows], tool[rows])[:, :3], axis=1)
    flanks[rows] = (turned * gap * levers).sum(axis=1)
    unknown = ((turned >= TURNED) & (gap == 0.0)).any(axis=1)
    flanks[rows[unknown]] = np.inf
    return PathCorrection(before, correction, allowed, flanks)


@dataclass(frozen=True)
class _Wholes:
    """Points that are all corrected, or none: arcs, and curves through many points.

    Attributes:
        reasons: Why those are left that could be corrected, for another's sake.
        reason: Which of them a whole has, (w,).
        whole, visit: The points of all, (p,) each.
    """

    reasons: tuple[Reason, ...]
    reason: Ints
    whole: Ints
    visit: Ints

    @classmethod
    def of(cls, visits: Visits) -> _Wholes:
        """Find them; behind the point on the way of an arc comes its end.

        Where the start of an arc that ends at an angle moves, so does its end, and the
        start of a curve is one of its points.
        """
        before, n = visits.graph.before, len(visits)
        via, arcs = np.flatnonzero(visits.motion.via), ArcAngles.of(visits)
        arcs = arcs.among(arcs.start >= 0)
        inside = np.flatnonzero(visits.motion.block >= 0)
        heads = inside[
            (visits.motion.block == np.arange(n))[inside] & (before[inside] >= 0)
        ]
        whole = np.concatenate(
            [via, via, *[arcs.end + n] * 3,
             visits.motion.block[inside] + 2 * n, heads + 2 * n]
        )  # fmt: skip
        visit = np.concatenate(
            [via, via + 1, arcs.start, arcs.via, arcs.end, inside,
             before[heads]]
        )  # fmt: skip
        found, whole = np.unique(whole, return_inverse=True)
        return cls((ARC, ANGLED, CURVE), found // max(n, 1), whole, visit)

    def find_broken(self, moves: Bools) -> dict[Reason, Bools]:
        """Say which points must stay since others of their whole do, (n,) by reason.

        Args:
            moves: Which points move, (n,).
        """
        stays = np.zeros(len(self.reason), dtype=bool)
        stays[self.whole[~moves[self.visit]]] = True
        out = {}
        for kind, reason in enumerate(self.reasons):
            rows = np.zeros(len(moves), dtype=bool)
            rows[self.visit[(stays & (self.reason == kind))[self.whole]]] = True
            if rows.any():
                out[reason] = rows
        return out


def keep_whole(
    reasons: Reasons, path: PathCorrection, visits: Visits, given: Bools, step_mm: float
) -> None:
    """Mark steps, what would be left lonely between, and what else moves as a whole.

    Args:
        reasons: Collects the first reason of every visit.
        path: The corrections along the path.
        visits: n visits.
        given: Visits that had a reason before any guard spoke, (n,): they do not
            move, or not by us.
        step_mm: See `PathLimits`.
    """
    steps = path.steps & reasons.none
    steps[path.before[steps]] = True
    reasons.mark(steps, Reason(Code.CORRECTION_STEP, STEP.format(step_mm)))
    wholes, along = _Wholes.of(visits), visits.target.follows >= 0
    while True:
        moves = reasons.none | along
        for reason, rows in wholes.find_broken(moves).items():
            reasons.mark(rows, reason)
        free = reasons.none
        lonely = path.find_bent(~free & ~given, free)
        if not lonely.any():
            return
        reasons.mark(lonely, Reason(Code.PATH_BENT, BENT.format(step_mm)))
