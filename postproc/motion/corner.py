"""How the path runs round a fly point.

Within the zone two moves are superposed: what the first still has to go is braked to
zero while the second starts. With the share a of the edge before, b of the edge behind
and s from 0 to 1,

    q(s) = q_before(1 - a (1 - s)^2) + q_behind(b s^2) - q_point,

joint by joint: between straight moves a parabola that leaves the first and joins the
second tangentially, the linear segments with parabolic blends of R. H. Taylor (Planning
and Execution of Straight Line Manipulator Trajectories, IBM Journal of Research and
Development 23, 1979). That FLY_CART superposes in space and not in the joints changes
the way by the square of the zone over the size of the arm: 1 um for 1 mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.motion.paths import along
from postproc.motion.targets import Fly, Targets
from postproc.motion.trace import Trace
from postproc.motion.zone import Zones, zones
from postproc.robot.arm import Arm

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

GRID = np.linspace(0.0, 1.0, 9)  # where the search for the nearest point begins
ROUNDS = 5  # of Newton's method
FLAT = 4e-5  # [rad] bend below which a corner's moves are as good as straight
REFINED, STEP = 2, 0.02  # rounds, and step in s, for the others


@dataclass(frozen=True)
class Corners:
    """c rounded corners.

    Attributes:
        zones: What they take of the neighbouring moves.
        nearest: Where on the corner the TCP passes closest to the point, (c,) in s.
        q: Joint angles there, (c, 6) [rad].
        bend: What the parabola bends by, half of its second derivative, (c, 6) [rad].
    """

    zones: Zones
    nearest: Array
    q: Array
    bend: Array

    @property
    def flat(self) -> Bools:
        """Tell where the nearest point alone tells of the corner, (c,)."""
        return np.asarray(np.abs(self.bend).max(axis=1) < FLAT)


def corners(arm: Arm, targets: Targets, traced: Trace) -> Corners:
    """Find all corners and where the path passes them."""
    found = zones(arm, targets, traced)
    if len(found.visit) == 0:
        return Corners(found, np.empty(0), np.empty((0, 6)), np.empty((0, 6)))
    first, last, nearest, miss = _passing(arm, targets, traced, found)
    within = targets.rounding[found.visit] == Fly.WITHIN
    wanted = targets.fly_distance[found.visit]
    too_far = within & (miss > wanted)
    if too_far.any():
        shrink = np.where(too_far, wanted / np.maximum(miss, 1e-12), 1.0)
        found = Zones(found.visit, found.into, found.out, found.before * shrink,
                      found.behind * shrink)  # fmt: skip
        first, last, nearest, _ = _passing(arm, targets, traced, found)
    bend = first + last - 2 * traced.q[found.visit]
    sharp = np.flatnonzero(np.abs(bend).max(axis=1) >= FLAT)
    nearest[sharp] = _refined(arm, targets, traced, found, sharp, nearest[sharp])
    q = on_corner(traced, found, np.arange(len(nearest)), nearest)
    return Corners(found, nearest, q, bend)


def on_corner(traced: Trace, found: Zones, row: Ints, s: Array) -> Array:
    """Follow the formula above on corners `row` (m,) at s (m,): (m, 6) [rad]."""
    before = along(traced, found.into[row], 1 - found.before[row] * (1 - s) ** 2)
    behind = along(traced, found.out[row], found.behind[row] * s**2)
    q: Array = before + behind - traced.q[found.visit[row]]
    return q


def _passing(
    arm: Arm, targets: Targets, traced: Trace, found: Zones
) -> tuple[Array, Array, Array, Array]:
    """Find where corners begin and end, where they pass closest, and how far off.

    Returns:
        Joint angles at begin and end (c, 6) [rad], s (c,), distance (c,) [m].
    """
    one = np.ones(len(found.visit))
    first = along(traced, found.into, one - found.before)
    last = along(traced, found.out, found.behind)
    tool = targets.tool[found.visit]
    point = (traced.flange[found.visit] @ tool)[:, :3, 3]
    ends = [(arm.flange(q) @ tool)[:, :3, 3] - point for q in (first, last)]
    nearest = nearest_on_parabola(ends[0], ends[1])
    s = nearest[:, None]
    miss = np.linalg.norm(ends[0] * (1 - s) ** 2 + ends[1] * s**2, axis=1)
    return first, last, nearest, miss


def _refined(
    arm: Arm, targets: Targets, traced: Trace, found: Zones, row: Ints, s: Array
) -> Array:
    """Improve the nearest points of corners `row`, whose moves are not straight."""
    visit = found.visit[row]
    tool = targets.tool[visit]
    point = (traced.flange[visit] @ tool)[:, :3, 3]
    for _ in range(REFINED):
        s = np.clip(s, STEP, 1 - STEP)
        before, x, after = (
            (arm.flange(on_corner(traced, found, row, at)) @ tool)[:, :3, 3] - point
            for at in (s - STEP, s, s + STEP)
        )
        slope, curve = (after - before) / 2, after - 2 * x + before
        down, curved = (x * slope).sum(axis=1), (slope**2 + x * curve).sum(axis=1)
        s = s - STEP * np.where(curved > 0, down / np.where(curved > 0, curved, 1), 0)
    return np.clip(s, 0.0, 1.0)


def nearest_on_parabola(begin: Array, end: Array) -> Array:
    """Find the s at which begin (1 - s)^2 + end s^2 is shortest, (c,).

    Args:
        begin: Where the zones begin, seen from the point, (c, 3) [m].
        end: Where they end, likewise.
    """
    grid = GRID[:, None, None]
    away = np.linalg.norm(begin * (1 - grid) ** 2 + end * grid**2, axis=2)
    s = GRID[np.argmin(away, axis=0)]
    bend = 2 * (begin + end)
    for _ in range(ROUNDS):
        t = s[:, None]
        x = begin * (1 - t) ** 2 + end * t**2
        slope = 2 * (end * t - begin * (1 - t))
        down = (x * slope).sum(axis=1)
        curved = (slope * slope + x * bend).sum(axis=1)
        step = np.where(curved > 0, down / np.where(curved > 0, curved, 1.0), 0.0)
        s = np.clip(s - step, 0.0, 1.0)
    return np.asarray(s)
