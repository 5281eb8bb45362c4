"""Why a point is where it is: the rules by which points come on the ways of a program.

A plan is immutable. A rule is a function from a plan and what is predicted of it (a
`PathPrediction` holds both) to another plan, which is predicted again:

1. `insert_reapproaches` (`reapproach.py`): targets are approached again from a stop,
   where asked for.
2. `find_split` (`split_selection.py`): which moves leave their paths too far, and may
   get points.
3. `drop_where_steep`: of two points between which a correction changes too fast, the
   one with less room goes.
4. `put_points`: a point comes where every part of a path is left the farthest, and in
   front of it a stop that preloads the backlash. Where a joint changes its flank that
   gives one point on the old flank, one on the new, and few others. Arcs are cut at
   their points on the way as well; flat pieces become chords, or are halved
   (`arc_splitting.py`).
5. `join_flat_pieces` (`arc_splitting.py`): pieces of arcs that are still too flat go on
   to the next cut.
6. `BestPoints.restore` (`best_points.py`): of all that was tried on a move what did
   best.
7. `choose_plans` (`prune.py`): of these points, fewer of them and none, what the data
   allow. `plan_rule.py` holds the rule, `plan_outcomes.py` what it weighs.
8. `judge` (`prune.py`): what is no better for certain is thinned out, or taken back.

3 and 4 are repeated until neither changes anything, then 5, then 8. How a plan is
predicted says `insertion_prediction.py`, how it is written `write_points.py`, and what
is told of it `insertion_summary.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from postproc.arrays import Floats
from postproc.compensation.findings.timing_comparison import run_in_time
from postproc.compensation.options import Job
from postproc.compensation.paths.arc_splitting import (
    cut_at_vias,
    halve_flat_pieces,
    join_flat_pieces,
    new_chords,
    whole_arcs,
)
from postproc.compensation.paths.arcs import point_on_way
from postproc.compensation.paths.backlash_preload import LATEST, TAKEN
from postproc.compensation.paths.best_points import BestPoints
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.insertion_prediction import (
    InsertionTask,
    PathPrediction,
    Write,
)
from postproc.compensation.paths.insertion_summary import summarize
from postproc.compensation.paths.path_error import apart
from postproc.compensation.paths.prune import judge
from postproc.compensation.paths.reapproach import insert_reapproaches
from postproc.compensation.paths.split_selection import find_split
from postproc.compensation.program import ParsedProgram
from postproc.compensation.window_result import CompensatedProgram, WindowResult
from postproc.language.languages import language_of

FORETOLD = 4  # points in a part of a path before it is predicted with them
ROUNDS = 16  # of points put on the ways


Rule = Callable[[PathPrediction], InsertionPlan]


def correct_paths(
    reading: ParsedProgram, kept: WindowResult, setting: Job, write: Write
) -> CompensatedProgram:
    """Put points on the ways of a corrected program where it leaves them too far.

    Args:
        reading: The program.
        kept: How it is corrected.
        setting: What it is compensated with, a tolerance of paths among it.
        write: Writes a corrected program, and reads it again.

    Returns:
        The program, written; `kept` speaks of the visits of the source.
    """
    language = language_of(reading.sources[0].name)
    splitter = language.splitter(reading.sources)
    again = reading.with_values(kept.decisions.corrected)
    with setting.clock("time"):
        own = np.arange(len(reading.visits))
        first = run_in_time(reading, again, kept.position, setting, own)
    task = InsertionTask(reading, kept, first, setting, write, splitter)
    now = task.predict(InsertionPlan())
    if setting.options.reapproach:
        now = insert_reapproaches(now)
    now = task.predict(find_split(now))
    if now.plan.open or now.plan.approaches:
        now, best = _repeat(now, BestPoints(), put_points, drop_where_steep)
        now, best = _repeat(now, best, join_flat_pieces)
        now = judge(task.predict(best.restore(now)))
    return summarize(now)


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
            plan = rule(best.settle(now))
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
        if not (steep := now.steep_pieces(v)):
            continue
        ends, gone = [0.0, *known, 1.0], set[float]()
        room = {b: c - a for a, b, c in zip(ends, ends[1:], ends[2:], strict=False)}
        free = {*known[v in plan.stops :]} - {1.0}
        for k in steep:
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
        if plan.crowded and room <= 0:
            break
        if now.sizes[v] <= now.task.aim:
            break
        if v not in plan.open or v in plan.settled:
            continue
        via = v in whole  # the point on the way of an arc becomes one, too
        more = _put_on_path(now, plan, v, room - via)
        old, new = (one.points.get(v, ()) for one in (plan, more))
        if old != new:
            room -= len(new) - len(old) + via
            if via:
                first = point_on_way(now.task.visits, v)
                whole -= {first, first + 1}
        plan = more
    return plan


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
            if stop == 0.0:
                return replace(plan, stops=plan.stops - {v}).put(v, rest)
            return replace(plan, stops=plan.stops | {v}).put(v, (stop, *rest))
    wanted = _on_path(now, v)
    new = wanted[: max(room, 0)]
    if len(new) < len(wanted):
        plan = replace(plan, crowded=True)
    return plan.put(v, (*known, *new)) if new else plan


def _find_stop(
    now: PathPrediction, plan: InsertionPlan, v: int
) -> tuple[InsertionPlan, float | None]:
    """Find where the arm stops to take up play before a path, as a share of it.

    How near does best is tried out, and whether any stop does: none is one at 0. None
    where nothing is left to try.
    """
    paths, k = now.path_to(v)
    samples = paths.samples(k)
    begin, length = paths.way[samples] < plan.open[v][0], float(paths.way[samples][-1])
    places = [there / length for there in TAKEN if there < LATEST * length]
    off = float(paths.after.across[samples][begin].max(initial=0.0))
    tried, here = plan.tried.get(v, ()), 0.0
    if v in plan.stops:
        here = plan.points[v][0]
    if not tried or (v in plan.stops and len(tried) <= len(places)):
        tried = (*tried, (off, here))
    stop, number = None, len(tried) - 1
    if off > now.task.aim and number <= len(places) and places:
        stop = places[number] if number < len(places) else min(tried)[1]
        if number == len(places):
            tried = (*tried, (0.0, stop))  # it is settled
            stop = stop if stop != here else None
    return replace(plan, tried={**plan.tried, v: tried}), stop


def _on_path(now: PathPrediction, v: int) -> list[float]:
    """Find what `_seek_on_path` does, once as long as nothing changes there."""
    wanted, plan = now.part_of(v).wanted, now.plan
    key = v, plan.points.get(v), plan.shut.get(v)
    if key not in wanted:
        wanted[key] = _seek_on_path(now, v)
    return wanted[key]


def _seek_on_path(now: PathPrediction, v: int) -> list[float]:
    """Find points in the parts of a path that are left too far, the worst first.

    Where the path is with them is foretold: it goes evenly from where one point moves
    it to the next one. In what is still too far off come the next points. Where it is
    open how flanks change nothing is foretold: the fewer points, the less they risk.
    """
    part, (paths, k) = now.part_of(v), now.path_to(v)
    samples = paths.samples(k)
    way, tangent = paths.way[samples], paths.tangent[samples]
    off, far = part.off_at_points[samples], paths.after.across[samples]
    found: list[float] = []
    for _ in range(1 if v in now.task.open_moves else FORETOLD):
        if not (new := _seek_in_parts(now, v, found, way, far)):
            break
        found += new
        known = [0.0, *now.plan.points.get(v, ()), 1.0]
        far, _ = apart(off - _move_between(way, off, known, found), tangent)
    return found


def _move_between(
    way: Floats, off: Floats, known: Sequence[float], new: Sequence[float]
) -> Floats:
    """Say by what new points move a path, (s, 3) [m].

    Args:
        way: Path length at its samples, (s,) [m].
        off: What points there are to move it by, (s, 3) [m].
        known: The points that it has, and its ends, shares of its way.
        new: .. and the new ones.
    """
    places = np.array([*known, *new]) * way[-1]
    by = np.zeros((len(places), 3))
    at = np.searchsorted(way, places[len(known) :])
    by[len(known) :] = off[at.clip(0, len(way) - 1)]
    order = np.argsort(places)
    columns = by[order].T
    moved = [np.interp(way, places[order], column) for column in columns]
    return np.stack(moved, axis=1)


def _seek_in_parts(
    now: PathPrediction, v: int, more: Sequence[float], way: Floats, far: Floats
) -> list[float]:
    """Find a point in every part of a path that is left too far, the worst first.

    Args:
        now: The program.
        v: The visit that the path leads to.
        more: Points that it is to have beside its own.
        way: Path length at its samples, (s,) [m].
        far: How far it is left there, (s,) [m].
    """
    plan = now.plan
    known = sorted([*plan.points.get(v, ()), *more])
    shut = plan.shut.get(v, ())
    least, clear, behind = plan.open[v]
    ends = [0.0, *(share * way[-1] for share in known), float(way[-1])]
    found = []
    for i, (a, b) in enumerate(pairwise(ends)):
        low = a + (clear if i == 0 else least)
        high = b - (behind if i == len(known) else least)
        if high < low or any(a < share * way[-1] < b for share in shut):
            continue
        inside = slice(way.searchsorted(a), way.searchsorted(b, side="right"))
        if inside.start == inside.stop:
            continue
        top = inside.start + far[inside].argmax()
        if far[top] > now.task.aim:
            at = min(max(float(way[top]), low), high)
            found.append((float(far[top]), at / float(way[-1])))
    return [share for _, share in sorted(found, reverse=True)]
