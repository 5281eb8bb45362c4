"""Ways corrected between the targets: points where a path would be left too far.

A point is put where the predicted deviation of a move is largest, corrected as every
target is, and the program is predicted again, until no move leaves its path farther
than asked for or no point helps. Where a joint changes its flank that gives a point on
the old flank and one on the new, and few others.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from math import hypot

import numpy as np

from postproc.compensation.options import Job
from postproc.compensation.paths.arc_splitting import (
    bending,
    cut_at_vias,
    halve_flat_pieces,
    join_flat_pieces,
    new_chords,
    whole_arcs,
)
from postproc.compensation.paths.arcs import Cut, halves, point_on_way
from postproc.compensation.paths.insertion_plan import InsertionPlan, Write, of_source
from postproc.compensation.paths.insertion_report import Insertions
from postproc.compensation.paths.path_error import sizes_of
from postproc.compensation.paths.plan_outcomes import BEGINS, compare
from postproc.compensation.paths.prune import judge
from postproc.compensation.paths.reapproach import (
    find_reapproaches,
    insert_reapproaches,
)
from postproc.compensation.paths.split_selection import find_split
from postproc.compensation.pipeline import CompensatedProgram
from postproc.compensation.timing_comparison import InTime
from postproc.language.languages import language_of
from postproc.robot.pose import MM

ROUNDS = 16  # of points put on the ways
BETTER = 1e-6  # [m] less is no matter
PRELOAD = "Preload the backlash: compensation.preload_backlash"
MEASURE_STARTS = (
    "Measure how the joints change their flanks: survey.reversals, or diagnose --path"
)
BY_HAND = "Change what the reason names, or put targets on its way in the program"
MORE_ROOM = "Allow more points: --max-inserted"
SHORTER = "A lower speed, or a smaller [limits] segment_ms, allows shorter pieces"
TAKEN = 2e-5, 1e-4, 3e-4  # [m] from where a move begins: where play is taken up
LATEST = 0.9  # of a way: the last place of it for a stop


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
    work = InsertionPlan(draft, first, setting, write, splitter)
    if setting.options.reapproach:
        insert_reapproaches(work)
    find_split(work)
    if work.open or work.approaches:
        best = BestPoints(work)
        _improve(work, best)
        _bend(work, best)
        best.restore()
        judge(work)
    return _result(work)


def _improve(work: InsertionPlan, best: BestPoints) -> None:
    """Put points on the ways until none is left too far, or none helps."""
    for _ in range(ROUNDS):
        if _drop_where_steep(work):
            work.make()
            continue
        flat = bending(work)
        best.note(flat)
        new = dict(_new_points(work))
        chords = new_chords(work, flat)
        more = halve_flat_pieces(work, flat, {*new, *(v for v, _ in chords)})
        if not new and not chords and not more:
            return
        for v, shares in (new | more).items():
            work.points[v] = tuple(sorted(map(float, shares)))
        work.chords |= chords
        cut_at_vias(work)
        work.make()


def _drop_where_steep(work: InsertionPlan) -> bool:
    """Take back points beside which corrections change faster than they may.

    The error itself changes fast there, and all points of the way would be left for it:
    over a longer piece it changes less.
    """
    changed = False
    for v, known in [*work.points.items()]:
        ends, gone = [0.0, *known, 1.0], set[float]()
        room = {b: c - a for a, b, c in zip(ends, ends[1:], ends[2:], strict=False)}
        free = {*known[v in work.stops :]} - {1.0}
        for k in work.steep_pieces(v):
            if either := free.intersection(ends[k : k + 2]):
                gone.add(max(either, key=room.__getitem__))
        if gone:
            work.drop(v, gone)
            work.shut.setdefault(v, set()).update(gone)
            changed = True
    return changed


def _bend(work: InsertionPlan, best: BestPoints) -> None:
    """Let pieces of arcs that are too flat go on to the next cut."""
    for _ in range(ROUNDS):
        flat, changed = bending(work), False
        best.note(flat)
        for v, points in join_flat_pieces(work, flat).items():
            changed |= points != work.points[v]
            if points[:1] != work.points[v][:1]:
                work.stops.discard(v)  # what comes first now is passed
            work.points[v] = points
        work.points = {v: points for v, points in work.points.items() if points}
        if not changed:
            return
        work.make()


def _new_points(work: InsertionPlan) -> Iterator[tuple[int, list[float]]]:
    """Yield the points of moves that get more of them, by their visit."""
    room = work.room
    sizes, whole = work.paths.after.sizes, whole_arcs(work)
    for k in np.argsort(-sizes, kind="stable").tolist():
        v = int(work.paths.visit[k])
        known, via = work.points.get(v, ()), v in whole
        near = v in work.beside and known in ((), (1.0,))
        if v not in work.open or sizes[k] <= (work.tolerance / 2 if near else work.aim):
            continue
        left = room - via  # the point on the way of an arc becomes one, too
        stop = _stop(work, k, v) if v in work.idle and left > 0 else None
        if stop is not None:
            left -= v not in work.stops
            more = [stop, *known[v in work.stops :]]
            work.stops.add(v)
        else:
            wanted = _on_path(work, k, v)
            new = wanted[: max(left, 0)]
            work.crowded |= len(new) < len(wanted)
            left -= len(new)
            more = [*known, *new] if new else []
        if more:
            room = left
            if via:
                first = point_on_way(work.source.reading.visits, v)
                whole -= {first, first + 1}
            yield v, more


def _stop(work: InsertionPlan, k: int, v: int) -> float | None:
    """Find where the arm stops to take up play before a path, as a share of it.

    How near does best is tried out. None where nothing is left to try.
    """
    paths, samples = work.paths, work.paths.samples(k)
    begin, length = paths.way[samples] < work.open[v][0], float(paths.way[samples][-1])
    places = [there / length for there in TAKEN if there < LATEST * length]
    off = float(paths.after.across[samples][begin].max(initial=0.0))
    tried = work.tried.setdefault(v, [])
    if v in work.stops and len(tried) < len(places):
        tried.append((off, work.points[v][0]))
    if off <= work.aim or len(tried) > len(places) or not places:
        return None
    if len(tried) == len(places):
        best = min(tried)[1]
        tried.append((0.0, best))  # it is settled
        return best if best != work.points[v][0] else None
    return places[len(tried)]


def _on_path(work: InsertionPlan, k: int, v: int) -> list[float]:
    """Find a point in every part of a path that is left too far, the worst first."""
    paths, samples = work.paths, work.paths.samples(k)
    way, far = paths.way[samples], paths.after.across[samples]
    known, shut = work.points.get(v, ()), work.shut.get(v, ())
    least, clear, behind = work.open[v]
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
        if far[top] > work.aim:
            at = min(max(float(way[top]), low), high)
            found.append((float(far[top]), at / float(way[-1])))
    return [share for _, share in sorted(found, reverse=True)]


def _result(work: InsertionPlan) -> CompensatedProgram:
    """Tell of the program as of the source's visits."""
    told = work.latest.in_time or work.first
    in_time = replace(
        told,
        before=work.first.before,
        other_side=told.other_side[work.own],
        inserted=_report_insertions(work, told),
    )
    kept = of_source(work.latest.kept, work.own)
    return replace(work.latest, kept=kept, in_time=in_time)


def _report_insertions(work: InsertionPlan, told: InTime) -> Insertions:
    """Say what was put on ways, and why moves that are left too far got nothing."""
    why = "its pieces would be too short, or the path no better"
    if work.crowded:
        why = "no more points may be inserted (max_inserted)"
    too_far = set(work.paths.visit[work.too_far].tolist()) - work.points.keys()
    visits, left = work.source.reading.visits, {}
    for v in sorted(too_far):  # what is known of one half of an arc is so of both
        halved = (work.left[h] for h in halves(visits, v) if h in work.left)
        left[v] = work.left.get(v) or next(halved, why)
    return Insertions(
        work.own,
        work.tolerance,
        work.points,
        work.stops & work.points.keys(),
        left,
        sizes_of(work.first.paths),
        _promises(work, told),
        find_reapproaches(work, told),
        frozenset(work.unconfirmed),
        _cures(work, told),
        _cell_speed(work),
    )


def _cell_speed(work: InsertionPlan) -> float:
    """Return the speed of the cell if moves with points are judged at it [mm/s]."""
    speed = work.setting.cell.file.motion.linear_mm_s or 0.0
    own = work.first.before.targets.linear_speed[sorted(work.points)] / MM
    return speed if np.isclose(own, speed).any() else 0.0


def _cures(work: InsertionPlan, told: InTime) -> dict[int, str]:
    """Say what helps the moves that are left too far, by visit."""
    visits, found = work.source.reading.visits, {}
    for k in work.too_far.tolist() if work.splitter is not None else ():
        v, largest = int(told.paths.visit[k]), told.paths.after.largest[k]
        known = [work.cures[h] for h in halves(visits, v) if work.cures.get(h)]
        if known:
            found[v] = known[0]
        elif v not in work.open:
            found[v] = BY_HAND
        elif told.paths.way[largest] < BEGINS and v not in work.stops:
            found[v] = MEASURE_STARTS if v in work.unconfirmed else PRELOAD
        else:
            found[v] = MORE_ROOM if work.crowded else SHORTER
    return found


def _promises(work: InsertionPlan, told: InTime) -> dict[int, float]:
    """Return what 95 % of every move stays within by all open hypotheses [m]."""
    visits = work.source.reading.visits
    moves = {halves(visits, v) for v in told.paths.visit.tolist()}
    return {
        v: compare((told.paths,), rows, work.tolerance).choose()[1]
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


class BestPoints:
    """What did best for every move that may be split, so far.

    Points are put where a path is left the farthest, one after the other; near a place
    where two joints turn back a next one can make the move worse.
    """

    def __init__(self, work: InsertionPlan) -> None:
        """Begin with nothing."""
        self._best: dict[int, _Tried] = {}
        self._refused: dict[int, str] = {}
        self._work = work

    def note(self, flat: Collection[Cut]) -> None:
        """Look at how the moves do with the points that they have now.

        Args:
            flat: Pieces of arcs that are too flat, see `bending`.
        """
        refused = self._refusals()
        self._refused = refused | self._refused  # what was said first
        bad = self._unfit(flat, refused)
        for v, tried in self._now().items():
            known = self._best.setdefault(v, tried)
            if v not in bad and tried.size <= known.size + BETTER:  # the later one
                self._best[v] = replace(tried, size=min(tried.size, known.size))

    def restore(self) -> None:
        """Give moves back the points that did better than those they have."""
        work, now = self._work, self._now()
        bad = self._unfit(bending(work), self._refusals())
        worse = [
            v for v in now if v in bad or (now[v].size > self._best[v].size + BETTER)
        ]
        for v in worse:
            has, best = now[v], self._best[v]
            others = {k: s for k, s in work.points.items() if k not in has.points}
            work.points = {**others, **best.points}
            work.stops = work.stops - has.stops | best.stops
            work.chords = work.chords - has.chords | best.chords
        for v in self._refused.keys() - work.points.keys():
            work.left[v] = self._refused[v]
        if worse:
            work.make()

    def _refusals(self) -> dict[int, str]:
        """Say why points of moves cannot be corrected, by their visits."""
        work = self._work
        return {v: told for v in work.points if (told := work.refusal(v))}

    def _unfit(self, flat: Collection[Cut], refused: Collection[int]) -> set[int]:
        """Return the moves with flat pieces, or refused points, by first visits."""
        visits = self._work.source.reading.visits
        return {halves(visits, v)[0] for v in (*(v for v, _ in flat), *refused)}

    def _now(self) -> dict[int, _Tried]:
        """Say what the moves have now, by their first visits, and how they do."""
        work, sizes = self._work, sizes_of(self._work.paths)
        found = {}
        for own in {halves(work.source.reading.visits, v) for v in work.open}:
            found[own[0]] = _Tried(
                hypot(*(sizes.get(row, np.inf) for row in own)),
                {row: work.points[row] for row in own if row in work.points},
                frozenset(work.stops.intersection(own)),
                frozenset(cut for cut in work.chords if cut[0] in own),
            )
        return found
