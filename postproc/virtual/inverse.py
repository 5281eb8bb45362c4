"""Closed-form inverse kinematics of an ortho-parallel arm with a spherical wrist.

Geometry: the wrist centre gives axes 1 to 3 (a turning plane with two links in it),
what is left of the orientation gives axes 4 to 6 (Z, Y, Z angles).
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.exceptions import PlanError
from postproc.virtual.kinematics import Chain

RIGHT = np.radians([-90.0, 0.0, -90.0, 90.0, -90.0, 0.0])
NOT_RIGHT = 1e-5  # [rad]
WRIST, SHOULDER, ELBOW = 4, 2, 1  # weights of the flags in a branch number


def require_closed_form(chain: Chain) -> None:
    """Check that the chain has the shape this solution is for.

    Raises:
        PlanError: The arm is no ortho-parallel arm with a spherical wrist.
    """
    zeros = np.concatenate([chain.d[[1, 2, 4]], chain.a[3:], chain.beta])
    bent = np.abs(chain.alpha - RIGHT).max() > NOT_RIGHT
    if bent or np.abs(zeros).max() > 1e-9:
        raise PlanError(
            "the virtual arm solves Cartesian targets only for arms with a parallel "
            "second and third axis and a spherical wrist; give it joint targets"
        )


def solve_branch(chain: Chain, flange: Floats, branch: int) -> Floats:
    """Return the joint angles that put the flange at the given poses, in one branch.

    Args:
        chain: Nominal arm.
        flange: Poses in the arm base, (n, 4, 4) [m].
        branch: 4 (axis 5 negative) + 2 (wrist centre behind axis 1) + 1 (elbow
            over the other side).

    Returns:
        Controller angles (n, 6) [rad], each D-H angle in (-pi, pi]; NaN where the
        pose is out of reach.
    """
    a, d = chain.a, chain.d
    wrist = flange[:, :3, 3] - d[5] * flange[:, :3, 2]
    behind = bool(branch & SHOULDER)
    radius = np.hypot(wrist[:, 0], wrist[:, 1]) * (-1.0 if behind else 1.0)
    theta = np.empty((len(flange), 6))
    theta[:, 0] = np.arctan2(wrist[:, 1], wrist[:, 0]) + (np.pi if behind else 0.0)
    forward, down = radius - a[0], d[0] - wrist[:, 2]
    fore = np.hypot(a[2], d[3])
    cosine = (forward**2 + down**2 - a[1] ** 2 - fore**2) / (2 * a[1] * fore)
    cosine = np.where(np.abs(cosine) <= 1.0, cosine, np.nan)
    bend = np.arccos(cosine) * (-1.0 if branch & ELBOW else 1.0)
    theta[:, 1] = np.arctan2(down, forward) - np.arctan2(
        fore * np.sin(bend), a[1] + fore * np.cos(bend)
    )
    theta[:, 2] = bend - np.arctan2(d[3], a[2])
    theta[:, 3:] = _wrist_angles(theta[:, :3], flange, bool(branch & WRIST))
    theta = np.pi - np.mod(np.pi - theta, 2 * np.pi)
    theta[np.isnan(cosine)] = np.nan
    return chain.controller_angles(theta)


def _wrist_angles(theta: Floats, flange: Floats, negative: bool) -> Floats:
    """Return the last three D-H angles (n, 3) given the first three (n, 3)."""
    c1, s1 = np.cos(theta[:, 0]), np.sin(theta[:, 0])
    elevation = theta[:, 1] + theta[:, 2]
    c, s = np.cos(elevation), np.sin(elevation)
    # Columns of the orientation of frame 3: x, y (along axis 2 reversed), z.
    x3 = np.stack([c1 * c, s1 * c, -s], axis=-1)
    y3 = np.stack([s1, -c1, np.zeros_like(c)], axis=-1)
    z3 = np.stack([-c1 * s, -s1 * s, -c], axis=-1)
    rest = np.stack([x3, y3, z3], axis=-2) @ flange[:, :3, :3]
    sign = -1.0 if negative else 1.0
    sine = np.hypot(rest[:, 0, 2], rest[:, 1, 2])
    fourth = np.arctan2(-sign * rest[:, 1, 2], -sign * rest[:, 0, 2])
    fifth = sign * np.arctan2(sine, rest[:, 2, 2])
    sixth = np.arctan2(-sign * rest[:, 2, 1], sign * rest[:, 2, 0])
    return np.stack([fourth, fifth, sixth], axis=-1)


def branch_of(chain: Chain, q: Floats) -> Ints:
    """Return the branch numbers (n,) of joint angles (n, 6) [rad]."""
    theta = chain.dh_angles(q)
    frames = chain.frames(q)
    outward = np.stack([np.cos(theta[:, 0]), np.sin(theta[:, 0])], axis=-1)
    behind = np.sum(frames[:, 4, :2, 3] * outward, axis=-1) < 0
    bend = np.sin(theta[:, 2] + np.arctan2(chain.d[3], chain.a[2]))
    negative = np.sin(theta[:, 4]) < 0
    return np.asarray(WRIST * negative + SHOULDER * behind + ELBOW * (bend < 0))


def nearest_turns(q: Floats, near: Floats) -> Floats:
    """Add the full turns that bring angles (n, 6) closest to (n, 6) or (6,) [rad]."""
    return np.asarray(q + 2 * np.pi * np.round((near - q) / (2 * np.pi)))
