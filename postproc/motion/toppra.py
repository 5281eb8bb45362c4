"""Time laws along given paths. The only importer of toppra.

(Pham and Pham: A New Approach to Time-Optimal Path Parameterization Based on
Reachability Analysis, IEEE Transactions on Robotics 2018.)
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np
import toppra
import toppra.algorithm
import toppra.constraint
from numpy.typing import NDArray

from postproc.exceptions import PlanError
from postproc.robot.arm import Arm

Array = NDArray[np.float64]

logging.getLogger("toppra").setLevel(logging.CRITICAL)


class _PathSpeed(toppra.constraint.LinearConstraint):  # type: ignore[misc]
    """A bound of the path velocity at each gridpoint."""

    def __init__(self, limit: Array) -> None:
        super().__init__()
        self.dof = 6
        self._square = limit**2

    def compute_constraint_params(
        self, path: Any, gridpoints: Array
    ) -> tuple[Any, ...]:
        bound = np.column_stack([np.zeros_like(self._square), self._square])
        return None, None, None, None, None, None, bound


@dataclass(frozen=True, eq=False)
class Run:
    """The time law of one run between two stops.

    Attributes:
        s: Path positions of the gridpoints, (k,).
        rate: ds/dt at the gridpoints, (k,).
        time: Time at the gridpoints, (k,) [s].
    """

    s: Array
    rate: Array
    time: Array
    _path: Any

    @property
    def velocity(self) -> Array:
        """Joint velocities at the gridpoints, (k, 6) [rad/s]."""
        velocity: Array = self._path(self.s, 1) * self.rate[:, None]
        return velocity

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Return joint angles, velocities and accelerations, (m, 6), at times (m,)."""
        i = np.clip(
            np.searchsorted(self.time, time, side="right") - 1, 0, len(self.s) - 2
        )
        squares = self.rate**2
        push = (squares[i + 1] - squares[i]) / (2 * (self.s[i + 1] - self.s[i]))
        dt = time - self.time[i]
        s = self.s[i] + dt * self.rate[i] + push * dt**2 / 2
        rate = (self.rate[i] + push * dt)[:, None]
        d1, d2 = self._path(s, 1), self._path(s, 2)
        return self._path(s), d1 * rate, d2 * rate**2 + d1 * push[:, None]


def run(arm: Arm, q: Array, s: Array, limit: Array, override: float) -> Run:
    """Find the fastest time law along a path, from stop to stop.

    Args:
        arm: Its joint velocity and acceleration limits hold.
        q: Joint angles at the waypoints, each one a gridpoint, (k, 6) [rad].
        s: Path positions of the waypoints, increasing, (k,).
        limit: Bound of ds/dt at the waypoints, (k,), inf where there is none.
        override: Share of the arm's joint velocity, its square of the acceleration.

    Raises:
        PlanError: toppra finds no time law.
    """
    path = toppra.SplineInterpolator(s, q)
    bounds = [
        toppra.constraint.JointVelocityConstraint(arm.velocity * override),
        toppra.constraint.JointAccelerationConstraint(arm.acceleration * override**2),
        _PathSpeed(np.minimum(limit, 1e4)),
    ]
    solver = toppra.algorithm.TOPPRA(
        bounds, path, gridpoints=s, solver_wrapper="seidel"
    )
    _, rate, _ = solver.compute_parameterization(0.0, 0.0)
    if rate is None or np.isnan(rate).any():
        raise PlanError("no time law for this path within the joint limits")
    between = rate[1:] + rate[:-1]
    if (between <= 0).any():
        raise PlanError("the path stops inside a run")
    time = np.concatenate([[0.0], np.cumsum(2 * np.diff(s) / between)])
    return Run(s, rate, time, path)
