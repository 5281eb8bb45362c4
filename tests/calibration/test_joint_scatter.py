"""How well every joint repeats, from what a fit leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.calibration.effect_selection import model_of
from postproc.calibration.joint_scatter import split_by_joint
from postproc.calibration.regression import Fit, fit_effects
from postproc.model.effects import propose
from postproc.model.kinematics import ArmStates
from postproc.model.model import load_model
from postproc.robot.pose import MM
from tests.calibration.simulator import NJ, PLATE, random_states, survey_of

TRUE = 1e-6 * np.array([25.0, 8.0, 12.0, 15.0, 15.0, 15.0])  # [rad]
TRACKER = 2e-5  # [m]


def fit_of(stops: int, nests: int = 1, seed: int = 4) -> Fit:
    """Fit an arm without errors, whose joints repeat differently."""
    rng = np.random.default_rng(seed)
    own = np.repeat(np.arange(stops), nests)
    states = random_states(stops, rng)[own]
    nest = np.tile(np.arange(nests), stops)
    states = states.with_(tool=PLATE[nest], tool_id=nest, order=own.astype(float))
    batch = ArmStates(NJ, states)
    turned = (TRUE * rng.standard_normal((stops, 6)))[own]
    off = np.einsum("nij,nj->ni", batch.jacobian, turned)
    position = batch.walk.tcp + off + TRACKER * rng.standard_normal((len(own), 3))
    return fit_effects(batch, position, propose(("geometry",), NJ, states))


@pytest.mark.parametrize(("stops", "nests"), [(1500, 1), (700, 3)])
def test_the_joints_that_repeat_worse_are_found(stops: int, nests: int) -> None:
    noise = split_by_joint(fit_of(stops, nests)).noise
    assert noise.joint_std[:3] == pytest.approx(TRUE[:3], rel=0.2)
    assert noise.tracker * 1e-5 == pytest.approx(TRACKER, rel=0.05)


def test_few_rows_leave_joints_alike_and_nothing_else_changes() -> None:
    before = fit_of(20)
    after = split_by_joint(before)
    assert np.ptp(np.log(after.noise.by_joint)) < np.log(2.0)
    assert replace(after.noise, by_joint=before.noise.by_joint, tracker=0.0) == replace(
        before.noise, tracker=0.0
    )
    assert (after.values == before.values).all()


def test_arrivals_scatter_as_the_model_file_says(tmp_path) -> None:
    fitted = fit_of(1000)
    survey = survey_of(fitted.batch.states, fitted.position)
    model_of(fitted, survey).save(tmp_path / "model.json")
    model = load_model(tmp_path / "model.json")
    J = ArmStates(NJ, random_states(400, np.random.default_rng(9))).jacobian
    noise = model.noise  # one visit a pose: what is of the pose is not known apart
    stated = np.sqrt(noise.arrival_variance(J) + noise.pose_variance(J)) / MM
    meant = np.sqrt(np.square(J) @ TRUE**2) / MM
    alike = fitted.noise.joint * np.sqrt(np.square(J).sum(axis=2)) / MM
    assert np.abs(stated / meant - 1.0).mean() < 0.08
    assert np.abs(alike / meant - 1.0).mean() > 0.12  # one size for all joints
