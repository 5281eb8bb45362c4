"""Aims and arrivals of a joint whose arrival answers its aim in proportion."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.iterate import SecantSearch


def searched(gain: float, middle: float, rounds: int = 8) -> tuple[float, float]:
    """Search where found = middle + gain (aim - middle), clipped to the flanks."""
    search, aim = SecantSearch(), np.array([[1.0]])
    found = aim
    for number in range(rounds):
        found = np.clip(middle + gain * (aim - middle), -1.0, 1.0)
        aim = search.next_aim(aim, found, number)
    return float(aim[0, 0]), float(np.clip(middle + gain * (aim - middle), -1, 1)[0, 0])


@pytest.mark.parametrize("gain", [-2.0, -0.9, -0.3, 0.0, 0.3, 0.7])
@pytest.mark.parametrize("middle", [-0.4, 0.0, 0.7])
def test_aim_and_arrival_meet(gain: float, middle: float) -> None:
    aim, found = searched(gain, middle)
    assert aim == pytest.approx(middle, abs=0.01) and found == pytest.approx(
        aim, abs=0.02
    )


@pytest.mark.parametrize("gain", [1.2, 2.0])
def test_what_runs_away_ends_on_a_flank(gain: float) -> None:
    aim, found = searched(gain, 0.3)
    assert aim == found == 1.0
