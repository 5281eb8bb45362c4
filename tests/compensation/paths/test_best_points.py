"""Of all points that were tried on a move those come back that did best."""

from __future__ import annotations

from typing import Any
from unittest.mock import Mock

import numpy as np

from postproc.compensation.paths.best_points import IN_VAIN, BestPoints
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.compensation.paths.insertion_prediction import PathPrediction
from postproc.compensation.paths.plan_rule import MoveDeviation
from postproc.robot.trajectory import Motion

OPEN = {7: (0.0, 0.0, 0.0)}


def tried(size: float, *shares: float, refused: str = "", within: float = 0.0) -> Any:
    """A line with points, how far it is off with them, and 95 % of its way [m]."""
    task = Mock(tolerance=1e-4, deviations={7: MoveDeviation(3e-4, 3e-4)})
    task.visits.motion.kind = np.full(9, int(Motion.LINEAR))
    plan = InsertionPlan(open=OPEN, points={7: shares} if shares else {})
    now = PathPrediction(task, plan, (), np.zeros(9, dtype=np.int64))
    refusals = {7: refused} if refused else {}
    deviations = {7: MoveDeviation(within, size)}
    vars(now).update(deviations=deviations, flat={}, refusals=refusals)
    return now


def test_points_that_did_better_come_back() -> None:
    best = BestPoints()
    for now in (tried(3e-4), tried(1e-4, 0.5), tried(2e-4, 0.5, 0.7)):
        best = best.note(now)
    assert best.restore(tried(2e-4, 0.5, 0.7)).points == {7: (0.5,)}
    assert best.restore(tried(1e-4, 0.5)).points == {7: (0.5,)}
    assert best.restore(tried(5e-5, 0.6)).points == {7: (0.6,)}


def test_a_way_that_is_nearer_makes_up_for_a_place_that_is_not() -> None:
    best = BestPoints().note(tried(3e-4, within=3e-4))
    nearer = best.note(tried(3.3e-4, 0.5, within=5e-5))
    assert nearer.restore(tried(3e-4, 0.6, within=3e-4)).points == {7: (0.5,)}
    harmed = best.note(tried(3.5e-4, 0.5, within=0.0))  # by more than may be
    assert not harmed.restore(tried(3.5e-4, 0.5, within=0.0)).points
    farther = best.note(tried(2.9e-4, 0.5, within=3.2e-4))
    assert not farther.restore(tried(2.9e-4, 0.5, within=3.2e-4)).points


def test_points_that_cannot_be_corrected_never_come_back() -> None:
    best = BestPoints().note(tried(3e-4)).note(tried(1e-5, 0.5, refused="why"))
    plan = best.restore(tried(1e-5, 0.5, refused="why"))
    assert not plan.points and plan.left == {7: "why"}


def test_a_move_that_more_points_do_not_help_gets_no_more() -> None:
    best, shares = BestPoints().note(tried(3e-4)), [0.5]
    for k in range(IN_VAIN):
        now = tried(3e-4, *shares)
        assert 7 not in best.settle(now).plan.settled
        best, shares = best.note(now), [*shares, 0.6 + k / 100]
    assert best.settle(tried(3e-4)).plan.settled == {7}
    helped = best.note(tried(2e-4, *shares))
    assert not helped.settle(tried(3e-4)).plan.settled


def test_rounds_in_which_other_moves_get_points_do_not_count() -> None:
    best = BestPoints()
    for _ in range(3 * IN_VAIN):
        best = best.note(tried(3e-4, 0.5))
    assert not best.settle(tried(3e-4, 0.5)).plan.settled
