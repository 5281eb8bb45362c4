from __future__ import annotations

import numpy as np
import pytest

from postproc.exceptions import PlanError
from postproc.motion.ruckig import JointMoves
from postproc.robot.arm import Arm


@pytest.mark.parametrize("override", [1.0, 0.3])
def test_a_move_ends_in_its_target_within_the_limits(
    arm: Arm, home: np.ndarray, override: float
) -> None:
    end = home + np.array([0.5, -0.2, 0.3, 1.0, -0.6, 4.0])
    move = JointMoves(arm).move(home, end, override)
    for time, q in ((0.0, home), (move.duration, end)):
        at, velocity, _ = move.at(time)
        np.testing.assert_allclose(at, q, atol=1e-9)
        np.testing.assert_allclose(velocity, 0.0, atol=1e-9)
    states = [move.at(t) for t in np.linspace(0, move.duration, 400)]
    q, velocity, acceleration = (np.array(part) for part in zip(*states, strict=True))
    assert (np.abs(velocity) <= override * arm.velocity + 1e-9).all()
    assert (np.abs(acceleration) <= override**2 * arm.acceleration + 1e-9).all()
    share = (q - home) / (end - home)
    np.testing.assert_allclose(share, share[:, :1] * np.ones(6), atol=1e-6)


def test_stretching_time_by_an_override(arm: Arm, home: np.ndarray) -> None:
    moves, end = JointMoves(arm), home + 0.4
    whole, half = (moves.move(home, end, share).duration for share in (1.0, 0.5))
    assert half == pytest.approx(2 * whole)


def test_no_move_takes_no_time(arm: Arm, home: np.ndarray) -> None:
    assert JointMoves(arm).move(home, home).duration == 0.0


def test_a_target_that_is_no_number_is_an_error_of_ours(
    arm: Arm, home: np.ndarray
) -> None:
    with pytest.raises(PlanError):
        JointMoves(arm).move(home, np.full(6, np.nan))
