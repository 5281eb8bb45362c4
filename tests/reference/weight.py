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
    out = np.empty((len(q), 6))
    for j in range(6):
        step = np.zeros(6)
        step[j] = STEP
        work = _work(arm, q + step, mass, pull) - _work(arm, q - step, mass, pull)
        out[:, j] = work / (2.0 * STEP)
    return out


def _work(arm: Arm, q: np.ndarray, mass: np.ndarray, pull: np.ndarray) -> np.ndarray:
    """Work that weight has done up to joint angles q (n, 6), (n,) [J]."""
    dh, links = arm.dh, arm.file.links
    assert links is not None
    theta = dh.offset + dh.sense * (q @ dh.mix.T)
    T, work = np.tile(np.eye(4), (len(q), 1, 1)), np.zeros(len(q))
    for j, centre in enumerate(np.array(links.com_mm) * 1e-3):
        c, s = np.cos(theta[:, j]), np.sin(theta[:, j])
        ca, sa = np.cos(dh.alpha[j]), np.sin(dh.alpha[j])
        A = np.zeros((len(q), 4, 4))
        A[:, 0] = np.stack([c, -s * ca, s * sa, dh.a[j] * c], axis=1)
        A[:, 1] = np.stack([s, c * ca, -c * sa, dh.a[j] * s], axis=1)
        A[:, 2] = 0.0, sa, ca, dh.d[j]
        A[:, 3, 3] = 1.0
        T = T @ A
        at = T[:, :3, :3] @ centre + T[:, :3, 3]
        work += GRAVITY * mass[j] * (at @ pull)
    return work
