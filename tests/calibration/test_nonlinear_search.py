"""A fit finds what must be found before it is fitted, and takes nothing else for it."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.effect_selection import fit_best
from postproc.calibration.nonlinear_search import SOUGHT_BESIDE_FREE, with_sought
from postproc.calibration.regression import Fit, fit_effects
from postproc.model.effects import BASE_EFFECTS
from postproc.model.effects.joint_spline import JointSpline
from postproc.model.kinematics import ArmStates
from tests.calibration.planted import TRACKER, campaign
from tests.slow import slow

SOUGHT = {
    "joint_step": "joint_step",
    "base_tilt": "base_tilt",
    "motor_wave": "transmission",
    "base_shift": "tracker_drift",  # whose step it is nobody knows
}
QUICK = ["joint_step", "motor_wave", "base_shift"]


@pytest.mark.parametrize("kind", [*QUICK, *slow(["base_tilt"])])
def test_what_must_be_found_first_is_named_without_being_asked_for(kind: str) -> None:
    """No drift and no chain of other laws stands in for it."""
    c = campaign(331, (kind,), 1.5)
    fit = fit_best(c.declared, c.states, c.position, tuple(TRACKER))
    names = [e.name for e in fit.combination.effects if e.name not in BASE_EFFECTS]
    assert set(names) == {SOUGHT[kind]}


def test_a_warm_up_is_named_by_the_order_of_rows_alone() -> None:
    c = campaign(334, ("warmup",), 2.0)
    untold = np.full(len(c.states), np.nan)
    states = c.states.with_(time=untold, temperature=untold)
    fit = fit_best(c.declared, states, c.position, tuple(TRACKER))
    names = {e.name for e in fit.combination.effects} - set(BASE_EFFECTS)
    assert names == {"thermal"}


def test_beside_free_forms_nothing_is_sought_in_many_poses(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    c = campaign(331, ("joint_step",), 1.5)
    fit = c.base_fit()
    assert with_sought(fit) is not fit
    spline = JointSpline.propose(c.declared, c.states)
    effects = (*fit.combination.effects, spline)
    batch = ArmStates(c.declared, c.states)
    free = fit_effects(batch, c.position, effects, tuple(TRACKER))
    monkeypatch.setattr(Fit, "poses", SOUGHT_BESIDE_FREE + 1)
    assert with_sought(free) is free
