"""Rotations and poses, written for the virtual arm alone.

The virtual arm is the truth that the rest is tested against, so it shares no
mathematics with it: not even a rotation.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats


def about_z(angle: Floats) -> Floats:
    """Rotate about z: (...,) [rad] -> (..., 3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(c), np.ones_like(c)
    flat = np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1)
    return np.asarray(flat.reshape(*np.shape(angle), 3, 3))


def about_y(angle: Floats) -> Floats:
    """Rotate about y: (...,) [rad] -> (..., 3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(c), np.ones_like(c)
    flat = np.stack([c, zero, s, zero, one, zero, -s, zero, c], axis=-1)
    return np.asarray(flat.reshape(*np.shape(angle), 3, 3))


def exponential(vector: Floats) -> Floats:
    """Return the rotations (..., 3, 3) of rotation vectors (..., 3) [rad].

    Rodrigues: R = I + sin(t)/t K + (1 - cos(t))/t^2 K^2, K the cross product matrix.
    """
    v = np.asarray(vector, dtype=float)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    K = np.zeros((*v.shape, 3))
    K[..., 0, 1], K[..., 0, 2], K[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    K -= np.swapaxes(K, -1, -2)
    half = np.sinc(angle / (2 * np.pi))
    turned: Floats = np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * half**2 * (K @ K)
    return turned


def logarithm(R: Floats) -> Floats:
    """Return the rotation vector (3,) [rad] of a rotation (3, 3), angle in [0, pi]."""
    skew = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine, cosine = 0.5 * float(np.linalg.norm(skew)), 0.5 * (float(np.trace(R)) - 1)
    angle = np.arctan2(sine, cosine)
    if sine > 1e-6:
        return np.asarray(skew * (0.5 * angle / sine))
    if cosine > 0:
        return np.asarray(0.5 * skew)
    # Half a turn: the axis is the largest column of R + I.
    columns = R + np.eye(3)
    axis = columns[:, np.argmax(np.diag(R))]
    return np.asarray(angle * axis / np.linalg.norm(axis))


def pose(R: Floats, p: Floats) -> Floats:
    """Join rotations (..., 3, 3) and positions (..., 3) [m] to poses (..., 4, 4)."""
    shape = np.broadcast_shapes(np.shape(R)[:-2], np.shape(p)[:-1])
    T = np.zeros((*shape, 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = R, p, 1.0
    return T


def pose_of_record(record: Floats) -> Floats:
    """Convert x, y, z, a, e, r (..., 6) [mm, deg] to poses (..., 4, 4) [m].

    R = Rz(a) Ry(e) Rz(r).
    """
    record = np.asarray(record, dtype=float)
    a, e, r = np.moveaxis(np.radians(record[..., 3:6]), -1, 0)
    return pose(about_z(a) @ about_y(e) @ about_z(r), record[..., :3] * 1e-3)


def undo(T: Floats) -> Floats:
    """Invert poses (..., 4, 4)."""
    back = np.swapaxes(T[..., :3, :3], -1, -2)
    return pose(back, -np.einsum("...ij,...j->...i", back, T[..., :3, 3]))


def small_motion(twist: Floats) -> Floats:
    """Return the poses of (..., 6): translation [m], then rotation vector [rad]."""
    return pose(exponential(twist[..., 3:]), twist[..., :3])
