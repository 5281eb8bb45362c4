"""From which side joints arrive, read off the trajectory in time.

The play operator infers the side from the geometric path; a plan in time goes through
its waypoints on a smooth curve, which may turn elsewhere. Here the trajectory is
sampled, and the sign of every joint's last motion beyond its play is read off it.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats, any_in_rows
from postproc.motion.cycle_time import ProgramCycle
from postproc.robot.arm import Arm
from postproc.robot.backlash_operator import along, never_turned

STEP = 4e-3  # [s] between samples of the trajectory
COUPLED = 8  # samples between waypoints, at the most, of arms with coupled drives
LONE = 8  # samples of a lone JOINT move, which goes straight from stop to stop


def read_directions(arm: Arm, cycle: ProgramCycle) -> Floats:
    """Read the direction of every joint at its last motion before n arrivals.

    Args:
        arm: The arm; its play and coupling are used.
        cycle: The program in time.

    Returns:
        (n, 6): +1, -1, or 0 where the joint has not moved by its play since the chain
        of moves began, or the joint angles are not known.
    """
    n, (_, source) = len(cycle), cycle.ways
    q, visit = _samples(arm, cycle)
    order = np.argsort(visit, kind="stable")
    q, visit = q[order] @ arm.coupling.T, visit[order]
    if not n:
        return np.zeros((0, 6))
    heads = np.flatnonzero((source != np.arange(n) - 1) | (np.arange(n) == 0))
    ends = np.searchsorted(visit, np.append(heads[1:], n))
    begins = np.append(0, ends[:-1])
    side = np.zeros((n, 6))
    last = np.searchsorted(visit, np.arange(n), side="right") - 1
    for head, a, b in zip(heads.tolist(), begins.tolist(), ends.tolist(), strict=True):
        if b == a:
            continue
        came_from = source[head]
        start = cycle.path.q[came_from] @ arm.coupling.T if came_from >= 0 else q[a]
        every = np.arange(b - a)
        found = along(q[a:b], never_turned(start), arm.play, every).side
        rows = np.arange(visit[a], visit[b - 1] + 1)
        rows = rows[last[rows] >= a]
        side[rows] = found[last[rows] - a]
    return side


def _samples(arm: Arm, cycle: ProgramCycle) -> tuple[Floats, Floats]:
    """Sample all moves: joint angles, (m, 6) [rad], and the move of each, (m,).

    Between waypoints no joint turns: only drives of several joints may.
    """
    alone = (np.count_nonzero(arm.coupling, axis=1) == 1).all()
    q, visit = cycle.clock.runs.sample(STEP, 1 if alone else COUPLED)
    _, source = cycle.ways
    known = ~any_in_rows(np.isnan(cycle.path.q))
    others = np.flatnonzero(known & (np.bincount(visit, minlength=len(cycle)) == 0))
    begin = np.where(source[others] >= 0, source[others], others)
    part = np.tile(np.arange(1, LONE + 1) / LONE, len(others))[:, None]
    a, b = (np.repeat(cycle.path.q[rows], LONE, axis=0) for rows in (begin, others))
    return (
        np.concatenate([q, a + part * (b - a)]),
        np.concatenate([visit, np.repeat(others, LONE)]),
    )


def disagreements(arm: Arm, cycle: ProgramCycle) -> Bools:
    """Tell where a joint arrives otherwise in time than along the path, (n, 6).

    Where the play operator does not know the side, there is nothing to agree with.
    """
    read, inferred = read_directions(arm, cycle), cycle.arrived.direction
    return np.asarray((read != inferred) & (read != 0) & (inferred != 0))
