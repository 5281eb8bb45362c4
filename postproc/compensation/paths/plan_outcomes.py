"""How far a move leaves its path with each plan, under each open hypothesis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from postproc import _native
from postproc.arrays import Bools, Floats, Ints, spans
from postproc.compensation.paths.flank_cases import OF_ALL, Key
from postproc.compensation.paths.path_error import (
    PathAccuracy,
    apart,
    largest_in,
    steps_of,
)
from postproc.compensation.paths.plan_rule import (
    ALONG,
    NEGLIGIBLE,
    PlanOutcome,
    choose_plan,
    choose_plans,
    negligible,
    tolerable_harm,
)
from postproc.compensation.solver.expected_error import SIDED
from postproc.model.flank_hypotheses import OPEN, FlankKind
from postproc.model.variance import covariance_times
from postproc.robot.pose import MM, lengths

BEGINS = 5e-3  # [m] in which drives cross their gaps, where a move begins
ALMOST = 2e-6  # [m] to which what is expected of a plan holds
LAST = 1.0 - 1e-9  # share of a way that is still on it
UNDESCRIBED: Key = 0, FlankKind.UNDESCRIBED, 0
"""That the arm errs as no effect describes, of its joints and poses all together.

How far, any way across the path, is what 5 % of poses err by more to that side: a
hypothesis that speaks of farther has no weight above `OPEN`.
"""


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
        if self.key == UNDESCRIBED:
            what = f"if the arm {self.key[1].value}"
        elif self.key is not None:
            what = f"if joint {self.key[0]} {self.key[1].value}"
        return f"it would be worse by {self.worse / MM:.2f} mm {what}"

    @property
    def cure(self) -> str:
        """Return what would tell, "" where nothing is open."""
        if self.key is None:
            return ""
        if self.key == UNDESCRIBED:
            return NAME_IT
        if self.key[1] is FlankKind.RAN_ON:
            return SLOWER
        if self.key[1] in (FlankKind.HELD, FlankKind.WEIGHED):
            return WEIGH.format(joint=self.key[0])
        return MEASURE.format(joint=self.key[0])


SLOWER = (
    "Let the JOINT move before it end at 20 % of the speed of the joints or less, or "
    "measure a path (diagnose --path)"
)
WEIGH = (
    "Survey more poses where joint {joint} carries as much weight, or measure a path "
    "(diagnose --path)"
)
NAME_IT = "Look for what the model lacks: diagnose the survey, or survey more poses"
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
        choice: The plan that is chosen, see `choose_plan`, and its promise [m].
    """

    plans: tuple[PlanOutcome, ...]
    share: Floats
    keys: tuple[Key, ...]
    weight: Floats
    tolerance: float
    choice: tuple[int, float]

    @property
    def open_keys(self) -> list[Key | None]:
        """Return the open hypotheses; None: all joints do as predicted."""
        open_ = (self.weight > OPEN).tolist()
        return [k for k, own in zip((None, *self.keys), open_, strict=True) if own]

    def would_choose(self, off: Floats) -> bool:
        """Return True if one more plan were chosen that harms none, (h,) [m]."""
        plan = PlanOutcome(off, np.zeros(len(off)))
        best, _ = choose_plan((*self.plans, plan), self.weight, self.tolerance)
        return best == len(self.plans)

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


class Predicted(NamedTuple):
    """What predictions tell of the moves of a program with one plan.

    Attributes:
        paths: The predictions.
        part: Which of them tells of each visit of the source, (n,).
    """

    paths: Sequence[PathAccuracy]
    part: Ints


Rows = tuple[int, ...]
"""The visits of a move; of an arc both."""


def compare(
    plans: Sequence[Predicted], moves: Sequence[Rows], tolerance: float
) -> dict[Rows, MoveOutcomes]:
    """Compare the plans of some moves.

    Args:
        plans: The program with each; the first one is without points.
        moves: The m moves.
        tolerance: Of paths [m].
    """
    if not len(moves):
        return {}
    found = [_PlannedMoves.of(plan, moves) for plan in plans]
    keys = [*dict.fromkeys(key for ways in found for key in ways.cases)]
    steps = np.max([ways.measure_steps() for ways in found], axis=0)
    counts = ~negligible(steps, tolerance)
    there = np.ones((len(moves), 1 + len(keys)), dtype=bool)
    for k, key in enumerate(keys, 1):
        own = np.any([ways.has(key) for ways in found], axis=0)
        there[:, k] = own & counts[:, key[0] - 1]
    reach = np.max([ways.measure_reach() for ways in found], axis=0)
    if (errs := reach >= NEGLIGIBLE * tolerance).any():
        keys, there = [*keys, UNDESCRIBED], np.column_stack([there, errs])
    off, worse, share = np.zeros((3, len(plans), *there.shape))
    for k, hypothesis in enumerate([None, *keys]):
        rows = np.flatnonzero(there[:, k])
        for p, ways in enumerate(found if len(rows) else ()):
            off[p, rows, k] = ways.measure_off(hypothesis, rows)
            if p:
                harm = ways.measure_harm(found[0], hypothesis, rows)
                worse[p, rows, k], share[p, rows, k] = harm
    weight = _weigh(found, keys, there)
    best, promise = choose_plans(off, worse, np.where(there, weight, 0.0), tolerance)
    choices = [*zip(best.tolist(), promise.tolist(), strict=True)]
    return {
        rows: MoveOutcomes(
            tuple(map(PlanOutcome, off[:, m, own], worse[:, m, own])),
            share[:, m, own],
            tuple(key for key, is_own in zip(keys, own[1:], strict=True) if is_own),
            weight[m, own],
            tolerance,
            choices[m],
        )
        for m, (rows, own) in enumerate(zip(moves, there, strict=True))
    }


def find_largest(
    plan: Predicted, compared: Mapping[Rows, MoveOutcomes]
) -> dict[Rows, float]:
    """Return how far moves leave their paths at the most by any open hypothesis [m].

    Of what has one cause in all joints, any of them may do it and the others not.

    Args:
        plan: The program.
        compared: What is open of its moves.
    """
    if not compared:
        return {}
    ways, every = _PlannedMoves.of(plan, [*compared]), np.arange(len(compared))
    keys = {key for one in compared.values() for key in one.open_keys}
    largest = {key: ways.measure_largest(key, every) for key in keys}
    return {
        rows: max(float(largest[key][m]) for key in one.open_keys)
        for m, (rows, one) in enumerate(compared.items())
    }


def expect_better(
    plan: Predicted,
    shifts: Sequence[tuple[Floats, Floats]],
    compared: Mapping[Rows, MoveOutcomes],
) -> list[Rows]:
    """List the moves that may do best with their points elsewhere, if that harms none.

    Expected is that paths go evenly from where one point has moved to the next one.

    Args:
        plan: The program with the points where they are.
        shifts: Shares of the way of each move, (k,), ascending from 0 to 1, and by what
            the path is moved there, (k, 3) [m].
        compared: How these moves, to one visit each, do with the plans that are known.
    """
    if not compared:
        return []
    other = _PlannedMoves.of(plan, [*compared]).shift(shifts)
    keys = [None, *{key for one in compared.values() for key in one.keys}]
    every = np.arange(len(compared))
    off = {key: other.measure_off(key, every) - ALMOST for key in keys}
    return [
        rows
        for m, (rows, one) in enumerate(compared.items())
        if one.would_choose(np.array([off[key][m] for key in (None, *one.keys)]))
    ]


def _weigh(found: Sequence[_PlannedMoves], keys: Sequence[Key], there: Bools) -> Floats:
    """Return the weights of hypotheses, (m, h), that of what is predicted first.

    Args:
        found: The moves with all plans.
        keys: The hypotheses behind the first one.
        there: Where they make a difference, (m, h).
    """
    weights = {key: w for ways in found for key, w in ways.weights.items()}
    weights[UNDESCRIBED] = 2 * OPEN  # on both sides
    usually = np.append(1.0 - weights[UNDESCRIBED], found[0].usually)
    weight = np.tile([1.0, *(weights[key] for key in keys)], (len(there), 1))
    for k, key in enumerate(keys, 1):
        own = there[:, k]
        weight[own, 0] = np.minimum(weight[own, 0], usually[key[0]])
    closed = weight[:, 0] <= OPEN  # it is what corrections are made for, and counts
    weight[closed, 0] = np.nextafter(OPEN, 1.0)
    return weight


class _Difference(NamedTuple):
    """What a hypothesis makes of some ways, k samples.

    Attributes:
        rows: At which it makes a difference, (k,).
        across: Distance from the path there, (k,) [m].
        by: From where the TCP is predicted there to where it is, (k, 3) [m].
    """

    rows: Ints
    across: Floats
    by: Floats


def _largest_at_begin(far: Floats, way: Floats, first: Ints) -> Floats:
    """Return the largest distance in the first `BEGINS` of each way, (w,) [m].

    Args:
        far: Distances from the path at samples, (s,) [m].
        way: Path length there, (s,) [m].
        first: Where the samples of each way begin, (w,).
    """
    return np.asarray(np.maximum.reduceat(np.where(way < BEGINS, far, 0.0), first))


@dataclass(frozen=True)
class _PlannedMoves:
    """The ways of m moves with one plan, s samples in all.

    Attributes:
        way: Path length since each way began, (s,) [m]; an arc has two ways.
        off: From the path to the TCP as predicted, (s, 3) [m].
        tangent: Directions of the path, (s, 3).
        across: Distance from the path, (s,) [m].
        first: The samples of way w are first[w] .. first[w + 1] - 1.
        begin: The ways of move k are begin[k] .. begin[k + 1] - 1, (m + 1,).
        spread: Covariance of what no effect describes, (s, 6) [m^2].
        cases: What hypotheses make of it.
        weights: Of the hypotheses.
        usually: Weight of what is predicted, of every joint, (6,).
    """

    way: Floats
    off: Floats
    tangent: Floats
    across: Floats
    spread: Floats
    first: Ints
    begin: Ints
    cases: Mapping[Key, _Difference]
    weights: Mapping[Key, float]
    usually: Floats

    @classmethod
    def of(cls, plan: Predicted, moves: Sequence[Rows]) -> _PlannedMoves:
        visits = np.array([v for rows in moves for v in rows])
        number = plan.part[visits]
        start, count = np.zeros((2, len(visits)), dtype=np.int64)
        for k in np.unique(number).tolist():
            mine = number == k
            start[mine], count[mine] = plan.paths[k].spans_to(visits[mine])
        first = np.append(0, np.cumsum(count))
        way, across = np.empty((2, first[-1]))
        off, tangent = np.empty((2, first[-1], 3))
        spread = np.zeros((first[-1], 6))
        told = dict[Key, list[_Difference]]()
        weights, usually = dict[Key, float](), np.ones(6)
        for k in np.unique(number).tolist():
            paths, mine = plan.paths[k], number == k
            here, there = (spans(at[mine], count[mine]) for at in (first[:-1], start))
            way[here], across[here] = paths.way[there], paths.after.across[there]
            off[here] = paths.after.off.take(there, axis=0)
            tangent[here] = paths.tangent.take(there, axis=0)
            if paths.cases is None:
                continue
            spread[here] = paths.cases.spread(there)
            usually, place = paths.cases.usually, np.full(len(paths.way), -1)
            place[there] = here
            for key, case in paths.cases.by_key.items():
                at = place[case.rows]
                if (hit := at >= 0).any():
                    one = at[hit], case.across[hit], case.by[hit]
                    told.setdefault(key, []).append(_Difference(*one))
                    weights[key] = case.weight
        cases = {}
        for key, some in told.items():
            cases[key] = _Difference(*map(np.concatenate, zip(*some, strict=True)))
        begin = np.cumsum([0, *map(len, moves)])
        return cls(
            way, off, tangent, across, spread, first, begin, cases, weights, usually
        )

    def shift(self, by: Sequence[tuple[Floats, Floats]]) -> _PlannedMoves:
        """Return them with the TCP elsewhere, see `expect_better`."""
        count, ways = np.diff(self.first), np.arange(len(self.first) - 1)
        whole = np.repeat(self.way[self.first[1:] - 1], count)
        share = np.minimum(self.way / np.maximum(whole, 1e-12), 1.0)
        here = share + 2 * np.repeat(ways, count)
        there = np.concatenate([own + 2 * k for k, (own, _) in enumerate(by)])
        columns = np.concatenate([own for _, own in by]).T
        off = self.off + np.stack([np.interp(here, there, c) for c in columns], axis=1)
        cases = {}
        for key, (rows, _, own) in self.cases.items():
            far, _ = apart(off[rows] + own, self.tangent[rows])
            cases[key] = _Difference(rows, far, own)
        across, _ = apart(off, self.tangent)
        return replace(self, off=off, across=across, cases=cases)

    def has(self, key: Key) -> Bools:
        """Return on which moves a hypothesis makes a difference, (m,)."""
        out = np.zeros(len(self.begin) - 1, dtype=bool)
        if key in self.cases:
            out[self._moves_at(self.cases[key][0])] = True
        return out

    def measure_steps(self) -> Floats:
        """Return how far each joint moves the TCP at the most, (m, 6) [m]."""
        out = np.zeros((len(self.begin) - 1, 6))
        for (joint, _, _), (samples, _, by) in self.cases.items():
            np.maximum.at(out[:, joint - 1], self._moves_at(samples), lengths(by))
        return out

    def measure_reach(self) -> Floats:
        """Return how far each move may err as no effect describes, (m,) [m]."""
        return np.asarray(np.maximum.reduceat(self._reach, self._ends[:-1]))

    def measure_off(self, key: Key | None, moves: Ints) -> Floats:
        """Return what 95 % of the way of some moves stays within, (k,) [m]."""
        far = self._distances(key)
        return _native.stays_within(ALONG, far, self._step, self._ends, moves)

    def measure_harm(
        self, usual: _PlannedMoves, key: Key | None, moves: Ints
    ) -> tuple[Floats, Floats]:
        """Return how much farther moves are off than without points [m], and where.

        Args:
            usual: The moves without points.
            key: The hypothesis; None: all joints do as predicted.
            moves: Some of the moves, (k,).

        Returns:
            (k,), and a part of the move, from 0, and a share of its way, (k,).
        """
        parts = np.diff(self.begin)[moves]
        ways = spans(self.begin[moves], parts)
        more, place = self._farther(
            usual, key, ways, ways == np.repeat(self.begin[moves], parts)
        )
        worst, at = np.zeros((2, len(moves)))
        first = np.cumsum(parts) - parts
        for k in range(int(parts.max())):
            own = np.flatnonzero(parts > k)
            far, there = more[first[own] + k], place[first[own] + k]
            larger = far > worst[own]
            at[own[larger]], worst[own[larger]] = k + there[larger], far[larger]
        return worst, at

    def _farther(
        self, usual: _PlannedMoves, key: Key | None, ways: Ints, leads: Bools
    ) -> tuple[Floats, Floats]:
        """Return how much farther ways are off than usual, and at which share.

        Where a move begins, the largest usual distance in `BEGINS` counts: links jump
        as soon as their drives have crossed, with points a little sooner or later.

        Args:
            usual: The moves without points.
            key: The hypothesis.
            ways: Some ways, (w,).
            leads: Which of them begin a move, (w,).
        """
        (samples, own, first), (old, there, start) = (
            one._samples_of(ways) for one in (self, usual)
        )
        apart = 1.0 + float(usual.way[old].max())
        end = usual.way[usual.first[ways + 1] - 1]
        here = np.minimum(self.way[samples], end[own]) + apart * own
        there = usual.way[old] + apart * there
        if key == UNDESCRIBED:
            beside = usual._beside(old)
            columns = [np.interp(here, there, column) for column in beside.T]
            far, usually = self._err_worst(samples, np.stack(columns, axis=1))
            most = _largest_at_begin(usually, self.way[samples], first)
        else:
            far, before = self._distances(key)[samples], usual._distances(key)[old]
            usually = np.interp(here, there, before)
            most = _largest_at_begin(before, usual.way[old], start)
        begins = (self.way[samples] < BEGINS) & leads[own]
        usually[begins] = np.maximum(usually, most[own])[begins]
        more = far - usually
        top = largest_in(more, own, first)
        whole = np.maximum(self.way[self.first[ways + 1] - 1], 1e-12)
        return more[top], np.minimum(self.way[samples[top]] / whole, LAST)

    def _err_worst(self, samples: Ints, usual: Floats) -> tuple[Floats, Floats]:
        """Return distances from the path, here and usually, as the arm may err worst.

        It errs the same in both, from where it usually is towards where it is here.

        Args:
            samples: Some samples, (k,).
            usual: Where the TCP usually is there, across the path, (k, 3) [m].

        Returns:
            (k,) each [m].
        """
        beside = self._beside(samples)
        to = beside - usual
        to /= np.maximum(lengths(to), 1e-12)[:, None]
        variance = np.einsum("si,si->s", covariance_times(self.spread[samples], to), to)
        err = to * (SIDED * np.sqrt(np.maximum(variance, 0.0)))[:, None]
        return lengths(beside + err), lengths(usual + err)

    def _beside(self, samples: Ints) -> Floats:
        """Return from the path to the TCP, across it, (k, 3) [m]."""
        off, tangent = self.off[samples], self.tangent[samples]
        along = np.einsum("si,si->s", off, tangent)[:, None]
        return np.asarray(off - along * tangent)

    def measure_largest(self, key: Key | None, moves: Ints) -> Floats:
        """Return the largest distance of some moves from their paths, (k,) [m]."""
        far = self._distances(key)
        if key is not None and key[2] == OF_ALL:
            far = self._farthest_of_any(key[1])
        largest = np.maximum.reduceat(far, self._ends[:-1])
        return np.asarray(largest[moves])

    def _farthest_of_any(self, kind: FlankKind) -> Floats:
        """Return the largest distance if any of some joints do what may be, (s,) [m].

        All sets of these joints are tried, each by one joint more or less than the one
        before (Gray code).
        """
        some = [case for (_, own, number), case in self.cases.items()
                if own is kind and number != OF_ALL]  # fmt: skip
        rows = np.unique(np.concatenate([case.rows for case in some]))
        by = np.zeros((len(some), len(rows), 3))
        for j, case in enumerate(some):
            by[j, np.searchsorted(rows, case.rows)] = case.by
        out, off, tangent = np.array(self.across), self.off[rows], self.tangent[rows]
        for number in range(1, 1 << len(some)):
            joint = (number & -number).bit_length() - 1
            adds = (number ^ number >> 1) >> joint & 1
            off += by[joint] if adds else -by[joint]
            out[rows] = np.maximum(out[rows], apart(off, tangent)[0])
        return out

    def _samples_of(self, ways: Ints) -> tuple[Ints, Ints, Ints]:
        """Return the samples of ways, whose each is, and where those of each begin."""
        count = np.diff(self.first)[ways]
        samples = spans(self.first[ways], count)
        return samples, np.repeat(np.arange(len(ways)), count), np.cumsum(count) - count

    def _distances(self, key: Key | None) -> Floats:
        """Return the distances from the paths under a hypothesis, (s,) [m]."""
        if key == UNDESCRIBED:
            return self.across + self._reach
        if key is None or key not in self.cases:
            return self.across
        out, (samples, across, _) = np.array(self.across), self.cases[key]
        out[samples] = across
        return out

    def _moves_at(self, samples: Ints) -> Ints:
        return np.searchsorted(self._ends, samples, side="right") - 1

    @cached_property
    def _reach(self) -> Floats:
        """How far the arm may err across the path as no effect describes, (s,) [m].

        Along the longest axis of the ellipse that the covariance is across the path.
        """
        if not self.spread.any():
            return np.zeros(len(self.spread))
        a, b, c, d, e, f = self.spread.T
        turned = covariance_times(self.spread, self.tangent)
        along = np.einsum("si,si->s", turned, self.tangent)
        trace = a + b + c - along
        square = a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f) + along**2
        square -= 2.0 * np.einsum("si,si->s", turned, turned)
        apart = square / 2 - (trace / 2) ** 2
        largest = trace / 2 + np.sqrt(np.maximum(apart, 0.0))
        return np.asarray(SIDED * np.sqrt(np.maximum(largest, 0.0)))

    @cached_property
    def _ends(self) -> Ints:
        """Where the samples of each move begin, and the last ones end, (m + 1,)."""
        return self.first[self.begin]

    @cached_property
    def _step(self) -> Floats:
        """Way from the sample before to each, (s,) [m]."""
        return steps_of(self.way, self.first)
