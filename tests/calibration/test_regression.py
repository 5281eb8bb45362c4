"""Fits against the truth of a simulated arm."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import qr

from postproc.calibration import regression
from postproc.calibration.effect_selection import fit_survey
from postproc.calibration.regression import Fit, fit_effects
from postproc.model.effect_sum import Combination
from postproc.model.effects import BASE_EFFECTS
from postproc.model.effects.geometry import Geometry
from postproc.model.kinematics import ArmStates
from postproc.robot.state import States
from tests.calibration.simulator import (
    NJ,
    PLATE,
    Simulated,
    random_arm,
    random_states,
    survey_of,
)

SEEDS = range(6)


def true_error(arm: Simulated, states: States) -> np.ndarray:
    truth = arm.tcp(states.q, states.direction, states.tool)
    return truth - ArmStates(NJ, states).walk.tcp


@cache
def case(seed: int) -> tuple[Simulated, States, np.ndarray, Fit]:
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    states = random_states(300, rng, PLATE)
    measured, _ = arm.measure(states, rng)
    return (
        arm,
        states,
        measured,
        fit_survey(survey_of(states, measured), NJ, BASE_EFFECTS, None),
    )


def informed(states: States, measured: np.ndarray, held: States) -> np.ndarray:
    """Least squares with exactly the effects that the arm has, iterated."""
    batch = ArmStates(NJ, states)
    geometry = Geometry.propose(NJ, states)
    values = np.zeros(len(geometry.parameters()))

    def waves(b: ArmStates) -> np.ndarray:
        s = b.states.direction
        phi = [s, s * np.sin(b.states.q), s * np.cos(b.states.q)]
        return np.concatenate([b.jacobian * f[:, None, :] for f in phi], axis=2)

    for _ in range(4):
        at = batch.move(geometry.deviation(values), None)
        X = np.concatenate([geometry.columns(at), waves(at)], axis=2)
        y = measured - at.walk.tcp
        flat = X.reshape(-1, X.shape[2])
        _, R, pivot = qr(flat, mode="economic", pivoting=True)
        keep = pivot[np.abs(np.diag(R)) > 1e-8 * np.abs(R[0, 0])]
        step = np.zeros(X.shape[2])
        step[keep] = np.linalg.lstsq(flat[:, keep], y.reshape(-1))[0]
        values = values + step[: len(values)]
        profile = step[len(values) :]
    nominal = ArmStates(NJ, held)
    at = nominal.move(geometry.deviation(values), None)
    return at.walk.tcp + waves(at) @ profile - nominal.walk.tcp


def test_the_true_error_left_is_near_that_of_the_informed_fit() -> None:
    ours, theirs = [], []
    for seed in SEEDS:
        arm, states, measured, fit = case(seed)
        held = random_states(500, np.random.default_rng(100 + seed), PLATE)
        truth = true_error(arm, held)
        predicted = fit.combination.error(ArmStates(NJ, held), fit.values)
        ours.append(np.linalg.norm(truth - predicted, axis=1).mean())
        best = informed(states, measured, held)
        theirs.append(np.linalg.norm(truth - best, axis=1).mean())
    assert np.mean(ours) < 1.2 * np.mean(theirs)
    assert np.mean(ours) < 0.015e-3  # [m]; 2.5 mm before


def test_intervals_cover_the_true_errors() -> None:
    inside = []
    for seed in SEEDS:
        arm, _, _, fit = case(seed)
        held = random_states(300, np.random.default_rng(200 + seed), PLATE)
        batch = ArmStates(NJ, held)
        gap = true_error(arm, held) - fit.combination.error(batch, fit.values)
        X = fit.combination.columns(fit.combination.at(batch, fit.values))
        std = np.sqrt(np.einsum("nip,nip->ni", X @ fit.covariance, X))
        inside.append((np.abs(gap) < 1.96 * std).mean())
    assert 0.90 < np.mean(inside) < 0.99


def test_both_components_of_the_noise_are_found() -> None:
    rng = np.random.default_rng(9)
    arm = random_arm(rng)
    arm.tracker, arm.joint = 2e-5, 1.5e-5
    states = random_states(400, rng)
    measured, _ = arm.measure(states, rng)
    fit = fit_survey(survey_of(states, measured), NJ, BASE_EFFECTS, None)
    assert fit.noise.tracker_std(measured)[0] == pytest.approx(2e-5, rel=0.15)
    assert fit.noise.joint == pytest.approx(1.5e-5, rel=0.15)


def test_gross_outliers_are_dropped_and_nothing_else() -> None:
    rng = np.random.default_rng(11)
    arm = random_arm(rng)
    states = random_states(300, rng)
    measured, _ = arm.measure(states, rng)
    bad = rng.choice(300, 12, replace=False)
    measured[bad] += rng.choice([-1, 1], (12, 3)) * rng.uniform(3e-4, 3e-2, (12, 1))
    fit = fit_survey(survey_of(states, measured), NJ, BASE_EFFECTS, None)
    assert set(bad) <= set(np.flatnonzero(fit.rows.weight < 0.5))
    assert (fit.rows.weight < 1).sum() <= 15
    held = random_states(300, rng)
    left = true_error(arm, held) - fit.combination.error(
        ArmStates(NJ, held), fit.values
    )
    assert np.linalg.norm(left, axis=1).mean() < 2e-5


def test_a_worn_spot_is_no_outlier() -> None:
    rng = np.random.default_rng(12)
    arm = random_arm(rng)
    states = random_states(400, rng)
    measured, _ = arm.measure(states, rng)
    bump = 3e-4 * np.exp(-0.5 * ((states.q[:, 1] - 0.2) / 0.08) ** 2)
    measured = measured + ArmStates(NJ, states).jacobian[:, :, 1] * bump[:, None]
    fit = fit_survey(survey_of(states, measured), NJ, BASE_EFFECTS, None)
    worn = np.abs(states.q[:, 1] - 0.2) < 0.08
    assert worn.sum() > 10
    assert (fit.rows.weight[worn] == 1).mean() > 0.9


def test_rows_of_unknown_side_count_less() -> None:
    rng = np.random.default_rng(13)
    arm = random_arm(rng)
    states = random_states(300, rng)
    measured, _ = arm.measure(states, rng)
    side = np.array(states.direction)
    side[:60] = 0.0
    hidden = states.with_(direction=side)
    fit = fit_survey(survey_of(hidden, measured), NJ, BASE_EFFECTS, None)
    variance = fit.whitener.variance(fit.noise).mean(axis=1)
    assert variance[:60].min() > 5 * variance[60:].max()
    assert (fit.rows.weight[60:] == 1).all()


def test_what_a_fit_leaves_is_plain_noise() -> None:
    _, _, _, fit = case(0)
    assert np.std(fit.whiten(fit.residual)) == pytest.approx(1.0, abs=0.1)


def test_a_long_step_tells_nothing_of_the_noise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Far off along a direction that hardly shows, the step back is not linear."""
    _, _, measured, fit = case(0)
    values = np.array(fit.values)
    values[fit.combination.names.index("geometry.alpha5")] += 0.1
    far = replace(fit, values=values)
    effects = fit.combination.effects
    for passes in (1, 30):
        monkeypatch.setattr(regression, "PASSES", passes)
        back = fit_effects(fit.batch, measured, effects, start=far)
        assert back.noise.joint == pytest.approx(fit.noise.joint, abs=1e-7)
        assert back.noise.tracker == pytest.approx(fit.noise.tracker, rel=0.01)
    np.testing.assert_allclose(back.residual, fit.residual, atol=1e-6)


def test_parameters_that_do_not_show_stay_at_their_prior() -> None:
    rng = np.random.default_rng(14)
    states = random_states(200, rng)
    q = np.array(states.q)
    q[:, 5] = 0.3  # joint 6 never moves
    states = states.with_(q=q)
    arm = random_arm(rng)
    measured, _ = arm.measure(states, rng)
    fit = fit_survey(survey_of(states, measured), NJ, ("geometry",), None)
    k = fit.combination.names.index("geometry.theta6")
    assert fit.std[k] > 0.5 * fit.prior_std[k]


def test_an_empty_combination_predicts_nothing() -> None:
    states = random_states(5, np.random.default_rng(0))
    nothing = Combination(())
    batch = ArmStates(NJ, states)
    assert nothing.columns(batch).shape == (5, 3, 0)
    assert np.abs(nothing.error(batch, np.zeros(0))).max() == 0


def test_what_rows_of_a_pose_share_of_the_parameters_is_little_of_the_noise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Left out where parameters are few; here they are three times as many."""
    rng = np.random.default_rng(7)
    states = random_states(300, rng)
    both = states[np.repeat(np.arange(300), 2)]
    side = np.where(np.arange(600) % 2 == 0, 1.0, -1.0)[:, None]
    both = both.with_(direction=both.direction * side, order=np.arange(600.0))
    seen = random_arm(rng).measure(both, rng)[0]
    survey, sizes = survey_of(both, seen), []
    for limit in (0.0, 1.0):
        monkeypatch.setattr(regression, "HARDLY", limit)
        noise = fit_survey(survey, NJ, ("geometry", "backlash_profile"), None).noise
        sizes.append([noise.tracker, noise.joint])
    np.testing.assert_allclose(*sizes, rtol=0.05)
