"""A spline of a joint's error is offered where the rows can show one."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.model.effects.joint_spline import LEAST_ROWS, JointSpline
from postproc.robot.state import make_states


@pytest.mark.parametrize(
    ("rows", "span_deg", "offered"),
    [
        (LEAST_ROWS, 90.0, True),
        (LEAST_ROWS - 1, 90.0, False),
        (5 * LEAST_ROWS, 5.0, False),  # no joint has moved far enough
    ],
)
def test_it_takes_rows_and_a_joint_that_moved(
    rows: int, span_deg: float, offered: bool
) -> None:
    rng = np.random.default_rng(rows)
    q = np.radians(span_deg) * rng.uniform(-0.5, 0.5, (rows, 6))
    states = make_states(q, np.ones((rows, 6)), np.zeros((rows, 3)))
    assert JointSpline.may_show(states) is offered
