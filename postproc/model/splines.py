"""Cubic splines on an even grid, as the few of them that are not 0 at a place."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Floats, Ints

ORDER = 3


@dataclass(frozen=True, eq=False)
class Splines:
    """Cubic B-splines on an even grid at n places: four of them are not 0 anywhere.

    Attributes:
        first: Number of the first of the four, (n,).
        weight: Their values, (n, 4).
    """

    first: Ints
    weight: Floats

    @classmethod
    def at(cls, x: Floats, lower: float, upper: float, points: int) -> Splines:
        """Evaluate as many as the grid has points, x (n,) clipped into its range."""
        from scipy.interpolate import BSpline  # slow to load, and seldom wanted

        if len(x) == 0:
            return cls(np.zeros(0, dtype=np.int64), np.zeros((0, ORDER + 1)))
        along = (np.clip(x, lower, upper) - lower) / (upper - lower)
        along = np.clip(along, 0.0, 1.0)
        grid = np.linspace(0.0, 1.0, points)
        ends = np.zeros(ORDER + 1), np.ones(ORDER + 1)
        knots: Floats = np.concatenate([ends[0], grid[2:-2], ends[1]])
        found = BSpline.design_matrix(along, knots, ORDER)
        first = found.indices[:: ORDER + 1].astype(np.int64)
        return cls(first, found.data.reshape(-1, ORDER + 1))

    def __getitem__(self, rows: Ints) -> Splines:
        """Return them at some of the places."""
        return Splines(self.first[rows], self.weight[rows])

    def fade(self, by: Floats) -> Splines:
        """Multiply all of them by a number at every place, (n,)."""
        return replace(self, weight=self.weight * by[:, None])

    def combine(self, mix: Floats) -> Floats:
        """Sum them times mix, (points,) or (points, k): (n,) or (n, k)."""
        total = np.zeros((len(self.first), *mix.shape[1:]))
        for k in range(ORDER + 1):
            some = mix[self.first + k]
            total += self.weight[:, k].reshape(-1, *(1,) * (mix.ndim - 1)) * some
        return total

    def moment(self, values: Floats, points: int) -> Floats:
        """Sum each of them times values (n,) over all places, (points,)."""
        total = np.zeros(points)
        for k in range(ORDER + 1):
            weighed = self.weight[:, k] * values
            total += np.bincount(self.first + k, weighed, points)
        return total
