"""Branches and turns as the controller chooses them."""

import numpy as np
import pytest

from postproc.exceptions import PlanError
from postproc.simulation.controller import joints_along, joints_of_pose, straight
from postproc.simulation.kinematics import NJ220

Q = np.radians([20.0, 10.0, -100.0, 40.0, 50.0, -60.0])
FLANGE = NJ220.flange(Q[None])[0]


def solve(config: str | None, near: np.ndarray = Q, free: bool = False) -> np.ndarray:
    return joints_of_pose(NJ220, FLANGE, near, config, free)


def test_the_string_picks_branch_and_turns() -> None:
    np.testing.assert_allclose(solve(""), Q, atol=1e-9)
    flipped = solve("W")
    assert flipped[4] == pytest.approx(-Q[4])
    np.testing.assert_allclose(NJ220.flange(flipped[None])[0], FLANGE, atol=1e-11)
    turned = solve("T1:1 T2:-2")
    np.testing.assert_allclose(
        turned - Q, [0, 0, 0, 2 * np.pi, 0, -4 * np.pi], atol=1e-8
    )


def test_the_nearest_turn_wins_where_the_program_says_so() -> None:
    near = Q + np.array([0, 0, 0, 4 * np.pi, 0, -2 * np.pi])
    np.testing.assert_allclose(solve("T1:0", near, free=True), near, atol=1e-8)
    np.testing.assert_allclose(solve("T1:0", near), Q, atol=1e-8)


def test_without_a_string_the_nearest_solution_wins() -> None:
    np.testing.assert_allclose(solve(None), Q, atol=1e-9)
    flipped = solve("W")
    np.testing.assert_allclose(solve(None, flipped + 0.01), flipped, atol=1e-9)


def test_out_of_reach_and_out_of_range_are_refused() -> None:
    far = FLANGE.copy()
    far[0, 3] = 4.0
    with pytest.raises(PlanError):
        joints_of_pose(NJ220, far, Q, None, True)
    with pytest.raises(PlanError):
        solve("T1:9")


def test_a_path_is_followed_without_a_jump() -> None:
    start = Q + np.array([0, 0, 0, 2 * np.pi, 0, 0])
    end = FLANGE.copy()
    end[:3, 3] += [-0.1, 0.3, -0.2]
    way = straight(FLANGE, end)
    joints = joints_along(NJ220, way, start)
    np.testing.assert_allclose(NJ220.flange(joints), way, atol=1e-11)
    assert np.abs(np.diff(np.vstack([start, joints]), axis=0)).max() < 0.05
    assert joints[-1, 3] > np.pi


def test_a_path_out_of_reach_is_refused() -> None:
    end = FLANGE.copy()
    end[0, 3] += 3.0
    with pytest.raises(PlanError, match="path"):
        joints_along(NJ220, straight(FLANGE, end), Q)
