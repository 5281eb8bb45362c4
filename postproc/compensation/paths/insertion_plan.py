"""What is put on the ways of a program, and why not more: an immutable plan."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from postproc.arrays import Floats
from postproc.compensation.paths.arcs import Cut, is_arc, point_on_way
from postproc.compensation.paths.backlash_preload import BacklashPreload
from postproc.language.visits import Visits

Written = tuple[frozenset[Any], ...]


@dataclass(frozen=True, eq=False)
class InsertionPlan:
    """The points of a program; rules return another plan, and change none.

    Attributes:
        open: Moves that may be split, by their visit: the shortest piece, and how far
            from both ends [m].
        idle: Moves that may have a stop that preloads the backlash, and how.
        unconfirmed: Moves that may not, as too much is open of their flanks.
        points: What is on their ways, shares of these, by visit.
        stops: Moves whose first point is a stop, where the backlash is preloaded.
        halved: Moves whose points correct half of what flanks change by.
        chords: Pieces of arcs that are chords whatever they bend.
        approaches: Stops from which targets are approached anew, by visit, (w,) each.
        tried: How far a move began off, and where it stopped, try by try; 0: nowhere.
        shut: Where no points may lie any more: corrections changed too fast there.
        settled: Moves that more points do not help.
        crowded: More points were wanted than there was room for.
        left: Why moves that leave their path too far are not split.
        cures: What would help those among them that something else hinders than room.
    """

    open: Mapping[int, tuple[float, float, float]] = field(default_factory=dict)
    idle: Mapping[int, BacklashPreload] = field(default_factory=dict)
    unconfirmed: frozenset[int] = frozenset()
    points: Mapping[int, tuple[float, ...]] = field(default_factory=dict)
    stops: frozenset[int] = frozenset()
    halved: frozenset[int] = frozenset()
    chords: frozenset[Cut] = frozenset()
    approaches: Mapping[int, Floats] = field(default_factory=dict)
    tried: Mapping[int, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    shut: Mapping[int, frozenset[float]] = field(default_factory=dict)
    settled: frozenset[int] = frozenset()
    crowded: bool = False
    left: Mapping[int, str] = field(default_factory=dict)
    cures: Mapping[int, str] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Return how many points it has, stops before targets among them."""
        return sum(map(len, self.points.values())) + len(self.approaches)

    @property
    def preloads(self) -> dict[int, BacklashPreload]:
        """Return what the stops of its moves do."""
        return {v: self.idle[v] for v in self.stops & self.points.keys()}

    @property
    def written(self) -> Written:
        """Return all of it that a program with its points depends on."""
        own = self.points.keys()
        return (
            frozenset(self.points.items()), self.stops.intersection(own),
            self.halved.intersection(own), self.chords, frozenset(self.approaches),
        )  # fmt: skip

    def put(self, v: int, shares: Collection[float]) -> InsertionPlan:
        """Put other points on the way of a move; none where there are no shares."""
        points = dict(self.points)
        points.pop(v, None)
        if shares:
            points[v] = tuple(sorted(map(float, shares)))
        return replace(self, points=points)

    def drop(self, v: int, gone: Collection[float]) -> InsertionPlan:
        """Take back points of a move; pieces that grow by it are chords no more."""
        rest = tuple(s for s in self.points[v] if s not in gone)
        longer = {min((s for s in rest if s > share), default=1.0) for share in gone}
        chords = self.chords - {(v, share) for share in (*gone, *longer)}
        plan = replace(self, chords=chords).put(v, rest)
        if not rest and plan.points.get(v - 1) == (1.0,):  # cut at its point alone
            return plan.put(v - 1, ())
        return plan

    def take_back(self, visits: Visits, v: int) -> InsertionPlan:
        """Take back all of a move; an arc that is cut no more stays whole."""
        own = self.points.get(v, ())
        approaches = {k: at for k, at in self.approaches.items() if k != v}
        plan = replace(
            self,
            approaches=approaches,
            stops=self.stops - {v},
            halved=self.halved - {v},
        ).put(v, ())
        if not is_arc(visits, v):
            return plan
        via = point_on_way(visits, v)
        if own in ((), (1.0,)):  # what it has is the cut at the point on the way alone
            return plan.put(via, ()).put(via + 1, ())
        if v == via and via + 1 in plan.points:
            return plan.put(via, (1.0,))
        if plan.points.get(via) == (1.0,):
            return plan.put(via, ())
        return plan

    def leave(self, v: int, why: str, cure: str | None = None) -> InsertionPlan:
        """Say why a move is not split, and what would help."""
        cures = self.cures if cure is None else {**self.cures, v: cure}
        return replace(self, left={**self.left, v: why}, cures=cures)

    def without_stops(self) -> InsertionPlan:
        """Take back the stops that preload the backlash."""
        plan = replace(self, stops=frozenset())
        for v in sorted(self.stops):
            plan = plan.drop(v, {plan.points[v][0]})
        return plan

    def put_all(self, points: Mapping[int, Collection[float]]) -> InsertionPlan:
        """Put other points on the ways of some lines, see `put`."""
        other = {v: tuple(sorted(map(float, own))) for v, own in points.items()}
        return replace(self, points={**self.points, **other})

    def as_in(self, other: InsertionPlan, v: int) -> InsertionPlan:
        """Put on the way of a move what another plan puts there."""
        own = {cut for cut in other.chords if cut[0] == v}
        return replace(
            self,
            stops=self.stops - {v} | (other.stops & {v}),
            halved=self.halved - {v} | (other.halved & {v}),
            chords=frozenset(c for c in self.chords if c[0] != v) | own,
        ).put(v, other.points.get(v, ()))
