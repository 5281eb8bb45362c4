"""Rigid transforms and the Euler ZYZ poses of robot programs.

A *pose* is an array (..., 4, 4) with lengths in metres. A *position record* is what
a program or a cell file holds: (..., 6) with x, y, z [mm] and a, e, r [deg] so that
R = Rz(a) Ry(e) Rz(r). This module imports nothing of the project but its core: the
language needs it to compose frames, the robot to place them.
"""

from __future__ import annotations

import numpy as np

from postproc import _native
from postproc.arrays import Bools, Floats, Ints, few_rows, floats

MM = 1e-3  # [m]
SAME_ROTATION = 1e-10  # elements of a matrix that differ less are the same


def rotation_from_zyz(zyz_deg: Floats) -> Floats:
    """Convert Euler ZYZ angles (..., 3) [deg] to rotations (..., 3, 3).

    >>> np.round(rotation_from_zyz(np.array([90.0, 0.0, 0.0])) @ [1, 0, 0], 12).tolist()
    [0.0, 1.0, 0.0]
    """
    angles = np.deg2rad(np.asarray(zyz_deg, dtype=float))
    cos, sin = np.cos(angles), np.sin(angles)
    ca, ce, cr = cos[..., 0], cos[..., 1], cos[..., 2]
    sa, se, sr = sin[..., 0], sin[..., 1], sin[..., 2]
    R = np.empty((*angles.shape[:-1], 3, 3))
    R[..., 0, 0], R[..., 0, 1] = ca * ce * cr - sa * sr, -ca * ce * sr - sa * cr
    R[..., 1, 0], R[..., 1, 1] = sa * ce * cr + ca * sr, -sa * ce * sr + ca * cr
    R[..., 0, 2], R[..., 1, 2] = ca * se, sa * se
    R[..., 2, 0], R[..., 2, 1], R[..., 2, 2] = -se * cr, se * sr, ce
    return R


def zyz_from_rotation(R: Floats) -> Floats:
    """Convert rotations (..., 3, 3) to Euler ZYZ angles (..., 3) [deg].

    e lies in [0, 180]; where it is 0 or 180 the split is free and a = 0.
    """
    sin_e = np.hypot(R[..., 0, 2], R[..., 1, 2])
    e = np.arctan2(sin_e, R[..., 2, 2])
    degenerate = sin_e < 1e-9
    a = np.where(degenerate, 0.0, np.arctan2(R[..., 1, 2], R[..., 0, 2]))
    upright = np.arctan2(R[..., 1, 0], R[..., 1, 1])
    r = np.where(degenerate, upright, np.arctan2(R[..., 2, 1], -R[..., 2, 0]))
    zyz: Floats = np.rad2deg(np.stack([a, e, r], axis=-1))
    return zyz


def angles_near(zyz_deg: Floats, R: Floats) -> Floats:
    """Convert rotations (n, 3, 3) to the Euler ZYZ angles next to given ones, (n, 3).

    (a, e, r) and (a + 180, -e, r + 180) are one rotation, and full turns change none;
    angles that already say what the rotation is are given back as they are.
    """
    zyz_deg = np.asarray(zyz_deg, dtype=float)
    out = np.array(zyz_deg)
    changed = np.abs(rotation_from_zyz(zyz_deg) - R).max(axis=(1, 2)) > SAME_ROTATION
    new = zyz_from_rotation(R[changed])
    other = new * [1.0, -1.0, 1.0] + [180.0, 0.0, 180.0]
    both = np.stack([new, other])
    both += 360.0 * np.round((zyz_deg[changed] - both) / 360.0)
    nearer = np.abs(both - zyz_deg[changed]).sum(axis=2).argmin(axis=0)
    out[changed] = both[nearer, np.arange(len(new))]
    return out


def pose_from_record(record: Floats) -> Floats:
    """Convert position records (..., 6) [mm, deg] to poses (..., 4, 4) [m]."""
    record = np.asarray(record, dtype=float)
    poses = _native.pose_from_record(floats(record.reshape(-1, 6)))
    return poses.reshape(*record.shape[:-1], 4, 4)


def record_from_pose(T: Floats) -> Floats:
    """Convert poses (..., 4, 4) [m] to position records (..., 6) [mm, deg]."""
    angles = zyz_from_rotation(T[..., :3, :3])
    record: Floats = np.concatenate([T[..., :3, 3] / MM, angles], axis=-1)
    return record


def inverse(T: Floats) -> Floats:
    """Invert poses (..., 4, 4); one for all rows stays one."""
    rows = few_rows(T) if T.ndim == 3 and len(T) else T
    found = _native.inverse(floats(rows.reshape(-1, 4, 4))).reshape(rows.shape)
    return found if rows is T else np.broadcast_to(found, T.shape)


def times(left: Floats, right: Floats) -> Floats:
    """Multiply poses (n, 4, 4) with others, (n, 4, 4)."""
    return _native.times(floats(left), floats(right))


def products(left: Floats, right: Floats, i: Ints, j: Ints) -> Floats:
    """Multiply some of few poses with each other, every pair once.

    Args:
        left: Poses, (k, 4, 4).
        right: Poses, (l, 4, 4).
        i: Which of `left`, (n,); negative ones count from the end.
        j: Which of `right`, (n,), likewise.

    Returns:
        left[i] @ right[j], (n, 4, 4), not to be written to.
    """
    count = len(right)
    pair = i % len(left) * count + j % count
    if len(pair) and (pair == pair[0]).all():  # one frame in a whole program, mostly
        one = left[i[0]] @ right[j[0]]
        return np.broadcast_to(one, (len(pair), 4, 4))
    used, which = np.unique(pair, return_inverse=True)
    return np.asarray((left[used // count] @ right[used % count])[which])


def is_unknown(T: Floats) -> Bools:
    """Tell which poses (n, 4, 4) hold a number that is not known, (n,)."""
    return np.asarray(np.isnan(np.einsum("nij->n", T)))


def cross(a: Floats, b: Floats) -> Floats:
    """Return the cross products of vectors (..., 3) with others that broadcast.

    What `numpy.cross` does for any axes takes ten times as long for a hundred vectors.
    """
    like = a if a.ndim >= b.ndim else b  # in its order of memory
    shape = np.broadcast_shapes(a.shape, b.shape)
    out = np.empty_like(like, dtype=float, shape=shape)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return out


def rotation_from_vector(vector: Floats) -> Floats:
    """Return the rotations (..., 3, 3) about vectors (..., 3) [rad].

    As in scipy, which takes longer to load than a small program to compensate. Raises
    ValueError where vectors do not have three components.
    """
    rows = floats(np.reshape(vector, (-1, 3)))
    return _native.rotation_from_vector(rows).reshape(*vector.shape, 3)


def lengths(vectors: Floats) -> Floats:
    """Return the lengths of vectors (..., 3), (...).

    What `numpy.linalg.norm` does along an axis of three takes three times as long.
    """
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def has_unknown(rows: Floats) -> Bools:
    """Tell which rows of finite numbers (n, k) hold one that is not known, (n,)."""
    return np.asarray(np.isnan(np.einsum("nk->n", rows)))


def rotation_vector(R: Floats) -> Floats:
    """Return the rotation vectors (..., 3) [rad] of rotations (..., 3, 3).

    Lengths are in [0, pi].
    """
    return _native.rotation_vector(floats(R.reshape(-1, 3, 3))).reshape(R.shape[:-1])
