"""Fly points: how large corners are, where the path passes, and what is left of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc import _native
from postproc.arrays import (
    Bools,
    Floats,
    Ints,
    all_in_rows,
    few_rows,
    floats,
)
from postproc.motion.joint_path import Trace
from postproc.motion.targets import Fly, Targets
from postproc.robot.arm import Arm
from postproc.robot.backlash_operator import Edges

# Which fly points are rounded, and how much of the neighbouring moves that takes.
#
# Two laws, as far as they are public:
#
# - FLY_CART between Cartesian moves: the zone begins at $FLY_DIST before the point and
# ends as far behind it ($FLY_TRAJ FLY_FROM), or is so large that the path passes within
# $FLY_DIST (FLY_TOL). - FLY_NORM, and every corner next to a JOINT move: the next move
# starts while the last   one brakes. With constant braking from the cruising speed over
# the time T, and the   last $FLY_PER % of it overlapped, the zone holds (FLY_PER /
# 100)^2 of the braking way.
#
# A zone never exceeds half of a neighbouring move: it ends before the next one begins.


@dataclass(frozen=True)
class Zones:
    """c corners.

    Attributes:
        visit: The fly point, (c,).
        into, out: The edges before and behind it, (c,).
        before, behind: Fractions of these edges that belong to the zone, (c,).
    """

    visit: Ints
    into: Ints
    out: Ints
    before: Floats
    behind: Floats

    def __getitem__(self, rows: Bools | Ints | slice) -> Zones:
        """Return some of the corners."""
        return Zones(
            self.visit[rows], self.into[rows], self.out[rows],
            self.before[rows], self.behind[rows],
        )  # fmt: skip


@dataclass(frozen=True)
class _Moves:
    """Columns of `Targets` as the core takes them; one row is that of all moves."""

    move: Ints
    fly: Bools
    via: Bools
    rounding: Ints
    fly_distance: Floats
    overlap: Floats
    linear_speed: Floats
    tool: Floats
    pred_start: Ints
    pred: Ints

    @classmethod
    def of(cls, targets: Targets) -> _Moves:
        """Take them over."""
        own = (few_rows(getattr(targets, name)) for name in MOVES)
        columns = zip(own, MOVES.values(), strict=True)
        return cls(*(np.ascontiguousarray(c, kind) for c, kind in columns))


MOVES = {
    "move": np.int64, "fly": np.bool_, "via": np.bool_, "rounding": np.int64,
    "fly_distance": np.float64, "overlap": np.float64, "linear_speed": np.float64,
    "tool": np.float64, "pred_start": np.int64, "pred": np.int64,
}  # fmt: skip


def zones(arm: Arm, targets: Targets, traced: Trace) -> Zones:
    """Find the corners with one way in and one way out, and their largest zones.

    Moves overlap while the first brakes and the second starts, at full override: a path
    that changes with the override knob could not be proved.
    """
    found = _native.zones(
        _Moves.of(targets), traced.edges.source, traced.q, traced.flange, traced.length,
        (floats(arm.acceleration), floats(arm.velocity)),
    )  # fmt: skip
    return Zones(*found)


# How the path runs round a fly point.
#
# Within the zone two moves are superposed: what the first still has to go is braked to
# zero while the second starts. With the share a of the edge before, b of the edge
# behind and s from 0 to 1,
#
#     q(s) = q_before(1 - a (1 - s)^2) + q_behind(b s^2) - q_point,
#
# joint by joint: between straight moves a parabola that leaves the first and joins the
# second tangentially, the linear segments with parabolic blends of R. H. Taylor
# (Planning and Execution of Straight Line Manipulator Trajectories, IBM Journal of
# Research and Development 23, 1979). That FLY_CART superposes in space and not in the
# joints changes the way by the square of the zone over the size of the arm: 1 um for 1
# mm.

FLAT = 4e-5  # [rad] bend below which a corner's moves are as good as straight


@dataclass(frozen=True)
class Corners:
    """c rounded corners.

    Attributes:
        zones: What they take of the neighbouring moves.
        nearest: Where on the corner the TCP passes closest to the point, (c,) in s.
        q: Joint angles there, (c, 6) [rad].
        aside: From the point to there, (c, 3) [m].
        along: Direction of the path there, (c, 3), of the length 1.
        bend: What the parabola bends by, half of its second derivative, (c, 6) [rad].
    """

    zones: Zones
    nearest: Floats
    q: Floats
    aside: Floats
    along: Floats
    bend: Floats

    @property
    def flat(self) -> Bools:
        """Tell where the nearest point alone tells of the corner, (c,)."""
        return all_in_rows(np.abs(self.bend) < FLAT)


def corners(arm: Arm, targets: Targets, traced: Trace) -> Corners:
    """Find all corners and where the path passes them."""
    return _pass_corners(arm, targets, traced, zones(arm, targets, traced))


def _pass_corners(arm: Arm, targets: Targets, traced: Trace, found: Zones) -> Corners:
    """Find where the path passes some corners, and keep to their tolerances."""
    tool = targets.tool.take(found.visit, axis=0)[:, :3, 3]
    flange = traced.flange.take(found.visit, axis=0)
    turned: Floats = np.einsum("nij,nj->ni", flange[:, :3, :3], tool)
    point = turned + flange[:, :3, 3]
    within = targets.rounding[found.visit] == Fly.WITHIN
    wanted = np.where(within, targets.fly_distance[found.visit], np.inf)
    before, behind, nearest, q, aside, along, bend = _native.passed(
        arm.dh.pack(), traced.edges, traced.q, found, floats(tool), point, wanted,
    )  # fmt: skip
    found = replace(found, before=before, behind=behind)
    return Corners(found, nearest, q, aside, along, bend)


# Paths whose fly points are rounded: new samples, and where each point is passed.

SAMPLES = 4  # on each side of the nearest point of a corner that is not flat


def blend(arm: Arm, targets: Targets, traced: Trace, timed: bool = True) -> Trace:
    """Round the fly points of a trace.

    Its joint angles at rounded points become those of the point of the path that lies
    nearest to the target; that is also where an edge ends and the next one begins. Its
    flange poses remain those of the targets. Edges without a corner stay as they are.

    Args:
        arm: The arm.
        targets: The moves.
        traced: Their paths without corners.
        timed: Sample the edges for a time law; else where no joint turns there are
            only the ends of the way, which is all that the joints' play sees of it.
    """
    found = corners(arm, targets, traced)
    visit = found.zones.visit
    if len(visit) == 0:
        return traced
    q, aside = np.array(traced.q), np.array(traced.aside)
    q[visit], aside[visit] = found.q, found.aside
    rounded = np.zeros((len(q), 7))
    parts = found.zones.before, found.zones.behind, found.nearest, ~found.flat
    rounded[visit] = np.column_stack([*parts, found.along])
    coupling = None if timed else floats(arm.coupling)
    edges, share = _resample(traced, found, coupling)
    return replace(traced, q=q, aside=aside, rounded=rounded, edges=edges, share=share)


def _resample(
    traced: Trace, found: Corners, coupling: Floats | None
) -> tuple[Edges, Floats]:
    """Sample all edges anew; return them and their samples' share of the way.

    Args:
        traced: The paths without corners.
        found: The corners.
        coupling: Drive-side angles = coupling @ q, (6, 6), where edges on which no
            drive turns back need no samples; None: all are sampled.
    """
    path, share, start, uneven = _native.rounded(
        traced.edges, traced.share, traced.q, found, coupling, SAMPLES
    )
    return replace(traced.edges, path=path, start=start, uneven=uneven), share
