"""What a survey gives evidence for is kept, and nothing else."""

from __future__ import annotations

import numpy as np

from postproc.calibration.fit import drifts
from postproc.calibration.regression import fit_effects
from postproc.calibration.selection import candidates, fit_best
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.kinematics import Batch
from tests.calibration.simulator import NJ, covariates, random_arm, random_states


def planted(seed: int, add: str) -> tuple[str, ...]:
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    states = random_states(300, rng)
    measured, _ = arm.measure(states, rng)
    J = Batch(NJ, states).jacobian
    q = states.q
    if add == "coupling":
        measured = measured + J[:, :, 4] * (8e-5 * q[:, [3]])
    if add == "joint_map":
        bump = np.exp(-0.5 * ((q[:, [2]] + 1.9) / 0.1) ** 2)
        measured = measured + J[:, :, 2] * (2e-4 * bump)
    fit = fit_best(NJ, states, measured, None)
    return tuple(e.name for e in fit.combination.effects)


def test_nothing_is_added_without_evidence() -> None:
    assert planted(0, "") == BASE_EFFECTS
    assert planted(1, "") == BASE_EFFECTS


def test_what_is_there_is_kept() -> None:
    assert planted(2, "coupling") == (*BASE_EFFECTS, "coupling")
    assert "joint_map" in planted(3, "joint_map")


def test_only_covariates_that_vary_are_candidates() -> None:
    rng = np.random.default_rng(0)
    bare = random_states(50, rng)
    assert not {"thermal", "payload", "lag"} & set(candidates(NJ, bare))
    assert {"thermal", "payload", "lag"} <= set(candidates(NJ, covariates(bare, rng)))
    timed = bare.with_(time=60.0 * np.arange(50.0))
    assert "thermal" in candidates(NJ, timed)  # a warm-up in time
    assert "thermal" not in candidates(NJ, bare.with_(time=0.2 * np.arange(50.0)))


def test_a_warm_up_in_time_is_told_with_the_state_that_predictions_are_for() -> None:
    rng = np.random.default_rng(8)
    arm, clock = random_arm(rng), 60.0 * np.arange(300.0)
    states = random_states(300, rng).with_(time=clock)
    measured, tcp = arm.measure(states, rng)
    cold = np.exp(-clock / (0.2 * np.ptp(clock)))
    measured = measured - 1.2e-4 * cold[:, None] * tcp
    effects = propose((*BASE_EFFECTS, "thermal"), NJ, states)
    (told,) = drifts(fit_effects(Batch(NJ, states), measured, effects))
    left, kept = (float(word) for word in told.split() if word.startswith("0."))
    assert kept > 1.5 * left
    assert "Predictions are for the warm arm: it may be tracker_drift" in told
    assert not drifts(fit_effects(Batch(NJ, states), measured, effects[:-1]))
