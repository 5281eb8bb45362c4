"""Torque of an arm's own weight, by differences of its potential energy."""

from __future__ import annotations

import numpy as np

from postproc.robot.arm import Arm

GRAVITY = 9.80665  # [m/s^2]
STEP = 1e-5


def torque(arm: Arm, q: np.ndarray, mass: np.ndarray, pull: np.ndarray) -> np.ndarray:
    """Compute the torque of the weight about every joint, (n, 6) [N m].

    Args:
        arm: The nominal arm, of which D-H numbers and centres of mass are read.
        q: Joint angles, (n, 6) [rad].
        mass: Of the links, (6,) [kg].
        pull: Direction in which weight pulls, unit vector (3,), base frame.
    """
    steps = STEP * np.concatenate([np.eye(6), -np.eye(6)])
    work = _work(arm, (q[:, None] + steps).reshape(-1, 6), mass, pull)
    there, back = np.split(work.reshape(-1, 12), 2, axis=1)
    return (there - back) / (2.0 * STEP)


def _work(arm: Arm, q: np.ndarray, mass: np.ndarray, pull: np.ndarray) -> np.ndarray:
    """Work that weight has done up to joint angles q (n, 6), (n,) [J]."""
    dh, links = arm.dh, arm.file.links
    assert links is not None
    theta = dh.offset + dh.sense * (q @ dh.mix.T)
    cos, sin = np.cos(theta).T, np.sin(theta).T
    work = np.zeros(len(q))
    for j, centre in enumerate(np.array(links.com_mm) * 1e-3):
        x, y, z = (np.full(len(q), along) for along in centre)
        for k in reversed(range(j + 1)):  # from the frame of a link to the one before
            ca, sa = np.cos(dh.alpha[k]), np.sin(dh.alpha[k])
            x = x + dh.a[k]
            y, z = ca * y - sa * z, sa * y + ca * z + dh.d[k]
            x, y = cos[k] * x - sin[k] * y, sin[k] * x + cos[k] * y
        work += GRAVITY * mass[j] * (x * pull[0] + y * pull[1] + z * pull[2])
    return work
