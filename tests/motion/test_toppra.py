from __future__ import annotations

import logging

import numpy as np
import pytest

from postproc.exceptions import PlanError
from postproc.motion.toppra import Runs, time_laws
from postproc.robot.arm import Arm

K = 81


def smooth(home: np.ndarray, size: float = 0.4) -> tuple[np.ndarray, np.ndarray]:
    """A curved path: joint angles (k, 6) and path positions (k,)."""
    s = np.linspace(0, 1, K)
    q = home + size * np.column_stack([np.sin((1 + j / 3) * s * 2) for j in range(6)])
    return q, s


def one(arm: Arm, q: np.ndarray, s: np.ndarray, limit: np.ndarray) -> Runs:
    return time_laws(arm, q, s, limit, np.arange(len(s)) == 0)


def test_limits_hold_all_along(arm: Arm, home: np.ndarray) -> None:
    q, s = smooth(home)
    law = one(arm, q, s, np.full(K, np.inf))
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
    law = one(arm, q, s, np.full(K, 0.8))
    time = np.linspace(0.01, law.time[-1] - 0.01, 50)
    ahead, behind = law.at(time + 1e-5)[0], law.at(time - 1e-5)[0]
    np.testing.assert_allclose((ahead - behind) / 2e-5, law.at(time)[1], atol=1e-3)
    np.testing.assert_allclose(law.at(law.time[:-1])[1], law.velocity[:-1], atol=1e-9)


def test_the_path_speed_is_bounded(arm: Arm, home: np.ndarray) -> None:
    q, s = smooth(home)
    limit = np.where(s < 0.5, 0.1, 0.3)
    law = one(arm, q, s, limit)
    assert (law.rate <= limit + 1e-9).all()
    assert law.rate[20] == pytest.approx(0.1, rel=1e-3)
    assert law.rate[60] == pytest.approx(0.3, rel=1e-3)


def test_runs_together_are_as_alone(arm: Arm, home: np.ndarray) -> None:
    parts = [smooth(home), smooth(home + 0.3, -0.2), smooth(home - 0.1, 0.05)]
    q, s = (np.concatenate(list(column)) for column in zip(*parts, strict=True))
    begins = np.arange(len(s)) % K == 0
    limit = np.full(len(s), 0.7)
    together = time_laws(arm, q, s, limit, begins)
    for i, (alone_q, alone_s) in enumerate(parts):
        alone = one(arm, alone_q, alone_s, np.full(K, 0.7))
        rows = slice(i * K, (i + 1) * K)
        np.testing.assert_allclose(together.time[rows], alone.time, rtol=1e-6)
        np.testing.assert_allclose(together.rate[rows], alone.rate, atol=1e-5)


def test_windows_change_nothing_at_programmed_speeds(
    arm: Arm, home: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    s = np.linspace(0, 40, 3000)
    phase = s[:, None] * np.arange(1, 7) / 5
    q = home + 0.3 * np.sin(phase)
    limit = np.where((s > 15) & (s < 16), 0.3, 0.9)
    limit[s > 30] = 3.0  # beyond what the joints can do: no bound is touched
    whole = one(arm, q, s, limit)
    monkeypatch.setattr("postproc.motion.toppra.WINDOW", 400)
    pieces = one(arm, q, s, limit)
    np.testing.assert_allclose(pieces.rate, whole.rate, rtol=3e-4, atol=1e-5)
    np.testing.assert_allclose(pieces.time, whole.time, rtol=3e-4)


def test_failure_is_an_error_of_ours_and_silent(
    arm: Arm, home: np.ndarray, caplog: pytest.LogCaptureFixture
) -> None:
    q, s = smooth(home)
    with caplog.at_level(logging.DEBUG), pytest.raises(PlanError):
        one(arm, q, s, np.zeros(K))
    assert not caplog.records
