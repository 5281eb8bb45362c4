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

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np

from postproc.arrays import Bools, Floats, in_pieces
from postproc.kernels import floats, native
from postproc.motion.paths import along, between
from postproc.motion.targets import Fly, Targets
from postproc.motion.trace import Trace
from postproc.motion.zone import Zones, zones
from postproc.robot.arm import Arm

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
        aside: From the point to there, (c, 3) [m].
        bend: What the parabola bends by, half of its second derivative, (c, 6) [rad].
    """

    zones: Zones
    nearest: Floats
    q: Floats
    aside: Floats
    bend: Floats

    @property
    def flat(self) -> Bools:
        """Tell where the nearest point alone tells of the corner, (c,)."""
        return _is_flat(self.bend)


def corners(arm: Arm, targets: Targets, traced: Trace) -> Corners:
    """Find all corners and where the path passes them."""
    found = zones(arm, targets, traced)
    parts = in_pieces(
        lambda rows: _passed(arm, targets, traced, found[rows]), len(found.visit)
    )
    return _joined(parts)


def _passed(arm: Arm, targets: Targets, traced: Trace, found: Zones) -> Corners:
    """Find where the path passes some corners, and keep to their tolerances."""
    tool = targets.tool.take(found.visit, axis=0)[:, :3, 3]
    point = _tcp(traced.flange.take(found.visit, axis=0), tool)
    within = targets.rounding[found.visit] == Fly.WITHIN
    wanted = np.where(within, targets.fly_distance[found.visit], np.inf)
    if native is not None:
        return _passed_natively(arm, traced, found, tool, point, wanted)
    first, last, nearest, miss = _passing(arm, traced, found, tool, point)
    too_far = miss > wanted
    if too_far.any():
        shrink = np.where(too_far, wanted / np.maximum(miss, 1e-12), 1.0)
        found = Zones(found.visit, found.into, found.out, found.before * shrink,
                      found.behind * shrink)  # fmt: skip
        first, last, nearest, _ = _passing(arm, traced, found, tool, point)
    bend = first + last - 2 * traced.q.take(found.visit, axis=0)
    sharp = np.flatnonzero(~_is_flat(bend))
    nearest[sharp] = _refined(
        arm, traced, found[sharp], nearest[sharp], tool[sharp], point[sharp]
    )
    q = parabolas(traced, found)(nearest)
    return Corners(found, nearest, q, arm.tcp(q, tool) - point, bend)


def _passed_natively(
    arm: Arm, traced: Trace, found: Zones, tool: Floats, point: Floats, wanted: Floats
) -> Corners:
    """Do as `_passed` with the native kernel."""
    before, behind, nearest, q, aside, bend = native.passed(
        arm.dh.packed(), traced.edges, traced.q, found, floats(tool), point, wanted,
    )  # fmt: skip
    found = replace(found, before=before, behind=behind)
    return Corners(found, nearest, q, aside, bend)


def _is_flat(bend: Floats) -> Bools:
    """Tell which corners are as good as straight, (c,)."""
    return np.asarray((np.abs(bend) < FLAT).all(axis=1))


def _tcp(flange: Floats, tool: Floats) -> Floats:
    """Place tools (c, 3) [m] at flange poses (c, 4, 4): (c, 3) [m]."""
    turned: Floats = np.einsum("nij,nj->ni", flange[:, :3, :3], tool)
    return turned + flange[:, :3, 3]


def _joined(parts: list[Corners]) -> Corners:
    """Put corners one after the other."""
    if not parts:
        none = np.empty(0, dtype=np.int64)
        zone = Zones(none, none, none, np.empty(0), np.empty(0))
        q, aside = np.empty((0, 6)), np.empty((0, 3))
        return Corners(zone, np.empty(0), q, aside, q)
    zone = Zones(
        *(
            np.concatenate([getattr(part.zones, f.name) for part in parts])
            for f in fields(Zones)
        )
    )
    names = ("nearest", "q", "aside", "bend")
    return Corners(
        zone, *(np.concatenate([getattr(p, name) for p in parts]) for name in names)
    )


def parabolas(traced: Trace, found: Zones) -> Callable[[Floats], Floats]:
    """Prepare to follow c corners by the formula above: s (c,) to (c, 6) [rad]."""
    into, out = between(traced, found.into), between(traced, found.out)
    point = traced.q.take(found.visit, axis=0)

    def at(s: Floats) -> Floats:
        before = into(1 - found.before * (1 - s) ** 2)
        behind = out(found.behind * s**2)
        return before + behind - point

    return at


def _passing(
    arm: Arm, traced: Trace, found: Zones, tool: Floats, point: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Find where corners begin and end, where they pass closest, and how far off.

    Args:
        arm: The arm.
        traced: The path without corners.
        found: The corners' zones.
        tool: TCP in the flange frame, (c, 3) [m].
        point: The fly points, (c, 3) [m].

    Returns:
        Joint angles at begin and end (c, 6) [rad], s (c,), distance (c,) [m].
    """
    first = along(traced, found.into, 1 - found.before)
    last = along(traced, found.out, found.behind)
    ends = [arm.tcp(q, tool) - point for q in (first, last)]
    nearest = nearest_on_parabola(ends[0], ends[1])
    s = nearest[:, None]
    off = ends[0] * (1 - s) ** 2 + ends[1] * s**2
    return first, last, nearest, np.sqrt(np.einsum("ni,ni->n", off, off))


def _refined(
    arm: Arm, traced: Trace, found: Zones, s: Floats, tool: Floats, point: Floats
) -> Floats:
    """Improve the nearest points of corners whose moves are not straight."""
    q = parabolas(traced, found)
    for _ in range(REFINED):
        s = np.clip(s, STEP, 1 - STEP)
        before, x, after = (
            arm.tcp(q(at), tool) - point for at in (s - STEP, s, s + STEP)
        )
        slope, curve = (after - before) / 2, after - 2 * x + before
        down, curved = (x * slope).sum(axis=1), (slope**2 + x * curve).sum(axis=1)
        s = s - STEP * np.where(curved > 0, down / np.where(curved > 0, curved, 1), 0)
    return np.clip(s, 0.0, 1.0)


def nearest_on_parabola(begin: Floats, end: Floats) -> Floats:
    """Find the s at which begin (1 - s)^2 + end s^2 is shortest, (c,).

    Args:
        begin: Where the zones begin, seen from the point, (c, 3) [m].
        end: Where they end, likewise.
    """
    b, e = np.ascontiguousarray(begin.T), np.ascontiguousarray(end.T)
    away = [((b * (1 - s) ** 2 + e * s**2) ** 2).sum(axis=0) for s in GRID]
    s = GRID[np.argmin(np.sqrt(away), axis=0)]
    bend = 2 * (b + e)
    for _ in range(ROUNDS):
        x = b * (1 - s) ** 2 + e * s**2
        slope = 2 * (e * s - b * (1 - s))
        down = (x * slope).sum(axis=0)
        curved = (slope * slope + x * bend).sum(axis=0)
        step = np.where(curved > 0, down / np.where(curved > 0, curved, 1.0), 0.0)
        s = np.clip(s - step, 0.0, 1.0)
    return np.asarray(s)
