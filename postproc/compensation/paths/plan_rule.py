"""The rule by which a plan is chosen for a move: points, fewer of them, or none.

The data leave hypotheses open of how every joint changes its flank. Each plan leaves
its path by some distance under each of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.model.flank_hypotheses import OPEN
from postproc.robot.pose import MM

ALONG = 0.95  # of a way: what the deviation of a plan is taken of
LEAST_STEP = 0.05 * MM  # [m] the finest promise, and harm that counts at the least
PREDICTED = 0.01 * MM  # [m] what a deviation is predicted to: harm may be so much more
NEGLIGIBLE = 0.2  # of the tolerance: steps that together never count against a plan


class MoveDeviation(NamedTuple):
    """How far a move leaves its path, as predicted.

    Attributes:
        within: What 95 % of its way stays within [m].
        largest: At the most [m].
    """

    within: float
    largest: float

    @property
    def both(self) -> float:
        """Return the sum, by which plans of a move are compared: both are promised."""
        return self.within + self.largest

    def is_harmed(self, before: MoveDeviation, tolerance: float) -> bool:
        """Return True if it is farther at the most by more than may be.

        Args:
            before: The move without points.
            tolerance: Of paths [m].
        """
        return self.largest > before.largest + tolerable_harm(tolerance)


@dataclass(frozen=True)
class PlanOutcome:
    """How far a move leaves its path with a plan, under each of h hypotheses.

    Attributes:
        off: What 95 % of its way stays within, (h,) [m].
        worse: How much farther it is than without points, anywhere, (h,) [m].
    """

    off: Floats
    worse: Floats


def resolution(tolerance: float) -> float:
    """Return the steps of a promise, which is also the harm that counts [m].

    Args:
        tolerance: Of paths [m].
    """
    return max(LEAST_STEP, tolerance / 2)


def tolerable_harm(tolerance: float) -> float:
    """Return by how much a plan may be predicted worse than no points [m].

    That much less than what counts as the prediction itself may be off by.

    Args:
        tolerance: Of paths [m].
    """
    return resolution(tolerance) - PREDICTED


def choose_plan(
    plans: Sequence[PlanOutcome], weight: Floats, tolerance: float
) -> tuple[int, float]:
    """Choose the plan of a move, see `choose_plans`.

    Args:
        plans: The first one is that without points.
        weight: Of each hypothesis, (h,).
        tolerance: Of paths [m].
    """
    off, worse = (
        np.array([getattr(plan, name) for plan in plans])[:, None]
        for name in ("off", "worse")
    )
    best, promise = choose_plans(off, worse, weight[None], tolerance)
    return int(best[0]), float(promise[0])


def choose_plans(
    off: Floats, worse: Floats, weight: Floats, tolerance: float
) -> tuple[Ints, Floats]:
    """Choose the plans of m moves.

    Of the plans that no open hypothesis makes worse anywhere than without points by
    more than `tolerable_harm`, those with the least promise, and of these the one that
    is expected to leave the path least. A promise is what 95 % of the way stays within
    under the worst open hypothesis, in whole steps of `resolution`. It is the least of
    largest values over sets that grow and shrink: to exclude a hypothesis never raises
    it.

    Args:
        off: As in `PlanOutcome`, (p, m, h) [m]; 0 where a hypothesis makes no
            difference. The first plan is that without points.
        worse: Likewise.
        weight: Of each hypothesis, (m, h); those above `OPEN` are open.
        tolerance: Of paths [m].

    Returns:
        Which plan, (m,), and its promise, (m,) [m].
    """
    step, open_ = resolution(tolerance), weight > OPEN
    most, harm = (
        np.where(open_, of, 0.0).max(axis=2, initial=0.0) for of in (off, worse)
    )
    with np.errstate(invalid="ignore"):  # where nothing is asked for
        promise = np.ceil(np.round(most / step, 6)) * step
    harms = harm > tolerable_harm(tolerance)
    expected = (off * weight).sum(axis=2)
    best = np.lexsort((expected, promise, harms), axis=0)[0]
    return best, np.take_along_axis(promise, best[None], axis=0)[0]


def negligible(steps: Floats, tolerance: float) -> Bools:
    """Return which joints' steps together are too small to count against a plan.

    The smallest first, as long as their sum stays below a fifth of the tolerance.

    Args:
        steps: How far each joint moves the TCP under its worst hypothesis on a move,
            (.., 6) [m].
        tolerance: Of paths [m].

    Returns:
        (.., 6).
    """
    order = np.argsort(steps, axis=-1, kind="stable")
    together = np.cumsum(np.take_along_axis(steps, order, axis=-1), axis=-1)
    small = np.zeros(steps.shape, dtype=bool)
    np.put_along_axis(small, order, together < NEGLIGIBLE * tolerance, axis=-1)
    return small
