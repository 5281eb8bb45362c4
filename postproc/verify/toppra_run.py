"""Runs from stop to stop in time, by toppra. The only importer of toppra.

toppra says None where it finds no time law, tells of it in its log, and loads a
library that draws.
"""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from postproc.arrays import Floats

SHORT = 1e-9  # [rad] a run of no length has no time law, and needs none


def run_in_time(q: Floats, velocity: Floats, acceleration: Floats) -> Floats | None:
    """Sample the fastest trajectory through waypoints, at rest at both ends.

    Args:
        q: Joint angles of the waypoints, (k, 6) [rad].
        velocity: Limits of the joints, (6,) [rad/s].
        acceleration: Limits of the joints, (6,) [rad/s^2].

    Returns:
        Joint angles at even times, (m, 6), or None where toppra finds no time law.
    """
    if not np.isfinite(q).all():
        return None
    size = np.abs(np.diff(q, axis=0)).max(axis=1)
    q = q[np.append(True, size > SHORT)]
    if len(q) < 2:
        return q
    s = np.append(0.0, np.cumsum(size[size > SHORT]))
    trajectory = _trajectory(s, q, velocity, acceleration)
    if trajectory is None or not np.isfinite(trajectory.duration):
        return None
    found = trajectory(np.linspace(0.0, trajectory.duration, 2 * len(s) + 2))
    return np.asarray(found) if np.isfinite(found).all() else None


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
        solver = algorithm.TOPPRA(limits, path, gridpoints=s, solver_wrapper="seidel")
        return solver.compute_trajectory(0.0, 0.0)
    except (ValueError, IndexError, ArithmeticError):
        return None
