"""How far a move leaves its path with each plan, under each open hypothesis."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.compensation.paths.flank_cases import FlankCase, Key
from postproc.compensation.paths.path_error import PathAccuracy
from postproc.compensation.paths.plan_rule import (
    PlanOutcome,
    choose_plan,
    negligible,
    tolerable_harm,
)
from postproc.model.flank_hypotheses import OPEN
from postproc.robot.pose import MM

ALONG = 0.95  # of a way: what the deviation of a plan is taken of
BEGINS = 5e-3  # [m] in which drives cross their gaps, where a move begins

LAST = 1.0 - 1e-9  # share of a way that is still on it

_Ways = Sequence[tuple[Floats, Floats]]
"""Way (s,) and distance from the path (h, s) of the parts of a move [m]."""


@dataclass(frozen=True)
class Objection:
    """What speaks against a plan.

    Attributes:
        worse: How much farther the path is than without points [m].
        place: Where: a part of the move, from 0, and a share of its way.
        key: The hypothesis, None if all joints do as predicted.
    """

    worse: float
    place: float
    key: Key | None

    def __str__(self) -> str:
        """Say it in words."""
        what = "somewhere, even if all joints do as predicted"
        if self.key is not None:
            what = f"if joint {self.key[0]} {self.key[1].value}"
        return f"it would be worse by {self.worse / MM:.2f} mm {what}"

    @property
    def cure(self) -> str:
        """Return what would tell, "" where nothing is open."""
        if self.key is None:
            return ""
        return MEASURE.format(joint=self.key[0])


MEASURE = (
    "Measure how joint {joint} changes its flank: survey.reversals, or diagnose --path"
)


@dataclass(frozen=True)
class MoveOutcomes:
    """The plans of one move, and the h hypotheses that they are compared under.

    Attributes:
        plans: The outcome of each; the first one is that without points.
        share: Where each is worse than without points the most, (p, h): a part of the
            move, from 0, and a share of its way.
        keys: The hypotheses behind the first one, that all joints do as predicted.
        weight: (h,).
        tolerance: Of paths [m].
    """

    plans: tuple[PlanOutcome, ...]
    share: Floats
    keys: tuple[Key, ...]
    weight: Floats
    tolerance: float

    def choose(self) -> tuple[int, float]:
        """Choose a plan, see `choose_plan`; return it and its promise [m]."""
        return choose_plan(self.plans, self.weight, self.tolerance)

    def objection(self, plan: int) -> Objection | None:
        """Return which hypothesis makes a plan worse than no points.

        None where none does by more than may be.
        """
        worse = np.where(self.weight > OPEN, self.plans[plan].worse, 0.0)
        k = int(worse.argmax())
        if worse[k] <= tolerable_harm(self.tolerance):
            return None
        key = None if k == 0 else self.keys[k - 1]
        return Objection(float(worse[k]), float(self.share[plan, k]), key)


def compare(
    plans: Sequence[PathAccuracy], rows: Sequence[int], tolerance: float
) -> MoveOutcomes:
    """Compare the plans of a move.

    Args:
        plans: The program with each; the first one is without points.
        rows: The visits of the move; of an arc both.
        tolerance: Of paths [m].
    """
    found = [_Move.of(paths, rows) for paths in plans]
    usual = found[0]
    steps = np.max([move.steps for move in found], axis=0)
    small = negligible(steps, tolerance)
    every = dict.fromkeys(key for move in found for key in move.cases)
    keys = tuple(key for key in every if not small[key[0] - 1])
    weights = {key: w for move in found for key, w in move.weights.items()}
    usually = min((usual.usually[key[0] - 1] for key in keys), default=1.0)
    weight = np.array([usually, *(weights[key] for key in keys)])
    hypotheses = (None, *keys)
    ways = [[*move.across(hypotheses)] for move in found]
    outcomes, shares = zip(*(_outcome(own, ways[0]) for own in ways), strict=True)
    if usually <= OPEN:  # it is what corrections are made for, and counts
        weight[0] = np.nextafter(OPEN, 1.0)
    return MoveOutcomes(outcomes, np.array(shares), keys, weight, tolerance)


@dataclass(frozen=True)
class _Move:
    """One move with one plan.

    Attributes:
        paths: The program.
        parts: The samples of the move; of an arc of both halves.
        cases: The cases that make a difference on it.
        usually: Weight of what is predicted, of every joint, (6,).
    """

    paths: PathAccuracy
    parts: tuple[slice, ...]
    cases: Mapping[Key, FlankCase]
    usually: Floats

    @classmethod
    def of(cls, paths: PathAccuracy, rows: Sequence[int]) -> _Move:
        parts = tuple(map(paths.samples_to, rows))
        cases: Mapping[Key, FlankCase] = {}
        usually = np.ones(6)
        if paths.cases is not None:
            usually = paths.cases.usually
            cases = paths.cases.on_moves([paths.row_of(v) for v in rows])
        return cls(paths, parts, cases, usually)

    @property
    def weights(self) -> dict[Key, float]:
        return {key: case.weight for key, case in self.cases.items()}

    @property
    def steps(self) -> Floats:
        """How far each joint moves the TCP under its worst hypothesis, (6,) [m]."""
        found = np.zeros(6)
        for (joint, _, _), case in self.cases.items():
            for part in self.parts:
                moved = case.moved[case.within(part)].max(initial=0.0)
                found[joint - 1] = max(found[joint - 1], moved)
        return found

    def across(self, keys: Sequence[Key | None]) -> Iterator[tuple[Floats, Floats]]:
        """Yield way (s,) and distance from the path (h, s) of its parts [m].

        Args:
            keys: The h hypotheses, None if all joints do as predicted.
        """
        for part in self.parts:
            far = np.tile(self.paths.after.across[part], (len(keys), 1))
            for row, key in zip(far, keys, strict=True):
                case = None if key is None else self.cases.get(key)
                if case is not None:
                    own = case.within(part)
                    row[case.rows[own] - part.start] = case.across[own]
            yield self.paths.way[part], far


def _outcome(own: _Ways, usual: _Ways) -> tuple[PlanOutcome, Floats]:
    """Return how a plan does under h hypotheses, and where it is worst, (h,).

    Where a move begins, what the whole of it is off without points counts there.

    Args:
        own: The parts of the move with the plan, see `_Move.across`.
        usual: .. and without points; the same if the plan has none.
    """
    worst, at = np.zeros((2, len(own[0][1])))
    rows = np.arange(len(worst))
    for k, ((way, far), (old, before)) in enumerate(zip(own, usual, strict=True)):
        if own is usual:
            break
        usually = np.array([np.interp(way, old, row) for row in before])
        if k == 0:
            usually[:, way < BEGINS] = before.max(axis=1)[:, None]
        more = far - usually
        top = more.argmax(axis=1)
        share = np.minimum(way[top] / max(way[-1], 1e-12), LAST)
        at = np.where(more[rows, top] > worst, k + share, at)
        worst = np.maximum(worst, more[rows, top])
    length = np.concatenate([np.diff(way, prepend=0.0) for way, _ in own])
    far = np.concatenate([part for _, part in own], axis=1)
    return PlanOutcome(_within(far, length), worst), at


def _within(far: Floats, length: Floats) -> Floats:
    """Return the distance that 95 % of a way stays within, (h,) [m].

    Args:
        far: Distances at s samples, (h, s) [m].
        length: Of the way up to each, (s,) [m].
    """
    order = np.argsort(far, axis=1)
    done = np.cumsum(length[order], axis=1)
    place = (done < ALONG * done[:, -1:]).sum(axis=1)
    rows = np.arange(len(far))
    return np.asarray(far[rows, order[rows, place]])
