"""Of all points that were tried on a move those come back that did best."""

from __future__ import annotations

from typing import Any
from unittest.mock import Mock

import numpy as np

from postproc.compensation.paths.best_points import BestPoints
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.robot.trajectory import Motion

OPEN = {7: (0.0, 0.0, 0.0)}


def tried(size: float, *shares: float, refused: str = "") -> Any:
    """A line with points, and how far it is off with them [m]."""
    now = Mock(plan=InsertionPlan(open=OPEN, points={7: shares} if shares else {}))
    now.sizes, now.flat = {7: size}, {}
    now.refusals = {7: refused} if refused else {}
    now.task.visits.motion.kind = np.full(9, int(Motion.LINEAR))
    return now


def test_points_that_did_better_come_back() -> None:
    best = BestPoints()
    for now in (tried(3e-4), tried(1e-4, 0.5), tried(2e-4, 0.5, 0.7)):
        best = best.note(now)
    assert best.restore(tried(2e-4, 0.5, 0.7)).points == {7: (0.5,)}
    assert best.restore(tried(1e-4, 0.5)).points == {7: (0.5,)}
    assert best.restore(tried(5e-5, 0.6)).points == {7: (0.6,)}


def test_points_that_cannot_be_corrected_never_come_back() -> None:
    best = BestPoints().note(tried(3e-4)).note(tried(1e-5, 0.5, refused="why"))
    plan = best.restore(tried(1e-5, 0.5, refused="why"))
    assert not plan.points and plan.left == {7: "why"}
