"""Lines whose wrist axes are interpolated instead of the orientation (WRIST_JNT)."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.robot.arm import Arm

ROUNDS = 20
CLOSE = 1e-9  # [m]


def wrist_interpolated(
    arm: Arm, begin: Floats, end: Floats, tool: Floats, k: int
) -> Floats:
    """Move the TCP along a line while axes 4 to 6 turn in proportion.

    Axes 1 to 3 follow by Newton's method on the TCP's position, from the straight line
    in joint space.

    Args:
        arm: The arm.
        begin: Joint angles at the start, (6,) [rad].
        end: Joint angles at the end, (6,) [rad].
        tool: TCP in the flange frame, (4, 4) [m].
        k: Number of samples, the end included.

    Returns:
        (k, 6) [rad]; empty where the line cannot be followed.
    """
    u = (np.arange(1, k + 1) / k)[:, None]
    q = begin + u * (end - begin)
    ends = arm.flange(np.vstack([begin, end])) @ tool
    wanted = ends[0, :3, 3] + u * (ends[1, :3, 3] - ends[0, :3, 3])
    for _ in range(ROUNDS):
        missing = wanted - (arm.flange(q) @ tool)[:, :3, 3]
        if np.isnan(missing).any():
            break
        if np.abs(missing).max() < CLOSE:
            return q
        J = arm.jacobian(q, tool[:3, 3])[:, :3, :3]
        if np.abs(np.linalg.det(J)).min() < CLOSE:
            break
        q[:, :3] += np.linalg.solve(J, missing[:, :, None])[:, :, 0]
    return np.empty((0, 6))
