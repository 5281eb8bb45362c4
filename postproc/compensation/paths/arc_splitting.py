"""Where arcs are cut: at the points on their ways too, and what becomes of flat pieces.

A piece that bends too little for what its corrections differ by is a chord where that
leaves the arc by little enough; else it is halved, or goes on to the next cut.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from postproc.compensation.paths.arcs import Cut, is_arc, point_on_way
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.insertion_prediction import PathPrediction
from postproc.language.visits import Visits


def join_flat_pieces(now: PathPrediction) -> InsertionPlan:
    """Let flat pieces of arcs go on to the next cut: one point less where one can go.

    What comes first then is passed, and no stop.
    """
    plan, seen = now.plan, set[int]()
    for v, end in now.flat:
        known = now.plan.points.get(v, ())
        if v in seen or not known or now.may_be_chord((v, end)):
            continue
        seen.add(v)
        begin = max((s for s in known if s < end), default=0.0)
        rest = tuple(s for s in known if s != (end if end < 1.0 else begin))
        if rest[:1] != known[:1]:
            plan = replace(plan, stops=plan.stops - {v})
        plan = plan.put(v, rest)
    return plan


def cut_at_vias(visits: Visits, plan: InsertionPlan) -> InsertionPlan:
    """Cut arcs that are cut anywhere at the points on their ways as well."""
    for v in [v for v in plan.points if is_arc(visits, v)]:
        via = point_on_way(visits, v)
        plan = plan.put(via, {*plan.points.get(via, ()), 1.0})
    return plan


def new_chords(now: PathPrediction) -> frozenset[Cut]:
    """Find pieces of arcs that are too flat for arcs, and may be chords."""
    return frozenset(filter(now.may_be_chord, now.flat)) - now.plan.chords


def halve_flat_pieces(
    now: PathPrediction, plan: InsertionPlan, changed: Collection[int]
) -> InsertionPlan:
    """Halve pieces of arcs that are too flat, and no chords.

    Args:
        now: The program.
        plan: Its points, and more.
        changed: Moves that change anyway.
    """
    room = now.room
    for v, end in now.flat:
        plan = replace(plan, crowded=plan.crowded or room <= 0)
        if room <= 0 or v in changed or now.may_be_chord((v, end)):
            continue
        known = plan.points.get(v, ())
        begin = max((s for s in known if s < end), default=0.0)
        paths, k = now.path_to(v)
        size = (end - begin) * float(paths.way[paths.samples(k)][-1])
        shut = any(begin < share < end for share in plan.shut.get(v, ()))
        if v in plan.open and not shut and size >= 2 * plan.open[v][0]:
            plan = plan.put(v, (*known, (begin + end) / 2))
            room -= 1
    return plan


def whole_arcs(now: PathPrediction) -> set[int]:
    """Return both visits of arcs that are not cut."""
    via = now.task.visits.motion.via
    arcs = np.flatnonzero(via & ~np.isin(np.arange(len(via)), now.cut_arcs))
    return {*arcs.tolist(), *(arcs + 1).tolist()}
