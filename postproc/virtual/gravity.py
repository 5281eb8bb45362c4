"""Gravity torques by moments about the joint axes, written for the virtual arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.virtual.kinematics import Chain

GRAVITY = np.array([0.0, 0.0, -9.80665])  # [m/s^2]


@dataclass(frozen=True)
class Body:
    """What the arm weighs: link masses (6,) [kg], centres in link frames (6, 3) [m]."""

    chain: Chain
    mass: Floats
    centre: Floats


def link_torque(body: Body, q: Floats) -> Floats:
    """Return the torque of the links' weight about every joint.

    tau_j = sense_j z_j . sum_{i >= j} (c_i - o_j) x m_i g, positive along positive
    rotation as the controller counts it.

    Args:
        body: Chain, masses and centres of mass.
        q: Controller joint angles, (n, 6) [rad].

    Returns:
        (n, 6) [N m].
    """
    frames = body.chain.frames(q)
    centre = np.einsum("niab,ib->nia", frames[:, 1:, :3, :3], body.centre)
    centre = centre + frames[:, 1:, :3, 3]
    return _moments(body.chain, frames, centre, body.mass[None, :] + 0 * centre[..., 0])


def payload_torque(chain: Chain, q: Floats, mass: Floats, com: Floats) -> Floats:
    """Return the torque of a payload about every joint, (n, 6) [N m].

    Args:
        chain: The arm.
        q: Controller joint angles, (n, 6) [rad].
        mass: Payload mass, (n,) [kg].
        com: Its centre of mass in the flange frame, (n, 3) [m].
    """
    frames = chain.frames(q)
    centre = np.einsum("nab,nb->na", frames[:, 6, :3, :3], com) + frames[:, 6, :3, 3]
    masses = np.zeros_like(q)
    masses[:, 5] = mass
    return _moments(chain, frames, np.repeat(centre[:, None], 6, axis=1), masses)


def _moments(chain: Chain, frames: Floats, centre: Floats, mass: Floats) -> Floats:
    """Sum the moments about every axis of the masses outward of it."""
    weight = mass[..., None] * GRAVITY
    torque = np.empty((len(frames), 6))
    for j in range(6):
        lever = centre[:, j:] - frames[:, j, None, :3, 3]
        moment = np.cross(lever, weight[:, j:]).sum(axis=1)
        axis = chain.sense[j] * frames[:, j, :3, 2]
        torque[:, j] = np.sum(axis * moment, axis=-1)
    return torque
