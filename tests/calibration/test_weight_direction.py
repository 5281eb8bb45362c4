"""An arm that does not stand as its cell says is noticed by how its joints yield."""

import numpy as np
import pytest

from postproc.calibration.regression import NEARLY, fit_effects
from postproc.calibration.selection import fit_best
from postproc.calibration.weight_direction import direction_warning
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.kinematics import Batch
from postproc.simulation import Planted, sample_survey, stream, virtual_arm
from tests.calibration.planted import ARM, BASE, TRACKER, states_of

ROWS = 160


def survey(seed, pulls, *planted):
    """Measure an arm whose weight pulls in a direction, (3,)."""
    gravity = 9.80665 * np.array(pulls, dtype=float)
    every = (*map(Planted, BASE), *planted)
    arm = virtual_arm(seed, every, rows=ROWS, tracker=TRACKER, gravity=gravity)
    arrivals = sample_survey(arm, ROWS, seed=seed)
    position = arm.measure(arrivals, TRACKER, stream(seed, "tracker"))
    return states_of(arrivals), position


def base_fit(states, position, stated):
    """Fit geometry and backlash, weight pulling where the cell says."""
    arm = ARM.mounted(np.array(stated, dtype=float))
    effects = propose(BASE_EFFECTS, arm, states)
    batch, place = Batch(arm, states), tuple(TRACKER)
    return fit_effects(batch, position, effects, place, until=NEARLY)


FLOOR, CEILING, WALL = (0, 0, -1), (0, 0, 1), (1, 0, 0)


@pytest.mark.parametrize(
    ("true", "stated", "named"),
    [
        (WALL, FLOOR, "[1, 0, 0]"), (FLOOR, WALL, "[0, 0, -1]"),
        (CEILING, FLOOR, "[0, 0, 1]"), (FLOOR, CEILING, "[0, 0, -1]"),
        (WALL, WALL, None), (FLOOR, FLOOR, None), (CEILING, CEILING, None),
    ],
)  # fmt: skip
def test_the_direction_that_the_rows_speak_for(true, stated, named):
    states, position = survey(11, true, Planted("compliance", 2, peak_mm=0.5))
    told = direction_warning(base_fit(states, position, stated))
    assert [f"along {named}" in line for line in told] == [True] * (named is not None)


@pytest.mark.parametrize("kind", ["transmission", "counterbalance", "base_tilt"])
def test_other_causes_are_no_other_direction(kind):
    states, position = survey(21, FLOOR, Planted(kind))
    fitted = fit_best(ARM, states, position, tuple(TRACKER))
    assert direction_warning(fitted) == ()


def test_few_rows_say_nothing():
    states, position = survey(11, WALL, Planted("compliance", 2, peak_mm=0.5))
    assert direction_warning(base_fit(states[:40], position[:40], FLOOR)) == ()
