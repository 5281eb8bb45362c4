"""Where arcs are cut: at the points on their ways too, and what becomes of flat pieces.

A piece that bends too little for what its corrections differ by is a chord where that
leaves the arc by little enough; else it is halved, or goes on to the next cut.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from postproc.compensation.paths.arcs import (
    STRAIGHT,
    Cut,
    flat_pieces,
    is_arc,
    point_on_way,
)
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.robot.pose import MM


def join_flat_pieces(
    work: InsertionPlan, flat: Mapping[Cut, float]
) -> dict[int, tuple[float, ...]]:
    """Return the points of arcs with flat pieces, one less where one can go.

    Args:
        work: The points.
        flat: Those pieces, see `bending`.
    """
    found = {}
    for (v, end), bent in flat.items():
        if v in found or v not in work.points or may_be_chord(work, (v, end), bent):
            continue
        known = work.points[v]
        begin = max((s for s in known if s < end), default=0.0)
        gone = end if end < 1.0 else begin
        found[v] = tuple(s for s in known if s != gone)
    return found


def cut_at_vias(work: InsertionPlan) -> None:
    """Cut arcs that are cut anywhere at the points on their ways as well."""
    visits = work.source.reading.visits
    for v in [v for v in work.points if is_arc(visits, v)]:
        via = point_on_way(visits, v)
        work.points[via] = tuple(sorted({*work.points.get(via, ()), 1.0}))


def new_chords(work: InsertionPlan, flat: Mapping[Cut, float]) -> set[Cut]:
    """Find pieces of arcs that are too flat for arcs, and may be chords."""
    may = {cut for cut, bent in flat.items() if may_be_chord(work, cut, bent)}
    return may - work.chords


def halve_flat_pieces(
    work: InsertionPlan, flat: Mapping[Cut, float], changed: set[int]
) -> dict[int, list[float]]:
    """Return the points of arcs with pieces that are too flat, and no chords yet.

    Args:
        work: The points.
        flat: Those pieces, see `bending`.
        changed: Moves that change anyway.
    """
    room, found = work.room, dict[int, list[float]]()
    for (v, end), bent in flat.items():
        work.crowded |= room <= 0
        if room <= 0 or v in changed or may_be_chord(work, (v, end), bent):
            continue
        known = found.get(v, [*work.points.get(v, ())])
        begin = max((s for s in known if s < end), default=0.0)
        size = (end - begin) * float(work.paths.way[work.paths.samples_to(v)][-1])
        shut = any(begin < share < end for share in work.shut.get(v, ()))
        if v in work.open and not shut and size >= 2 * work.open[v][0]:
            found[v] = [*known, (begin + end) / 2]
            room -= 1
    return found


def may_be_chord(work: InsertionPlan, cut: Cut, bent: float) -> bool:
    """Tell whether a piece that bends so little may be a chord, but the last."""
    last = cut[1] == 1.0 and not work.source.reading.visits.via[cut[0]]
    return bent <= STRAIGHT * work.tolerance and not last


def bending(work: InsertionPlan) -> dict[Cut, float]:
    """What the pieces of arcs bend that are too flat for arcs [m]."""
    visits = work.latest.reading.visits
    values = work.latest.kept.decisions.corrected
    moved = (values - visits.values)[:, :3] * MM
    ends = {
        row: (half, share)
        for via in work.cut_arcs()
        for half in (via, via + 1)
        for row, share in zip(
            work.ends(half), (*work.points.get(half, ()), 1.0), strict=False
        )
    }
    arcs = [row - 1 for row in sorted(ends) if visits.via[row - 1]]
    found = flat_pieces(visits, moved, np.array(arcs, dtype=np.int64))
    return {ends[row]: bent for row, bent in found}


def whole_arcs(work: InsertionPlan) -> set[int]:
    """Return both visits of arcs that are not cut."""
    via = work.source.reading.visits.via
    arcs = np.flatnonzero(via & ~np.isin(np.arange(len(via)), work.cut_arcs()))
    return {*arcs.tolist(), *(arcs + 1).tolist()}
