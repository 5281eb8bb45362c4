"""When the arm arrives, and how fast it passes where it does not stop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.exceptions import PlanError
from postproc.motion.ruckig import JointMoves
from postproc.motion.targets import Move, Targets
from postproc.motion.trace import Trace
from postproc.motion.waypoints import Waypoints, waypoints
from postproc.robot.arm import Arm

BATCH = 20_000  # waypoints solved at a time, if one run does not need more


@dataclass(frozen=True)
class Clock:
    """Times of n arrivals.

    Attributes:
        time: Since the first move, along the first predecessors, (n,) [s].
        speed: TCP speed at the target, (n,) [m/s], 0 where the arm stops.
        untimed: No time law was found; time and speed are as if the arm kept to the
            programmed speed or to full joint speed, (n,).
    """

    time: Floats
    speed: Floats
    untimed: Bools


def no_time(n: int) -> Clock:
    """Leave the times of n arrivals unknown."""
    unknown = np.full(n, np.nan)
    return Clock(unknown, unknown, np.zeros(n, dtype=bool))


def tell_time(arm: Arm, targets: Targets, traced: Trace) -> Clock:
    """Time all moves: JOINT moves between stops with ruckig, other runs with toppra."""
    edge, source = main_edges(targets, traced)
    first, end = runs(targets, source)
    lone = (end - first == 1) & (targets.move[first] == Move.JOINT)
    points = waypoints(arm, targets, traced, edge, source, first[~lone], end[~lone])
    since, velocity, failed = _run_times(arm, points)
    inside = points.at >= 0
    at = points.at[inside]
    duration, joint_velocity = np.zeros(len(targets)), np.zeros((len(targets), 6))
    duration[inside] = since[at]
    goes_on = np.flatnonzero(inside)
    goes_on = goes_on[~np.isin(goes_on, first)]
    duration[goes_on] -= since[points.at[goes_on - 1]]
    joint_velocity[inside] = velocity[at]
    untimed = np.zeros(len(targets), dtype=bool)
    untimed[inside] = failed[at]
    moves = JointMoves(arm)
    for v in first[lone].tolist():
        begin, override = traced.q[source[v]], float(targets.override[v])
        try:
            duration[v] = moves.move(begin, traced.q[v], override).duration
        except PlanError:
            full = np.abs(traced.q[v] - begin) / arm.velocity
            duration[v], untimed[v] = full.max() / override, True
    speed = _speeds(arm, targets, traced, joint_velocity)
    return Clock(_times(targets, duration), speed, untimed)


def main_edges(targets: Targets, traced: Trace) -> tuple[Ints, Ints]:
    """Pick the first known edge of each move: edges (n,), sources (n,), else -1."""
    n, edges = len(targets), traced.edges
    edge, source = np.full(n, -1), np.full(n, -1)
    visit = np.repeat(np.arange(n), np.diff(targets.pred_start))
    known = ~np.isnan(traced.q[:, 0])
    usable = (edges.source >= 0) & known[np.maximum(edges.source, 0)] & known[visit]
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


def _run_times(arm: Arm, points: Waypoints) -> tuple[Floats, Floats, Bools]:
    """Time all waypoints.

    Returns:
        Times since their run began, (k,) [s], joint velocities, (k, 6) [rad/s], and
        where no time law was found, (k,).
    """
    k = len(points.ds)
    since, velocity = np.zeros(k), np.zeros((k, 6))
    failed = np.zeros(k, dtype=bool)
    if k == 0:
        return since, velocity, failed
    from postproc.motion import toppra  # slow to load: it brings a plotting library

    begins = np.flatnonzero(points.begins)
    limit, s = points.limit(), np.cumsum(points.ds)
    batch = begins // BATCH
    firsts = np.flatnonzero(np.diff(batch, prepend=-1))
    todo = list(zip(firsts.tolist(), [*firsts[1:].tolist(), len(begins)], strict=True))
    bounds = np.append(begins, k)
    while todo:
        a, b = todo.pop()
        rows = slice(int(bounds[a]), int(bounds[b]))
        try:
            law = toppra.time_laws(
                arm, points.q[rows], s[rows], limit[rows], points.begins[rows]
            )
            since[rows] = law.time / points.override[rows]
            velocity[rows] = law.velocity * points.override[rows, None]
        except PlanError:
            if b - a > 1:
                todo += [(a, (a + b) // 2), ((a + b) // 2, b)]
                continue
            since[rows], velocity[rows] = _estimate(points, rows)
            failed[rows] = True
    return since, velocity, failed


def _estimate(points: Waypoints, rows: slice) -> tuple[Floats, Floats]:
    """Guess the times of one run from programmed speeds and full joint speed."""
    dt = np.maximum(points.ds[rows] / points.override[rows], points.least[rows])
    velocity = np.zeros((len(dt), 6))
    velocity[1:-1] = (np.diff(points.q[rows], axis=0) / dt[1:, None])[:-1]
    return np.cumsum(dt), velocity


def _speeds(arm: Arm, targets: Targets, traced: Trace, velocity: Floats) -> Floats:
    """TCP speeds (n,) [m/s] from joint velocities (n, 6) [rad/s]."""
    speed = np.zeros(len(targets))
    rows = np.flatnonzero(np.abs(velocity).max(axis=1) > 0)
    J = arm.jacobian(traced.q[rows], targets.tool[rows, :3, 3])[:, :3]
    moving = np.einsum("nij,nj->ni", J, velocity[rows])
    speed[rows] = np.linalg.norm(moving, axis=1)
    return speed


def _times(targets: Targets, duration: Floats) -> Floats:
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
