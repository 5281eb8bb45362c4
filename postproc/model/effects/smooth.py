"""Free smooth functions of one variable, as columns with independent priors.

A function is a Gaussian process with Matern 3/2 correlation, sampled on a grid and
interpolated by cubic splines; its eigenvectors, scaled by the square roots of their
eigenvalues, are the columns. Rough shapes then cost more evidence than smooth ones.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from postproc.arrays import Floats
from postproc.model.splines import ORDER, Splines

PER_LENGTH = 2.0  # grid points per correlation length
FEWEST, MOST = 6, 300  # grid points
LEFT_OUT = 1e-3  # share of the variance that the columns do not reach


@cache
def _modes(points: int, relative: float, closed: bool) -> Floats:
    """Scaled eigenvectors of a Matern 3/2 process on a grid, (points, k).

    On a circle places are as far apart as its chord is long.
    """
    grid = np.linspace(0.0, 1.0, points)
    apart = np.abs(grid[:, None] - grid)
    if closed:
        apart = np.sin(np.pi * apart) / np.pi
    gap = np.sqrt(3.0) * apart / relative
    values, vectors = np.linalg.eigh((1 + gap) * np.exp(-gap))
    values, vectors = values[::-1], vectors[:, ::-1]
    total = np.cumsum(values) / values.sum()
    keep = int(np.searchsorted(total, 1 - LEFT_OUT)) + 1
    modes: Floats = vectors[:, :keep] * np.sqrt(np.maximum(values[:keep], 0.0))
    return modes


def _grid(span: float, length: float) -> tuple[int, float]:
    """Choose the number of grid points and the length relative to the span."""
    relative = length / max(span, 1e-12)
    points = int(np.clip(np.ceil(PER_LENGTH / relative) + 1, FEWEST, MOST))
    return points, relative


def smooth_count(
    lower: float, upper: float, length: float, closed: bool = False
) -> int:
    """Return the number of columns of a smooth function, see `smooth`."""
    return int(_modes(*_grid(upper - lower, length), closed).shape[1])


@cache
def _mix(points: int, relative: float, closed: bool) -> Floats:
    """What of every spline makes each column, (points, k)."""
    from scipy.interpolate import make_interp_spline  # slow to load, and seldom wanted

    modes = _modes(points, relative, closed)
    grid = np.linspace(0.0, 1.0, points)
    mix: Floats = np.ascontiguousarray(make_interp_spline(grid, modes, k=ORDER).c)
    return mix


def smooth_mix(
    lower: float, upper: float, length: float, closed: bool = False
) -> Floats:
    """Return what of every spline makes each column, (points, k), see `smooth`."""
    return _mix(*_grid(upper - lower, length), closed)


def smooth(
    x: Floats, lower: float, upper: float, length: float, closed: bool = False
) -> tuple[Splines, Floats]:
    """Write the columns as splines, which together have unit prior variance.

    Args:
        x: (n,), clipped into the range.
        lower: Lower end of the variable's range.
        upper: Upper end.
        length: Correlation length, in units of x.
        closed: Whether the range is a circle, whose ends are one place.

    Returns:
        The splines at x, and what of each makes every column, (points, k).
    """
    points, relative = _grid(upper - lower, length)
    return Splines.at(x, lower, upper, points), _mix(points, relative, closed)
