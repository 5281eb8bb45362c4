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

from postproc.arrays import Bools, Floats, Ints
from postproc.kernels import native
from postproc.motion.targets import Fly, Move, Targets
from postproc.motion.trace import Trace
from postproc.robot.arm import Arm

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
    cartesian = targets.move != Move.JOINT
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
    share[:, rest] = _by_overlap(arm, targets, visit[rest], ways)
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
    round_ = targets.fly & ~targets.via & (targets.rounding != Fly.EXACT)
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
    chords = _chords(targets, traced.flange, traced.edges.source[at], to[at])
    length = np.zeros(len(to))
    length[at] = np.fmax(traced.length[at], chords)
    return length[edge]


def _chords(targets: Targets, flange: Floats, begin: Ints, end: Ints) -> Floats:
    """Measure the straight ways of the TCP from targets to others, (m,) [m]."""
    if native is not None:
        lengths: Floats = native.chords(flange, targets.tool, begin, end)
        return lengths
    tool = targets.tool.take(end, axis=0)[:, :3, 3]
    chord = np.zeros((len(end), 3))
    for sign, visit in ((1, end), (-1, begin)):
        at = flange.take(visit, axis=0)
        place = np.einsum("nij,nj->ni", at[:, :3, :3], tool) + at[:, :3, 3]
        chord += sign * place
    return np.asarray(np.sqrt(np.einsum("ni,ni->n", chord, chord)))


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


def _by_overlap(arm: Arm, targets: Targets, visit: Ints, ways: list[_Ways]) -> Floats:
    """Let the moves overlap while the first brakes and the second starts, (2, c).

    At full override: a path that changes with the override knob could not be proved.
    """
    ramps = [_ramp(arm, targets, way) for way in ways]
    time = targets.overlap[visit] * np.minimum(ramps[0][1], ramps[1][1])
    return np.stack([push * time**2 / 2 for push, _ in ramps])


def _ramp(arm: Arm, targets: Targets, way: _Ways) -> tuple[Floats, Floats]:
    """Give the acceleration of u [1/s^2] along moves, and how long it lasts [s], (c,).

    u goes from 0 to 1; the joints' limits are the bounds, and the programmed speed.
    """
    turned = np.maximum(way.turned, NOTHING)
    push = (arm.acceleration / turned).min(axis=1)
    speed = (arm.velocity / turned).min(axis=1)
    length = np.maximum(way.length, NOTHING)
    joint = targets.move[way.to] == Move.JOINT
    programmed = np.where(joint, np.inf, targets.linear_speed[way.to] / length)
    speed = np.fmin(speed, programmed)
    moves = (turned > NOTHING).any(axis=1)
    push = np.where(moves, push, 0.0)
    with np.errstate(divide="ignore"):
        lasts = np.minimum(speed / push, np.sqrt(1.0 / push))
    return push, np.where(moves, lasts, 0.0)
