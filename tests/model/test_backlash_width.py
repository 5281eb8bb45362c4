"""The fitted play is as wide as the gaps of the arm that was measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.model.backlash_width import half_gap, half_widths, play_of_model
from postproc.model.model import Model
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell
from postproc.robot.direction import WIDTH_IN_PLAYS
from postproc.simulation import virtual_arm
from tests.conftest import SEED


def test_play_is_as_wide_as_the_gaps(bench_cell: Cell, bench_model: Model) -> None:
    arm: Arm = bench_cell.arm
    fitted = play_of_model(bench_model, arm) * WIDTH_IN_PLAYS / 2
    largest = half_gap(bench_model, arm)
    true = virtual_arm(SEED).gears.gap
    off, widest = (np.abs(np.log(g / true)).mean() for g in (fitted, largest))
    assert off < 0.1 and off < widest
    assert (largest >= fitted - 1e-12).all()


def test_widths_follow_the_gaps_with_the_joint_angle(
    bench_cell: Cell, bench_model: Model
) -> None:
    gears, ranges = virtual_arm(SEED).gears, bench_model.ranges
    share = np.random.default_rng(2).uniform(size=(200, 6))
    q = np.array(ranges.lower) + share * np.subtract(ranges.upper, ranges.lower)
    found = half_widths(bench_model, bench_cell.arm, q)
    true = gears.half_gaps(q @ bench_cell.arm.coupling.T)
    even = play_of_model(bench_model, bench_cell.arm) * WIDTH_IN_PLAYS / 2
    off, usual = (np.abs(np.log(w / true)).mean() for w in (found, even))
    assert off < 0.7 * usual


def test_without_backlash_widths_are_the_arms(
    bench_cell: Cell, bench_model: Model
) -> None:
    arm, size = bench_cell.arm, len(bench_model.values)
    model = replace(bench_model, values=np.zeros(size))
    found = half_widths(model, arm, np.zeros((3, 6)))
    np.testing.assert_allclose(found, np.tile(WIDTH_IN_PLAYS / 2 * arm.play, (3, 1)))
