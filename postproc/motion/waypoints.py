"""Sampled runs of moves between stops, as a time law wants them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.motion.targets import Move, Targets
from postproc.motion.trace import Trace
from postproc.robot.arm import Arm

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
    straight = (sampled == 1) & ((targets.move == Move.JOINT) | alone)
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
    cartesian = (targets.move != Move.JOINT) & (edge >= 0)
    return np.where(cartesian, slowest / targets.override, 0.0)
