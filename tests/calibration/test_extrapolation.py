"""What a fit states of poses unlike its own is as unsure as it turns out to be."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.effect_selection import model_of
from postproc.calibration.extrapolation import widening
from postproc.calibration.joint_scatter import split_by_joint
from postproc.calibration.measurements import Measurements
from postproc.calibration.regression import Fit, fit_effects
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.kinematics import ArmStates
from tests.calibration.simulator import NJ, random_arm, random_states, survey_of

MOVED = 3e-4  # [rad] by which joint 2 errs where joints 1 to 3 say so


def fitted(seed: int, size: float, rows: int = 400) -> tuple[Fit, Measurements]:
    """Fit geometry and backlash where joint 2 errs by a function of three joints."""
    rng = np.random.default_rng(seed)
    states = random_states(rows, rng)
    measured, _ = random_arm(rng).measure(states, rng)
    q, J = states.q, ArmStates(NJ, states).jacobian
    shape = np.sin(q[:, [0]]) * q[:, [1]] * q[:, [2]]
    measured = measured + J[:, :, 1] * (size * shape)
    effects = propose(BASE_EFFECTS, NJ, states)
    fit = fit_effects(ArmStates(NJ, states), measured, effects)
    return fit, survey_of(states, measured)


@pytest.mark.parametrize("seed", range(5))
def test_what_has_no_other_cause_is_as_sure_as_stated(seed: int) -> None:
    fit, _ = fitted(seed, 0.0)
    assert widening(fit) == 1.0


def test_a_function_of_three_joints_makes_a_fit_less_sure_elsewhere() -> None:
    fit, survey = fitted(0, MOVED)
    factor = widening(fit)
    assert factor > 2.0
    by_joint = split_by_joint(fit)
    assert widening(by_joint) > 2.0
    model = model_of(fit, survey)
    assert np.allclose(model.covariance, widening(by_joint) * by_joint.stated)


def test_of_few_rows_nothing_is_asked() -> None:
    fit, _ = fitted(1, MOVED, rows=80)
    assert widening(fit) == 1.0
