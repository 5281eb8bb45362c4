"""Straight lines on which the wrist turns joint by joint ($ORNT_TYPE WRIST_JNT)."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.exceptions import PlanError
from postproc.virtual.kinematics import Chain

NEWTON_STEPS = 12
CLOSE = 1e-9  # [m]


def joints_with_wrist(
    chain: Chain, points: Floats, tool: Floats, start: Floats, end: Floats
) -> Floats:
    """Follow TCP points while joints 4 to 6 go straight from start to end.

    Newton's method on joints 1 to 3, for all points at once.

    Args:
        chain: Nominal arm.
        points: TCP positions at even steps, the last at the end, (m, 3) [m].
        tool: Flange to TCP, (4, 4).
        start: Joints before the first point, (6,) [rad].
        end: Joints at the last point, (6,) [rad].

    Returns:
        (m, 6) [rad].

    Raises:
        PlanError: The line leaves the reach of the arm.
    """
    progress = np.arange(1, len(points) + 1)[:, None] / len(points)
    q = start + progress * (end - start)
    for _ in range(NEWTON_STEPS):
        frames = chain.frames(q)
        tcp = frames[:, 6, :3, :3] @ tool[:3, 3] + frames[:, 6, :3, 3]
        miss = points - tcp
        if np.abs(miss).max() < CLOSE:
            break
        axes = chain.sense[:3, None] * frames[:, :3, :3, 2]
        jacobian = np.swapaxes(
            np.cross(axes, tcp[:, None] - frames[:, :3, :3, 3]), 1, 2
        )
        if np.abs(np.linalg.det(jacobian)).min() < 1e-6:
            raise PlanError("the path passes a singularity of the arm")
        q[:, :3] += np.linalg.solve(jacobian, miss[..., None])[..., 0]
    inside = (q >= chain.lower) & (q <= chain.upper)
    if not np.abs(miss).max() < CLOSE or not inside.all():
        raise PlanError("the path leaves the reach or the joint range of the arm")
    return np.asarray(q)
