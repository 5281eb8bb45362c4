"""The points with which each move kept to its path best, of all that were tried.

Points are put where a path is left the farthest, one after the other; near a place
where two joints turn back a next one can make the move worse.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from math import hypot

from postproc.compensation.arc_cuts import bending
from postproc.compensation.arc_splitting import Cut, halves
from postproc.compensation.path_judging import sizes_of
from postproc.compensation.path_work import PathWork

BETTER = 1e-6  # [m] less is no matter


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
    """What did best for every move that may be split, so far."""

    def __init__(self, work: PathWork) -> None:
        """Begin with nothing."""
        self._best: dict[int, _Tried] = {}
        self._refused: dict[int, str] = {}
        self._work = work

    def note(self, flat: Collection[Cut]) -> None:
        """Look at how the moves do with the points that they have now.

        Args:
            flat: Pieces of arcs that are too flat, see `bending`.
        """
        moves, work = self._moves(flat), self._work
        refused = {v: told for v in work.points if (told := work.refusal(v))}
        self._refused = refused | self._refused  # what was said first
        for v, tried in self._now().items():
            known = self._best.setdefault(v, tried)
            if v not in moves and tried.size <= known.size + BETTER:  # the later one
                self._best[v] = replace(tried, size=min(tried.size, known.size))

    def restore(self) -> None:
        """Give moves back the points that did better than those they have."""
        work, now = self._work, self._now()
        flat = self._moves(bending(work))
        worse = [v for v in now if v in flat or self._was_better(v, now[v])]
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

    def _was_better(self, v: int, tried: _Tried) -> bool:
        return tried.size > self._best[v].size + BETTER

    def _moves(self, flat: Collection[Cut]) -> set[int]:
        """Return the moves that have flat pieces, by their first visits."""
        visits = self._work.source.reading.visits
        return {halves(visits, v)[0] for v, _ in flat}

    def _now(self) -> dict[int, _Tried]:
        """Say what the moves have now, by their first visits, and how they do."""
        work, sizes = self._work, sizes_of(self._work.paths)
        found = {}
        for own in {halves(work.source.reading.visits, v) for v in work.open}:
            found[own[0]] = _Tried(
                hypot(*(sizes.get(row, 0.0) for row in own)),
                {row: work.points[row] for row in own if row in work.points},
                frozenset(work.stops.intersection(own)),
                frozenset(cut for cut in work.chords if cut[0] in own),
            )
        return found
