"""The points with which each move kept to its path best, of all that were tried.

Points are put where a path is left the farthest, one after the other; near a place
where two joints turn back a next one can make the move worse.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from postproc.compensation.arc_cuts import bending
from postproc.compensation.arc_splitting import Cut, is_arc, point_on_way
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
        """Begin with the program as it is."""
        self._best: dict[int, _Tried] = {}
        self._work = work
        self.note()

    def note(self) -> None:
        """Look at how the moves do with the points that they have now."""
        flat = {self._move(v) for v, _ in bending(self._work)}
        for v, tried in self._now().items():
            known = self._best.setdefault(v, tried)
            if v not in flat and tried.size <= known.size + BETTER:  # the later one
                self._best[v] = replace(tried, size=min(tried.size, known.size))

    def restore(self) -> None:
        """Give moves back the points that did better than those they have."""
        work = self._work
        flat = {self._move(v) for v, _ in bending(work)}
        worse = {
            v
            for v, tried in self._now().items()
            if v in flat or tried.size > self._best[v].size + BETTER
        }
        if not worse:
            return
        for v in [v for v in work.points if self._move(v) in worse]:
            del work.points[v]
        work.stops -= {v for v in work.stops if self._move(v) in worse}
        work.chords -= {cut for cut in work.chords if self._move(cut[0]) in worse}
        for v in worse:
            work.points |= self._best[v].points
            work.stops |= self._best[v].stops
            work.chords |= self._best[v].chords
        work.make()

    def _move(self, v: int) -> int:
        """Return the visit that stands for a move: of an arc the point on its way."""
        visits = self._work.source.reading.visits
        return point_on_way(visits, v) if is_arc(visits, v) else v

    def _now(self) -> dict[int, _Tried]:
        """Say what the moves have now, and how they do with it."""
        work, sizes = self._work, sizes_of(self._work.paths)
        found = {}
        for v in {self._move(v) for v in work.open}:
            visits = work.source.reading.visits
            own = (v, v + 1) if is_arc(visits, v) else (v,)
            found[v] = _Tried(
                float(np.hypot.reduce([sizes.get(row, 0.0) for row in own])),
                {row: work.points[row] for row in own if row in work.points},
                frozenset(work.stops.intersection(own)),
                frozenset(cut for cut in work.chords if cut[0] in own),
            )
        return found
