"""Curves: what they are between the rows, and beyond them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.model.effects.curve import BEYOND, END, Curve
from postproc.model.kinematics import ArmStates
from postproc.robot.state import States, make_states
from tests.calibration.planted import ARM

ROWS = 41


def states(**given: np.ndarray) -> States:
    tool = np.tile([0.0, 0.0, 0.3], (ROWS, 1))
    return make_states(np.zeros((ROWS, 6)), np.ones((ROWS, 6)), tool, **given)


def batch(**given: np.ndarray) -> ArmStates:
    return ArmStates(ARM, states(**given))


def test_a_curve_of_the_temperature_goes_on_as_a_straight_line() -> None:
    curve = Curve("link 3 turn x", ("temperature",), (20.0,), (30.0,))
    grid = np.linspace(10.0, 40.0, ROWS)
    shape = curve.shape(batch(temperature=grid))
    for below, ends in ((grid < 20.0, (17.0, 20.0)), (grid > 30.0, (30.0, 33.0))):
        line = below & (grid >= ends[0]) & (grid <= ends[1])
        assert np.diff(shape[line], n=2, axis=0) == pytest.approx(0.0, abs=1e-9)
        held = below & ((grid < ends[0]) | (grid > ends[1]))
        assert np.ptp(shape[held], axis=0) == pytest.approx(0.0, abs=1e-9)
    assert pytest.approx(3.0) == BEYOND * 10.0


def test_the_line_has_the_slope_of_the_last_part_of_the_range() -> None:
    curve = Curve("link 3 turn x", ("temperature",), (20.0,), (30.0,))
    places = np.resize([20.0 - 10.0 * END, 20.0, 20.0 + 10.0 * END], ROWS)
    before, here, after = curve.shape(batch(temperature=places))[:3]
    assert here - before == pytest.approx(after - here)


def test_a_curve_of_an_angle_fades_where_nobody_has_been() -> None:
    curve = Curve("link 3 turn x", ("joint 2",), (-1.0,), (1.0,))
    here = states()
    there = replace(here, q=np.full((ROWS, 6), 1.3))
    assert np.abs(curve.shape(ArmStates(ARM, there))).max() == 0.0


def test_half_of_the_ways_lie_in_the_lower_half_of_a_curve() -> None:
    ways = np.exp(np.linspace(np.log(0.01), np.log(3.0), ROWS))
    made = batch(travel=np.tile(ways[:, None], 6))
    curve = Curve.over(made, "joint 4", ("way 6",), "", whole=False)
    first = curve.shape(made)[:, 0]  # the straight term, -1 to 1
    assert np.median(first) == pytest.approx(0.0, abs=1e-9)
    assert (np.diff(first) > 0.0).all()
    assert first.min() > -1.0
    assert first.max() < 1.0
