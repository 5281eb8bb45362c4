"""A spline of a joint's error is offered where the rows can show one."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.regression import fit_effects
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.effects.joint_spline import (
    FINEST,
    LEAST_ROWS,
    LONG,
    SHORTEST,
    JointSpline,
)
from postproc.model.kinematics import ArmStates
from postproc.robot.state import States, make_states
from tests.calibration.simulator import NJ, random_arm, random_states

TURN = 2.0 * np.pi


@pytest.mark.parametrize(
    ("rows", "span_deg", "offered"),
    [
        (LEAST_ROWS, 90.0, True),
        (LEAST_ROWS - 1, 90.0, False),
        (5 * LEAST_ROWS, 5.0, False),  # no joint has moved far enough
    ],
)
def test_it_takes_rows_and_a_joint_that_moved(
    rows: int, span_deg: float, offered: bool
) -> None:
    rng = np.random.default_rng(rows)
    q = np.radians(span_deg) * rng.uniform(-0.5, 0.5, (rows, 6))
    states = make_states(q, np.ones((rows, 6)), np.zeros((rows, 3)))
    assert JointSpline.may_show(states) is offered


def ranged(span: float) -> tuple[JointSpline, States]:
    """Make a spline over ranges of all joints, and states at their lower ends."""
    q = np.linspace(-0.3, span - 0.3, 400)[:, None] * np.ones(6)
    states = make_states(q, np.ones((400, 6)), np.zeros((400, 3)))
    (effect,) = propose(["joint_spline"], NJ, states)
    assert isinstance(effect, JointSpline)
    return effect, states


@pytest.mark.parametrize(
    ("rows", "finest"),
    [(400, SHORTEST), (600, np.deg2rad(4.5)), (900, FINEST), (9000, FINEST)],
)
def test_it_is_finer_beside_named_waves_where_rows_allow(
    rows: int, finest: float
) -> None:
    q = np.linspace(0.0, np.pi, rows)[:, None] * np.ones(6)
    states = make_states(q, np.ones((rows, 6)), np.zeros((rows, 3)))
    effect = JointSpline.propose(NJ, states)
    assert effect.lengths == (LONG, SHORTEST)
    long, short = effect.beside_waves(states).lengths
    assert long == LONG
    assert short == pytest.approx(finest)


@pytest.mark.parametrize("span", [1.0, 3.0, 5.2, 5.3, 6.2, 7.5])
def test_it_repeats_with_every_turn_without_a_jump(span: float) -> None:
    effect, states = ranged(span)
    p = np.random.default_rng(1).standard_normal(len(effect.parameters()))
    wide = np.linspace(-1.0, TURN - 1.0, 20001)
    there = states[np.zeros(len(wide), dtype=int)].with_(q=wide[:, None] * np.ones(6))
    found = effect.angles(ArmStates(NJ, there), p)
    for k in (-2, 1):
        far = ArmStates(NJ, there.with_(q=there.q + k * TURN))
        np.testing.assert_allclose(effect.angles(far, p), found, atol=1e-9)
    steps = np.abs(np.diff(found, axis=0))
    assert steps.max() < 0.02 * np.ptp(found)
    assert np.abs(found[-1] - found[0]).max() < 0.02 * np.ptp(found)


def test_beyond_the_surveyed_range_the_long_length_alone_goes_on() -> None:
    effect, states = ranged(2.0)
    far = ArmStates(NJ, states.with_(q=states.q + 2.4))
    columns = effect.basis(far).any(axis=0)
    wide = [f" {np.rad2deg(LONG):.1f} deg " in p.name for p in effect.parameters()]
    assert np.array_equal(columns, wide)


def test_an_older_model_ends_where_its_survey_did() -> None:
    effect, states = ranged(2.0)
    old = JointSpline(effect.joints, effect.lower, effect.upper, effect.lengths)
    p = np.ones(len(old.parameters()))
    assert old.angles(ArmStates(NJ, states), p).any()
    assert not old.angles(ArmStates(NJ, states.with_(q=states.q + TURN)), p).any()


def test_what_is_fitted_on_one_turn_holds_on_the_next() -> None:
    rng = np.random.default_rng(3)
    states = random_states(400, rng)
    measured, _ = random_arm(rng).measure(states, rng)

    def wave(at: States) -> np.ndarray:
        size = 3e-4 * np.sin(5.0 * at.q[:, [0]]) + 2e-4 * np.cos(7.0 * at.q[:, [0]])
        moved: np.ndarray = ArmStates(NJ, at).jacobian[:, :, 0] * size
        return moved

    effects = propose((*BASE_EFFECTS, "joint_spline"), NJ, states)
    fit = fit_effects(ArmStates(NJ, states), measured + wave(states), effects)
    q = states.q + np.array([TURN, 0.0, 0.0, 0.0, 0.0, 0.0])
    here, next_turn = (
        fit.combination.error(ArmStates(NJ, at), fit.values)
        for at in (states, states.with_(q=q))
    )
    np.testing.assert_allclose(next_turn, here, atol=1e-9)
    left = np.linalg.norm(fit.residual, axis=1).mean()
    assert left < 0.5 * np.linalg.norm(wave(states), axis=1).mean()
