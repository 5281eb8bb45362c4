"""Points on ways that make a move no better for certain are taken back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from postproc.arrays import Bools, Floats, any_in_rows
from postproc.compensation.paths.arc_splitting import bending, may_be_chord
from postproc.compensation.paths.arcs import (
    Cut,
    halves,
    is_arc,
    largest_zones,
    measure_passing,
    point_on_way,
    zone_sizes,
)
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.path_error import apart, sizes_of
from postproc.compensation.paths.plan_outcomes import Objection, compare
from postproc.compensation.paths.reapproach import WORSE, bad_approaches
from postproc.compensation.timing_comparison import InTime
from postproc.robot.pose import lengths

JUDGED = 8  # rounds in which points are taken back
NEAR = 4  # visits behind a move that may be worse for its points
MOVED = 5e-6  # [m] that a rounded corner may move


def judge(work: InsertionPlan) -> None:
    """Take back points that make moves no better for certain."""
    choose_plans(work)
    without = _of_moves(work, sizes_of(work.first.paths))
    for k in range(JUDGED):
        bad = dict([*_harmful(work, without), *_bad(work, without)])
        anew = bad_approaches(work)
        if not bad and not anew:
            return
        for v, (why, share, cure) in bad.items():
            if share is None or k >= JUDGED / 2 or not _thin_out(work, v, share):
                work.left[v], work.cures[v] = why, cure
                _take_back(work, v)
        for v in anew:
            work.left[v] = "a stop before its target is no help"
            _take_back(work, v)
        work.make()
    work.left |= dict.fromkeys(work.points, "its points change with every round")
    work.points.clear()
    work.approaches.clear()
    work.make()


def choose_plans(work: InsertionPlan) -> None:
    """Choose for every move with points how much of them it gets.

    See `choose_plan`: all points, those without the stop that preloads, points that
    correct half of what flanks change by, or none. What a hypothesis speaks against
    is thinned out first.
    """
    if not work.points:
        return
    full = _Inserted.of(work)
    variants = [full, *_variants(work, full)]
    made = [work.paths]
    for variant in variants[1:]:
        variant.insert(work)
        work.make()
        made.append(work.paths)
    full.insert(work)
    chosen: dict[int, _Inserted] = {}
    for rows in _moves_with_points(work):
        compared = compare((work.first.paths, *made), rows, work.tolerance)
        best, _ = compared.choose()
        if best:
            chosen |= dict.fromkeys(rows, variants[best - 1])
        elif compared.objection(1) is None:
            for v in work.points.keys() & {*rows}:
                work.left[v] = "inserted points make it no better"
                _take_back(work, v)
    for v, variant in chosen.items():
        variant.insert_into(work, v)
    work.make()


def _variants(work: InsertionPlan, full: _Inserted) -> Iterator[_Inserted]:
    """Yield the points without stops, and those that correct half; work is changed."""
    plain = full
    if work.stops:
        for v in sorted(work.stops):
            work.stops.discard(v)
            work.drop(v, {work.points[v][0]})
        plain = _Inserted.of(work)
        yield plain
    if any(flank.open_kinds for flank in work.flanks):
        yield replace(plain, halved=frozenset(plain.points))


@dataclass(frozen=True)
class _Inserted:
    """What a plan inserts, as in `InsertionPlan`."""

    points: Mapping[int, tuple[float, ...]]
    stops: frozenset[int]
    chords: frozenset[Cut]
    halved: frozenset[int] = frozenset()

    @classmethod
    def of(cls, work: InsertionPlan) -> _Inserted:
        """Take what a program has now."""
        return cls({**work.points}, frozenset(work.stops), frozenset(work.chords))

    def insert(self, work: InsertionPlan) -> None:
        """Give all moves what they have here."""
        for v in [*(work.points.keys() | self.points.keys())]:
            self.insert_into(work, v)

    def insert_into(self, work: InsertionPlan, v: int) -> None:
        """Give one visit what it has here."""
        work.points.pop(v, None)
        if v in self.points:
            work.points[v] = self.points[v]
        work.stops = work.stops - {v} | (self.stops & {v})
        work.halved = work.halved - {v} | (self.halved & {v})
        others = {cut for cut in work.chords if cut[0] != v}
        work.chords = others | {cut for cut in self.chords if cut[0] == v}


def _moves_with_points(work: InsertionPlan) -> list[tuple[int, ...]]:
    """Return the visits of every move with points, of arcs both."""
    visits = work.source.reading.visits
    return sorted({halves(visits, v) for v in work.points})


def _thin_out(work: InsertionPlan, v: int, share: float) -> bool:
    """Take back the points around a place of a move, if that leaves others."""
    known = work.points.get(v, ())
    free = np.array([s for s in known[v in work.stops :] if s < 1.0])
    behind = int(np.searchsorted(free, share))
    gone = set(free[max(behind - 1, 0) : behind + 1].tolist())
    if not gone or len(gone) == len(free):
        return False
    work.drop(v, gone)
    return True


def _take_back(work: InsertionPlan, v: int) -> None:
    """Take back the points of a move; an arc that is cut no more stays whole."""
    own = work.points.pop(v, ())
    work.stops.discard(v)
    work.halved.discard(v)
    work.approaches.pop(v, None)
    visits = work.source.reading.visits
    if not is_arc(visits, v):
        return
    via = point_on_way(visits, v)
    if own in ((), (1.0,)):  # what it has is the cut at the point on the way alone
        work.points.pop(via, None)
        work.points.pop(via + 1, None)
    elif v == via and via + 1 in work.points:
        work.points[via] = (1.0,)
    elif work.points.get(via) == (1.0,):
        del work.points[via]


class Removal(NamedTuple):
    """Why points must go, at what share of the way if not all of them, and the cure."""

    why: str
    share: float | None = None
    cure: str = ""


def _bad(
    work: InsertionPlan, without: dict[int, float]
) -> Iterator[tuple[int, Removal]]:
    """Yield the moves with points that must go, and why."""
    told = work.latest.in_time
    if not work.points or told is None:
        return
    flat = bending(work)
    bent = {cut[0] for cut, far in flat.items() if not may_be_chord(work, cut, far)}
    moved = told.before.path.aside[work.own] - work.first.before.path.aside
    there = any_in_rows(np.abs(np.nan_to_num(moved)) > MOVED)
    there[work.cut_arcs()] = False  # judged as the points that they are
    before = work.source.reading.visits.before
    judged = _Judged(
        work, without, _worst(work, told), _objections(work, told),
        there | (there[before] & (before >= 0)), bent,
    )  # fmt: skip
    for v in sorted(_with_points(work)):
        if reason := judged.why_not(v):
            yield v, reason


@dataclass(frozen=True)
class _Judged:
    """What is known of moves with points.

    Attributes:
        work: The points.
        without: How far each move leaves its path without points [m].
        worst: .. and with them at the most, however they are rounded, and where.
        objections: Which hypotheses make moves worse, and where.
        corner: Moves with a rounded corner at an end that is passed otherwise, (n,).
        bent: Arcs with pieces that bend too little.
    """

    work: InsertionPlan
    without: dict[int, float]
    worst: dict[int, tuple[float, float]]
    objections: dict[int, Objection]
    corner: Bools
    bent: set[int]

    def why_not(self, v: int) -> Removal | None:
        """Say why the points of a move must go, None where they may stay."""
        if v not in self.worst:
            return Removal("with inserted points its path is not predicted")
        if v in self.bent:
            return Removal("its pieces would be too straight for arcs")
        if refused := self.work.refusal(v):
            return Removal(refused)
        far, share = self.worst[v]
        if far > self.without[v]:
            return Removal("inserted points make it no better", share)
        if v in self.objections:
            objection = self.objections[v]
            return Removal(str(objection), objection.place % 1.0, objection.cure)
        if self.corner[v]:
            return Removal("a rounded corner at one of its ends would move")
        return None


def _with_points(work: InsertionPlan) -> set[int]:
    """Return the moves with points, of arcs that are cut both halves."""
    return {*work.points, *(via + 1 for via in work.cut_arcs())}


def _harmful(
    work: InsertionPlan, without: dict[int, float]
) -> Iterator[tuple[int, Removal]]:
    """Yield moves with points behind which moves without any are worse for them.

    From which flank a joint leaves is a matter of the moves before.
    """
    now = _of_moves(work, sizes_of(work.paths))
    cut = np.array(sorted(work.points), dtype=np.int64)
    for v in now.keys() - _with_points(work) - work.approaches.keys():
        last = int(np.searchsorted(cut, v)) - 1
        near = last >= 0 and v - cut[last] <= NEAR
        if near and now[v] > without.get(v, np.inf) + WORSE:
            yield int(cut[last]), Removal("a later move would be worse")


def _objections(work: InsertionPlan, told: InTime) -> dict[int, Objection]:
    """Say which hypotheses make moves with points worse, and at what share."""
    found = {}
    for rows in _moves_with_points(work):
        compared = compare((work.first.paths, told.paths), rows, work.tolerance)
        objection = compared.objection(1)
        if objection is not None:
            found[rows[int(objection.place)]] = objection
    return found


def _of_moves(work: InsertionPlan, far: dict[int, float]) -> dict[int, float]:
    """Say of both halves of an arc, which is one move, what the farther one is off."""
    visits = work.source.reading.visits
    return {v: max(far.get(row, 0.0) for row in halves(visits, v)) for v in far}


@dataclass(frozen=True)
class _Corner:
    """How a point on a way may be rounded.

    Attributes:
        half: Half of its largest zone [m].
        moved: What that moves the path by at the point, (3,) [m].
        done: How much of it the plan has.
        beside: How far an arc is passed besides [m].
    """

    half: float
    moved: Floats
    done: float
    beside: float

    def farthest(self, aside: Floats, off: Floats, tangent: Floats) -> Floats:
        """Say how far the path is off at the most, however the point is rounded, (s,).

        Args:
            aside: How far samples are from the point along the way, (s,) [m].
            off: From the path to the TCP there, (s, 3) [m].
            tangent: Directions of the path, (s, 3).
        """
        bend = 1 - (aside / max(self.half, 1e-12)) ** 2  # bounds chords and parabolas
        by = bend[:, None] * self.moved
        far = [apart(off + u * by, tangent)[0] for u in (-self.done, 1.0 - self.done)]
        return np.where(bend >= 0, np.maximum(*far) + self.beside * bend, 0.0)


def _worst(work: InsertionPlan, told: InTime) -> dict[int, tuple[float, float]]:
    """How far each move leaves its path, however its points are rounded.

    Returns:
        The distance [m], and where, as a share of the way.
    """
    rounded, found = _list_roundings(work, told), dict[int, tuple[float, float]]()
    for k, v in enumerate(told.paths.visit.tolist()):
        samples = told.paths.samples(k)
        way, off = told.paths.way[samples], told.paths.after.off[samples]
        tangent = told.paths.tangent[samples]
        worst = np.array(told.paths.after.across[samples])
        points = zip(work.points.get(v, ()), rounded.get(v, ()), strict=True)
        for share, corner in points:
            aside = np.abs(way - share * way[-1])
            worst = np.maximum(worst, corner.farthest(aside, off, tangent))
        found[v] = _largest_on(way, worst)
    return found


def _list_roundings(work: InsertionPlan, told: InTime) -> dict[int, list[_Corner]]:
    """Say how points on ways may be rounded, where they are no stops.

    No corner is larger than half of a neighbouring piece; what cuts it off straight
    passes the point farthest. On an arc it is no larger than zones are, by any law.
    """
    arm, found = work.setting.cell.arm, dict[int, list[_Corner]]()
    p, c = (
        arm.tcp(cycle.path.q, cycle.targets.tool[:, :3, 3])
        for cycle in (told.after, told.before)
    )
    visits, arcs = work.source.reading.visits, work.list_wanted_arcs()
    zone = largest_zones(arm, told.after) if len(arcs) else None
    planned = zone_sizes(arm, told.after, told.after.targets)
    for v, shares in work.points.items():
        rows = [int(work.own[visits.before[v]]), *work.ends(v)]
        if shares[-1] == 1.0:
            rows.append(work.ends(v + 1)[0])
        rows = rows[: len(shares) + 2]
        size = np.maximum(lengths(np.diff(p[rows], axis=0)), 1e-9)
        slope = np.diff((p - c)[rows], axis=0) / size[:, None]
        half = np.minimum(size[1:], size[:-1]) / 2
        beside = np.zeros(len(half))
        if zone is not None and is_arc(visits, v):
            half = np.minimum(half, zone[rows[1:-1]])
            beside = measure_passing(half, arcs.radius_of(v))
        moved = np.diff(slope, axis=0) * half[:, None] / 2
        done = np.minimum(planned[rows[1:-1]] / np.maximum(half, 1e-12), 1.0)
        moved[: int(v in work.stops)] = beside[: int(v in work.stops)] = 0.0
        found[v] = [*map(_Corner, half, moved, done, beside)]
    return found


# How far moves are from their paths, by the visit at their end.


def _largest_on(way: Floats, far: Floats) -> tuple[float, float]:
    """Return the largest distance on a way, and where, as a share of it."""
    top = int(far.argmax())
    return float(far[top]), float(way[top] / max(way[-1], 1e-12))
