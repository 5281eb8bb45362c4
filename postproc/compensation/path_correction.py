"""Ways corrected between the targets: points where a path would be left too far.

A point is put where the predicted deviation of a move is largest, corrected as every
target is, and the program is predicted again, until no move leaves its path farther
than asked for or no point helps. Where a joint changes its flank that gives a point on
the old flank and one on the new, and few others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from postproc.compensation.approach_anew import approach_anew, approached
from postproc.compensation.arc_cuts import (
    bending,
    cut_at_vias,
    halved,
    joined,
    new_chords,
    whole_arcs,
)
from postproc.compensation.arc_splitting import halves, point_on_way
from postproc.compensation.best_points import BestPoints
from postproc.compensation.correction import Draft
from postproc.compensation.options import Setting
from postproc.compensation.path_judging import judge, largest_on_moves, sizes_of
from postproc.compensation.path_points import Insertions
from postproc.compensation.path_work import PathWork, Write, of_source
from postproc.compensation.split_moves import find_split
from postproc.exceptions import PostprocError
from postproc.language.languages import language_of

ROUNDS = 16  # of points put on the ways
TAKEN = 2e-5, 1e-4, 3e-4  # [m] from where a move begins: where play is taken up


def correct_paths(draft: Draft, setting: Setting, write: Write) -> Draft:
    """Put points on the ways of a corrected program where it leaves them too far.

    Args:
        draft: The program, run in time.
        setting: What it is compensated with, a tolerance of paths among it.
        write: Writes a corrected program, and reads it again.

    Returns:
        The program, `kept` speaking of the visits of the source.

    Raises:
        PostprocError: Targets cannot be approached anew in its language.
    """
    reading, first = draft.reading, draft.in_time
    if first is None or not setting.options.inserts:
        return draft
    language = language_of(reading.sources[0].name)
    splitter = language.splitter(reading.sources)
    if splitter is None and setting.options.approach:
        raise PostprocError(
            f"--approach: targets are not approached anew in {language.name} programs. "
            "Leave it out: side-not-sure says how to approach them"
        )
    work = PathWork(draft, first, setting, write, splitter)
    if splitter is not None and setting.options.approach:
        approach_anew(work, splitter)
    find_split(work)
    if work.open or work.approaches:
        best = BestPoints(work)
        _improve(work, best)
        _bend(work, best)
        best.restore()
        judge(work)
    return _result(work)


def _improve(work: PathWork, best: BestPoints) -> None:
    """Put points on the ways until none is left too far, or none helps."""
    for _ in range(ROUNDS):
        flat = bending(work)
        best.note(flat)
        new = dict(_new_points(work))
        chords = new_chords(work, flat)
        more = halved(work, flat, {*new, *(v for v, _ in chords)})
        if not new and not chords and not more:
            return
        for v, shares in (new | more).items():
            work.points[v] = tuple(sorted(map(float, shares)))
        work.chords |= chords
        cut_at_vias(work)
        work.make()


def _bend(work: PathWork, best: BestPoints) -> None:
    """Let pieces of arcs that are too flat go on to the next cut."""
    for _ in range(ROUNDS):
        flat, changed = bending(work), False
        best.note(flat)
        for v, points in joined(work, flat).items():
            changed |= points != work.points[v]
            if points[:1] != work.points[v][:1]:
                work.stops.discard(v)  # what comes first now is passed
            work.points[v] = points
        work.points = {v: points for v, points in work.points.items() if points}
        if not changed:
            return
        work.make()


def _new_points(work: PathWork) -> Iterator[tuple[int, list[float]]]:
    """Yield the points of moves that get more of them, by their visit."""
    room = work.room
    sizes, whole = work.paths.after.sizes, whole_arcs(work)
    for k in np.argsort(-sizes, kind="stable").tolist():
        v = int(work.paths.visit[k])
        if v not in work.open or sizes[k] <= work.aim:
            continue
        known, via = work.points.get(v, ()), v in whole
        left = room - via  # the point on the way of an arc becomes one, too
        stop = _stop(work, k, v) if v in work.idle and left > 0 else None
        if stop is not None:
            left -= v not in work.stops
            more = [stop, *known[v in work.stops :]]
            work.stops.add(v)
        else:
            new = _on_path(work, k, v)[: max(left, 0)]
            left -= len(new)
            more = [*known, *new] if new else []
        if more:
            room = left
            if via:
                first = point_on_way(work.source.reading.visits, v)
                whole -= {first, first + 1}
            yield v, more


def _stop(work: PathWork, k: int, v: int) -> float | None:
    """Find where the arm stops to take up play before a path, as a share of it.

    How near does best is tried out. None where nothing is left to try.
    """
    paths, samples = work.paths, work.paths.samples(k)
    begin = paths.way[samples] < work.open[v][0]
    off = float(paths.after.across[samples][begin].max(initial=0.0))
    tried = work.tried.setdefault(v, [])
    if v in work.stops and len(tried) < len(TAKEN):
        tried.append((off, work.points[v][0]))
    if off <= work.aim or (v in work.stops and _settled(work, v)):
        return None
    if len(tried) == len(TAKEN):
        best = min(tried)[1]
        tried.append((0.0, best))
        return best if best != work.points[v][0] else None
    return TAKEN[len(tried)] / float(paths.way[samples][-1])


def _settled(work: PathWork, v: int) -> bool:
    """Tell whether a move stops where it does best."""
    return len(work.tried.get(v, ())) > len(TAKEN)


def _on_path(work: PathWork, k: int, v: int) -> list[float]:
    """Find a point in every part of a path that is left too far, the worst first.

    Args:
        work: The points.
        k: The path.
        v: The visit at its end.
    """
    paths, samples = work.paths, work.paths.samples(k)
    way, far = paths.way[samples], paths.after.across[samples]
    known = work.points.get(v, ())
    least, clear, behind = work.open[v]
    ends = [0.0, *(share * way[-1] for share in known), float(way[-1])]
    found = []
    for i, (a, b) in enumerate(pairwise(ends)):
        low = a + (clear if i == 0 else least)
        high = b - (behind if i == len(known) else least)
        inside = np.flatnonzero((way >= a) & (way <= b))
        if high < low or not len(inside):
            continue
        top = inside[far[inside].argmax()]
        if far[top] > work.aim:
            at = min(max(float(way[top]), low), high)
            found.append((float(far[top]), at / float(way[-1])))
    return [share for _, share in sorted(found, reverse=True)]


def _why_left(work: PathWork, v: int, why: str) -> str:
    """Say why a move is left; what is said of one half of an arc is so of both."""
    both = halves(work.source.reading.visits, v)
    return work.left.get(v) or next((work.left[h] for h in both if h in work.left), why)


def _result(work: PathWork) -> Draft:
    """Tell of the program as of the source's visits."""
    told = work.latest.in_time or work.first
    why = "its pieces would be too short, or the path no better"
    if work.room <= 0:
        why = "no more points may be put on ways (--max-inserted)"
    too_far = set(work.paths.visit[work.too_far].tolist()) - work.points.keys()
    otherwise = largest_on_moves(told.paths, told.paths.otherwise)
    inserted = Insertions(
        work.own,
        work.tolerance,
        work.points,
        work.stops & work.points.keys(),
        {v: _why_left(work, v, why) for v in sorted(too_far)},
        sizes_of(work.first.paths),
        {v: far for v, (far, _) in otherwise.items()}
        if work.latest is not work.source
        else {},
        approached(work, told),
        frozenset(work.unconfirmed),
    )
    in_time = replace(
        told,
        before=work.first.before,
        other_side=told.other_side[work.own],
        inserted=inserted,
    )
    kept = of_source(work.latest.kept, work.own)
    return replace(work.latest, kept=kept, in_time=in_time)
