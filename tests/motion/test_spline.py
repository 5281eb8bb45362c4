from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from postproc import _native


def test_every_run_has_its_own_natural_spline() -> None:
    rng = np.random.default_rng(0)
    sizes = [2, 3, 7, 40]
    parts = [np.cumsum(rng.uniform(0.1, 1, size)) for size in sizes]
    q = rng.normal(size=(sum(sizes), 6))
    begins = np.concatenate([np.arange(size) == 0 for size in sizes])
    first, second = _native.splines(np.concatenate(parts), q, begins)
    row = 0
    for s in parts:
        rows = slice(row, row + len(s))
        row += len(s)
        spline = CubicSpline(s, q[rows], bc_type="natural")
        np.testing.assert_allclose(first[rows], spline(s, 1), atol=1e-10)
        np.testing.assert_allclose(second[rows], spline(s, 2), atol=1e-9)
