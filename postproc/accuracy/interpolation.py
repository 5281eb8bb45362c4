"""Spatial interpolation: the error at a place is that of its measured neighbours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.batch import Batch
from postproc.accuracy.effect import Effect, Parameter
from postproc.arrays import Floats

NEAREST_GAP = 1e-6  # [m] a neighbour at the very place takes all the weight


@dataclass(frozen=True)
class Interpolation(Effect):
    """Inverse-distance weighting over Cartesian neighbours.

    Attributes:
        points: Nominal TCP positions of the measurements [m].
        neighbours: How many of them count.
        power: Of the distance.
    """

    name: ClassVar[str] = "interpolation"

    points: tuple[tuple[float, ...], ...]
    neighbours: int = 8
    power: float = 2.0

    @classmethod
    def through(cls, position: Floats) -> Self:
        """Interpolate between nominal positions (m, 3) [m]."""
        points = tuple(tuple(map(float, p)) for p in position)
        return cls(points, neighbours=min(8, len(points)))

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the measured errors, point by point."""
        return tuple(
            Parameter(f"{axis}_{k + 1}", "m", 1e-3, axis)
            for k in range(len(self.points))
            for axis in "xyz"
        )

    def _weights(self, batch: Batch) -> tuple[NDArray[np.int64], Floats]:
        """Find neighbours and their weights, (n, k) each."""
        from scipy.spatial import cKDTree  # slow to load, and seldom wanted

        tree = cKDTree(np.array(self.points))
        gap, index = tree.query(batch.walk.tcp, k=list(range(1, self.neighbours + 1)))
        weight = np.maximum(np.asarray(gap), NEAREST_GAP) ** -self.power
        return np.asarray(index), weight / weight.sum(axis=1, keepdims=True)

    def columns(self, batch: Batch) -> Floats:
        """Lay the weights out, (n, 3, 3 m)."""
        index, weight = self._weights(batch)
        out = np.zeros((len(batch), 3, len(self.points), 3))
        rows = np.arange(len(batch))[:, None]
        for k in range(3):
            out[rows, k, index, k] = weight
        return out.reshape(len(batch), 3, -1)

    def displacement(self, batch: Batch, p: Floats) -> Floats:
        """Average the neighbours' errors, (n, 3) [m]."""
        index, weight = self._weights(batch)
        moved: Floats = (p.reshape(-1, 3)[index] * weight[:, :, None]).sum(axis=1)
        return moved
