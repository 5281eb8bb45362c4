"""What the core makes of effects is what their columns say."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.arrays import Floats
from postproc.model.carrier import every_carrier
from postproc.model.covariate import JOINTS
from postproc.model.effect_sum import Combination
from postproc.model.effects.backlash import Backlash
from postproc.model.effects.compliance import Compliance
from postproc.model.effects.curve import Curve
from postproc.model.effects.effect import Effect
from postproc.model.effects.elm import ElmMap, HiddenLayer
from postproc.model.effects.geometry import Geometry
from postproc.model.effects.part_motion import PartMotion
from postproc.model.evaluator import Evaluator, Scatter, Spread, make_evaluator
from postproc.model.kinematics import ArmStates
from postproc.model.noise import Noise
from postproc.model.variance import (
    beyond_variance,
    covariance_of,
    parameter_covariance,
    side_covariance,
)
from postproc.robot.arm import Arm
from postproc.robot.state import States
from tests.calibration.simulator import COUPLED, NJ
from tests.model.test_effects import STATES, variants

NOISE = Noise(1.0, 1e-5, None, 2e-5, 3e-5, 1e-5, by_joint=(1, 2, 1, 0.5, 1, 3))
SPREAD = (1e-5, 2e-5, 3e-5)
LAWS = ("linear", "harmonic 2", "step", "saturating", "constant")
DRIVERS = (
    *(f"{kind} {j}" for j in JOINTS
      for kind in ("joint", "drive", "lambda", "torque", "travel", "way", "loop")),
    *(f"moment {j}{a}" for j in JOINTS for a in "xy"),
    "tilting", "speed", "payload", "temperature", "time", "order",
)  # fmt: skip


def compensable() -> list[Effect]:
    layer = HiddenLayer.draw(STATES, 7, 3, directions=True, activation="tanh")
    return [
        *(e for e in variants() if e.belongs_to() != "setup"),
        ElmMap(layer),
        Curve("link 3 turn x", ("joint 1", "torque 2"), (-1.0, -900.0), (1.0, 900.0)),
        Curve("joint 4", ("way 2",), (0.0,), (0.2,), "lambda 4", whole=True),
        PartMotion("joint 2", loose=True, source="torque 2", heavier=((3, (5, 0, 9)),)),
    ]


def arm_of(effect: Effect) -> Arm:
    return COUPLED if effect.name.startswith("drive") else NJ


def drawn(effects: Combination, seed: int) -> tuple[Floats, Floats]:
    """Draw parameters and a covariance of their sizes."""
    rng = np.random.default_rng(seed)
    mixed = rng.standard_normal((len(effects.scales),) * 2) * effects.scales
    return rng.standard_normal(len(effects.scales)) * effects.scales, mixed.T @ mixed


def evaluate(
    arm: Arm, effects: Combination, values: Floats, spread: Spread
) -> Evaluator:
    found = make_evaluator(
        arm, effects, values, effects.scales, spread, Scatter(NOISE, SPREAD)
    )
    assert found is not None
    return found


def by_columns(
    arm: Arm, effects: Combination, values: Floats, covariance: Floats, states: States
) -> tuple[Floats, Floats, Floats]:
    batch = ArmStates(arm, states)
    at = effects.at(batch, values)
    known = side_covariance(effects, at, values)
    known += parameter_covariance(effects, at, covariance)
    known += covariance_of(NOISE.pose_columns(at.jacobian))
    known[:, :3] += beyond_variance(effects, at, effects.scales) + np.square(SPREAD)
    arrival = known + covariance_of(NOISE.scatter_columns(at.jacobian))
    return effects.error(batch, values), known, arrival


def assert_alike(arm: Arm, effects: Combination, states: States, seed: int = 1) -> None:
    values, covariance = drawn(effects, seed)
    core = evaluate(arm, effects, values, Spread(effects, covariance))
    found = core.predict(states)
    wanted = by_columns(arm, effects, values, covariance, states)
    turned = core.core.turns(core.states(states))
    turn = effects.turn(ArmStates(arm, states), values)
    for got, want in zip((*found, turned), (*wanted, turn), strict=True):
        size = float(np.nanmax(np.abs(want)))  # differences of torques round more
        np.testing.assert_allclose(got, want, rtol=1e-9, atol=1e-9 * size)
    np.testing.assert_array_equal(core.errors(states), found[0])


@pytest.mark.parametrize("effect", compensable(), ids=lambda e: e.name)
def test_an_effect_is_in_the_core_what_its_columns_say(effect: Effect) -> None:
    assert_alike(arm_of(effect), Combination((effect,)), STATES)


def test_all_effects_together_are_as_well() -> None:
    names = set[str]()
    own = [e for e in compensable() if arm_of(e) is NJ]
    once = [e for e in own if e.name not in names and not names.add(e.name)]
    assert len(once) > 15
    assert_alike(NJ, Combination(tuple(once)), STATES)


@pytest.mark.parametrize("driver", DRIVERS)
def test_a_cell_of_the_table_is_in_the_core_what_its_columns_say(driver: str) -> None:
    rng = np.random.default_rng(len(driver) + ord(driver[-1]))
    carriers = every_carrier()
    for law in LAWS:
        moved = str(carriers[rng.integers(len(carriers))])
        factor = rng.choice(["", "lambda 3", "torque 2", "speed"])
        half = 100.0 if driver.startswith(("torque", "moment", "tilting")) else 0.7
        cell = PartMotion(
            moved, source=driver, factor=str(factor), law=law, middle=0.1, half=half
        )
        assert_alike(NJ, Combination((cell,)), STATES, seed=int(rng.integers(99)))


def test_what_is_not_known_of_states_counts_as_in_columns() -> None:
    lost = STATES.with_(
        temperature=np.full(len(STATES), np.nan), payload=np.full(len(STATES), np.nan),
        travel=np.full((len(STATES), 6), np.nan), speed=np.full(len(STATES), np.nan),
        direction=np.tile([0.0, 1.0, -1.0, 0.3, 0.0, -0.7], (len(STATES), 1)),
    )  # fmt: skip
    for effect in compensable():
        assert_alike(arm_of(effect), Combination((effect,)), lost)


@pytest.mark.parametrize("base", [True, False])
def test_joint_angles_that_are_not_known_have_no_error(base: bool) -> None:
    q = np.array(STATES.q)
    q[5, 1] = np.nan
    effects = Combination((Backlash(), Geometry((2, 6), base), Compliance()))
    states = STATES.with_(q=q)
    assert_alike(NJ, effects, states)
    values, covariance = drawn(effects, 1)
    core = evaluate(NJ, effects, values, Spread(effects, covariance))
    for found in core.predict(states):
        lost = np.isnan(found).any(axis=1)
        assert np.flatnonzero(lost).tolist() == [5]
