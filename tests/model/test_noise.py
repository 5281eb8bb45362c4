from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.noise_estimate import estimate_noise
from postproc.model.kinematics import ArmStates
from postproc.model.noise import Noise
from postproc.model.whitening import Whitener
from tests.calibration.simulator import NJ, random_states


def test_the_rotated_variances_are_the_covariance() -> None:
    batch = ArmStates(NJ, random_states(20, np.random.default_rng(0)))
    origin = (3.0, 1.0, 1.0)
    whitener = Whitener.build(batch, batch.walk.tcp, origin)
    noise = Noise(1.5, 2e-5, origin)
    J = batch.jacobian
    reach = np.linalg.norm(batch.walk.tcp - origin, axis=1)
    tracker = 1.5 * (1e-5 + 5e-6 * reach)
    expected = tracker[:, None, None] ** 2 * np.eye(3)
    expected = expected + noise.joint**2 * J @ np.swapaxes(J, 1, 2)
    turn, v = whitener.turn, whitener.variance(noise)
    found = np.einsum("nji,nj,njk->nik", turn, v, turn)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-20)
    np.testing.assert_allclose(noise.tracker_std(batch.walk.tcp), tracker)


def test_components_are_estimated_from_squares() -> None:
    rng = np.random.default_rng(1)
    batch = ArmStates(NJ, random_states(3000, rng))
    whitener = Whitener.build(batch, batch.walk.tcp, None)
    true = Noise(3.0, 2e-5)
    e = np.sqrt(whitener.variance(true)) * rng.standard_normal((3000, 3))
    found = estimate_noise(whitener, e**2, np.ones(3000), Noise(1.0, 1e-6))
    assert found.tracker == pytest.approx(3.0, rel=0.05)
    assert found.joint == pytest.approx(2e-5, rel=0.05)


def test_rotation_keeps_lengths_and_columns() -> None:
    batch = ArmStates(NJ, random_states(10, np.random.default_rng(2)))
    whitener = Whitener.build(batch, batch.walk.tcp, None)
    rows = np.random.default_rng(3).standard_normal((10, 3, 4))
    turned = whitener.rotate(rows)
    np.testing.assert_allclose(
        np.linalg.norm(turned, axis=1), np.linalg.norm(rows, axis=1)
    )
    np.testing.assert_allclose(turned[:, :, 2], whitener.rotate(rows[:, :, 2]))


def test_a_component_that_was_thought_absent_is_found_again() -> None:
    rng = np.random.default_rng(2)
    batch = ArmStates(NJ, random_states(400, rng))
    whitener = Whitener.build(batch, batch.walk.tcp, None)
    truth = Noise(2.0, 3e-5)
    squares = whitener.variance(truth) * rng.chisquare(1, (400, 3))
    for start in (Noise(2.0, 1e-7), Noise(1e-2, 3e-5)):
        found = estimate_noise(whitener, squares, np.ones(400), start)
        assert found.tracker == pytest.approx(truth.tracker, rel=0.1)
        assert found.joint == pytest.approx(truth.joint, rel=0.1)


def test_what_was_read_in_motion_tells_nothing_along_it() -> None:
    rng = np.random.default_rng(4)
    states = random_states(30, rng)
    heading = rng.standard_normal((30, 3))
    heading /= np.linalg.norm(heading, axis=1)[:, None]
    heading[::3] = np.nan
    batch = ArmStates(NJ, states.with_(heading=heading))
    still = Whitener.build(ArmStates(NJ, states), batch.walk.tcp, None)
    whitener, noise = Whitener.build(batch, batch.walk.tcp, None), Noise(1.0, 2e-5)
    rows = rng.standard_normal((30, 3)) * 1e-4
    moved = rows + np.nan_to_num(heading) * rng.uniform(-1e-3, 1e-3, (30, 1))

    def whitened(by: Whitener, vectors: np.ndarray) -> np.ndarray:
        return by.rotate(vectors) / np.sqrt(by.variance(noise))

    np.testing.assert_allclose(
        whitened(whitener, rows), whitened(whitener, moved), rtol=0, atol=0.01
    )
    at_rest = slice(None, None, 3)
    np.testing.assert_array_equal(whitener.turn[at_rest], still.turn[at_rest])
    np.testing.assert_array_equal(
        whitener.variance(noise)[at_rest], still.variance(noise)[at_rest]
    )
    size = np.abs(np.linalg.det(whitener.turn))
    np.testing.assert_allclose(size, 1.0, atol=1e-12)
    np.testing.assert_allclose(
        states.with_(heading=heading).across(moved),
        states.with_(heading=heading).across(rows), atol=1e-18,
    )  # fmt: skip
    # .. so that the noise of a reading is that of what was read.
    read, usual = whitener.read_variance(noise), float(still.variance(noise).mean())
    assert read == pytest.approx(usual, rel=0.3)
    assert still.read_variance(noise) == pytest.approx(usual)
