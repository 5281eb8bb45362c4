"""Planted faults are found, or lie where nothing is compared."""

from __future__ import annotations

import numpy as np
import pytest

from tests.slow import slow
from tests.verify.faults import FAULTS, FLY, FOUND, MISSED, plant, wrong_arm


@pytest.mark.parametrize("seed", [*range(15), *slow(range(15, 25))])
def test_a_fault_is_found_or_not_reached(seed: int, bench_cell, bench_model) -> None:
    planted = plant(seed, bench_cell, bench_model)
    assert planted.came != MISSED, planted
    if planted.kind in ("sign_of_a_joint", "wrong_branch"):
        assert planted.came == FOUND, planted
    if planted.kind == "wrong_lambda":
        assert planted.came in (FOUND, FLY), planted


def test_all_kinds_are_planted() -> None:
    assert {FAULTS[seed % len(FAULTS)] for seed in range(15)} == set(FAULTS)


def test_the_wrong_arm_agrees_with_itself(bench_cell) -> None:
    """Else its own checks would find it, and not the second opinion."""
    for joint in range(6):
        arm = wrong_arm(bench_cell.arm, joint)
        q = np.deg2rad([[20.0, 10, -100, 40, 50, -60]])
        again = arm.inverse(arm.flange(q)).q.reshape(8, 6)
        off = np.angle(np.exp(1j * (again - q)))
        assert np.nanmin(np.abs(off).max(axis=1)) < 1e-9
