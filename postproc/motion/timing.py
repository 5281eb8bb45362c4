"""When the arm arrives, and how fast it passes where it does not stop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.exceptions import PlanError
from postproc.motion.arrival_times import ArrivalTimes, Trajectory
from postproc.motion.joint_path import Trace
from postproc.motion.ruckig import JointMoves
from postproc.motion.targets import Targets
from postproc.robot.arm import Arm
from postproc.robot.trajectory import Motion

# Sampled runs of moves between stops, as a time law wants them.

JOINT_INTERVALS = 8  # gridpoints of a JOINT move inside a fly run
END_INTERVALS = 8  # gridpoints between a stop and the sample next to it
EVEN = 1e-6  # of an interval: what is longer by less is not cut once more
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
    least = np.where(
        nth > 0, _compute_programmed(targets, traced, edge)[visit] * share, 0
    )
    override = np.ones(len(first))
    inside = np.flatnonzero(run_of >= 0)
    np.minimum.at(override, run_of[inside], targets.override[inside])
    at = np.where(run_of >= 0, start[1:] - 1, -1)
    parts = _parts(ds, visit, curved & (targets.move[visit] == Motion.JOINT))
    run = run_of[visit]
    kept = _thin_waypoints(
        *_divide_intervals(parts, q, ds, least, override[run], run, at)
    )
    return _fine_ends(arm, kept)


def _parts(ds: Floats, visit: Ints, rounded: Bools) -> Ints:
    """Say into how many gridpoints the intervals of rounded JOINT moves are cut, (k,).

    Their corners have samples, what is straight between these has one interval: with
    one acceleration throughout, a stop behind it would be twice as late, or more.
    """
    whole = np.bincount(visit, ds)[visit]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(rounded & (whole > SHORTEST), ds / whole, 0.0)
    return np.maximum(np.ceil(JOINT_INTERVALS * share - EVEN), 1).astype(np.int64)


def _divide_intervals(
    parts: Ints, q: Floats, ds: Floats, least: Floats, override: Floats, run: Ints,
    at: Ints,
) -> tuple[Floats, Floats, Floats, Floats, Ints, Ints]:  # fmt: skip
    """Cut the intervals before waypoints into equal parts."""
    if (parts == 1).all():
        return q, ds, least, override, run, at
    end = np.cumsum(parts)
    row = np.repeat(np.arange(len(parts)), parts)
    u = (np.arange(len(row)) - end[row] + parts[row] + 1) / parts[row]
    before = np.maximum(row - 1, 0)
    q = q[before] + u[:, None] * (q[row] - q[before])
    ds, least = (ds / parts)[row], (least / parts)[row]
    at = np.where(at >= 0, end[np.maximum(at, 0)] - 1, -1)
    return q, ds, least, override[row], run[row], at


def _fine_ends(arm: Arm, points: Waypoints) -> Waypoints:
    """Cut the first and the last interval of runs at a programmed speed.

    The arm reaches that speed within some mm, or less. On intervals of 5 mm it would
    take the whole of one, and double the time for it. Between are points of the
    parabola through the nearest three.
    """
    k, begins = len(points.ds), points.begins
    if k == 0:
        return points
    ends, row = np.append(begins[1:], True), np.arange(k)
    first = np.append(False, begins[:-1]) & ~begins
    cut = (first | ends) & ~begins & (points.least > 0)
    third = np.where(first, row + 1, row - 2)
    lone = (first & ends) | (third < 0) | (third >= k)
    third = np.where(lone, row, third)
    parts = np.where(cut, END_INTERVALS, 1)
    bend = _bend(points, third) * cut[:, None]
    own = np.repeat(row, parts)
    end = np.cumsum(parts)
    nth = np.arange(len(own)) - end[own] + parts[own]
    u, since = (_grade(n, parts[own], first[own]) for n in (nth + 1, nth))
    before = np.maximum(own - 1, 0)
    q = points.q[before] + u[:, None] * (points.q[own] - points.q[before])
    q += (u * (u - 1))[:, None] * bend[own]
    step = np.linalg.norm(np.diff(q, axis=0, prepend=q[:1]) / arm.velocity, axis=1)
    ds = np.where(cut[own], step, points.ds[own])
    least = points.least[own] * (u - since)
    at = np.where(points.at >= 0, end[np.maximum(points.at, 0)] - 1, -1)
    return Waypoints(q, ds, least, points.override[own], begins[own], at)


def _grade(nth: Ints, parts: Ints, first: Bools) -> Floats:
    """Say where an interval is cut: by squares, the finest where the arm stands."""
    u = nth / parts
    return np.where(parts == 1, u, np.where(first, u**2, 1 - (1 - u) ** 2))


def _bend(points: Waypoints, third: Ints) -> Floats:
    """Return what bends the chord before each waypoint into the parabola, (k, 6).

    q(u) = q_before + u (q - q_before) + u (u - 1) bend goes through a third waypoint.
    """
    row, s = np.arange(len(third)), np.cumsum(points.ds)
    before = np.maximum(row - 1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = ((s[third] - s[before]) / (s - s[before]))[:, None]
        chord = points.q[before] + u * (points.q - points.q[before])
        bend = (points.q[third] - chord) / (u * (u - 1))
    return np.where(np.isfinite(bend), bend, 0.0)


def _runs_of(n: int, first: Ints, end: Ints) -> Ints:
    """Number the run of each move, (n,), -1 for none."""
    run_of = np.full(n, -1)
    moves = np.repeat(np.arange(len(first)), end - first)
    offset = np.arange(len(moves)) - np.repeat(
        np.cumsum(end - first) - (end - first), end - first
    )
    run_of[first[moves] + offset] = moves
    return run_of


def _thin_waypoints(
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


def _compute_programmed(targets: Targets, traced: Trace, edge: Ints) -> Floats:
    """Time each move takes at its programmed TCP speed, (n,) [s], 0 without one."""
    line = traced.length[edge] / targets.linear_speed
    turn = traced.turning[edge] / targets.rotary_speed
    slowest = np.fmax(np.nan_to_num(line), np.nan_to_num(turn))
    cartesian = (targets.move != Motion.JOINT) & (edge >= 0)
    return np.where(cartesian, slowest / targets.override, 0.0)


# When the arm arrives, and how fast it passes where it does not stop.


def tell_time(arm: Arm, targets: Targets, traced: Trace) -> ArrivalTimes:
    """Time all moves: JOINT moves between stops with ruckig, other runs by TOPP-RA."""
    edge, source = main_edges(targets, traced)
    first, end = runs(targets, source)
    lone = (end - first == 1) & (targets.move[first] == Motion.JOINT)
    points = waypoints(arm, targets, traced, edge, source, first[~lone], end[~lone])
    law = _run_laws(arm, points)
    inside = points.at >= 0
    at = points.at[inside]
    n = len(targets)
    duration, joint_velocity = np.zeros(n), np.zeros((n, 6))
    duration[inside] = law.since[at]
    goes_on = np.flatnonzero(inside)
    goes_on = goes_on[~np.isin(goes_on, first)]
    duration[goes_on] -= law.since[points.at[goes_on - 1]]
    joint_velocity[inside] = law.velocity[at]
    untimed = np.zeros(n, dtype=bool)
    untimed[inside] = law.failed[at]
    visit = _visits(points)
    used = law.read_joints(arm, points, visit, n)
    moves = JointMoves(arm)
    for v in first[lone].tolist():
        begin, override = traced.q[source[v]], float(targets.override[v])
        try:
            move = moves.move(begin, traced.q[v], override)
            duration[v] = move.duration
            used[0][v], used[1][v] = move.peaks / [arm.velocity, arm.acceleration]
        except PlanError:
            full = np.abs(traced.q[v] - begin) / arm.velocity
            duration[v], untimed[v] = full.max() / override, True
    speed = _speeds(arm, targets, traced, joint_velocity)
    trajectory = Trajectory(
        points.q, np.cumsum(points.ds), law.rate, law.since, points.begins, visit,
    )  # fmt: skip
    return ArrivalTimes(_times(targets, duration), speed, untimed, *used, trajectory)


def _visits(points: Waypoints) -> Ints:
    """Return the move that each waypoint belongs to, (k,)."""
    inside = np.flatnonzero(points.at >= 0)
    if not len(inside):
        return inside
    nth = np.searchsorted(points.at[inside], np.arange(len(points.ds)))
    return np.asarray(inside[np.minimum(nth, len(inside) - 1)])


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


@dataclass(frozen=True)
class _Laws:
    """The time laws of all runs at their k waypoints.

    Attributes:
        since: Time since the run began, (k,) [s].
        rate: As in `Trajectory`.
        velocity, acceleration: Of the joints, (k, 6) [rad/s], [rad/s^2].
        fastest: ds/dt that the joints' velocities allow, (k,).
        failed: Where no time law was found, (k,).
    """

    since: Floats
    rate: Floats
    velocity: Floats
    acceleration: Floats
    fastest: Floats
    failed: Bools

    def read_joints(
        self, arm: Arm, points: Waypoints, visit: Ints, n: int
    ) -> tuple[Floats, Floats, Floats]:
        """Return what `ArrivalTimes` says of the joints, given each waypoint's move."""
        velocity, acceleration = np.zeros((2, n, 6))
        allowed = np.ones(n)
        if len(visit):
            np.maximum.at(velocity, visit, np.abs(self.velocity) / arm.velocity)
            pushed = np.abs(self.acceleration) / arm.acceleration
            np.maximum.at(acceleration, visit, pushed)
            limit = points.limit()
            share = np.where(np.isfinite(limit), self.fastest / limit, 1.0)
            np.minimum.at(allowed, visit, np.where(limit > 0, share, 1.0))
        return velocity, acceleration, allowed


def _run_laws(arm: Arm, points: Waypoints) -> _Laws:
    k = len(points.ds)
    if k == 0:
        none, joints = np.zeros(0), np.zeros((0, 6))
        return _Laws(none, none, joints, joints, none, none > 0)
    from postproc.motion.topp import time_laws  # it brings solvers along

    s, limit, override = np.cumsum(points.ds), points.limit(), points.override
    law = time_laws(arm, points.q, s, limit, points.begins)
    found = _Laws(
        law.time / override,
        law.rate * override,
        law.velocity * override[:, None],
        law.acceleration * override[:, None] ** 2,
        law.fastest,
        np.isnan(law.time),
    )
    begins = np.append(np.flatnonzero(points.begins), k)
    for i in np.flatnonzero(found.failed[begins[:-1]]).tolist():
        # Guessed by programmed speeds and full joint speed, evenly between waypoints.
        rows = slice(int(begins[i]), int(begins[i + 1]))
        ds = points.ds[rows]
        dt = np.maximum(ds / points.override[rows], points.least[rows])
        found.since[rows] = np.cumsum(dt)
        velocity = np.zeros((len(dt), 6))
        velocity[1:-1] = (np.diff(points.q[rows], axis=0) / dt[1:, None])[:-1]
        found.velocity[rows], found.acceleration[rows] = velocity, 0.0
        found.fastest[rows] = np.inf
        rate = ds[1:] / np.maximum(np.diff(found.since[rows]), SHORTEST)
        found.rate[rows] = np.append(rate[:1], rate)
    return found


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
