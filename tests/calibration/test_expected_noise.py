"""What is said of poses that nobody has measured."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.expected_noise import count_repeats, expect_noise
from postproc.calibration.regression import Fit
from postproc.calibration.stops import pool_readings
from postproc.calibration.validation import FitTask
from postproc.robot.cell import load_cell
from tests.calibration.simulator import random_arm, survey_of
from tests.campaign_rows import Habit, measure

CELL = load_cell("programs/cell.toml")
SHIFT = 8e-5  # [m] of a stop: more than three times the data sheet


def fit_of(
    rounds: int, sides: int, decimals: int = 5, shift: float = SHIFT,
    pose: float = 0.0, poses: int = 80,
) -> Fit:  # fmt: skip
    """Fit a campaign; every pose may be off by a shift that all its visits share."""
    rng = np.random.default_rng(8)
    arm = random_arm(rng)
    arm.backlash[:, 1:] = 0.0
    habit = Habit(poses, 2, 1, rounds, sides, decimals, 0.0, shift, 1e-5, clock=False)
    survey = measure(arm, habit, rng)
    _, of_row = np.unique(survey.states.q, axis=0, return_inverse=True)
    off = pose * rng.standard_normal((poses, 3))[of_row.reshape(-1)]
    rows = pool_readings(survey_of(survey.states, survey.position + off))
    return FitTask(rows, CELL.arm, ("geometry", "backlash"), None).fit()


def std_of_pose(fitted: Fit) -> float:
    noise = expect_noise(fitted)
    variance = noise.pose_variance(fitted.design.jacobian)
    return float(np.sqrt(variance.mean()))


@pytest.mark.parametrize(("rounds", "sides"), [(2, 1), (1, 2), (2, 2)])
def test_scatter_that_several_visits_show_is_no_error_of_a_pose(
    rounds: int, sides: int
) -> None:
    assert std_of_pose(fit_of(rounds, sides)) < 0.25 * SHIFT


@pytest.mark.parametrize(("rounds", "sides"), [(3, 1), (1, 2), (2, 2)])
def test_an_error_that_all_visits_share_is_one_of_the_pose(
    rounds: int, sides: int
) -> None:
    fitted = fit_of(rounds, sides, shift=1e-5, pose=1e-4)
    assert std_of_pose(fitted) == pytest.approx(1e-4, rel=0.25)


def test_what_one_approach_alone_has_is_no_larger_than_what_both_share() -> None:
    fitted = fit_of(1, 2, pose=4e-5)
    assert count_repeats(fitted.batch.states) == 0
    noise = fitted.noise
    own = float(noise.pose_variance(fitted.design.jacobian).mean())
    assert 3e-5 < own**0.5 < std_of_pose(fitted) <= 1.001 * (2.0 * own) ** 0.5


def test_of_one_visit_a_pose_all_beyond_the_data_sheet_is_of_the_pose() -> None:
    fitted = fit_of(1, 1)
    sheet = CELL.arm.repeatability / 3.0
    assert std_of_pose(fitted) == pytest.approx((SHIFT**2 - sheet**2) ** 0.5, rel=0.2)


@pytest.mark.parametrize("decimals", [1, 2, 3])
@pytest.mark.parametrize(("rounds", "sides"), [(2, 1), (1, 2)])
def test_rounding_that_exceeds_its_limit_by_chance_is_no_error_of_poses(
    rounds: int, sides: int, decimals: int
) -> None:
    fitted = fit_of(rounds, sides, decimals, shift=1e-5)
    step = np.deg2rad(10.0**-decimals) / 12.0**0.5
    assert std_of_pose(fitted) == 0.0
    assert expect_noise(fitted).rounding <= 1.001 * step
