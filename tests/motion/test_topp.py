from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import toppra
import toppra.algorithm
import toppra.constraint
from scipy.interpolate import CubicHermiteSpline

from postproc.motion.topp import Runs, time_laws
from postproc.robot.arm import Arm

K = 81


def smooth(home: np.ndarray, size: float = 0.4) -> tuple[np.ndarray, np.ndarray]:
    """A curved path: joint angles (k, 6) and path positions (k,)."""
    s = np.linspace(0, 1, K)
    q = home + size * np.column_stack([np.sin((1 + j / 3) * s * 2) for j in range(6)])
    return q, s


def one(arm: Arm, q: np.ndarray, s: np.ndarray, limit: np.ndarray) -> Runs:
    return time_laws(arm, q, s, limit, np.arange(len(s)) == 0)


def followed(law: Runs, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Follow a single run: angles, velocities and accelerations at times (m,)."""
    i = np.clip(np.searchsorted(law.time, time, side="right") - 1, 0, len(law.s) - 2)
    squares = law.rate**2
    push = (squares[i + 1] - squares[i]) / (2 * (law.s[i + 1] - law.s[i]))
    dt = time - law.time[i]
    s = law.s[i] + dt * law.rate[i] + push * dt**2 / 2
    rate = (law.rate[i] + push * dt)[:, None]
    path = CubicHermiteSpline(law.s, law.q, law.slope)
    first, second = path(s, 1), path(s, 2)
    return path(s), first * rate, second * rate**2 + first * push[:, None]


def test_limits_hold_all_along(arm: Arm, home: np.ndarray) -> None:
    q, s = smooth(home)
    law = one(arm, q, s, np.full(K, np.inf))
    found, velocity, acceleration = followed(law, np.linspace(0, law.time[-1], 1000))
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
    ahead, behind = followed(law, time + 1e-5)[0], followed(law, time - 1e-5)[0]
    np.testing.assert_allclose(
        (ahead - behind) / 2e-5, followed(law, time)[1], atol=1e-3
    )
    np.testing.assert_allclose(
        followed(law, law.time[:-1])[1], law.velocity[:-1], atol=1e-9
    )


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


def test_a_run_that_must_stand_still_has_no_time(arm: Arm, home: np.ndarray) -> None:
    parts = [smooth(home), smooth(home + 0.3, -0.2)]
    q, s = (np.concatenate(list(column)) for column in zip(*parts, strict=True))
    limit = np.full(len(s), np.inf)
    limit[10:20] = 0.0
    law = time_laws(arm, q, s, limit, np.arange(len(s)) % K == 0)
    assert np.isnan(law.time[:K]).all() and np.isfinite(law.time[K:]).all()


@pytest.mark.parametrize("seed", range(8))
def test_it_is_the_law_of_toppra(arm: Arm, home: np.ndarray, seed: int) -> None:
    rng = np.random.default_rng(seed)
    s = np.concatenate([[0.0], np.cumsum(rng.uniform(0.002, 0.02, 300))])
    phase = rng.uniform(0, 2 * np.pi, 6)
    q = home + 0.3 * np.sin(s[:, None] * rng.uniform(1, 6, 6) + phase)
    limit = np.where(rng.random(len(s)).repeat(10)[: len(s)] < 0.5, 0.3, np.inf)
    ours = one(arm, q, s, limit)
    theirs = their_rate(arm, ours, limit)
    np.testing.assert_allclose(ours.rate[1:-1], theirs[1:-1], rtol=2e-3, atol=2e-4)
    assert (ours.rate[1:-1] >= (1 - 1e-5) * theirs[1:-1] - CREEP).all()


CREEP = 1e-4  # ds/dt that counts as standing: an exact zero leaves toppra no room


def their_rate(arm: Arm, law: Runs, limit: np.ndarray) -> np.ndarray:
    """The ds/dt of toppra along the same path, at the same gridpoints, (k,)."""
    joints = (arm.velocity / np.abs(law.slope)).min(axis=1)
    bound = np.minimum(limit, joints)
    bound[[0, -1]] = CREEP
    path = toppra.SplineInterpolator(law.s, law.q, bc_type="natural")
    solver = toppra.algorithm.TOPPRA(
        [toppra.constraint.JointAccelerationConstraint(arm.acceleration), Speed(bound)],
        path,
        gridpoints=law.s,
        solver_wrapper="seidel",
    )
    _, rate, _ = solver.compute_parameterization(0.0, 0.0)
    return np.asarray(rate)


class Speed(toppra.constraint.LinearConstraint):  # type: ignore[misc]
    """A bound of the path velocity at each gridpoint."""

    def __init__(self, limit: np.ndarray) -> None:
        super().__init__()
        self.dof, self.limit = 6, limit

    def compute_constraint_params(
        self, path: Any, gridpoints: np.ndarray
    ) -> tuple[Any, ...]:
        bound = np.column_stack([np.zeros_like(self.limit), self.limit**2])
        return None, None, None, None, None, None, bound
