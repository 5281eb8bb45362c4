"""What is unsure of the weights of links, of an arm whose file estimates them.

A load is linear in the first moments of the links, each in the frame of its own link.
They are not unsure one by one: a link that is heavier than its file says pulls at all
links before it, along their lengths.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import JOINTS
from postproc.model.effects.compliance import moments
from postproc.robot.arm import Arm
from postproc.robot.pose import MM

CENTRE = 0.15  # [m] how well a centre of mass is known, times the share of its mass
HARDLY = 0.1  # [kg m] how well any first moment is known at best


def links_beyond(load: str) -> tuple[int, ...]:
    """List the links whose weights a load holds, "torque 3" those from 3 on."""
    return JOINTS[int(load.split()[1][0]) - 1 :]


def moment_root(arm: Arm, links: tuple[int, ...]) -> Floats:
    """Return what turns independent normal numbers into first moments of links.

    Args:
        arm: The arm.
        links: The links, each after the one before it, the last one to the flange.

    Returns:
        (3 l, 3 l) [kg m]: lower triangle R of their covariance R R^T.
    """
    if arm.file.links is None:
        spreads = [moments(arm, k)[0][1] for k in links]
        return np.diag(np.repeat(spreads, 3))
    mass, centre = np.array(arm.file.links.mass_kg), np.array(arm.file.links.com_mm)
    unsure = arm.file.links.spread * mass
    ways = _by_mass(arm, links, centre * MM) * unsure
    own = [(CENTRE * unsure[k - 1]) ** 2 + HARDLY**2 for k in links]
    covariance = ways @ ways.T + np.diag(np.repeat(own, 3))
    return np.asarray(np.linalg.cholesky(covariance), dtype=float)


def _by_mass(arm: Arm, links: tuple[int, ...], centre: Floats) -> Floats:
    """Differentiate first moments by the masses of all links, (3 l, 6) [m].

    Args:
        arm: The arm.
        links: The links.
        centre: Centres of mass of all in their frames, (6, 3) [m].
    """
    dh = arm.dh
    length = np.stack(
        [dh.a, dh.d * np.sin(dh.alpha), dh.d * np.cos(dh.alpha)], axis=1
    )  # of every link, from joint to joint, in its frame
    out = np.zeros((len(links), 3, len(JOINTS)))
    for row, link in enumerate(links):
        out[row, :, link - 1 :] = length[link - 1][:, None]
        out[row, :, link - 1] += centre[link - 1]
    return out.reshape(-1, len(JOINTS))
