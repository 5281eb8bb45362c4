"""Inverse kinematics that recalls the path it solved last.

A program is planned again for every round of corrections, and most rounds move few
targets: all other poses on the path are, to the last bit, those of the round before.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.intp]
Bools = NDArray[np.bool_]
Solve = Callable[[Array], Array]

MOST = 20_000  # poses kept; longer paths take their memory for themselves

# Tells poses apart at a glance; equal poses are found by comparing them in full.
_WEIGHTS = np.sqrt(np.arange(2.0, 14.0)).reshape(3, 4)


class Recall:
    """The last path and its branches.

    A pose is solved by itself, so that recalled branches are the bits that solving
    would give.
    """

    def __init__(self, solve: Solve) -> None:
        """Recall what `solve` gives: poses (n, 4, 4) -> joint angles (n, 8, 6)."""
        self._solve = solve
        self._poses, self._q = np.empty((0, 4, 4)), np.empty((0, 8, 6))
        self._keys = np.empty(0)  # ascending

    def __call__(self, poses: Array) -> Array:
        """Return all branches of flange poses (n, 4, 4) [m], (n, 8, 6) [rad]."""
        if len(poses) > MOST:
            return self._solve(poses)
        keys = np.sum(poses[:, :3] * _WEIGHTS, axis=(1, 2))
        at, same = self._find(poses, keys)
        q = np.empty((len(poses), 8, 6))
        q[same] = self._q[at[same]]
        q[~same] = self._solve(poses[~same])
        order = np.argsort(keys, kind="stable")
        self._keys = keys[order]
        self._poses, self._q = poses[order], q[order]
        return q

    def _find(self, poses: Array, keys: Array) -> tuple[Ints, Bools]:
        """Find poses among the last ones: their rows, and which were found."""
        if len(self._keys) == 0:
            return np.zeros(len(keys), dtype=np.intp), np.zeros(len(keys), dtype=bool)
        at = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        same = (self._poses[at] == poses).all(axis=(1, 2))
        return at, same
