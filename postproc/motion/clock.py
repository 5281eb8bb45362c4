"""When the arm arrives, and how fast it passes where it does not stop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.exceptions import PlanError
from postproc.motion import toppra
from postproc.motion.ruckig import JointMoves
from postproc.motion.targets import Move, Targets
from postproc.motion.trace import Trace
from postproc.motion.waypoints import Waypoints, waypoints
from postproc.robot.arm import Arm

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SIMILAR = 0.1  # neighbouring bounds nearer than this share belong to one speed
SHORTEST = 1e-9  # [s at full joint speed] below this two samples are one


@dataclass(frozen=True)
class Clock:
    """Times of n arrivals.

    Attributes:
        time: Since the first move, along the first predecessors, (n,) [s].
        speed: TCP speed at the target, (n,) [m/s], 0 where the arm stops.
        untimed: No time law was found; time and speed are as if the arm kept to the
            programmed speed or to full joint speed, (n,).
    """

    time: Array
    speed: Array
    untimed: Bools


def tell_time(arm: Arm, targets: Targets, traced: Trace) -> Clock:
    """Time all moves: JOINT moves between stops with ruckig, other runs with toppra."""
    n = len(targets)
    edge, source = main_edges(targets, traced)
    duration, velocity = np.zeros(n), np.zeros((n, 6))
    untimed = np.zeros(n, dtype=bool)
    first, end = runs(targets, source)
    lone = (end - first == 1) & (targets.move[first] == Move.JOINT)
    joint_moves = JointMoves(arm)
    for v in first[lone].tolist():
        begin, override = traced.q[source[v]], float(targets.override[v])
        duration[v] = joint_moves.move(begin, traced.q[v], override).duration
    points = waypoints(arm, targets, traced, edge, source, first[~lone], end[~lone])
    for a, b in zip(first[~lone].tolist(), end[~lone].tolist(), strict=True):
        try:
            duration[a:b], velocity[a:b] = _run(arm, targets, points, a, b)
        except PlanError:
            duration[a:b], velocity[a:b] = _estimate(points, a, b)
            untimed[a:b] = True
    speed = _speeds(arm, targets, traced, velocity)
    return Clock(_times(targets, duration), speed, untimed)


def main_edges(targets: Targets, traced: Trace) -> tuple[Ints, Ints]:
    """Pick the first known edge of each move: edges (n,), sources (n,), else -1."""
    n, edges = len(targets), traced.edges
    edge, source = np.full(n, -1), np.full(n, -1)
    visit = np.repeat(np.arange(n), np.diff(targets.pred_start))
    known = ~np.isnan(traced.q[:, 0])
    usable = (edges.source >= 0) & known[edges.source] & known[visit]
    rows = np.flatnonzero(usable)[::-1]
    edge[visit[rows]], source[visit[rows]] = rows, edges.source[rows]
    return edge, source


def runs(targets: Targets, source: Ints) -> tuple[Ints, Ints]:
    """Find the runs of moves between stops: moves first .. end - 1 each.

    Args:
        targets: The moves.
        source: Where each move comes from, (n,); a move from -1 is in no run.
    """
    n = len(targets)
    passing = targets.fly | targets.via
    goes_on = np.zeros(n, dtype=bool)
    goes_on[1:] = (source[1:] == np.arange(n - 1)) & passing[:-1] & (source[:-1] >= 0)
    first = np.flatnonzero(~goes_on)
    end = np.append(first[1:], n)
    timed = source[first] >= 0
    return first[timed], end[timed]


def _run(
    arm: Arm, targets: Targets, points: Waypoints, first: int, end: int
) -> tuple[Array, Array]:
    """Time one run: durations (m,) [s] and joint velocities (m, 6) at its targets.

    Raises:
        PlanError: toppra finds no time law.
    """
    rows = slice(int(points.start[first]), int(points.start[end]))
    q, ds = points.q[rows], points.ds[rows]
    limit = ds[1:] / np.maximum(points.least[rows][1:], np.finfo(float).tiny)
    moved = np.append(True, ds[1:] > SHORTEST)
    at = np.cumsum(moved)[points.start[first + 1 : end + 1] - 1 - rows.start] - 1
    if moved.sum() < 2:
        return np.zeros(end - first), np.zeros((end - first, 6))
    limit = limit[moved[1:]]
    override = float(targets.override[first:end].min())
    s = np.cumsum(np.where(moved, ds, 0.0))[moved]
    law = toppra.run(arm, q[moved], s, _at_points(limit), override)
    return np.diff(law.time[at], prepend=0.0), law.velocity[at]


def _estimate(points: Waypoints, first: int, end: int) -> tuple[Array, Array]:
    """Guess what `_run` would find, from programmed speeds and full joint speed."""
    visit = np.arange(first, end)
    last = points.start[visit + 1] - 1
    dt = np.maximum(points.ds, points.least)
    dt[points.start[first]] = 0.0
    total = np.cumsum(dt[points.start[first] : points.start[end]])
    moving = np.maximum(dt[last], SHORTEST)[:, None]
    velocity = (points.q[last] - points.q[last - 1]) / moving
    velocity[-1] = 0.0
    return np.diff(total[last - points.start[first]], prepend=0.0), velocity


def _at_points(limit: Array) -> Array:
    """Bounds at k + 1 waypoints from the bounds of the k intervals between them.

    The mean where they are nearly equal (one speed on a curved path), else the lower.
    """
    before, after = np.append(limit[0], limit), np.append(limit, limit[-1])
    lower, upper = np.minimum(before, after), np.maximum(before, after)
    similar = upper < (1 + SIMILAR) * lower
    return np.asarray(np.where(similar, (lower + upper) / 2, lower))


def _speeds(arm: Arm, targets: Targets, traced: Trace, velocity: Array) -> Array:
    """TCP speeds (n,) [m/s] from joint velocities (n, 6) [rad/s]."""
    speed = np.zeros(len(targets))
    rows = np.flatnonzero(np.abs(velocity).max(axis=1) > 0)
    J = arm.jacobian(traced.q[rows], targets.tool[rows, :3, 3])[:, :3]
    moving = np.einsum("nij,nj->ni", J, velocity[rows])
    speed[rows] = np.linalg.norm(moving, axis=1)
    return speed


def _times(targets: Targets, duration: Array) -> Array:
    """Add durations (n,) [s] along the first predecessors."""
    n = len(duration)
    lead = np.arange(n) - 1
    some = np.flatnonzero(np.diff(targets.pred_start) > 0)
    given = targets.pred[targets.pred_start[some]]
    lead[some] = np.where((given >= 0) & (given < some), given, some - 1)
    total = np.cumsum(duration)
    heads = np.flatnonzero(lead != np.arange(n) - 1)
    for head, end in zip(heads, np.append(heads[1:], n), strict=False):
        total[head:end] += total[lead[head]] + duration[head] - total[head]
    return total
