"""What a finding says besides place and size."""

import numpy as np
import pytest

from postproc.calibration.diagnosis.describe import story, unseen_drivers
from postproc.calibration.regression import fit_effects
from postproc.model.effects.part_motion import PartMotion
from postproc.model.kinematics import ArmStates
from postproc.robot.state import States, make_states
from tests.calibration.planted import ARM

ROWS = 20


def states(temperature: object = np.nan, payload: object = np.nan) -> States:
    """Rows at drawn angles."""
    q = np.random.default_rng(3).uniform(-1.0, 1.0, (ROWS, 6))
    rows = np.ones(ROWS)
    return make_states(
        q, np.ones((ROWS, 6)), np.zeros((ROWS, 3)),
        temperature=temperature * rows, payload=payload * rows,
    )  # fmt: skip


VARIES = np.linspace(0.0, 30.0, ROWS)


@pytest.mark.parametrize(
    ("given", "doubted", "certain"),
    [
        ({}, ["temperature", "payload"], []),
        ({"temperature": 31.0, "payload": VARIES}, ["temperature"], ["payload"]),
        ({"temperature": VARIES, "payload": 80.0}, ["payload"], ["temperature"]),
        ({"temperature": VARIES}, ["payload"], ["temperature"]),
    ],
)
def test_a_state_that_hardly_varied_may_have_moved_a_part(given, doubted, certain):
    said = unseen_drivers(states(**given))
    assert all(name in said for name in doubted)
    assert not any(name in said for name in certain)


def test_states_that_vary_leave_no_doubt():
    assert unseen_drivers(states(VARIES, VARIES)) == ""


@pytest.mark.parametrize(("law", "doubted"), [("constant", True), ("linear", False)])
def test_a_part_that_stands_elsewhere_tells_what_may_have_moved_it(law, doubted):
    given = states(payload=VARIES)
    effect = PartMotion("link 3 turn x", law=law)
    batch = ArmStates(ARM, given)
    position = batch.walk.tcp + effect.columns(batch)[:, :, 0] * 1e-4
    noise = np.random.default_rng(1).normal(0.0, 1e-5, position.shape)
    fit = fit_effects(batch, position + noise, (effect,))
    said = story(fit, effect, slice(0, 1))
    assert said.startswith("link 3 turns about the x of its frame")
    assert ("perhaps by the temperature, which" in said) is doubted
