"""Splines against the interpolation that they stand for."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from postproc.model.effects.smooth import smooth
from postproc.model.splines import ORDER, Splines

LOWER, UPPER, LENGTH = -2.0, 1.3, 0.4
X = np.random.default_rng(1).uniform(LOWER - 0.2, UPPER + 0.2, 200)


def test_columns_are_cubic_between_points_of_an_even_grid() -> None:
    found, mix = smooth(X, LOWER, UPPER, LENGTH)
    grid = np.linspace(LOWER, UPPER, len(mix))
    there, _ = smooth(grid, LOWER, UPPER, LENGTH)
    meant = CubicSpline(grid, there.combine(mix))(np.clip(X, LOWER, UPPER))
    np.testing.assert_allclose(found.combine(mix), meant, atol=1e-13)


def test_splines_sum_to_one_and_fade() -> None:
    found = Splines.at(X, LOWER, UPPER, 9)
    by = np.linspace(0.0, 2.0, len(X))
    np.testing.assert_allclose(found.combine(np.ones(9)), 1.0, rtol=1e-14)
    np.testing.assert_allclose(found.fade(by).combine(np.ones(9)), by, atol=1e-14)
    assert found.first.min() == 0
    assert found.first.max() == 9 - ORDER - 1


def test_moments_are_sums_over_the_places() -> None:
    found, mix = smooth(X, LOWER, UPPER, LENGTH)
    values = np.random.default_rng(2).standard_normal(len(X))
    meant = found.combine(np.eye(len(mix))).T @ values
    np.testing.assert_allclose(found.moment(values, len(mix)), meant, atol=1e-12)


def test_nowhere_are_no_values() -> None:
    found, mix = smooth(np.zeros(0), LOWER, UPPER, LENGTH)
    assert found.combine(mix).shape == (0, mix.shape[1])
