"""Sampled runs of moves between stops, as a time law wants them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.motion.targets import Move, Targets
from postproc.motion.trace import Trace
from postproc.robot.arm import Arm

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

JOINT_INTERVALS = 8  # gridpoints of a JOINT move inside a fly run


@dataclass(frozen=True)
class Waypoints:
    """All runs, one after the other; each begins with where it starts from.

    Attributes:
        q: Joint angles, (k, 6) [rad].
        ds: Time that the joints need at full speed since the waypoint before, added in
            squares, (k,) [s].
        least: Time since the waypoint before at the programmed TCP speed, (k,) [s].
        start: Row of the first waypoint of move v (of where it starts from, if v begins
            a run) is start[v], (n + 1,).
    """

    q: Array
    ds: Array
    least: Array
    start: Ints


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
    begins, used = np.zeros(n, dtype=bool), np.zeros(n + 1, dtype=np.int64)
    begins[first] = True
    np.add.at(used, first, 1)
    np.add.at(used, end, -1)
    inside = np.cumsum(used)[:n] > 0
    joint = targets.move == Move.JOINT
    sampled = edges.start[edge + 1] - edges.start[edge]
    intervals = np.where(joint, JOINT_INTERVALS, sampled)
    count = np.where(inside, intervals + begins, 0)
    start = np.concatenate([[0], np.cumsum(count)])
    visit = np.repeat(np.arange(n), count)
    nth = np.arange(len(visit)) - start[visit] + ~begins[visit]
    u = (nth / intervals[visit])[:, None]
    q = (1 - u) * traced.q[source[visit]] + u * traced.q[visit]
    curved = ~joint[visit] & (nth > 0)
    rows = edges.start[edge[visit[curved]]] + nth[curved] - 1
    q[curved] = edges.path[rows]
    step = np.diff(q, axis=0, prepend=q[:1]) / arm.velocity
    least = _programmed(targets, traced, edge) / intervals
    return Waypoints(q, np.linalg.norm(step, axis=1), least[visit], start)


def _programmed(targets: Targets, traced: Trace, edge: Ints) -> Array:
    """Time each move takes at its programmed TCP speed, (n,) [s], 0 without one."""
    line = traced.length[edge] / targets.linear_speed
    turn = traced.turning[edge] / targets.rotary_speed
    slowest = np.fmax(np.nan_to_num(line), np.nan_to_num(turn))
    cartesian = (targets.move != Move.JOINT) & (edge >= 0)
    return np.where(cartesian, slowest / targets.override, 0.0)
