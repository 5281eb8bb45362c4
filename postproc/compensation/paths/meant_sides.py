"""From which sides of their gaps joints are meant to pass the points of a plan."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from postproc.arrays import Floats, spans
from postproc.compensation.findings.timing_comparison import InTime
from postproc.compensation.options import Job
from postproc.compensation.paths.arcs import halves
from postproc.compensation.paths.backlash_preload import (
    cross_at_once,
    find_drive_turns,
)
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.language.visits import Visits
from postproc.model.flank_hypotheses import FlankOfJoint

MeantKey = tuple[int, tuple[float, ...], bool]
"""A visit, the points on its way, and whether they correct half of what flanks do."""


@dataclass(frozen=True)
class MeantSides:
    """From which sides k points on a way are meant to be passed.

    Attributes:
        side: Where each joint is to lie in its play, (k, 6) from -1 to 1.
        turn: What the tool turns by in its own frame, (k, 3) [rad].
        between: Where it is to lie half way between a point and the one before, and
            behind the last one, (k + 1, 6).
    """

    side: Floats
    turn: Floats
    between: Floats


@dataclass(frozen=True, eq=False)
class PlanSides:
    """From which sides points on the ways of a program are meant to be passed.

    Attributes:
        setting: What the program is compensated with.
        visits: It without points, n visits.
        first: .. in time.
        flanks: What is known of joints 1 to 6.
    """

    setting: Job
    visits: Visits
    first: InTime
    flanks: tuple[FlankOfJoint, ...]
    _known: dict[MeantKey, MeantSides] = field(default_factory=dict, repr=False)
    _sides: dict[tuple[int, ...], Floats] = field(default_factory=dict, repr=False)

    def of_plan(self, plan: InsertionPlan) -> dict[int, MeantSides]:
        """Say from which sides points on ways are meant to be passed.

        An arc is one way, from where it begins to where it ends.
        """
        keys, new = dict[int, MeantKey](), list[_PointsOnWay]()
        moves = {halves(self.visits, v) for v in plan.points}
        self._cross_on(sorted(moves - self._sides.keys()))
        for move in moves:
            half = bool(plan.halved.intersection(move))
            own = {v: (v, plan.points[v], half) for v in move if v in plan.points}
            if not self._known.keys() >= {*own.values()}:
                new += self._points_on(move, own.values(), half)
            keys |= own
        self._known.update(self._mean(new))
        return {v: self._known[key] for v, key in keys.items()}

    def half_shifts(
        self, plan: InsertionPlan, moves: Sequence[int]
    ) -> list[tuple[Floats, Floats]]:
        """Say by what lines are moved if their points correct half of what flanks do.

        That is what the arm's error changes by between the sides that are meant.

        Args:
            plan: The points.
            moves: The lines.

        Returns:
            For each both its ends and its points, shares of the way, (k,), and what the
            path is moved by there, (k, 3) [m].
        """
        paths, points = self.first.paths, [plan.points[v] for v in moves]
        if not moves:
            return []
        assert paths.cases is not None
        at = [paths.sample_at(v, own) for v, own in zip(moves, points, strict=True)]
        halved = replace(plan, halved=frozenset(moves))
        whole, half = (
            paths.cases.predict(
                np.concatenate(at), np.concatenate([meant[v].side for v in moves])
            )
            for meant in map(self.of_plan, (replace(plan, halved=frozenset()), halved))
        )
        by = np.split(whole - half, np.cumsum([len(own) for own in at])[:-1])
        return [
            (np.array([0.0, *own, 1.0]), np.pad(moved, ((1, 1), (0, 0))))
            for own, moved in zip(points, by, strict=True)
        ]

    def _cross_on(self, moves: Sequence[tuple[int, ...]]) -> None:
        """Let sharp joints cross their gaps on moves where they begin to."""
        if not moves:
            return
        paths = self.first.paths
        start, _ = paths.spans_to(np.array([move[0] for move in moves]))
        last, count = paths.spans_to(np.array([move[-1] for move in moves]))
        count += last - start
        side, first = paths.side[spans(start, count)], np.append(0, np.cumsum(count))
        sharp = np.array([flank.nominal == 1.0 for flank in self.flanks])
        side[:, sharp] = cross_at_once(side[:, sharp], first)
        self._sides.update(zip(moves, np.split(side, first[1:-1]), strict=True))

    def _points_on(
        self, move: tuple[int, ...], keys: Collection[MeantKey], half: bool
    ) -> Iterator[_PointsOnWay]:
        """Yield the places of points on a move, and where joints are to lie there."""
        paths = self.first.paths
        own, side = [paths.samples_to(v) for v in move], self._sides[move]
        if half:
            side = (side + _evenly(side, [paths.way[rows] for rows in own])) / 2
        for key in keys:
            at = paths.sample_at(key[0], (0.0, *key[1], 1.0))
            there = side[at - own[0].start]
            yield _PointsOnWay(key, paths.q[at], there, there - side[0])

    def _mean(self, new: Sequence[_PointsOnWay]) -> dict[MeantKey, MeantSides]:
        """Say from which sides the points on some ways are meant to be passed."""
        if not new:
            return {}
        v = np.repeat([one.key[0] for one in new], [len(one.q) for one in new])
        q, crossed = (
            np.concatenate([getattr(one, name) for one in new])
            for name in ("q", "crossed")
        )
        tool = self.first.after.targets.tool[v, :3, :3]
        turn = find_drive_turns(self.setting, self.visits, v, tool, q, crossed)
        turns = np.split(turn, np.cumsum([len(one.q) for one in new])[:-1])
        return {
            one.key: MeantSides(
                one.side[1:-1], own[1:-1], (one.side[:-1] + one.side[1:]) / 2
            )
            for one, own in zip(new, turns, strict=True)
        }


@dataclass(frozen=True)
class _PointsOnWay:
    """Both ends of a way, and the points on it, k places.

    Attributes:
        key: The visit at its end, and its points.
        q: Joint angles there, (k, 6) [rad].
        side: Where joints are to lie in their play, (k, 6).
        crossed: .. and what they have crossed since the move began, (k, 6).
    """

    key: MeantKey
    q: Floats
    side: Floats
    crossed: Floats


def _evenly(side: Floats, ways: list[Floats]) -> Floats:
    """Let joints go evenly from where they lie first to where they lie last, (s, 6).

    Args:
        side: Where they lie along a move, (s, 6).
        ways: Path length at the samples of its parts [m].
    """
    ends = np.cumsum([0.0, *(way[-1] for way in ways)])
    along = np.concatenate([way + end for way, end in zip(ways, ends, strict=False)])
    u = (along / max(ends[-1], 1e-12))[:, None]
    return np.asarray((1 - u) * side[0] + u * side[-1])
