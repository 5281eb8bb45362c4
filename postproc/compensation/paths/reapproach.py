"""Stops from which targets are approached anew, and whether they are better for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import Bools, Floats, any_in_rows
from postproc.compensation.findings.approach_advice import place_to_approach
from postproc.compensation.findings.findings import SURE
from postproc.compensation.outcome import Status
from postproc.compensation.paths.insertion_prediction import (
    InsertionTask,
    PathPrediction,
)
from postproc.compensation.paths.write_points import numbers_at
from postproc.compensation.window_result import WindowResult
from postproc.robot.pose import MM
from postproc.robot.trajectory import Motion

TRIES = 8  # rounds in which stops are taken back
WORSE = 5e-5  # [m] that a path may be worse for such a stop


def insert_reapproaches(now: PathPrediction) -> PathPrediction:
    """Approach targets anew that a joint reaches from a side that is not sure."""
    task, plan = now.task, now.plan
    visits, room = task.visits, now.room
    ends = (visits.motion.kind == Motion.LINEAR) & ~visits.motion.fly
    ends &= ~visits.motion.fly[visits.graph.before]
    places = dict(plan.approaches)
    for v in np.flatnonzero(ends & _find_uncertain(task.kept)).tolist():
        file, line = int(visits.place.file[v]), int(task.lines[v])
        may = not task.find_hindrance(v) and task.splitter.stops(file, line)
        if may and len(places) < room:
            place = _place_to_approach(task, v)
            if place is not None:
                places[v] = place
    for _ in range(TRIES):
        now = task.predict(replace(plan, approaches=places))
        bad = bad_approaches(now) | _worse_paths(now)
        if not bad:
            return now
        places = {v: place for v, place in places.items() if v not in bad}
    return task.predict(plan)


def _worse_paths(now: PathPrediction) -> set[int]:
    """Find the targets approached anew to or from which the path is worse for it.

    Only where a path was asked for, and where it is farther off than that.
    """
    task, before = now.task, now.task.visits.graph.before
    was, far = task.sizes, now.sizes
    worse = {
        v
        for v, size in far.items()
        if size > max(was.get(v, np.inf) + WORSE, task.tolerance)
    }
    own = now.plan.approaches
    return {v for v in own if worse & {v, *np.flatnonzero(before == v)}}


def _place_to_approach(task: InsertionTask, v: int) -> Floats | None:
    """Find the numbers of a stop from which to approach a target."""
    cell, cycle = task.setting.cell, task.first.before
    visits, side = task.visits, task.kept.decisions.side
    q = place_to_approach(
        cell.arm, cycle, v, int(visits.graph.before[v]), np.abs(side[v]) < SURE,
        cell.limits.reapproach_mm * MM,
    )  # fmt: skip
    if q is None:
        return None
    pose = cell.arm.flange(q[None]) @ cycle.targets.tool[[v]]
    return numbers_at(visits, v, pose[0], q)


def _find_uncertain(kept: WindowResult) -> Bools:
    """Tell which targets move that a joint reaches from a side that is not sure."""
    return kept.corrected & any_in_rows(np.abs(kept.decisions.side) < SURE)


def bad_approaches(now: PathPrediction) -> set[int]:
    """Find the targets that are approached anew and are no better for it."""
    kept = now.program.kept.take(now.own)
    unsure, status = _find_uncertain(kept), kept.decisions.status
    stops = now.program.kept.decisions.status[now.own - 1]
    others = np.flatnonzero(unsure & ~_find_uncertain(now.task.kept))
    asked = np.array(sorted(now.plan.approaches), dtype=np.int64)
    bad = (
        unsure[asked]
        | (status[asked] != Status.CORRECTED)
        | (stops[asked] != Status.CORRECTED)
    )
    cause = np.searchsorted(asked, others, side="right") - 1
    return {*asked[bad].tolist(), *asked[cause[cause >= 0]].tolist()}


def find_reapproaches(now: PathPrediction) -> dict[int, float]:
    """Return the shares of the ways at which targets are approached anew."""
    cycle = now.in_time.before
    p = now.task.setting.cell.arm.tcp(cycle.path.q, cycle.targets.tool[:, :3, 3])
    found = {}
    for v in now.plan.approaches:
        row = int(now.own[v])
        there, back = (float(np.linalg.norm(p[row - 1] - p[k])) for k in
                       (row - 2, row))  # fmt: skip
        found[v] = there / (there + back)
    return found
