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
    any_in_rows,
    few_rows,
    floats,
)
from postproc.motion.joint_path import Trace
from postproc.motion.path import BlendCoupling
from postproc.motion.targets import Fly, Targets
from postproc.robot.arm import Arm
from postproc.robot.backlash_operator import Edges
from postproc.robot.trajectory import Motion

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

HALF = 0.5  # of a move that a zone may take
NOTHING = 1e-9  # [m], [rad] a move that goes nowhere has no corner


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


def zones(arm: Arm, targets: Targets, traced: Trace) -> Zones:
    """Find the corners with one way in and one way out, and their largest zones."""
    visit, into, out = _corners(targets, traced)
    to = np.repeat(np.arange(len(targets)), np.diff(targets.pred_start))
    cartesian = targets.move != Motion.JOINT
    both = cartesian[visit] & cartesian[to[out]]
    by_distance = both & (targets.rounding[visit] != Fly.OVERLAP)
    edge = np.stack([into, out])
    length, share = _lengths(targets, traced, to, edge), np.empty(edge.shape)
    near, rest = np.flatnonzero(by_distance), np.flatnonzero(~by_distance)
    share[:, near] = _by_distance(targets, visit[near], length[:, near])
    ways = [
        _Ways.on(traced, to, way[rest], long[rest])
        for way, long in zip(edge, length, strict=True)
    ]
    # Moves overlap while the first brakes and the second starts, at full override: a
    # path that changes with the override knob could not be proved.
    ramps = [_ramp(arm, targets, way) for way in ways]
    time = targets.overlap[visit[rest]] * np.minimum(ramps[0][1], ramps[1][1])
    share[:, rest] = np.stack([push * time**2 / 2 for push, _ in ramps])
    found = Zones(visit, into, out, share[0], share[1])
    return found[np.asarray((share > 0).all(axis=0))]


def _corners(targets: Targets, traced: Trace) -> tuple[Ints, Ints, Ints]:
    """Pair the only edge into every rounded fly point with the only one out of it."""
    n, source = len(targets), traced.edges.source
    to = np.repeat(np.arange(n), np.diff(targets.pred_start))
    told = np.flatnonzero(targets.pred >= 0)
    ways_out = np.bincount(targets.pred[told], minlength=n)
    out = np.full(n, -1)
    out[targets.pred[told]] = told
    known = (source >= 0) & ~np.isnan(traced.q[to, 0])
    known &= ~np.isnan(traced.q[np.maximum(source, 0), 0])
    round_ = targets.fly & ~targets.via & (targets.rounding < Fly.EXACT)
    single = (np.diff(targets.pred_start) == 1) & (ways_out == 1)
    visit = np.flatnonzero(round_ & single)
    into = targets.pred_start[visit]
    good = known[into] & known[out[visit]] & (to[out[visit]] != visit)
    visit = visit[good]
    return visit, targets.pred_start[visit], out[visit]


def _lengths(targets: Targets, traced: Trace, to: Ints, edge: Ints) -> Floats:
    """Measure the TCP's ways on edges (2, c) [m], chords where they are no lines."""
    used = np.zeros(len(to), dtype=bool)
    used[edge] = True
    at = np.flatnonzero(used)
    chords = _native.chords(
        traced.flange, few_rows(targets.tool), traced.edges.source[at], to[at]
    )
    length = np.zeros(len(to))
    length[at] = np.fmax(traced.length[at], chords)
    return length[edge]


def _by_distance(targets: Targets, visit: Ints, length: Floats) -> Floats:
    """Take the same length of both moves, all there is where only WITHIN bounds it.

    Args:
        targets: The moves.
        visit: The fly points, (c,).
        length: Lengths of the moves before and behind, (2, c) [m].
    """
    distance = targets.fly_distance[visit]
    begin = np.where(targets.rounding[visit] == Fly.WITHIN, np.inf, distance)
    shortest = length.min(axis=0)
    zone = np.minimum(begin, HALF * shortest)
    share: Floats = np.where(length > NOTHING, zone / np.maximum(length, NOTHING), 0.0)
    return np.where(shortest > NOTHING, share, 0.0)


@dataclass(frozen=True)
class _Ways:
    """The moves on c edges.

    Attributes:
        to: Target that they lead to, (c,).
        length: Length of the TCP's way, (c,) [m].
        turned: What the joints turn by, (c, 6) [rad].
    """

    to: Ints
    length: Floats
    turned: Floats

    @classmethod
    def on(cls, traced: Trace, to: Ints, edge: Ints, length: Floats) -> _Ways:
        """Describe the moves on edges of known lengths."""
        end, begin = to[edge], traced.edges.source[edge]
        return cls(end, length, np.abs(traced.q[end] - traced.q[begin]))


def _ramp(arm: Arm, targets: Targets, way: _Ways) -> tuple[Floats, Floats]:
    """Give the acceleration of u [1/s^2] along moves, and how long it lasts [s], (c,).

    u goes from 0 to 1; the joints' limits are the bounds, and the programmed speed.
    """
    turned = np.maximum(way.turned, NOTHING)
    push = (arm.acceleration / turned).min(axis=1)
    speed = (arm.velocity / turned).min(axis=1)
    length = np.maximum(way.length, NOTHING)
    joint = targets.move[way.to] == Motion.JOINT
    programmed = np.where(joint, np.inf, targets.linear_speed[way.to] / length)
    speed = np.fmin(speed, programmed)
    moves = (turned > NOTHING).any(axis=1)
    push = np.where(moves, push, 0.0)
    with np.errstate(divide="ignore"):
        lasts = np.minimum(speed / push, np.sqrt(1.0 / push))
    return push, np.where(moves, lasts, 0.0)


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
    before, behind, nearest, q, aside, bend = _native.passed(
        arm.dh.pack(), traced.edges, traced.q, found, floats(tool), point, wanted,
    )  # fmt: skip
    found = replace(found, before=before, behind=behind)
    return Corners(found, nearest, q, aside, bend)


# Paths whose fly points are rounded: new samples, and where each point is passed.

SAMPLES = 4  # on each side of the nearest point of a corner that is not flat
ONE_SAMPLE = [[0], [0], [1]]  # of the three pieces: where the next corner is passed
EMPTY = 1e-9  # part of a move between two zones that is nothing


@dataclass(frozen=True)
class _Pieces:
    """What e edges are made of: the end of a corner, a middle, the begin of a corner.

    Attributes:
        corner: Corner at both ends, (2, e), -1 where there is none.
        begin, end: Where the middle begins and ends, (e,) in u.
        count: Samples of the three pieces, (3, e).
    """

    corner: Ints
    begin: Floats
    end: Floats
    count: Ints


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
    pieces = _pieces(traced, found)
    if not timed:
        pieces.count[:, _one_way(arm, traced, found)] = ONE_SAMPLE
    edges, share = _resample(traced, found, pieces)
    pull = _pull(targets, traced, found)
    return replace(traced, q=q, aside=aside, edges=edges, share=share, pull=pull)


def _pull(targets: Targets, traced: Trace, found: Corners) -> BlendCoupling:
    """Tell how sharp corners move with the targets next to them.

    On a flat one the corrections of neighbours are alike but where a joint turns, and
    to sharpen that step would make the joint turn elsewhere.
    """
    to = np.repeat(np.arange(len(targets)), np.diff(targets.pred_start))
    zones, s = found.zones[~found.flat], found.nearest[~found.flat]
    return BlendCoupling(
        zones.visit, traced.edges.source[zones.into], to[zones.out],
        zones.before * (1 - s) ** 2, zones.behind * s**2,
    )  # fmt: skip


def _one_way(arm: Arm, traced: Trace, found: Corners) -> Bools:
    """Tell on which edges no joint's drive turns back, (e,).

    Straight ones into a corner, if at both ends every drive goes on as it goes here:
    so it does on the parabolas between straight moves.
    """
    zones, edges = found.zones, traced.edges
    one = np.diff(edges.start) == 1
    here = traced.q.take(zones.visit, axis=0)
    into = here - traced.q.take(edges.source[zones.into], axis=0)
    out = edges.path.take(edges.start[zones.out], axis=0) - here
    back = (into @ arm.coupling.T) * (out @ arm.coupling.T) < 0
    goes_on = one[zones.into] & one[zones.out] & ~any_in_rows(back)
    before, behind = np.ones_like(one), np.zeros_like(one)
    before[zones.out], behind[zones.into] = goes_on, goes_on
    return np.asarray(before & behind)


def _pieces(traced: Trace, found: Corners) -> _Pieces:
    """Cut the edges at the ends of the zones."""
    e, zones = len(traced.edges.source), found.zones
    rows = np.arange(len(zones.visit))
    corner = np.full((2, e), -1)
    corner[0, zones.out], corner[1, zones.into] = rows, rows
    begin, end = np.zeros(e), np.ones(e)
    begin[zones.out], end[zones.into] = zones.behind, 1 - zones.before
    flat = found.flat
    count = np.zeros((3, e), dtype=np.int64)
    count[0, zones.out] = np.where(flat, 0, SAMPLES)
    count[2, zones.into] = np.where(flat, 1, SAMPLES)
    before = np.diff(traced.edges.start)
    inner = np.ceil(before * (end - begin) - EMPTY).astype(np.int64)
    count[1] = np.where(end - begin > EMPTY, np.minimum(inner, before), 0)
    return _Pieces(corner, begin, end, count)


def _resample(traced: Trace, found: Corners, pieces: _Pieces) -> tuple[Edges, Floats]:
    """Sample all edges anew; return them and their samples' share of the way."""
    touched = np.asarray((pieces.corner >= 0).any(axis=0))
    start = np.concatenate([[0], np.cumsum(pieces.count.sum(axis=0))])
    path, share = _native.resampled(traced.edges, traced.share, traced.q, found, pieces)
    uneven = _uneven(pieces, touched, start)
    return replace(traced.edges, path=path, start=start, uneven=uneven), share


def _uneven(pieces: _Pieces, touched: Bools, start: Ints) -> Ints:
    """List the samples whose neighbours are not equally far along the path.

    The last one of a piece, and the first one where its piece does not begin at a
    sample because the corner before is flat.
    """
    first, middle, _ = pieces.count
    flat = (pieces.corner[0] >= 0) & (first == 0)
    ends = [start[:-1] + first, start[:-1] + first + middle]
    joints = [ends[0][touched & (first > 0)], ends[1][touched & (middle > 0)]]
    after = start[:-1][touched & flat] + 1
    uneven = np.zeros(start[-1] + 1, dtype=bool)
    for samples in (*joints, after):
        uneven[samples - 1] = True
    return np.flatnonzero(uneven)
