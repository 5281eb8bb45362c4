"""Poses of the interpreter: PDL2 records and what `:` and POS_INV make of them.

Written from PDL2's definition, R = Rz(A) Ry(E) Rz(R) [deg], with none of the code that
is tested.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, degrees, hypot, radians, sin

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Record = tuple[float, ...]


def matrix(record: Sequence[float]) -> Array:
    """Return the homogeneous matrix of a record, (4, 4) [mm]."""
    a, e, r = (radians(angle) for angle in record[3:6])
    out = np.eye(4)
    out[:3, :3] = _about_z(a) @ _about_y(e) @ _about_z(r)
    out[:3, 3] = record[:3]
    return out


def composed(a: Sequence[float], b: Sequence[float]) -> Record:
    """Return a : b."""
    return _record(matrix(a) @ matrix(b))


def inverted(record: Sequence[float]) -> Record:
    """Return POS_INV."""
    return _record(np.linalg.inv(matrix(record)))


def _record(pose: Array) -> Record:
    """Return the angles of a matrix with E from 0 to 180 deg."""
    sine = hypot(pose[2, 0], pose[2, 1])
    e = atan2(sine, pose[2, 2])
    a, r = atan2(pose[1, 2], pose[0, 2]), atan2(pose[2, 1], -pose[2, 0])
    if sine < 1e-12:
        a, r = atan2(-pose[0, 1], pose[1, 1]), 0.0
    return (*map(float, pose[:3, 3]), degrees(a), degrees(e), degrees(r))


def _about_z(angle: float) -> Array:
    c, s = cos(angle), sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _about_y(angle: float) -> Array:
    c, s = cos(angle), sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
