"""Which moves that leave their paths get points, and which a stop where they begin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.compensation.paths.arcs import halves
from postproc.compensation.paths.backlash_preload import take_up
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.plan_rule import resolution
from postproc.compensation.paths.split_constraints import shortest_pieces

SPEED = "Set the speed before the move, or [motion] linear_mm_s in the cell"


def find_split(work: InsertionPlan) -> None:
    """Say which of the moves that leave their paths may be split."""
    visits, paths = work.source.reading.visits, work.paths
    shortest = work.setting.cell.limits.segment_ms / 1e3
    pieces = shortest_pieces(visits, work.first.before, shortest)
    far = set(paths.visit[work.to_split].tolist())
    for v in sorted({half for row in far for half in halves(visits, row)}):
        if told := _explain_refusal(work, v):
            if v in far:
                work.left[v] = told
                if np.isnan(work.first.before.targets.linear_speed[v]):
                    work.cures[v] = SPEED
            continue
        work.open[v] = pieces[v]
        if v not in far:
            work.beside.add(v)
        if work.setting.options.preload_backlash and _can_stop(work, v):
            taken = take_up(work.first.after, work.setting, visits, v)
            if taken.crossing and _is_within_lag(work, v, taken.crossing):
                work.idle[v] = taken
            elif taken.crossing:
                work.unconfirmed.add(v)


def _explain_refusal(work: InsertionPlan, v: int) -> str:
    """Say why a path that is left too far gets no points, "" where it may."""
    if v in work.approaches:
        return "its target is approached again from an inserted stop"
    return work.find_hindrance(v)


def _can_stop(work: InsertionPlan, v: int) -> bool:
    """Tell whether the arm stands where a move begins, and may stop once more."""
    visits = work.source.reading.visits
    before = int(visits.before[v])
    if visits.fly[before] or visits.via[before]:
        return False
    return work.splitter.stops(int(visits.file[v]), int(work.lines[v]))


def _is_within_lag(work: InsertionPlan, v: int, joints: Sequence[int]) -> bool:
    """Return True if no open hypothesis makes a stop that crosses gaps matter.

    What a link lacks of its step behind a sharp gap's way, it is off by at the stop.
    """
    lacks = (work.flanks[joint - 1].max_lag * _step(work, v, joint) for joint in joints)
    return sum(lacks) <= resolution(work.tolerance)


def _step(work: InsertionPlan, v: int, joint: int) -> float:
    """Return how far a joint's change of its flank moves the TCP at a visit [m]."""
    cycle, arm = work.first.after, work.setting.cell.arm
    tool = cycle.targets.tool[v, :3, 3]
    by_joint = arm.jacobian(cycle.path.q[v][None], tool)[0, :3, joint - 1]
    gap = 2.0 * work.setting.gap[joint - 1]
    return float(np.linalg.norm(by_joint) * gap)
