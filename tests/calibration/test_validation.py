"""Poses that no fit has seen decide what is written."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.calibration.cross_validation import (
    HeldOutRows,
    PairedErrors,
    choose,
    parts_of,
    predict_held_out_linearly,
    summarise,
)
from postproc.calibration.expected_noise import expect_noise
from postproc.calibration.fit import fit_measurements
from postproc.calibration.validation import ASKED, FitTask, Rung
from postproc.robot.cell import load_cell
from tests.calibration.simulator import random_arm, random_states, survey_of
from tests.campaign_rows import Habit, draw_habit, measure, unseen
from tests.campaigns import judge
from tests.slow import slow

CELL = load_cell("programs/cell.toml")
PLAIN = ("geometry", "backlash")


def rows_of(error: np.ndarray, std: float = 1e-5) -> HeldOutRows:
    """Make held-out rows of one pose each."""
    n = len(error)
    return HeldOutRows(
        error, np.full((n, 3), std), np.arange(n) % 5, np.ones(n, dtype=bool),
        np.arange(n), np.full(n, 1e-12),
    )  # fmt: skip


def noise(seed: int, size: float = 1e-5, n: int = 300) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal((n, 3))


def test_a_model_that_is_better_by_chance_is_not_chosen() -> None:
    """Of 200 pairs that are equally good at most 4 % of the others are taken."""
    taken = [
        choose([rows_of(noise(2 * k)), rows_of(noise(2 * k + 1))]) for k in range(200)
    ]
    assert sum(taken) <= 8


def test_a_model_that_leaves_less_is_chosen_and_the_simpler_of_two_alike() -> None:
    usual, better = rows_of(noise(1, 1.5e-5)), rows_of(noise(2))
    assert choose([usual, better]) == 1
    assert choose([better, usual]) == 0
    assert choose([rows_of(noise(3, 2e-5)), better, better]) == 1


def test_errors_are_paired_by_pose() -> None:
    """A small gain shows beside scatter that both models share."""
    shared = 0.1 * np.abs(noise(1, 1.0, 400)) + 1.0
    gain = PairedErrors.of(rows_of(shared), rows_of(0.999 * shared))
    assert gain.better and gain.poses == 400
    assert not PairedErrors.of(rows_of(noise(1)), rows_of(noise(2))).better


def test_intervals_are_widened_by_rows_that_did_not_judge_them() -> None:
    narrow = rows_of(noise(4, 2e-5))
    assert narrow.widening == pytest.approx(2.0, rel=0.05)
    assert narrow.covered == pytest.approx(0.95, abs=0.02)
    assert rows_of(noise(5)).widening == 1.0


def test_the_tracker_s_own_part_is_taken_off() -> None:
    own = noise(6, 3e-5, 4000)
    error = own + noise(7, 4e-5, 4000)
    rows = replace(rows_of(error), tracker=np.full(4000, 16e-10))
    found = summarise(rows, 0.1, chosen=True)
    expected = np.linalg.norm(own, axis=1).mean() * 1e3
    assert found.arm_mm == pytest.approx(expected, rel=0.03)
    assert "effects chosen again" in found.describe()


def test_parts_hold_whole_poses() -> None:
    pose = np.repeat(np.arange(40), 3)
    part = parts_of(pose, 0)
    assert (part.reshape(40, 3) == part.reshape(40, 3)[:, :1]).all()
    assert np.bincount(part).tolist() == 5 * [24]


def test_parts_predicted_linearly_are_near_to_fits_without_them() -> None:
    rng = np.random.default_rng(0)
    arm, states = random_arm(rng), random_states(80, rng)
    survey = survey_of(states, arm.measure(states, rng)[0])
    task = FitTask(survey, CELL.arm, PLAIN, None)
    fitted = task.fit()
    part = parts_of(np.arange(80), 0)
    linear = predict_held_out_linearly(fitted, part)
    exact = task.errors(Rung(ASKED, PLAIN), part, np.ones(80, dtype=bool))
    gap = np.linalg.norm(linear.error - exact.error, axis=1)
    assert np.median(gap) < 0.15 * np.median(np.linalg.norm(exact.error, axis=1))


def test_rows_that_fit_no_arm_are_rejected() -> None:
    rng = np.random.default_rng(1)
    states = random_states(40, rng)
    arm = random_arm(rng)
    true = arm.arm.tcp(states.q, states.tool)
    wild = survey_of(states, true + 2e-3 * rng.standard_normal(true.shape))
    found = fit_measurements(wild, CELL, effects=("geometry",))
    assert "registration and probe alone" in found.rejected


def test_few_poses_are_said_to_be_unchecked() -> None:
    rng = np.random.default_rng(2)
    arm, states = random_arm(rng), random_states(10, rng)
    survey = survey_of(states, arm.measure(states, rng)[0])
    found = fit_measurements(survey, CELL, effects=("geometry",))
    assert found.report.held_out is None
    assert any("too few to hold some out" in w for w in found.report.warnings)


@pytest.mark.parametrize("seed", [112, *slow([7, 9])])
def test_the_default_is_never_worse_than_geometry_and_backlash(seed: int) -> None:
    """Of three short campaigns, two of which it once left twice as much of."""
    rng = np.random.default_rng([20261126, seed])
    arm, habit = random_arm(rng), draw_habit(rng, 20, 300)
    survey, checked = measure(arm, habit, rng), unseen(arm, rng)
    full, plain = (judge(survey, CELL, e, checked) for e in (None, PLAIN))
    assert not isinstance(full, str) and not isinstance(plain, str)
    assert full.mean < 1.05 * plain.mean
    assert full.covered > 0.8


def test_rounded_angles_are_no_error_of_other_poses() -> None:
    rng = np.random.default_rng(3)
    arm = random_arm(rng)
    habit = Habit(60, 1, 1, 1, 2, 2, 0.0, 0.0, 1e-5, clock=False)
    survey = measure(arm, habit, rng)
    fitted = FitTask(survey, CELL.arm, ("geometry", "backlash_profile"), None).fit()
    step = np.deg2rad(0.01) / np.sqrt(12.0)
    assert fitted.noise.pose_joint == pytest.approx(step, rel=0.2)
    expected = expect_noise(fitted)
    assert expected.pose_joint < 0.7 * step
    assert expected.rounding == pytest.approx(step, rel=0.2)


def test_one_pause_within_a_stop_leaves_the_stated_errors() -> None:
    """A single return to a pose cannot part scatter of stops from errors of a pose."""
    rng = np.random.default_rng(4)
    arm = random_arm(rng)
    habit = Habit(40, 2, 1, 1, 1, 5, 5e-6, 1e-5, 2e-5, clock=True)
    survey, (states, _) = measure(arm, habit, rng), unseen(arm, rng)
    time = np.array(survey.states.time)
    time[41:] += 3600.0
    paused = survey.with_states(survey.states.with_(time=time))
    usual, late = (
        fit_measurements(rows, CELL, effects=PLAIN, validate=False).model
        for rows in (survey, paused)
    )
    stated = [m.predict(arm.arm, states).std_model.mean() for m in (usual, late)]
    assert stated[1] == pytest.approx(stated[0], rel=0.05)
