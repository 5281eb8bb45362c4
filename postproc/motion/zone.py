"""Which fly points are rounded, and how much of the neighbouring moves that takes.

Two laws, as far as they are public:

- FLY_CART between Cartesian moves: the zone begins at $FLY_DIST before the point and
  ends as far behind it ($FLY_TRAJ FLY_FROM), or is so large that the path passes within
  $FLY_DIST (FLY_TOL).
- FLY_NORM, and every corner next to a JOINT move: the next move starts while the last
  one brakes. With constant braking from the cruising speed over the time T, and the
  last $FLY_PER % of it overlapped, the zone holds (FLY_PER / 100)^2 of the braking way.

A zone never exceeds half of a neighbouring move: it ends before the next one begins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.motion.targets import Fly, Move, Targets
from postproc.motion.trace import Trace
from postproc.robot.arm import Arm

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

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
    before: Array
    behind: Array

    def __getitem__(self, rows: Bools) -> Zones:
        """Return some of the corners."""
        return Zones(
            self.visit[rows], self.into[rows], self.out[rows],
            self.before[rows], self.behind[rows],
        )  # fmt: skip


def zones(arm: Arm, targets: Targets, traced: Trace) -> Zones:
    """Find the corners with one way in and one way out, and their largest zones."""
    visit, into, out = _corners(targets, traced)
    after = np.repeat(np.arange(len(targets)), np.diff(targets.pred_start))[out]
    cartesian = (targets.move[visit] != Move.JOINT) & (
        targets.move[after] != Move.JOINT
    )
    by_distance = cartesian & (targets.rounding[visit] != Fly.OVERLAP)
    near = _by_distance(targets, traced, visit, into, out)
    late = _by_overlap(arm, targets, traced, visit, (into, out))
    before, behind = np.where(by_distance, near, late)
    found = Zones(visit, into, out, before, behind)
    return found[(before > 0) & (behind > 0)]


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
    round_ = targets.fly & ~targets.via & (targets.rounding != Fly.EXACT)
    single = (np.diff(targets.pred_start) == 1) & (ways_out == 1)
    visit = np.flatnonzero(round_ & single)
    into = targets.pred_start[visit]
    good = known[into] & known[out[visit]] & (to[out[visit]] != visit)
    visit = visit[good]
    return visit, targets.pred_start[visit], out[visit]


def _by_distance(
    targets: Targets, traced: Trace, visit: Ints, into: Ints, out: Ints
) -> Array:
    """Take the same length of both edges, all there is where only WITHIN bounds it."""
    length = np.stack([_length(targets, traced, edge) for edge in (into, out)])
    distance = targets.fly_distance[visit]
    begin = np.where(targets.rounding[visit] == Fly.WITHIN, np.inf, distance)
    zone = np.minimum(begin, HALF * length.min(axis=0))
    share: Array = np.where(length > NOTHING, zone / np.maximum(length, NOTHING), 0.0)
    return np.where(length.min(axis=0) > NOTHING, share, 0.0)


def _length(targets: Targets, traced: Trace, edge: Ints) -> Array:
    """Length of the TCP's way on edges, its chord where the path is not Cartesian."""
    n = len(targets)
    to = np.repeat(np.arange(n), np.diff(targets.pred_start))[edge]
    begin = (traced.flange[traced.edges.source[edge]] @ targets.tool[to])[:, :3, 3]
    end = (traced.flange[to] @ targets.tool[to])[:, :3, 3]
    chord = np.linalg.norm(end - begin, axis=1)
    return np.asarray(np.fmax(traced.length[edge], chord))


def _by_overlap(
    arm: Arm, targets: Targets, traced: Trace, visit: Ints, edges: tuple[Ints, Ints]
) -> Array:
    """Let the moves overlap while the first brakes and the second starts, (2, c).

    At full override: a path that changes with the override knob could not be proved.
    """
    ramps = [_ramp(arm, targets, traced, edge) for edge in edges]
    time = targets.overlap[visit] * np.minimum(ramps[0][1], ramps[1][1])
    return np.stack([push * time**2 / 2 for push, _ in ramps])


def _ramp(arm: Arm, targets: Targets, traced: Trace, edge: Ints) -> tuple[Array, Array]:
    """Give the acceleration of u [1/s^2] along edges, and how long it lasts [s], (c,).

    u goes from 0 to 1; the joints' limits are the bounds, and the programmed speed.
    """
    to = np.repeat(np.arange(len(targets)), np.diff(targets.pred_start))[edge]
    way = np.abs(traced.q[to] - traced.q[traced.edges.source[edge]])
    way = np.maximum(way, NOTHING)
    push = (arm.acceleration / way).min(axis=1)
    speed = (arm.velocity / way).min(axis=1)
    length = np.maximum(_length(targets, traced, edge), NOTHING)
    programmed = np.where(
        targets.move[to] == Move.JOINT, np.inf, targets.linear_speed[to] / length
    )
    speed = np.fmin(speed, programmed)
    moves = (way > NOTHING).any(axis=1)
    push = np.where(moves, push, 0.0)
    with np.errstate(divide="ignore"):
        lasts = np.minimum(speed / push, np.sqrt(1.0 / push))
    return push, np.where(moves, lasts, 0.0)
