"""Which moves that leave their paths get points, and which a stop where they begin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from postproc.arrays import Floats
from postproc.compensation.paths.arcs import halves
from postproc.compensation.paths.backlash_preload import BacklashPreload, take_up
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.insertion_prediction import (
    InsertionTask,
    PathPrediction,
)
from postproc.compensation.paths.path_error import steps_of
from postproc.compensation.paths.plan_rule import resolution
from postproc.compensation.paths.split_constraints import shortest_pieces

MOST = 0.95  # of a way: that much is to be as near as points aim at
SPEED = (
    "Set the speed before the move, or in the cell [motion] linear_mm_s, or "
    "linear_limit_mm_s where the speed is a value at run time"
)


def find_split(now: PathPrediction) -> InsertionPlan:
    """Say which of the moves that leave their paths may be split."""
    task, plan = now.task, now.plan
    shortest = task.setting.cell.limits.segment_ms / 1e3
    pieces = shortest_pieces(task.visits, task.first.before, shortest, task.speeds)
    far = _list_far(now)
    open_, begins = dict(plan.open), list[int]()
    for v in sorted({half for row in far for half in halves(task.visits, row)}):
        if told := _explain_refusal(now, v):
            if v in far:
                unknown = np.isnan(task.speeds[v])
                plan = plan.leave(v, told, SPEED if unknown else None)
            continue
        open_[v] = pieces[v]
        if task.setting.options.preload_backlash and can_stop(task, v):
            begins.append(v)
    stops = take_up(task.first.after, task.setting, task.visits, begins)
    lacks = _find_lacks(task, begins)
    stops = {v: stop for v, stop in stops.items() if stop.crossing}
    fits = {v for v, stop in stops.items() if _is_within_lag(task, lacks[v], stop)}
    return replace(
        plan,
        open=open_,
        idle={v: stops[v] for v in sorted(fits)},
        unconfirmed=frozenset(stops.keys() - fits),
    )


def _list_far(now: PathPrediction) -> set[int]:
    """List the moves that are left too far, or most of whose way is not near enough.

    Near enough is what points aim at. Were it farther, a move a little nearer would
    keep what points take from one a little farther off: a gap of hardly any difference
    in the predictions, by which more data could make a path worse.
    """
    paths, task = now.parts[0].paths, now.task
    step = steps_of(paths.way, paths.first)
    far = np.where(paths.after.across > task.aim, step, 0.0)
    off, whole = (np.add.reduceat(each, paths.first[:-1]) for each in (far, step))
    far_off = (off > (1.0 - MOST) * whole) | (paths.after.sizes > task.tolerance)
    return set(paths.visit[far_off].tolist())


def _explain_refusal(now: PathPrediction, v: int) -> str:
    """Say why a path that is left too far gets no points, "" where it may."""
    task = now.task
    if v in now.plan.approaches:
        return "its target is approached again from an inserted stop"
    return task.find_hindrance(v)


def can_stop(task: InsertionTask, v: int) -> bool:
    """Tell whether the arm stands where a move begins, and may stop once more."""
    visits = task.visits
    before = int(visits.graph.before[v])
    if visits.motion.fly[before] or visits.motion.via[before]:
        return False
    return task.splitter.stops(int(visits.place.file[v]), int(task.lines[v]))


def _is_within_lag(task: InsertionTask, lacks: Floats, stop: BacklashPreload) -> bool:
    """Return True if no open hypothesis makes a stop that crosses gaps matter.

    Args:
        task: The program.
        lacks: What each link may lack of its step there, (6,) [m].
        stop: The stop.
    """
    most = float(sum(lacks[joint - 1] for joint in stop.crossing))
    return most <= resolution(task.tolerance)


def _find_lacks(task: InsertionTask, moves: Sequence[int]) -> dict[int, Floats]:
    """Return what links lack of their steps behind a sharp gap's way, (6,) [m] each.

    By any open hypothesis. The tool is off by it at a stop where drives have crossed.
    """
    if not moves:
        return {}
    cycle, arm, gap = task.first.after, task.setting.cell.arm, task.setting.gap
    own = np.array(moves)
    tool = cycle.targets.tool[own, :3, 3]
    by_joint = arm.jacobian(cycle.path.q[own], tool)[:, :3]
    lags = np.array([flank.max_lag for flank in task.flanks])
    lacks = lags * (np.linalg.norm(by_joint, axis=1) * (2.0 * gap))
    return dict(zip(moves, lacks, strict=True))
