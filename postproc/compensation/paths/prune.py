"""Points on ways that make a move no better for certain are taken back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from postproc.compensation.paths.arcs import halves
from postproc.compensation.paths.backlash_preload import LATEST, TAKEN
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.insertion_prediction import PathPrediction
from postproc.compensation.paths.plan_outcomes import (
    BEGINS,
    MoveOutcomes,
    Objection,
    Rows,
)
from postproc.compensation.paths.plan_rule import MoveDeviation, resolution
from postproc.compensation.paths.reapproach import WORSE, bad_approaches
from postproc.compensation.paths.rounded_points import measure_rounded
from postproc.language.visits import Visits

JUDGED = 8  # rounds in which points are taken back
NEAR = 4  # visits behind a move that may be worse for its points


def judge(now: PathPrediction) -> PathPrediction:
    """Take back points that make moves no better for certain."""
    task = now.task
    now = task.predict(choose_plans(now))
    without = _of_moves(now, task.deviations)
    for k in range(JUDGED):
        now, bad, anew = _find_bad(now, without)
        if not bad and not anew:
            return now
        plan = now.plan
        for v, removal in bad.items():
            plan = _remove(task.visits, plan, v, removal, thins_out=k < JUDGED / 2)
        for v in anew:
            plan = plan.leave(v, "a stop before its target is no help")
            plan = plan.take_back(task.visits, v)
        now = task.predict(plan)
    left = dict.fromkeys(now.plan.points, "its points change with every round")
    left = {**now.plan.left, **left}
    return task.predict(replace(now.plan, left=left, points={}, approaches={}))


def _find_bad(
    now: PathPrediction, without: dict[int, MoveDeviation]
) -> tuple[PathPrediction, dict[int, Removal], set[int]]:
    """Find what must go; where nothing must, write the program.

    It is judged again only if it does not come out as its windows did.

    Args:
        now: The program.
        without: How far each move leaves its path without points [m].

    Returns:
        What was looked at, the moves whose points must go, and the targets whose stops
        before them must.
    """
    while True:
        bad = dict([*_harmful(now, without), *_bad(now, without)])
        anew = bad_approaches(now) if now.plan.approaches else set()
        if bad or anew or now.written:
            return now, bad, anew
        now, alone = now.whole(), now
        if now.parts is alone.parts:
            return now, {}, set()


def choose_plans(now: PathPrediction) -> InsertionPlan:
    """Choose for every move with points how much of them it gets.

    See `choose_plan`: all points, those without the stop that preloads or with a later
    one, those with a later first point, points that correct half of what flanks change
    by, or none. What a hypothesis speaks against is thinned out later.
    """
    visits, chosen = now.task.visits, now.plan
    for rows, compared, plans in _try_plans(now):
        best, _ = compared.choice
        if best:
            for v in rows:
                chosen = chosen.as_in(plans[best - 1], v)
        elif compared.objection(1) is None:
            for v in now.plan.points.keys() & {*rows}:
                chosen = chosen.leave(v, "inserted points make it no better")
                chosen = chosen.take_back(visits, v)
    return chosen


def _try_plans(
    now: PathPrediction,
) -> Iterator[tuple[Rows, MoveOutcomes, list[InsertionPlan]]]:
    """Yield every move with points, how it does without and by some plans, and these.

    A later stop is looked at where something speaks against points with an early one,
    and a later first point where something speaks against one where the move begins.
    Half is looked at where nothing else keeps the finest promise, and it is expected to
    do better.
    """
    task, made = now.task, [now]
    if now.plan.stops:
        made.append(task.predict(now.plan.without_stops()))
    plain, moves = made[-1], task.compare(made, _moves_with_points(now))
    if later := _stop_later(now, moves):
        made.append(task.predict(now.plan.put_all(later)))
        moves |= task.compare(made, [(v,) for v in later])
    if later := _begin_later(plain, moves, 1 + made.index(plain)):
        made.append(task.predict(plain.plan.put_all(later)))
        moves |= task.compare(made, [(v,) for v in later])
    finest, halved = resolution(task.tolerance), dict[Rows, MoveOutcomes]()
    if any(flank.open_kinds for flank in task.flanks):
        rough = {rows: own for rows, own in moves.items() if own.choice[1] > finest}
        open_ = task.expect_halves(plain, rough)
        own = plain.plan.points.keys() & {v for rows in open_ for v in rows}
        made.append(task.predict(replace(plain.plan, halved=frozenset(own))))
        halved = task.compare(made, open_)
    plans = [one.plan for one in made]
    for rows, compared in moves.items():
        yield rows, halved.get(rows, compared), plans


def _stop_later(
    now: PathPrediction, moves: Mapping[Rows, MoveOutcomes]
) -> dict[int, tuple[float, ...]]:
    """Find lines for which the last place of a stop may do, and all their points.

    Where links ran on, drives that leave on have crossed more of their gaps there.
    """
    found = dict[int, tuple[float, ...]]()
    for (v, *rest), compared in moves.items():
        if v in now.plan.stops and not rest and compared.objection(1):
            share = TAKEN[-1] / now.length_of(v)
            stop, *points = now.plan.points[v]
            if stop < share < min((*points, LATEST)):
                found[v] = (share, *points)
    return found


def _begin_later(
    now: PathPrediction, moves: Mapping[Rows, MoveOutcomes], plan: int
) -> dict[int, tuple[float, ...]]:
    """Find lines for which a later first point may do, and all their points.

    Something speaks against what is put where they begin: a link that gives way over
    several gaps lies between its flanks there.

    Args:
        now: The program without stops that preload.
        moves: How its moves do.
        plan: Which of the compared plans that is.
    """
    found = dict[int, tuple[float, ...]]()
    for (v, *rest), compared in moves.items():
        objection = compared.objection(plan)
        if rest or objection is None or v not in now.plan.points:
            continue
        length, points = now.length_of(v), now.plan.points[v]
        if max(objection.place, points[0]) * length < BEGINS:
            behind = (BEGINS + now.plan.open[v][0]) / length
            found[v] = (BEGINS / length, *(s for s in points if s > behind))
    return {v: points for v, points in found.items() if points[0] < LATEST}


def _moves_with_points(now: PathPrediction) -> list[Rows]:
    """Return the visits of every move with points, of arcs both."""
    return sorted({halves(now.task.visits, v) for v in now.plan.points})


def _remove(
    visits: Visits, plan: InsertionPlan, v: int, removal: Removal, thins_out: bool
) -> InsertionPlan:
    """Take back the points around a place of a move, or all of them."""
    if removal.share is not None and thins_out:
        gone = _around(plan, v, removal.share)
        if gone:
            return plan.drop(v, gone)
    return plan.leave(v, removal.why, removal.cure).take_back(visits, v)


def _around(plan: InsertionPlan, v: int, share: float) -> set[float]:
    """Return the points around a place of a move, if there are others."""
    known = plan.points.get(v, ())
    free = np.array([s for s in known[v in plan.stops :] if s < 1.0])
    behind = int(np.searchsorted(free, share))
    gone = set(free[max(behind - 1, 0) : behind + 1].tolist())
    return gone if len(gone) < len(free) else set()


class Removal(NamedTuple):
    """Why points must go, at what share of the way if not all of them, and the cure."""

    why: str
    share: float | None = None
    cure: str = ""


def _bad(
    now: PathPrediction, without: dict[int, MoveDeviation]
) -> Iterator[tuple[int, Removal]]:
    """Yield the moves with points that must go, and why."""
    plan = now.plan
    if not plan.points:
        return
    bent = {cut[0] for cut in now.flat if not now.may_be_chord(cut)}
    worst = measure_rounded(now, sorted(_with_points(now) & now.sizes.keys()))
    judged = _Judged(now, without, worst, _objections(now), bent)
    for v in sorted(_with_points(now)):
        if reason := judged.why_not(v):
            yield v, reason


@dataclass(frozen=True)
class _Judged:
    """What is known of moves with points.

    Attributes:
        now: The program.
        without: How far each move leaves its path without points [m].
        worst: .. and with them at the most, however they are rounded, and where.
        objections: Which hypotheses make moves worse, and where.
        bent: Arcs with pieces that bend too little.
    """

    now: PathPrediction
    without: dict[int, MoveDeviation]
    worst: dict[int, tuple[float, float]]
    objections: dict[int, Objection]
    bent: set[int]

    def why_not(self, v: int) -> Removal | None:
        """Say why the points of a move must go, None where they may stay."""
        if v not in self.worst:
            return Removal("with inserted points its path is not predicted")
        if v in self.bent:
            return Removal("its pieces would be too straight for arcs")
        if v in self.now.refusals:
            return Removal(self.now.refusals[v])
        far, share = self.worst[v]
        if self._is_no_better(v, far):
            return Removal("inserted points make it no better", share)
        if v in self.objections:
            objection = self.objections[v]
            return Removal(str(objection), objection.place % 1.0, objection.cure)
        return None

    def _is_no_better(self, v: int, far: float) -> bool:
        """Return True if a move is harmed, or no nearer to its path by both measures.

        Args:
            v: The move; of an arc, a half.
            far: How far it leaves its path at the most, however points are rounded [m].
        """
        task, usual = self.now.task, self.without[v]
        now = self.now.deviations[v]._replace(largest=far)
        return now.is_harmed(usual, task.tolerance) or now.both > usual.both


def _with_points(now: PathPrediction) -> set[int]:
    """Return the moves with points, of arcs that are cut both halves."""
    return {*now.plan.points, *(via + 1 for via in now.cut_arcs)}


def _harmful(
    now: PathPrediction, without: dict[int, MoveDeviation]
) -> Iterator[tuple[int, Removal]]:
    """Yield moves with points behind which moves without any are worse for them.

    From which flank a joint leaves is a matter of the moves before, and how a corner is
    rounded one of both moves beside it.
    """
    far = _of_moves(now, now.deviations)
    cut = np.array(sorted(now.plan.points), dtype=np.int64)
    for v in far.keys() - _with_points(now) - now.plan.approaches.keys():
        last = int(np.searchsorted(cut, v)) - 1
        near = last >= 0 and v - cut[last] <= NEAR
        if v not in without or far[v].largest <= without[v].largest + WORSE:
            continue
        if near:
            yield int(cut[last]), Removal("a later move would be worse")
        if v + 1 in now.plan.points and now.task.visits.motion.fly[v]:
            yield v + 1, Removal("the corner where it begins would move")


def _objections(now: PathPrediction) -> dict[int, Objection]:
    """Say which hypotheses make moves with points worse, and at what share."""
    found = dict[int, Objection]()
    for rows, compared in now.task.compare([now], _moves_with_points(now)).items():
        if (objection := compared.objection(1)) is not None:
            found[rows[int(objection.place)]] = objection
    return found


def _of_moves(
    now: PathPrediction, far: Mapping[int, MoveDeviation]
) -> dict[int, MoveDeviation]:
    """Say of both halves of an arc, which is one move, what the farther one is off."""
    visits, found = now.task.visits, dict[int, MoveDeviation]()
    for v in far:
        both = [far[row] for row in halves(visits, v) if row in far]
        found[v] = MoveDeviation(*map(max, zip(*both, strict=True)))
    return found
