"""Directions that are wrong in the file are found and listed, and never invented."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.direction_labels import judge_directions, mend_directions
from postproc.calibration.effect_selection import fit_survey
from postproc.calibration.fit import fit_measurements
from postproc.calibration.measurements import Measurements
from postproc.calibration.regression import Fit
from postproc.model.effects import BASE_EFFECTS
from postproc.model.kinematics import ArmStates
from postproc.report.fit import tell_fit
from postproc.robot.cell import load_cell
from tests.calibration.simulator import NJ, random_arm, random_states, survey_of

ROWS = 300


def flipped(seed: int, rate: float) -> tuple[Measurements, np.ndarray]:
    """Return a survey, and which of its directions are wrong."""
    rng = np.random.default_rng(seed)
    arm, states = random_arm(rng), random_states(ROWS, rng)
    position, _ = arm.measure(states, rng)
    wrong = rng.random((ROWS, 6)) < rate
    told = np.where(wrong, -states.direction, states.direction)
    return survey_of(states.with_(direction=told), position), wrong


def true_error(fit: Fit, seed: int) -> float:
    """Mean error of the fit at poses that it has not seen [mm]."""
    arm = random_arm(np.random.default_rng(seed))
    held = random_states(ROWS, np.random.default_rng(1000 + seed))
    landed = arm.tcp(held.q, held.direction, held.tool)
    batch = ArmStates(NJ, held)
    left = landed - batch.walk.tcp - fit.combination.error(batch, fit.values)
    return float(np.linalg.norm(left, axis=1).mean() * 1e3)


@pytest.mark.parametrize("seed", [2, 3])
def test_flipped_directions_hardly_cost_accuracy(seed: int) -> None:
    clean = true_error(fit_survey(flipped(seed, 0.0)[0], NJ, BASE_EFFECTS, None), seed)
    survey, wrong = flipped(seed, 0.05)
    fit = fit_survey(survey, NJ, BASE_EFFECTS, None)
    assert true_error(fit, seed) < 1.3 * clean
    used, told = fit.batch.states.direction, survey.states.direction
    turned = used == -told
    assert (turned & wrong).sum() > 20 and not (turned & ~wrong).any()
    judged = judge_directions(fit, told)
    assert judged.rate == pytest.approx(0.05, abs=0.015)


def test_right_directions_stay() -> None:
    for seed in range(3):
        survey, _ = flipped(seed, 0.0)
        fit = fit_survey(survey, NJ, BASE_EFFECTS, None)
        np.testing.assert_array_equal(
            fit.batch.states.direction, survey.states.direction
        )
        assert judge_directions(fit, survey.states.direction).rate < 1e-3


def test_a_gross_outlier_is_no_wrong_direction() -> None:
    survey, _ = flipped(0, 0.0)
    survey.position[5] += [0.004, -0.003, 0.002]
    fit = fit_survey(survey, NJ, BASE_EFFECTS, None)
    assert fit.rows.weight[5] == 0
    assert mend_directions(fit, survey.position) is fit


def test_inferred_directions_are_left_to_the_plan() -> None:
    survey, _ = flipped(2, 0.05)
    guessed = Measurements(**{**vars(survey), "inferred": np.ones(ROWS, dtype=bool)})
    fit = fit_survey(guessed, NJ, BASE_EFFECTS, None)
    np.testing.assert_array_equal(fit.batch.states.direction, survey.states.direction)


def test_the_report_names_rate_and_rows(tmp_path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text('[robot]\narm = "nj220-2.7"\n[tool]\nxyz_mm = [80, -40, 150]\n')
    survey, wrong = flipped(2, 0.05)
    report = fit_measurements(survey, load_cell(path), effects=BASE_EFFECTS).report
    assert report.directions is not None
    for likely in report.directions.likeliest[:20]:
        assert wrong[survey.ids.index(likely.id), likely.joint - 1]
    lines = tell_fit(report).splitlines()
    told = next(line for line in lines if line.startswith("directions: "))
    assert "wrong in the file (estimated)" in told
    assert "fitted the other way" in told
    (rows,) = [line for line in lines if line.startswith("likeliest wrong: row ")]
    assert rows.count("joint") == 8 and rows.endswith(" more")
