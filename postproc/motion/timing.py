"""When the arm arrives, and how fast it passes where it does not stop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.exceptions import PlanError
from postproc.motion.ruckig import JointMoves
from postproc.motion.targets import Targets
from postproc.motion.trace import Trace
from postproc.robot.arm import Arm
from postproc.robot.trajectory import Motion

# Sampled runs of moves between stops, as a time law wants them.

JOINT_INTERVALS = 8  # gridpoints of a JOINT move inside a fly run
SHORTEST = 1e-9  # [s at full joint speed] below this two samples are one
SIMILAR = 0.1  # neighbouring bounds nearer than this share belong to one speed


@dataclass(frozen=True)
class Waypoints:
    """All runs, one after the other; each begins with where it starts from.

    Attributes:
        q: Joint angles, (k, 6) [rad]; no two neighbours in a run are equal.
        ds: Path length since the waypoint before: the time that the joints need at full
            speed, added in squares, (k,) [s]; 0 where a run begins.
        least: Time since the waypoint before at the programmed speed, (k,) [s].
        override: Lowest override of the run, (k,).
        begins: True at the first waypoint of each run, (k,).
        at: Waypoint of each move, (n,), -1 where it is in no run or nothing moves.
    """

    q: Floats
    ds: Floats
    least: Floats
    override: Floats
    begins: Bools
    at: Ints

    def limit(self) -> Floats:
        """Bound ds/dt at the waypoints by the programmed speeds, (k,).

        At full override, between two intervals the mean of their bounds where these
        are nearly equal (one speed on a curved path), else the lower one.
        """
        after = np.append(~self.begins[1:], False)
        with np.errstate(divide="ignore", invalid="ignore"):
            interval = self.ds / (self.least * self.override)
        before = np.where(self.begins | np.isnan(interval), np.inf, interval)
        behind = np.where(after, np.append(before[1:], np.inf), np.inf)
        lower, upper = np.minimum(before, behind), np.maximum(before, behind)
        similar = upper < (1 + SIMILAR) * lower
        bound: Floats = np.where(similar, (lower + upper) / 2, lower)
        return bound


def waypoints(
    arm: Arm,
    targets: Targets,
    traced: Trace,
    edge: Ints,
    source: Ints,
    first: Ints,
    end: Ints,
) -> Waypoints:
    """Sample the moves of runs first .. end - 1.

    Args:
        arm: Its joint velocities are the unit of path length.
        targets: The moves.
        traced: Their paths.
        edge: Edge by which each move is reached, (n,).
        source: Where it comes from, (n,).
        first: First move of each run, (r,).
        end: One past its last move, (r,).
    """
    n, edges = len(targets), traced.edges
    if len(first) == 0:
        none, rows = np.empty(0), np.full(n, -1)
        return Waypoints(np.empty((0, 6)), none, none, none, none > 0, rows)
    run_of = _runs_of(n, first, end)
    begins = np.zeros(n, dtype=bool)
    begins[first] = True
    sampled = edges.start[edge + 1] - edges.start[edge]
    # A run needs a waypoint between its stops.
    alone = np.zeros(n, dtype=bool)
    alone[first] = end - first == 1
    straight = (sampled == 1) & ((targets.move == Motion.JOINT) | alone)
    intervals = np.where(straight, JOINT_INTERVALS, sampled)
    count = np.where(run_of >= 0, intervals + begins, 0)
    start = np.concatenate([[0], np.cumsum(count)])
    visit = np.repeat(np.arange(n), count)
    nth = np.arange(len(visit)) - start[visit] + ~begins[visit]
    u = (nth / intervals[visit])[:, None]
    q = (1 - u) * traced.q[source[visit]] + u * traced.q[visit]
    curved = ~straight[visit] & (nth > 0)
    sample = edges.start[edge[visit[curved]]] + nth[curved] - 1
    q[curved] = edges.path[sample]
    share = 1.0 / intervals[visit]
    share[curved] = traced.share[sample]
    step = np.diff(q, axis=0, prepend=q[:1]) / arm.velocity
    ds = np.where(nth > 0, np.linalg.norm(step, axis=1), 0.0)
    least = np.where(nth > 0, _programmed(targets, traced, edge)[visit] * share, 0)
    override = np.ones(len(first))
    inside = np.flatnonzero(run_of >= 0)
    np.minimum.at(override, run_of[inside], targets.override[inside])
    at = np.where(run_of >= 0, start[1:] - 1, -1)
    return _thinned(q, ds, least, override[run_of[visit]], run_of[visit], at)


def _runs_of(n: int, first: Ints, end: Ints) -> Ints:
    """Number the run of each move, (n,), -1 for none."""
    run_of = np.full(n, -1)
    moves = np.repeat(np.arange(len(first)), end - first)
    offset = np.arange(len(moves)) - np.repeat(
        np.cumsum(end - first) - (end - first), end - first
    )
    run_of[first[moves] + offset] = moves
    return run_of


def _thinned(
    q: Floats, ds: Floats, least: Floats, override: Floats, run: Ints, at: Ints
) -> Waypoints:
    """Drop waypoints where nothing moves, and runs that are nothing else."""
    runs = int(run.max(initial=-1)) + 1
    moved = ds > SHORTEST
    busy = np.bincount(run[moved], minlength=runs) > 0
    begins = np.diff(run, prepend=-1) > 0
    keep = busy[run] & (moved | begins)
    kept = np.cumsum(keep) - 1
    inside = at >= 0
    at = np.array(at)
    at[inside] = np.where(busy[run[at[inside]]], kept[at[inside]], -1)
    return Waypoints(q[keep], ds[keep], least[keep], override[keep], begins[keep], at)


def _programmed(targets: Targets, traced: Trace, edge: Ints) -> Floats:
    """Time each move takes at its programmed TCP speed, (n,) [s], 0 without one."""
    line = traced.length[edge] / targets.linear_speed
    turn = traced.turning[edge] / targets.rotary_speed
    slowest = np.fmax(np.nan_to_num(line), np.nan_to_num(turn))
    cartesian = (targets.move != Motion.JOINT) & (edge >= 0)
    return np.where(cartesian, slowest / targets.override, 0.0)


# When the arm arrives, and how fast it passes where it does not stop.

BATCH = 20_000  # waypoints solved at a time, if one run does not need more


@dataclass(frozen=True)
class ArrivalTimes:
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


def no_time(n: int) -> ArrivalTimes:
    """Leave the times of n arrivals unknown."""
    unknown = np.full(n, np.nan)
    return ArrivalTimes(unknown, unknown, np.zeros(n, dtype=bool))


def tell_time(arm: Arm, targets: Targets, traced: Trace) -> ArrivalTimes:
    """Time all moves: JOINT moves between stops with ruckig, other runs with toppra."""
    edge, source = main_edges(targets, traced)
    first, end = runs(targets, source)
    lone = (end - first == 1) & (targets.move[first] == Motion.JOINT)
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
    return ArrivalTimes(_times(targets, duration), speed, untimed)


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
