"""Why a point is where it is: the rules by which points come on the ways of a program.

A plan is immutable. A rule is a function from a plan and what is predicted of it (a
`PathPrediction` holds both) to another plan, which is predicted again:

1. `insert_reapproaches`: targets are approached anew from a stop, where asked for.
2. `find_split`: which moves leave their paths too far, and may get points.
3. `drop_where_steep`: of two points between which a correction changes too fast, the
   one with less room goes.
4. `put_points`: a point comes where every part of a path is left the farthest, and in
   front of it a stop that preloads the backlash. Where a joint changes its flank that
   gives one point on the old flank, one on the new, and few others. Arcs are cut at
   their points on the way as well; flat pieces become chords, or are halved.
5. `join_flat_pieces`: pieces of arcs that are still too flat go on to the next cut.
6. `BestPoints.restore`: of all that was tried on a move what did best.
7. `choose_plans`: of these points, fewer of them and none, what the data allow.
8. `judge`: what is no better for certain is thinned out, or taken back.

3 and 4 are repeated until neither changes anything, then 5, then 8.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import hypot

import numpy as np

from postproc.compensation.options import Job
from postproc.compensation.paths.arc_splitting import (
    cut_at_vias,
    halve_flat_pieces,
    join_flat_pieces,
    new_chords,
    whole_arcs,
)
from postproc.compensation.paths.arcs import Cut, halves, point_on_way
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.insertion_prediction import (
    InsertionTask,
    PathPrediction,
    Write,
    of_source,
)
from postproc.compensation.paths.insertion_report import Insertions
from postproc.compensation.paths.path_error import sizes_of
from postproc.compensation.paths.plan_outcomes import BEGINS, compare
from postproc.compensation.paths.prune import judge
from postproc.compensation.paths.reapproach import (
    find_reapproaches,
    insert_reapproaches,
)
from postproc.compensation.paths.split_selection import can_stop, find_split
from postproc.compensation.pipeline import CompensatedProgram
from postproc.language.languages import language_of
from postproc.robot.pose import MM

ROUNDS = 16  # of points put on the ways
BETTER = 1e-6  # [m] less is no matter
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
TAKEN = 2e-5, 1e-4, 3e-4  # [m] from where a move begins: where play is taken up
LATEST = 0.9  # of a way: the last place of it for a stop


Rule = Callable[[PathPrediction], InsertionPlan]


def correct_paths(
    draft: CompensatedProgram, setting: Job, write: Write
) -> CompensatedProgram:
    """Put points on the ways of a corrected program where it leaves them too far.

    Args:
        draft: The program, run in time.
        setting: What it is compensated with, a tolerance of paths among it.
        write: Writes a corrected program, and reads it again.

    Returns:
        The program, `kept` speaking of the visits of the source.
    """
    reading, first = draft.reading, draft.in_time
    if first is None or not setting.options.inserts:
        return draft
    language = language_of(reading.sources[0].name)
    splitter = language.splitter(reading.sources)
    task = InsertionTask(draft, first, setting, write, splitter)
    now = task.predict(InsertionPlan())
    if setting.options.reapproach:
        now = insert_reapproaches(now)
    now = task.predict(find_split(now))
    if now.plan.open or now.plan.approaches:
        now, best = _repeat(now, BestPoints(), put_points, drop_where_steep)
        now, best = _repeat(now, best, join_flat_pieces)
        now = judge(task.predict(best.restore(now)))
    return _result(now)


def _nothing(now: PathPrediction) -> InsertionPlan:
    return now.plan


def _repeat(
    now: PathPrediction, best: BestPoints, rule: Rule, repair: Rule = _nothing
) -> tuple[PathPrediction, BestPoints]:
    """Follow a rule until it changes nothing, and note what did best.

    Args:
        now: The program.
        best: What did best before.
        rule: The rule.
        repair: What comes before it; what that changes is not noted.
    """
    for _ in range(ROUNDS):
        plan = repair(now)
        if plan.written == now.plan.written:
            best = best.note(now)
            plan = rule(now)
            if plan.written == now.plan.written:
                return replace(now, plan=plan), best
        now = now.task.predict(plan)
    return now, best


def drop_where_steep(now: PathPrediction) -> InsertionPlan:
    """Take back points beside which corrections change faster than they may.

    The error itself changes fast there, and all points of the way would be left for it:
    over a longer piece it changes less.
    """
    plan = now.plan
    for v, known in now.plan.points.items():
        ends, gone = [0.0, *known, 1.0], set[float]()
        room = {b: c - a for a, b, c in zip(ends, ends[1:], ends[2:], strict=False)}
        free = {*known[v in plan.stops :]} - {1.0}
        for k in now.steep_pieces(v):
            if either := free.intersection(ends[k : k + 2]):
                gone.add(max(either, key=room.__getitem__))
        if gone:
            shut = {**plan.shut, v: plan.shut.get(v, frozenset()) | gone}
            plan = replace(plan.drop(v, gone), shut=shut)
    return plan


def put_points(now: PathPrediction) -> InsertionPlan:
    """Put points on the ways that are left too far, and cut their arcs."""
    plan = _put_on_paths(now)
    chords = new_chords(now)
    changed = {v for v in plan.points if plan.points[v] != now.plan.points.get(v)}
    plan = halve_flat_pieces(now, plan, {*changed, *(v for v, _ in chords)})
    return cut_at_vias(now.task.visits, replace(plan, chords=plan.chords | chords))


def _put_on_paths(now: PathPrediction) -> InsertionPlan:
    """Put points on the paths that are left too far, the worst first."""
    plan, room = now.plan, now.room
    whole = whole_arcs(now)
    for v in now.worst_first:
        if not _needs_points(now, v, now.sizes[v]):
            continue
        via = v in whole  # the point on the way of an arc becomes one, too
        more = _put_on_path(now, plan, v, room - via)
        count = more.count - plan.count
        if count or more.points.get(v) != plan.points.get(v):
            room -= count + via
            if via:
                first = point_on_way(now.task.visits, v)
                whole -= {first, first + 1}
        plan = more
    return plan


def _needs_points(now: PathPrediction, v: int, size: float) -> bool:
    """Return True if a path that is so far off [m] at the most gets more points."""
    plan, task = now.plan, now.task
    near = v in plan.beside and plan.points.get(v, ()) in ((), (1.0,))
    return v in plan.open and size > (task.tolerance / 2 if near else task.aim)


def _put_on_path(
    now: PathPrediction, plan: InsertionPlan, v: int, room: int
) -> InsertionPlan:
    """Put the stop in front of a path, or points where it is left too far.

    Args:
        now: The program.
        plan: Its points, and those of other paths.
        v: The visit that the path leads to.
        room: How many points may be put on it.
    """
    known = plan.points.get(v, ())
    if v in plan.idle and room > 0:
        plan, stop = _find_stop(now, plan, v)
        if stop is not None:
            rest = known[v in plan.stops :]
            return replace(plan, stops=plan.stops | {v}).put(v, (stop, *rest))
    wanted = _on_path(now, v)
    new = wanted[: max(room, 0)]
    plan = replace(plan, crowded=plan.crowded or len(new) < len(wanted))
    return plan.put(v, (*known, *new)) if new else plan


def _find_stop(
    now: PathPrediction, plan: InsertionPlan, v: int
) -> tuple[InsertionPlan, float | None]:
    """Find where the arm stops to take up play before a path, as a share of it.

    How near does best is tried out. None where nothing is left to try.
    """
    paths, k = now.path_to(v)
    samples = paths.samples(k)
    begin, length = paths.way[samples] < plan.open[v][0], float(paths.way[samples][-1])
    places = [there / length for there in TAKEN if there < LATEST * length]
    off = float(paths.after.across[samples][begin].max(initial=0.0))
    tried = plan.tried.get(v, ())
    if v in plan.stops and len(tried) < len(places):
        tried = (*tried, (off, plan.points[v][0]))
    stop = None
    if off > now.task.aim and len(tried) <= len(places) and places:
        stop = places[len(tried)] if len(tried) < len(places) else min(tried)[1]
        if len(tried) == len(places):
            tried = (*tried, (0.0, stop))  # it is settled
            stop = stop if stop != plan.points[v][0] else None
    return replace(plan, tried={**plan.tried, v: tried}), stop


def _on_path(now: PathPrediction, v: int) -> list[float]:
    """Find a point in every part of a path that is left too far, the worst first."""
    plan, (paths, k) = now.plan, now.path_to(v)
    samples = paths.samples(k)
    way, far = paths.way[samples], paths.after.across[samples]
    known, shut = plan.points.get(v, ()), plan.shut.get(v, ())
    least, clear, behind = plan.open[v]
    ends = [0.0, *(share * way[-1] for share in known), float(way[-1])]
    found = []
    for i, (a, b) in enumerate(pairwise(ends)):
        low = a + (clear if i == 0 else least)
        high = b - (behind if i == len(known) else least)
        inside = np.flatnonzero((way >= a) & (way <= b))
        if high < low or not len(inside):
            continue
        if any(a < share * way[-1] < b for share in shut):
            continue
        top = inside[far[inside].argmax()]
        if far[top] > now.task.aim:
            at = min(max(float(way[top]), low), high)
            found.append((float(far[top]), at / float(way[-1])))
    return [share for _, share in sorted(found, reverse=True)]


def _result(now: PathPrediction) -> CompensatedProgram:
    """Tell of the program as of the source's visits."""
    in_time = replace(
        now.in_time, before=now.task.first.before, inserted=_report_insertions(now)
    )
    kept = of_source(now.program.kept, now.own)
    return replace(now.program, kept=kept, in_time=in_time)


def _report_insertions(now: PathPrediction) -> Insertions:
    """Say what was put on ways, and why moves that are left too far got nothing."""
    task, plan, visits = now.task, now.plan, now.task.visits
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
        sizes_of(task.first.paths),
        _promises(now),
        find_reapproaches(now),
        plan.unconfirmed,
        _cures(now),
        _cell_speed(now),
        _limit_speed(now),
    )


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


def _promises(now: PathPrediction) -> dict[int, float]:
    """Return what 95 % of every move stays within by all open hypotheses [m]."""
    task = now.task
    now = task.predict(now.plan)
    moves = {halves(task.visits, v) for v in now.sizes}
    return {
        v: compare((now.part_of(v).paths,), rows, task.tolerance).choose()[1]
        for rows in moves
        for v in rows
    }


@dataclass(frozen=True)
class _Tried:
    """What was put on the way of a move.

    Attributes:
        size: How far the move left its path with it [m]; of an arc, of both halves.
        points: The points by visit; of an arc, of both its halves.
        stops: Those of these visits whose first point is a stop.
        chords: Which of its pieces are chords.
    """

    size: float
    points: Mapping[int, tuple[float, ...]]
    stops: frozenset[int]
    chords: frozenset[Cut]


@dataclass(frozen=True)
class BestPoints:
    """What did best for every move that may be split, so far.

    Points are put where a path is left the farthest, one after the other; near a place
    where two joints turn back a next one can make the move worse.

    Attributes:
        best: What did best, by the first visit of each move.
        refused: Why points of moves could not be corrected, what was said first.
    """

    best: Mapping[int, _Tried] = field(default_factory=dict)
    refused: Mapping[int, str] = field(default_factory=dict)

    def note(self, now: PathPrediction) -> BestPoints:
        """Look at how the moves do with the points that they have now."""
        best, bad = dict(self.best), _unfit(now)
        for v, tried in _list_tried(now).items():
            known = best.setdefault(v, tried)
            if v not in bad and tried.size <= known.size + BETTER:  # the later one
                best[v] = replace(tried, size=min(tried.size, known.size))
        return BestPoints(best, {**now.refusals, **self.refused})

    def restore(self, now: PathPrediction) -> InsertionPlan:
        """Give moves back the points that did better than those they have."""
        plan, bad = now.plan, _unfit(now)
        for v, has in _list_tried(now).items():
            best = self.best[v]
            if v in bad or has.size > best.size + BETTER:
                others = {k: s for k, s in plan.points.items() if k not in has.points}
                plan = replace(
                    plan,
                    points={**others, **best.points},
                    stops=plan.stops - has.stops | best.stops,
                    chords=plan.chords - has.chords | best.chords,
                )
        for v in self.refused.keys() - plan.points.keys():
            plan = plan.leave(v, self.refused[v])
        return plan


def _unfit(now: PathPrediction) -> set[int]:
    """Return the moves with flat pieces, or refused points, by first visits."""
    rows: Collection[int] = {*(v for v, _ in now.flat), *now.refusals}
    return {halves(now.task.visits, v)[0] for v in rows}


def _list_tried(now: PathPrediction) -> dict[int, _Tried]:
    """Say what the moves have now, by their first visits, and how they do."""
    plan, sizes, found = now.plan, now.sizes, dict[int, _Tried]()
    for own in {halves(now.task.visits, v) for v in plan.open}:
        found[own[0]] = _Tried(
            hypot(*(sizes.get(row, np.inf) for row in own)),
            {row: plan.points[row] for row in own if row in plan.points},
            plan.stops.intersection(own),
            frozenset(cut for cut in plan.chords if cut[0] in own),
        )
    return found
