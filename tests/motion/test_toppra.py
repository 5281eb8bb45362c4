from __future__ import annotations

import logging

import numpy as np
import pytest

from postproc.exceptions import PlanError
from postproc.motion.toppra import run
from postproc.robot.arm import Arm


def smooth(home: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A curved path: joint angles (k, 6) and path positions (k,)."""
    s = np.linspace(0, 1, 81)
    q = home + 0.4 * np.column_stack([np.sin((1 + j / 3) * s * 2) for j in range(6)])
    return q, s


def test_limits_hold_all_along(arm: Arm, home: np.ndarray) -> None:
    q, s = smooth(home)
    law = run(arm, q, s, np.full(81, np.inf), 1.0)
    found, velocity, acceleration = law.at(np.linspace(0, law.time[-1], 1000))
    np.testing.assert_allclose(found[[0, -1]], q[[0, -1]], atol=1e-9)
    np.testing.assert_allclose(velocity[[0, -1]], 0.0, atol=1e-6)
    assert (np.abs(velocity) <= 1.001 * arm.velocity).all()
    assert (np.abs(acceleration) <= 1.02 * arm.acceleration).all()
    busy = np.maximum(
        np.abs(velocity) / arm.velocity, np.abs(acceleration) / arm.acceleration
    )
    assert np.median(busy.max(axis=1)) > 0.95


def test_the_velocity_is_the_derivative(arm: Arm, home: np.ndarray) -> None:
    q, s = smooth(home)
    law = run(arm, q, s, np.full(81, 0.8), 1.0)
    time = np.linspace(0.01, law.time[-1] - 0.01, 50)
    ahead, behind = law.at(time + 1e-5)[0], law.at(time - 1e-5)[0]
    np.testing.assert_allclose((ahead - behind) / 2e-5, law.at(time)[1], atol=1e-3)
    np.testing.assert_allclose(law.at(law.time[:-1])[1], law.velocity[:-1], atol=1e-9)


def test_the_path_speed_is_bounded(arm: Arm, home: np.ndarray) -> None:
    q, s = smooth(home)
    limit = np.where(s < 0.5, 0.1, 0.3)
    law = run(arm, q, s, limit, 1.0)
    assert (law.rate <= limit + 1e-9).all()
    assert law.rate[20] == pytest.approx(0.1, rel=1e-3)
    assert law.rate[60] == pytest.approx(0.3, rel=1e-3)


def test_failure_is_an_error_of_ours_and_silent(
    arm: Arm, home: np.ndarray, caplog: pytest.LogCaptureFixture
) -> None:
    q, s = smooth(home)
    with caplog.at_level(logging.DEBUG), pytest.raises(PlanError):
        run(arm, q, s, np.full(81, 0.0), 1.0)
    assert not caplog.records
