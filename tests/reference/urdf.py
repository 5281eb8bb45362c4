"""The flange of a chain of URDF joints: matrices, one joint after the other."""

from __future__ import annotations

import math

import numpy as np


def turned(axis, angle):
    """Rotate about a unit vector, (4, 4), by quaternion."""
    w = math.cos(angle / 2)
    x, y, z = (math.sin(angle / 2) * component for component in axis)
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return out


def origin(xyz, rpy):
    """Place a joint in its parent link, (4, 4): fixed axes x, y, z in this order."""
    roll, pitch, yaw = rpy
    shift = np.eye(4)
    shift[:3, 3] = xyz
    turns = turned((0, 0, 1), yaw) @ turned((0, 1, 0), pitch) @ turned((1, 0, 0), roll)
    return shift @ turns


def flange(rows, q):
    """Place the last link of a chain for the angles of its axes [rad], (n, 4, 4).

    Args:
        rows: Joints with `xyz`, `rpy`, `axis` and `moves`.
        q: (n, 6) [rad].
    """
    out = []
    for angles in q:
        pose = np.eye(4)
        for row in rows:
            pose = pose @ origin(row.xyz, row.rpy)
            if row.moves is not None:
                number, multiplier, offset = row.moves
                angle = multiplier * angles[number - 1] + offset
                pose = pose @ turned(row.axis, angle)
        out.append(pose)
    return np.array(out)
