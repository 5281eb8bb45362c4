"""Arcs that end at an angle, not at the point that is written as their end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.eligibility.reasons import Reasons
from postproc.diagnostics import Code, Reason
from postproc.language.visits import Meaning, Visits
from postproc.motion.path import circles
from postproc.robot.pose import lengths, rotation_from_vector, rotation_vector

# The circle goes through the start, the point on the way and a third point that the
# move names as its end. This one only shapes the circle; the arc ends at an angle.
# One that goes nearly all around is left, but what comes behind begins at its end.

WHOLE = np.deg2rad(300.0)  # from here on the end lies nearer to the start than the
# centre does: what their corrections differ by would bend the arc by twice as much
BEHIND = np.deg2rad(1.0)  # that the end lies behind the point on the way
TURNED = np.deg2rad(0.5)  # between start and third point: it may count at either end
NO_START = Reason(
    Code.ARC_UNDETERMINED,
    "its arc ends at an angle, and its start is not one known point with this tool: "
    "write its end point, without the angle",
)
NO_END = Reason(
    Code.ARC_UNDETERMINED,
    "its arc ends before its middle point, near its start, or runs backwards: divide "
    "it, without the angle",
)
TILTED = Reason(
    Code.ARC_UNDETERMINED,
    "its arc ends at an angle, and the tool turns on it: its orientation at the end "
    "depends on the controller. Divide the arc, without the angle",
)
ASTRAY = Reason(
    Code.ARC_DISTORTED,
    "its arc ends at an angle: with a corrected end it would pass this point at a "
    "larger distance than now. Divide the arc, without the angle",
)


@dataclass(frozen=True)
class ArcAngles:
    """k arcs that end at an angle.

    Attributes:
        start, via, end: Their visits, (k,); start -1 where it is not one alone.
        angle: From start to end, the way on that the points follow, (k,) [rad].
    """

    start: Ints
    via: Ints
    end: Ints
    angle: Floats

    @classmethod
    def of(cls, visits: Visits) -> ArcAngles:
        """Find them."""
        end = np.flatnonzero(~np.isnan(visits.motion.arc_angle))
        start = visits.graph.before[end - 1] if len(end) else end
        return cls(start, end - 1, end, visits.motion.arc_angle[end])

    def __len__(self) -> int:
        """Return the number of such arcs."""
        return len(self.end)

    def among(self, rows: Bools) -> ArcAngles:
        """Return some of them, (k,)."""
        return ArcAngles(
            self.start[rows], self.via[rows], self.end[rows], self.angle[rows]
        )

    def find_moved(self, moved: Bools) -> Bools:
        """Tell which of their ends move as some of n visits do, (n,)."""
        out = np.zeros(len(moved), dtype=bool)
        known = self.among(self.start >= 0)
        ways = np.stack([known.start, known.via, known.end])
        out[known.end] = moved[ways].any(axis=0)
        return out

    def ends(self, tcp: Floats) -> Floats:
        """Place their ends, (k, 4, 4) [m]; NaN where there is no such arc.

        Args:
            tcp: TCP poses of all visits, those of the third points instead of the
                ends, (n, 4, 4) [m].
        """
        points = [tcp[rows, :3, 3] for rows in (self.start, self.via, self.end)]
        centre, normal, valid = circles(*points)
        out = np.array(tcp[self.end])
        turn = rotation_from_vector(self.angle[:, None] * normal)
        radius = points[0] - centre
        out[:, :3, 3] = centre + np.einsum("kij,kj->ki", turn, radius)
        tangent = np.cross(normal, radius)
        to_via = points[1] - centre
        via = np.arctan2((to_via * tangent).sum(1), (to_via * radius).sum(1))
        before = np.mod(via, 2 * np.pi)
        behind = self.angle > before + BEHIND
        behind &= self.angle < before + 2 * np.pi - BEHIND
        apart = np.abs(self.angle - 2 * np.pi) > BEHIND  # from where it begins
        out[~(valid & behind & apart & (self.start >= 0))] = np.nan
        return out

    @property
    def is_whole(self) -> Bools:
        """Whether they go nearly all around or farther, (k,)."""
        return np.asarray(self.angle >= WHOLE)


def place_ends(visits: Visits, tcp: Floats, reasons: Reasons) -> Bools:
    """Place the ends of arcs that end at an angle, in place.

    Args:
        visits: n visits.
        tcp: TCP poses as they are written, (n, 4, 4) [m], NaN where not known.
        reasons: Why visits must not be compensated; more are added.

    Returns:
        The visits whose end is not known, (n,).
    """
    lost = np.zeros(len(visits), dtype=bool)
    arcs = ArcAngles.of(visits)
    if len(arcs) == 0:
        return lost
    poses = visits.target.meaning == Meaning.POSE
    known = (arcs.start >= 0) & poses[arcs.start] & poses[arcs.via] & poses[arcs.end]
    known &= visits.frame.tool[arcs.start] == visits.frame.tool[arcs.end]
    turn = np.swapaxes(tcp[arcs.start, :3, :3], 1, 2) @ tcp[arcs.end, :3, :3]
    tilted = known & (lengths(rotation_vector(turn)) > TURNED)
    ends = arcs.ends(tcp)
    nowhere = np.isnan(ends[:, 0, 3])
    for rows, why in (
        (~known, NO_START), (tilted, TILTED), (nowhere | arcs.is_whole, NO_END)
    ):  # fmt: skip
        for visit in (arcs.end, arcs.via):
            reasons.mark(np.isin(np.arange(len(visits)), visit[rows]), why)
    lost[arcs.end[~known | tilted | nowhere]] = True
    tcp[arcs.end] = ends
    return lost


def find_past_start(visits: Visits) -> Bools:
    """Tell which visits are points of arcs that end past where they begin, (n,)."""
    past: Bools = visits.motion.arc_angle > 2 * np.pi
    past[:-1] |= visits.motion.via[:-1] & past[1:]
    return past


def points_to_write(
    before: Floats, after: Floats, third: Floats
) -> tuple[Floats, Floats]:
    """Say what to write for the points of arcs so that they end where they should.

    A similarity takes start and end to where they are wanted, and turns about the line
    between them so that the point on the way comes nearest to where it is wanted. It
    takes circles to circles and keeps angles, so that the arc through the points that
    it takes along ends where it takes the end.

    Args:
        before: Start, point on the way and end of k arcs as the program has them,
            (3, k, 3) [m].
        after: Where they are wanted, (3, k, 3) [m].
        third: The points that the program writes as the ends, (k, 3) [m].

    Returns:
        Points on the way and third points, (k, 3) [m] each.
    """
    old, new = before[2] - before[0], after[2] - after[0]
    scale = np.linalg.norm(new, axis=1) / np.linalg.norm(old, axis=1)
    axis = new / np.linalg.norm(new, axis=1)[:, None]
    onto = _shortest(old, new)
    way = scale[:, None] * np.einsum("kij,kj->ki", onto, before[1] - before[0])
    side = way - (way * axis).sum(1)[:, None] * axis
    wanted = after[1] - after[0]
    across = np.cross(axis, side)
    roll = np.arctan2((wanted * across).sum(1), (wanted * side).sum(1))
    turn = rotation_from_vector(roll[:, None] * axis) @ onto
    via, end = (
        after[0] + scale[:, None] * np.einsum("kij,kj->ki", turn, point - before[0])
        for point in (before[1], third)
    )
    return via, end


def _shortest(a: Floats, b: Floats) -> Floats:
    """Rotations (k, 3, 3) that take directions a (k, 3) to b (k, 3) the shortest way.

    They are near each other.
    """
    normal = np.cross(a, b)
    size = np.linalg.norm(normal, axis=1)
    angle = np.arctan2(size, (a * b).sum(1))
    return rotation_from_vector(normal * (angle / np.maximum(size, 1e-300))[:, None])
