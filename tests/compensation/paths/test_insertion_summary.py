"""What is told of moves that stay too far from their paths."""

from __future__ import annotations

from unittest.mock import Mock

import numpy as np
import pytest

from postproc.compensation.paths import insertion_summary
from postproc.compensation.paths.insertion_plan import InsertionPlan
from postproc.robot.trajectory import Motion


@pytest.mark.parametrize(
    ("shut", "cure"),
    [({7: {0.6}}, insertion_summary.TURNS), ({}, insertion_summary.SHORTER)],
)
def test_where_the_error_changes_too_fast_the_limit_is_named(shut, cure) -> None:
    plan = InsertionPlan(points={}, shut=shut, open={7: (0.0, 0.0, 0.0)})
    now = Mock(plan=plan, too_far=[7])
    now.task.visits.motion.kind = np.full(9, int(Motion.LINEAR))
    paths = Mock(way=np.array([0.4]))
    paths.after.largest = np.array([0])
    now.path_to.return_value = (paths, 0)
    assert insertion_summary._cures(now) == {7: cure}
