"""What is told of the moves of a finished plan: points, reasons, remedies, promises."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.compensation.outcome import Status
from postproc.compensation.paths.arcs import halves
from postproc.compensation.paths.fast_stops import predict_fast_stops
from postproc.compensation.paths.insertion_prediction import (
    InsertionTask,
    PathPrediction,
)
from postproc.compensation.paths.insertion_report import Insertions
from postproc.compensation.paths.plan_outcomes import (
    BEGINS,
    MoveOutcomes,
    Rows,
    compare,
    find_largest,
)
from postproc.compensation.paths.reapproach import find_reapproaches
from postproc.compensation.paths.split_selection import can_stop
from postproc.compensation.window_result import CompensatedProgram
from postproc.robot.pose import MM

PRELOAD = "Preload the backlash: compensation.preload_backlash"
MEASURE_STARTS = (
    "Measure how the joints change their flanks: survey.reversals, or diagnose --path"
)
IN_CORNER = (
    "Joints change their flanks where it begins, and the arm does not stop there, or "
    "may not stop once more: let it stop there, or lead the corner elsewhere"
)
BY_HAND = "Change what the reason names, or put targets on its way in the program"
MORE_ROOM = "Allow more points: compensation.max_inserted"
SHORTER = "A lower speed, or a smaller [limits] segment_ms, allows shorter pieces"
STEEP = "between points on it the correction would change faster than may be"
TURNS = (
    "Lead it where the wrist turns less on the way, or raise [limits] "
    "correction_step_mm"
)


def summarize(now: PathPrediction) -> CompensatedProgram:
    """Tell of the program as of the source's visits."""
    in_time = replace(
        now.in_time, before=now.task.first.before, inserted=_report_insertions(now)
    )
    kept = now.program.kept.take(now.own)
    return replace(now.program, kept=kept, in_time=in_time)


def _report_insertions(now: PathPrediction) -> Insertions:
    """Say what was put on ways, and why moves that are left too far got nothing."""
    task, plan, visits = now.task, now.plan, now.task.visits
    outcomes = _outcomes(now)
    promises = {v: one.choice[1] for rows, one in outcomes.items() for v in rows}
    farthest = find_largest(now.predicted, outcomes)
    largest = {v: far for rows, far in farthest.items() for v in rows}
    why = "its pieces would be too short, or the path no better"
    if plan.crowded:
        why = "no more points may be inserted (max_inserted)"
    too_far = set(now.too_far) - plan.points.keys()
    left = {}
    for v in sorted(too_far):  # what is known of one half of an arc is so of both
        halved = (plan.left[h] for h in halves(visits, v) if h in plan.left)
        usual = STEEP if v in plan.shut and not plan.crowded else why
        left[v] = plan.left.get(v) or next(halved, usual)
    return Insertions(
        now.own,
        task.tolerance,
        plan.points,
        plan.stops & plan.points.keys(),
        left,
        task.sizes,
        promises,
        find_reapproaches(now),
        plan.unconfirmed,
        _cures(now),
        _cell_speed(now),
        _limit_speed(now),
        largest,
        _fast_stops(now.task),
    )


def _fast_stops(task: InsertionTask) -> dict[int, float]:
    """Return the corrected targets that fast JOINT moves may miss, see `Insertions`."""
    setting, corrected = task.setting, task.kept.decisions.status == Status.CORRECTED
    off = predict_fast_stops(
        task.first.after, setting.cell, setting.model, setting.temperature
    )
    rows = np.flatnonzero(corrected & (off > task.tolerance))
    return dict(zip(rows.tolist(), off[rows].tolist(), strict=True))


def _cell_speed(now: PathPrediction) -> float:
    """Return the speed of the cell if moves with points are judged at it [mm/s]."""
    task = now.task
    speed = task.setting.cell.file.motion.linear_mm_s or 0.0
    own = task.first.before.targets.linear_speed[sorted(now.plan.points)] / MM
    return speed if np.isclose(own, speed).any() else 0.0


def _limit_speed(now: PathPrediction) -> float:
    """Return the limit of the cell if moves with points are judged at it [mm/s]."""
    unknown = np.isnan(now.task.first.before.targets.linear_speed)
    judged = unknown[sorted(now.plan.points)].any()
    return float(now.task.setting.cell.file.motion.linear_limit_mm_s or 0.0) * judged


def _cures(now: PathPrediction) -> dict[int, str]:
    """Say what helps the moves that are left too far, by visit."""
    plan, found = now.plan, dict[int, str]()
    for v in now.too_far:
        paths, k = now.path_to(v)
        both = halves(now.task.visits, v)
        known = [plan.cures[h] for h in both if plan.cures.get(h)]
        if known:
            found[v] = known[0]
        elif v not in plan.open:
            found[v] = BY_HAND
        elif paths.way[paths.after.largest[k]] < BEGINS and v not in plan.stops:
            start = MEASURE_STARTS if v in plan.unconfirmed else PRELOAD
            found[v] = start if can_stop(now.task, both[0]) else IN_CORNER
        elif plan.crowded:
            found[v] = MORE_ROOM
        else:
            found[v] = TURNS if v in plan.shut else SHORTER
    return found


def _outcomes(now: PathPrediction) -> dict[Rows, MoveOutcomes]:
    """Return how moves do with their points by all open hypotheses."""
    moves = sorted({halves(now.task.visits, v) for v in now.sizes})
    return compare([now.predicted], moves, now.task.tolerance)
