"""Points on ways that make a move no better for certain are taken back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from postproc.arrays import Floats
from postproc.compensation.paths.arcs import (
    halves,
    is_arc,
    largest_zones,
    measure_passing,
    zone_sizes,
)
from postproc.compensation.paths.changed_windows import Part
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.insertion_prediction import PathPrediction
from postproc.compensation.paths.path_error import apart, sizes_of
from postproc.compensation.paths.plan_outcomes import (
    MoveOutcomes,
    Objection,
    Rows,
)
from postproc.compensation.paths.plan_rule import resolution
from postproc.compensation.paths.reapproach import WORSE, bad_approaches
from postproc.language.visits import Visits
from postproc.robot.pose import lengths

JUDGED = 8  # rounds in which points are taken back
NEAR = 4  # visits behind a move that may be worse for its points


def judge(now: PathPrediction) -> PathPrediction:
    """Take back points that make moves no better for certain."""
    task = now.task
    now = task.predict(choose_plans(now))
    without = _of_moves(now, sizes_of(task.first.paths))
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
    now: PathPrediction, without: dict[int, float]
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

    See `choose_plan`: all points, those without the stop that preloads, points that
    correct half of what flanks change by, or none. What a hypothesis speaks against
    is thinned out later.
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

    Half is looked at where nothing else keeps the finest promise.
    """
    task, made = now.task, [now]
    if now.plan.stops:
        made.append(task.predict(now.plan.without_stops()))
    moves = task.compare(made, _moves_with_points(now))
    finest, halved = resolution(task.tolerance), dict[Rows, MoveOutcomes]()
    if any(flank.open_kinds for flank in task.flanks):
        open_ = [rows for rows, own in moves.items() if own.choice[1] > finest]
        plain = made[-1].plan
        own = plain.points.keys() & {v for rows in open_ for v in rows}
        made.append(task.predict(replace(plain, halved=frozenset(own))))
        halved = task.compare(made, open_)
    plans = [one.plan for one in made]
    for rows, compared in moves.items():
        yield rows, halved.get(rows, compared), plans


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
    now: PathPrediction, without: dict[int, float]
) -> Iterator[tuple[int, Removal]]:
    """Yield the moves with points that must go, and why."""
    plan = now.plan
    if not plan.points:
        return
    bent = {cut[0] for cut in now.flat if not now.may_be_chord(cut)}
    judged = _Judged(now, without, _worst(now), _objections(now), bent)
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
    without: dict[int, float]
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
        if far > self.without[v]:
            return Removal("inserted points make it no better", share)
        if v in self.objections:
            objection = self.objections[v]
            return Removal(str(objection), objection.place % 1.0, objection.cure)
        return None


def _with_points(now: PathPrediction) -> set[int]:
    """Return the moves with points, of arcs that are cut both halves."""
    return {*now.plan.points, *(via + 1 for via in now.cut_arcs)}


def _harmful(
    now: PathPrediction, without: dict[int, float]
) -> Iterator[tuple[int, Removal]]:
    """Yield moves with points behind which moves without any are worse for them.

    From which flank a joint leaves is a matter of the moves before, and how a corner is
    rounded one of both moves beside it.
    """
    far = _of_moves(now, now.sizes)
    cut = np.array(sorted(now.plan.points), dtype=np.int64)
    for v in far.keys() - _with_points(now) - now.plan.approaches.keys():
        last = int(np.searchsorted(cut, v)) - 1
        near = last >= 0 and v - cut[last] <= NEAR
        if far[v] <= without.get(v, np.inf) + WORSE:
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


def _of_moves(now: PathPrediction, far: dict[int, float]) -> dict[int, float]:
    """Say of both halves of an arc, which is one move, what the farther one is off."""
    visits = now.task.visits
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


def _worst(now: PathPrediction) -> dict[int, tuple[float, float]]:
    """How far each move leaves its path, however its points are rounded.

    Returns:
        The distance [m], and where, as a share of the way.
    """
    rounded, found = _list_roundings(now), dict[int, tuple[float, float]]()
    for v in _with_points(now) & now.sizes.keys():
        paths, k = now.path_to(v)
        samples = paths.samples(k)
        way, off = paths.way[samples], paths.after.off[samples]
        tangent = paths.tangent[samples]
        worst = np.array(paths.after.across[samples])
        points = zip(now.plan.points.get(v, ()), rounded.get(v, ()), strict=True)
        for share, corner in points:
            aside = np.abs(way - share * way[-1])
            worst = np.maximum(worst, corner.farthest(aside, off, tangent))
        found[v] = _largest_on(way, worst)
    return found


def _list_roundings(now: PathPrediction) -> dict[int, list[_Corner]]:
    """Say how points on ways may be rounded, where they are no stops.

    No corner is larger than half of a neighbouring piece; what cuts it off straight
    passes the point farthest. On an arc it is no larger than zones are, by any law.
    """
    found: dict[int, list[_Corner]] = {}
    for number, part in enumerate(now.parts):
        moves = [v for v in now.plan.points if now.part[v] == number]
        if moves:
            found.update(_roundings_in(now, part, moves))
    return found


def _roundings_in(
    now: PathPrediction, part: Part, moves: list[int]
) -> Iterator[tuple[int, list[_Corner]]]:
    """Yield the moves of a part, and how their points may be rounded."""
    task, plan, in_time = now.task, now.plan, part.in_time
    arm = task.setting.cell.arm
    p, c = (
        arm.tcp(cycle.path.q, cycle.targets.tool[:, :3, 3])
        for cycle in (in_time.after, in_time.before)
    )
    visits, arcs = task.visits, task.list_wanted_arcs(plan)
    zone = largest_zones(arm, in_time.after) if len(arcs) else None
    planned = zone_sizes(arm, in_time.after, in_time.after.targets)
    for v in moves:
        shares = plan.points[v]
        rows = [int(part.own[visits.graph.before[v]]), *now.ends(v)]
        if shares[-1] == 1.0:
            rows.append(now.ends(v + 1)[0])
        rows = rows[: len(shares) + 2]
        size = np.maximum(lengths(np.diff(p[rows], axis=0)), 1e-9)
        slope = np.diff(p[rows] - c[rows], axis=0) / size[:, None]
        half = np.minimum(size[1:], size[:-1]) / 2
        beside = np.zeros(len(half))
        if zone is not None and is_arc(visits, v):
            half = np.minimum(half, zone[rows[1:-1]])
            beside = measure_passing(half, arcs.radius_of(v))
        moved = np.diff(slope, axis=0) * half[:, None] / 2
        done = np.minimum(planned[rows[1:-1]] / np.maximum(half, 1e-12), 1.0)
        stop = int(v in plan.stops)
        moved[:stop] = beside[:stop] = 0.0
        yield v, [*map(_Corner, half, moved, done, beside)]


# How far moves are from their paths, by the visit at their end.


def _largest_on(way: Floats, far: Floats) -> tuple[float, float]:
    """Return the largest distance on a way, and where, as a share of it."""
    top = int(far.argmax())
    return float(far[top]), float(way[top] / max(way[-1], 1e-12))
