"""Time laws along given paths. The only importer of toppra."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import solve_banded

from postproc.arrays import Bools, Floats
from postproc.exceptions import PlanError
from postproc.robot.arm import Arm

PLOTS = ("matplotlib", "matplotlib.pyplot")


@contextmanager
def _without_plots() -> Iterator[None]:
    """Let an import do without the plotting library that only its plots would need.

    It takes longer to load than all that is used of it.
    """
    absent = [name for name in PLOTS if name not in sys.modules]
    sys.modules.update({name: ModuleType(name) for name in absent})
    try:
        yield
    finally:
        for name in absent:
            del sys.modules[name]


with _without_plots():
    import toppra
    import toppra.algorithm
    import toppra.constraint

# Natural cubic splines through the waypoints of many runs at once.


def derivatives(s: Floats, q: Floats, begins: Bools) -> tuple[Floats, Floats]:
    """Differentiate at the waypoints the natural spline through each run.

    With the step h and the slope m of an interval, the first derivatives d satisfy
    d_i / h_i + 2 d_i (1/h_i + 1/h_i+1) + .. = 3 (m_i / h_i + m_i+1 / h_i+1), and
    2 d_0 + d_1 = 3 m_0 at a free end (de Boor: A Practical Guide to Splines,
    chapter 4); runs do not see each other.

    Args:
        s: Path positions, increasing within each run, (k,).
        q: Waypoints, (k, p).
        begins: True at the first waypoint of each run, (k,); a run has two or more.

    Returns:
        First and second derivatives, (k, p) each.
    """
    ends = np.append(begins[1:], True)
    h = np.append(np.diff(s), 1.0)
    h[ends] = 1.0
    slope = np.vstack([np.diff(q, axis=0), np.zeros((1, q.shape[1]))]) / h[:, None]
    after = np.where(ends, 0.0, 1.0 / h)  # weight of the interval after a waypoint
    before = np.append(0.0, after[:-1])
    bands = np.zeros((3, len(s)))
    bands[0, 1:], bands[1], bands[2, :-1] = after[:-1], 2 * (before + after), before[1:]
    pull = after[:, None] * slope
    right = 3 * (pull + np.vstack([np.zeros((1, q.shape[1])), pull[:-1]]))
    first = np.asarray(solve_banded((1, 1), bands, right))
    following = np.vstack([first[1:], first[-1:]])
    second = (6 * slope - 4 * first - 2 * following) / h[:, None]
    last = np.flatnonzero(ends)
    before_last = slope[last - 1] * 6 - 2 * first[last - 1] - 4 * first[last]
    second[last] = -before_last / h[last - 1, None]
    return first, second


# Time laws along given paths. The only importer of toppra.
#
# (Pham and Pham: A New Approach to Time-Optimal Path Parameterization Based on
# Reachability Analysis, IEEE Transactions on Robotics 2018.)

Orders = tuple[Floats, Floats, Floats]  # joint angles and their two derivatives, (k, 6)

GAP = 0.01  # path length put between two runs, where the arm stands
CREEP = 1e-4  # ds/dt that counts as standing: an exact zero leaves the solver no room
WINDOW = 20_000  # gridpoints solved at a time
TOUCHING = 0.9998  # of the bound; toppra itself stays a little below it
FASTEST = 1e4  # bound of ds/dt where the joints give none

logging.getLogger("toppra").setLevel(logging.CRITICAL)


@dataclass(frozen=True)
class Runs:
    """Time laws of runs from stop to stop, at their k waypoints.

    Attributes:
        s: Path positions, (k,).
        q: Joint angles, (k, 6) [rad].
        slope, curve: dq/ds and its derivative, (k, 6) each.
        rate: ds/dt, (k,), 0 at both ends of each run.
        time: Time since the run began, (k,) [s].
    """

    s: Floats
    q: Floats
    slope: Floats
    curve: Floats
    rate: Floats
    time: Floats

    @property
    def acceleration(self) -> Floats:
        """Joint accelerations behind the waypoints, (k, 6) [rad/s^2]."""
        squares, ds = np.diff(self.rate**2), np.diff(self.s)
        push = np.zeros((len(self.s), 1))
        moves = np.flatnonzero(ds > 0)  # from a run to the next nothing does
        push[moves, 0] = squares[moves] / (2 * ds[moves])
        return np.asarray(self.curve * self.rate[:, None] ** 2 + self.slope * push)

    @property
    def velocity(self) -> Floats:
        """Joint velocities at the waypoints, (k, 6) [rad/s]."""
        return self.slope * self.rate[:, None]

    def at(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        """Follow the first and only run.

        Returns:
            Joint angles, velocities and accelerations, (m, 6) each, at times (m,).
        """
        i = np.searchsorted(self.time, time, side="right") - 1
        i = np.clip(i, 0, len(self.s) - 2)
        squares = self.rate**2
        push = (squares[i + 1] - squares[i]) / (2 * (self.s[i + 1] - self.s[i]))
        dt = time - self.time[i]
        s = self.s[i] + dt * self.rate[i] + push * dt**2 / 2
        rate = (self.rate[i] + push * dt)[:, None]
        path = CubicHermiteSpline(self.s, self.q, self.slope)
        first, second = path(s, 1), path(s, 2)
        return path(s), first * rate, second * rate**2 + first * push[:, None]


class _Path(toppra.interpolator.AbstractGeometricPath):  # type: ignore[misc]
    """A path that is only asked for its derivatives at all the gridpoints."""

    def __init__(self, s: Floats, q: Floats, first: Floats, second: Floats) -> None:
        self._s, self._orders = s, (q, first, second)

    def __call__(self, positions: Floats, order: int = 0) -> Floats:
        if np.ndim(positions) == 0:
            return self._orders[order][np.searchsorted(self._s, positions)]
        return self._orders[order]

    @property
    def dof(self) -> int:
        return 6

    @property
    def path_interval(self) -> Floats:
        return self._s[[0, -1]]


class _PathSpeed(toppra.constraint.LinearConstraint):  # type: ignore[misc]
    """A bound of the path velocity at each gridpoint."""

    def __init__(self, limit: Floats) -> None:
        super().__init__()
        self.dof = 6
        self._square = limit**2

    def compute_constraint_params(
        self, path: Any, gridpoints: Floats
    ) -> tuple[Any, ...]:
        """Return no linear constraint, only bounds of the squared velocity."""
        bound = np.column_stack([np.zeros_like(self._square), self._square])
        return None, None, None, None, None, None, bound


def time_laws(arm: Arm, q: Floats, s: Floats, limit: Floats, begins: Bools) -> Runs:
    """Find the fastest time laws along paths, from stop to stop.

    All runs are solved as one path on which the arm must stand at the seams.

    Args:
        arm: Its joint velocity and acceleration limits hold.
        q: Joint angles at the waypoints, each one a gridpoint, (k, 6) [rad].
        s: Path positions of the waypoints, increasing within a run, (k,).
        limit: Bound of ds/dt at the waypoints, (k,), inf where there is none.
        begins: True at the first waypoint of each run, (k,).

    Raises:
        PlanError: toppra finds no time law for one of the runs.
    """
    first, second = derivatives(s, q, begins)
    step = np.diff(s, prepend=s[0])
    step[begins] = GAP
    ends = np.append(begins[1:], True)
    with np.errstate(divide="ignore"):
        joints = (arm.velocity / np.abs(first)).min(axis=1)
    bound = np.minimum(np.minimum(limit, joints), FASTEST)
    bound[begins | ends] = CREEP
    rate = _in_windows(arm, np.cumsum(step), (q, first, second), bound)
    rate = np.where(begins | ends, 0.0, rate)
    between = (rate[1:] + rate[:-1])[~begins[1:]]
    if (between <= 0).any():
        raise PlanError("the arm would stand still inside a run")
    lasts = np.zeros(len(s))
    lasts[~begins] = 2 * step[~begins] / between
    total = np.cumsum(lasts)
    since = total - total[np.maximum.accumulate(np.where(begins, np.arange(len(s)), 0))]
    return Runs(s, q, first, second, rate, since)


def _in_windows(arm: Arm, along: Floats, orders: Orders, bound: Floats) -> Floats:
    """Solve a long path piece by piece, (k,).

    A piece ends at rest, so that its velocities are nowhere above those of the whole
    path, which are nowhere above the bound. Where the piece touches the bound all three
    are equal: up to there it is the whole path's own law, and the next piece goes on
    from there at that velocity.

    Raises:
        PlanError: toppra finds no time law.
    """
    rate, a, size = np.zeros(len(along)), 0, WINDOW
    while True:
        rows = slice(a, a + size)
        part = _solve(arm, along[rows], orders, rows, bound[rows], float(rate[a]))
        if a + size >= len(along):
            rate[rows] = part
            return rate
        touching = np.flatnonzero(part >= TOUCHING * bound[rows])
        if len(touching) == 0 or touching[-1] == 0:
            size *= 2
            continue
        last = int(touching[-1])
        rate[a : a + last + 1] = part[: last + 1]
        a, size = a + last, WINDOW


def _solve(
    arm: Arm, along: Floats, orders: Orders, rows: slice, bound: Floats, begin: float
) -> Floats:
    """Find the fastest ds/dt, (k,), from a given one to a standstill.

    Raises:
        PlanError: toppra finds no time law.
    """
    path = _Path(along, *(order[rows] for order in orders))
    solver = toppra.algorithm.TOPPRA(
        [
            toppra.constraint.JointAccelerationConstraint(arm.acceleration),
            _PathSpeed(bound),
        ],
        path,
        gridpoints=along,
        solver_wrapper="seidel",
    )
    _, rate, _ = solver.compute_parameterization(begin, 0.0)
    if rate is None or np.isnan(rate).any():
        raise PlanError("no time law for this path within the joint limits")
    return np.asarray(rate, dtype=float)
