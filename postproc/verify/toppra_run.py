"""Runs from stop to stop in time, by toppra. The only importer of toppra.

toppra says None where it finds no time law, tells of it in its log, and loads a
library that draws.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np

from postproc.arrays import Floats

SHORT = 1e-9  # [rad] a run of no length has no time law, and needs none
END_POINTS = 12  # parts of an interval next to a stop
AT_ONCE = 1e6  # [1/s] how fast the programmed speed is reached, if joints allow it


@dataclass(frozen=True)
class TimedRun:
    """A run or a move in time.

    Attributes:
        q: Joint angles at even times, (m, 6) [rad].
        seconds: How long it takes.
    """

    q: Floats
    seconds: float


def run_in_time(
    q: Floats, velocity: Floats, acceleration: Floats, least: Floats
) -> TimedRun | None:
    """Find the fastest trajectory through waypoints, at rest at both ends.

    Args:
        q: Joint angles of the waypoints, (k, 6) [rad].
        velocity: Limits of the joints, (6,) [rad/s].
        acceleration: Limits of the joints, (6,) [rad/s^2].
        least: Time to each waypoint at the programmed speed, (k,) [s]; it goes along
            as a seventh joint that runs by 1 s in a second at most.

    Returns:
        The run, or None where toppra finds no time law.
    """
    if not np.isfinite(q).all():
        return None
    size = np.abs(np.diff(q, axis=0)).max(axis=1)
    moves = np.append(True, size > SHORT)
    if moves.sum() < 2:
        return TimedRun(q[:1], 0.0)
    q = np.column_stack([q, least])[moves]
    s = np.append(0.0, np.cumsum(size[size > SHORT]))
    limits = np.append(velocity, 1.0), np.append(acceleration, AT_ONCE)
    trajectory = _trajectory(s, q, *limits)
    if trajectory is None or not np.isfinite(trajectory.duration):
        return None
    found = trajectory(np.linspace(0.0, trajectory.duration, 2 * len(s) + 2))
    if not np.isfinite(found).all():
        return None
    return TimedRun(np.asarray(found[:, :6]), float(trajectory.duration))


def _fine(s: Floats) -> Floats:
    """Return gridpoints: waypoints, and more in both intervals at the ends.

    They are the finest where the arm stands: it may be fast within a part of one.
    """
    u = np.linspace(0.0, 1.0, END_POINTS + 1)[1:-1] ** 2
    first, last = s[1] - s[0], s[-1] - s[-2]
    if len(s) == 2:
        both = np.append(u, 2.0 - u) / 2
        return np.unique(np.concatenate([s, s[0] + both * first]))
    return np.unique(np.concatenate([s, s[0] + u * first, s[-1] - u * last]))


def _trajectory(s: Floats, q: Floats, velocity: Floats, acceleration: Floats) -> Any:
    """Let toppra plan; None where it fails, in whatever way."""
    import toppra
    from toppra import algorithm, constraint

    logging.getLogger("toppra").setLevel(logging.CRITICAL)
    path = toppra.SplineInterpolator(s, q, bc_type="natural")
    limits = [
        constraint.JointVelocityConstraint(np.stack([-velocity, velocity], axis=1)),
        constraint.JointAccelerationConstraint(acceleration),
    ]
    try:
        solver = algorithm.TOPPRA(
            limits, path, gridpoints=_fine(s), solver_wrapper="seidel"
        )
        return solver.compute_trajectory(0.0, 0.0)
    except (ValueError, IndexError, ArithmeticError):
        return None
