"""Stops from which targets are approached anew, and whether they are better for it."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats, any_in_rows
from postproc.compensation.approach_advice import place_to_approach
from postproc.compensation.findings import SURE
from postproc.compensation.outcome import Status
from postproc.compensation.paths.insertion_plan import InsertionPlan, of_source
from postproc.compensation.paths.path_error import sizes_of
from postproc.compensation.paths.write_points import numbers_at
from postproc.compensation.pipeline import WindowResult
from postproc.compensation.timing_comparison import InTime
from postproc.robot.pose import MM
from postproc.robot.trajectory import Motion

TRIES = 8  # rounds in which stops are taken back
WORSE = 5e-5  # [m] that a path may be worse for such a stop


def insert_reapproaches(work: InsertionPlan) -> None:
    """Approach targets anew that a joint reaches from a side that is not sure."""
    visits = work.source.reading.visits
    ends = (visits.motion == Motion.LINEAR) & ~visits.fly
    ends &= ~visits.fly[visits.before]
    for v in np.flatnonzero(ends & _find_uncertain(work.source.kept)).tolist():
        file, line = int(visits.file[v]), int(work.lines[v])
        may = not work.find_hindrance(v) and work.splitter.stops(file, line)
        if may and work.room > 0:
            place = _place_to_approach(work, v)
            if place is not None:
                work.approaches[v] = place
    for _ in range(TRIES):
        work.make()
        bad = bad_approaches(work) | _worse_paths(work)
        if not bad:
            return
        for v in bad:
            del work.approaches[v]
    work.approaches.clear()
    work.make()


def _worse_paths(work: InsertionPlan) -> set[int]:
    """Find the targets approached anew to or from which the path is worse for it.

    Only where a path was asked for, and where it is farther off than that.
    """
    before = work.source.reading.visits.before
    was, now = sizes_of(work.first.paths), sizes_of(work.paths)
    worse = {
        v
        for v, far in now.items()
        if far > max(was.get(v, np.inf) + WORSE, work.tolerance)
    }
    return {v for v in work.approaches if worse & {v, *np.flatnonzero(before == v)}}


def _place_to_approach(work: InsertionPlan, v: int) -> Floats | None:
    """Find the numbers of a stop from which to approach a target."""
    cell, cycle = work.setting.cell, work.first.before
    visits, side = work.source.reading.visits, work.source.kept.decisions.side
    q = place_to_approach(
        cell.arm, cycle, v, int(visits.before[v]), np.abs(side[v]) < SURE,
        cell.limits.reapproach_mm * MM,
    )  # fmt: skip
    if q is None:
        return None
    pose = cell.arm.flange(q[None]) @ cycle.targets.tool[[v]]
    return numbers_at(visits, v, pose[0], q)


def _find_uncertain(kept: WindowResult) -> Bools:
    """Tell which targets move that a joint reaches from a side that is not sure."""
    return kept.corrected & any_in_rows(np.abs(kept.decisions.side) < SURE)


def bad_approaches(work: InsertionPlan) -> set[int]:
    """Find the targets that are approached anew and are no better for it."""
    kept = of_source(work.latest.kept, work.own)
    unsure, status = _find_uncertain(kept), kept.decisions.status
    stops = work.latest.kept.decisions.status[work.own - 1]
    others = np.flatnonzero(unsure & ~_find_uncertain(work.source.kept))
    asked = np.array(sorted(work.approaches), dtype=np.int64)
    bad = (
        unsure[asked]
        | (status[asked] != Status.CORRECTED)
        | (stops[asked] != Status.CORRECTED)
    )
    cause = np.searchsorted(asked, others, side="right") - 1
    return {*asked[bad].tolist(), *asked[cause[cause >= 0]].tolist()}


def find_reapproaches(work: InsertionPlan, told: InTime) -> dict[int, float]:
    """Return the shares of the ways at which targets are approached anew."""
    p = work.setting.cell.arm.tcp(
        told.before.path.q, told.before.targets.tool[:, :3, 3]
    )
    found = {}
    for v in work.approaches:
        row = int(work.own[v])
        there, back = (float(np.linalg.norm(p[row - 1] - p[k])) for k in
                       (row - 2, row))  # fmt: skip
        found[v] = there / (there + back)
    return found
