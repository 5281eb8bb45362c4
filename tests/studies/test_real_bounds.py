"""The bound of a true error, held against readings of a real arm."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
SHARED = Path(os.environ.get("POSTPROC_SHARED", ROOT.parent / "shared"))
sys.path.insert(0, str(ROOT / "docs/studies"))

import intervals  # noqa: E402
import real_bounds  # noqa: E402
from real_bounds import Held  # noqa: E402


def test_shares_are_counted_by_quarter_of_the_bound():
    size, bound = np.arange(1.0, 9.0), np.array([1, 1, 9, 9, 10, 10, 11, 11.0])
    held = Held(size, bound, np.zeros(8, dtype=bool))
    assert held.share == 87.5 and held.quarters() == "50.0, 100.0, 100.0, 100.0"
    assert held.take(size > 2).share == 100.0


@pytest.mark.slow
@pytest.mark.skipif(
    not (SHARED / "data/ur5").is_dir(), reason=f"no measured data in {SHARED}"
)
def test_the_bound_holds_real_readings_of_other_poses(tmp_path):
    series = intervals.loaded(SHARED, tmp_path)["grid"]
    test = real_bounds.by_pose(series, intervals.random_rows(len(series.rows), 1))
    held = real_bounds.judge(series, test)
    assert len(held.size) >= 290 and 92.0 <= held.share <= 98.0
    assert not held.outside.any()
