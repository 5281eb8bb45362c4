"""What did best on a move of all points that were tried on it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from math import hypot

import numpy as np

from postproc.compensation.paths.arcs import Cut, halves
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.insertion_prediction import PathPrediction
from postproc.compensation.paths.plan_outcomes import Rows

BETTER = 1e-6  # [m] less is no matter
IN_VAIN = 5  # rounds of more points that make a move no better: it gets no more


@dataclass(frozen=True)
class _Tried:
    """What was put on the way of a move.

    Attributes:
        score: How far the move left its path with it, see `_score` [m].
        points: The points by visit; of an arc, of both its halves.
        stops: Those of these visits whose first point is a stop.
        chords: Which of its pieces are chords.
    """

    score: float
    points: Mapping[int, tuple[float, ...]]
    stops: frozenset[int]
    chords: frozenset[Cut]

    @property
    def count(self) -> int:
        """Return the number of points."""
        return sum(map(len, self.points.values()))


@dataclass(frozen=True)
class BestPoints:
    """What did best for every move that may be split, so far.

    Points are put where a path is left the farthest, one after the other; near a place
    where two joints turn back a next one can make the move worse.

    Attributes:
        best: What did best, by the first visit of each move.
        refused: Why points of moves could not be corrected, what was said first.
        vain: In how many rounds more points made a move no better, and how many it had.
    """

    best: Mapping[int, _Tried] = field(default_factory=dict)
    refused: Mapping[int, str] = field(default_factory=dict)
    vain: Mapping[int, tuple[int, int]] = field(default_factory=dict)

    def note(self, now: PathPrediction) -> BestPoints:
        """Look at how the moves do with the points that they have now."""
        best, vain, bad = dict(self.best), dict(self.vain), _unfit(now)
        for v, tried in _list_tried(now).items():
            known = best.setdefault(v, tried)
            rounds, most = vain.get(v, (0, 0))
            helps = tried.score < known.score - BETTER
            more = tried.count > most
            vain[v] = 0 if helps else rounds + more, max(most, tried.count)
            if v not in bad and tried.score <= known.score + BETTER:  # the later one
                best[v] = replace(tried, score=min(tried.score, known.score))
        return BestPoints(best, {**now.refusals, **self.refused}, vain)

    def settle(self, now: PathPrediction) -> PathPrediction:
        """Let moves that more points do not help get no more."""
        over = {v for v, (rounds, _) in self.vain.items() if rounds >= IN_VAIN}
        rows = frozenset(row for v in over for row in halves(now.task.visits, v))
        return replace(now, plan=replace(now.plan, settled=rows))

    def restore(self, now: PathPrediction) -> InsertionPlan:
        """Give moves back the points that did better than those they have."""
        plan, bad = now.plan, _unfit(now)
        for v, has in _list_tried(now).items():
            best = self.best[v]
            if v in bad or has.score > best.score + BETTER:
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


def _score(now: PathPrediction, own: Rows) -> float:
    """Say how far a move leaves its path, inf where it is harmed or not predicted [m].

    See `MoveDeviation`; of an arc it is that of both halves.
    """
    task, scores = now.task, list[float]()
    for v in own:
        one = now.deviations.get(v)
        if one is None or one.is_harmed(task.deviations.get(v, one), task.tolerance):
            return np.inf
        scores.append(one.both)
    return hypot(*scores)


def _list_tried(now: PathPrediction) -> dict[int, _Tried]:
    """Say what the moves have now, by their first visits, and how they do."""
    plan, found = now.plan, dict[int, _Tried]()
    chords = dict[int, list[Cut]]()
    for cut in plan.chords:
        chords.setdefault(cut[0], []).append(cut)
    for own in {halves(now.task.visits, v) for v in plan.open}:
        points = {row: plan.points[row] for row in own if row in plan.points}
        cuts = frozenset(cut for row in own for cut in chords.get(row, ()))
        found[own[0]] = _Tried(
            _score(now, own), points, plan.stops.intersection(own), cuts
        )
    return found
