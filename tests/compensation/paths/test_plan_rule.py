"""The rule that chooses a plan: knowing more never raises the promise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc.compensation.paths.plan_rule import (
    PlanOutcome,
    choose_plan,
    negligible,
    tolerable_harm,
)
from postproc.model.flank_hypotheses import OPEN
from postproc.robot.pose import MM

TOLERANCE = 0.1 * MM
sizes = st.floats(0.0, 0.5).map(lambda mm: mm * MM)


def outcomes(count: int) -> st.SearchStrategy[list[PlanOutcome]]:
    """Draw up to four plans, the first one that without points."""
    column = st.lists(sizes, min_size=count, max_size=count).map(np.array)
    plan = st.builds(PlanOutcome, column, column)
    none = column.map(lambda off: PlanOutcome(off, np.zeros(count)))
    return st.tuples(none, st.lists(plan, max_size=3)).map(lambda p: [p[0], *p[1]])


@st.composite
def moves(draw: st.DrawFn) -> tuple[list[PlanOutcome], np.ndarray, int]:
    count = draw(st.integers(2, 6))
    weights = st.lists(st.floats(0.0, 1.0), min_size=count, max_size=count)
    weight = np.array(draw(weights))
    weight[0] = max(weight[0], 0.1)
    return draw(outcomes(count)), weight, draw(st.integers(1, count - 1))


@given(moves())
def test_to_exclude_a_hypothesis_never_raises_the_promise(move) -> None:
    plans, weight, gone = move
    _, promise = choose_plan(plans, weight, TOLERANCE)
    less = np.where(np.arange(len(weight)) == gone, 0.0, weight)
    assert choose_plan(plans, less, TOLERANCE)[1] <= promise


@given(moves())
def test_the_promise_holds_and_no_open_hypothesis_is_worse(move) -> None:
    plans, weight, _ = move
    best, promise = choose_plan(plans, weight, TOLERANCE)
    open_ = weight > OPEN
    assert (plans[best].off[open_] <= promise + 1e-9).all()
    assert (plans[best].worse[open_] <= tolerable_harm(TOLERANCE)).all()


def plan(off: list[float], worse: list[float]) -> PlanOutcome:
    return PlanOutcome(np.array(off) * MM, np.array(worse) * MM)


def test_what_is_unlikely_closes_no_plan() -> None:
    none = plan([0.2, 0.2], [0.0, 0.0])
    points = plan([0.02, 0.2], [0.0, 0.3])
    for likely, best in ((0.04, 1), (0.06, 0)):
        weight = np.array([0.9, likely])
        assert choose_plan([none, points], weight, TOLERANCE)[0] == best


def test_of_equal_promises_the_least_expected_is_taken() -> None:
    plans = [plan([0.049], [0.0]), plan([0.01], [0.0]), plan([0.03], [0.0])]
    best, promise = choose_plan(plans, np.ones(1), TOLERANCE)
    assert best == 1 and promise == pytest.approx(0.05 * MM)


@pytest.mark.parametrize("steps", [(0.004, 0.3, 0.014), (0.3, 0.004, 0.014)])
def test_small_steps_together_never_count(steps: tuple[float, ...]) -> None:
    found = negligible(np.array(steps) * MM, TOLERANCE)
    np.testing.assert_array_equal(found, np.array(steps) < 0.1)
    assert not negligible(np.array([0.015, 0.015]) * MM, TOLERANCE).all()


@given(st.lists(sizes, min_size=6, max_size=6), st.integers(0, 5))
def test_smaller_steps_count_no_more(steps: list[float], joint: int) -> None:
    usual, less = np.array(steps), np.array(steps)
    less[joint] = 0.0
    assert (negligible(less, TOLERANCE) >= negligible(usual, TOLERANCE)).all()
