"""What belongs to the set-up of a survey is fitted and never compensated."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.effect_selection import model_of
from postproc.calibration.regression import fit_effects
from postproc.model.effect_sum import Combination
from postproc.model.effects import BASE_EFFECTS, BY_NAME, propose
from postproc.model.effects.effect import Effect
from postproc.model.effects.step import EDGE
from postproc.model.kinematics import ArmStates
from postproc.robot.state import States
from tests.calibration.simulator import (
    NJ,
    PLATE,
    covariates,
    random_arm,
    random_states,
    survey_of,
)

N = 300
U = np.linspace(0.0, 1.0, N)[:, None]
BEFORE = (np.arange(N) < 120)[:, None]


def stand_moves(states: States, tcp: np.ndarray) -> np.ndarray:
    """The tracker's stand sinks and turns slowly."""
    turn = np.cross(np.array([2e-5, 0.0, -3e-5]), tcp)
    return U * (np.array([2e-4, -1e-4, 1e-4]) + turn)


def base_slips(states: States, tcp: np.ndarray) -> np.ndarray:
    """The base slips on its foundation before row 120."""
    moved = np.array([3e-4, 1e-4, 0.0]) + np.cross([0.0, 0.0, 1e-4], tcp)
    return np.where(BEFORE, -moved, 0.0)


def nest_slips(states: States, tcp: np.ndarray) -> np.ndarray:
    """The nest slips in the flange before row 120."""
    R = ArmStates(NJ, states).walk.flange
    return np.where(BEFORE, -R @ np.array([2e-4, 0.0, 3e-4]), 0.0)


CASES = {
    "tracker_drift": (stand_moves, None),
    "base_shift": (base_slips, BY_NAME["base_shift"](row=120.0)),
    "tool_shift": (nest_slips, BY_NAME["tool_shift"](row=120.0)),
}


@pytest.mark.parametrize("name", CASES)
def test_it_is_fitted_and_the_arm_is_compensated_without_it(name: str) -> None:
    displace, given = CASES[name]
    rng = np.random.default_rng(4)
    arm = random_arm(rng)
    states = covariates(random_states(N, rng, PLATE), rng)
    measured, tcp = arm.measure(states, rng)
    measured = measured + displace(states, tcp)
    effect: Effect = given or propose((name,), NJ, states)[0]
    chosen = (*propose(BASE_EFFECTS, NJ, states), effect)
    fit = fit_effects(ArmStates(NJ, states), measured, chosen)
    model = model_of(fit, survey_of(states, measured))
    # Fitted: nothing of it is left in the rows, and it is what was planted.
    assert np.linalg.norm(fit.residual, axis=1).mean() < 6e-5
    own = fit.combination.slices[-1]
    found = effect.columns(fit.batch) @ fit.values[own]
    gap = found - displace(states, tcp)
    assert np.sqrt((gap**2).sum(axis=1).mean()) < 4e-5
    # Not compensated: a prediction is that of the arm alone, at any time.
    assert name not in {e.name for e in model.compensable()[0].effects}
    alone = Combination(chosen[:-1]).error(fit.batch, np.delete(fit.values, own))
    np.testing.assert_allclose(model.error(NJ, states), alone, atol=1e-9)
    held = covariates(random_states(150, rng, PLATE), rng)
    truth = arm.tcp(held.q, held.direction, held.tool) - ArmStates(NJ, held).walk.tcp
    assert np.linalg.norm(truth - model.error(NJ, held), axis=1).mean() < 4e-5


@pytest.mark.parametrize("name", ["base_shift", "tool_shift"])
def test_a_step_is_shown_by_rows_on_both_sides(name: str) -> None:
    """What all rows but a few are off by was there before they were measured."""
    rng = np.random.default_rng(4)
    batch = ArmStates(NJ, random_states(N, rng, PLATE))
    for row in (EDGE, N - EDGE):
        tried = BY_NAME[name](row=float(row)).refine(np.linspace(-1, 1, 9), batch)
        rows = [effect.row for effect in tried]
        assert len(rows) > 3 and min(rows) >= EDGE and max(rows) <= N - EDGE
