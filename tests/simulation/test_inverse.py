"""Inverse kinematics by its definition: fk(ik(x)) = x, ik(fk(q)) contains q."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.exceptions import PlanError
from postproc.simulation.kinematics import (
    NJ220,
    branch_of,
    nearest_turns,
    require_closed_form,
    solve_branch,
)


def sample(n: int = 400) -> np.ndarray:
    low = np.radians([-170, -70, -250, -175, -120, -175])
    high = np.radians([170, 90, 5, 175, 120, 175])
    return np.random.default_rng(0).uniform(low, high, (n, 6))


@pytest.mark.parametrize("branch", range(8))
def test_every_branch_reaches_the_pose_and_is_that_branch(branch: int) -> None:
    flange = NJ220.flange(sample())
    q = solve_branch(NJ220, flange, branch)
    reached = ~np.isnan(q).any(axis=1)
    assert reached.sum() > 100
    np.testing.assert_allclose(NJ220.flange(q[reached]), flange[reached], atol=1e-11)
    assert set(branch_of(NJ220, q[reached])) == {branch}


def test_the_branch_of_the_joints_gives_the_joints_back() -> None:
    q = sample()
    flange, branch = NJ220.flange(q), branch_of(NJ220, q)
    for b in range(8):
        rows = branch == b
        found = nearest_turns(solve_branch(NJ220, flange[rows], b), q[rows])
        np.testing.assert_allclose(found, q[rows], atol=1e-8)


def test_flags_mean_what_the_controller_means() -> None:
    q = np.radians([[0, 0, -90, 0, 30, 0], [0, 0, -90, 0, -30, 0]])
    np.testing.assert_array_equal(branch_of(NJ220, q), [0, 4])
    # Axis 3 outside (-192.53, -12.53) deg is the other elbow.
    edge = np.radians([[0, 0, -12.6, 0, 30, 0], [0, 0, -12.4, 0, 30, 0]])
    np.testing.assert_array_equal(branch_of(NJ220, edge), [0, 1])
    # Leaning over backwards brings the wrist centre behind axis 1.
    back = np.radians([[0, -75.0, -60.0, 0, 30, 0]])
    assert branch_of(NJ220, back)[0] & 2


def test_out_of_reach_is_nan() -> None:
    flange = NJ220.flange(sample(1))
    flange[0, :3, 3] = [5.0, 0.0, 0.0]
    assert np.isnan(solve_branch(NJ220, flange, 0)).all()


def test_another_shape_of_arm_is_refused() -> None:
    with pytest.raises(PlanError, match="spherical wrist"):
        require_closed_form(replace(NJ220, d=NJ220.d + 0.1))
