"""The fitted play is as wide as the gaps of the arm that was measured."""

from __future__ import annotations

import numpy as np

from postproc.model.model import Model
from postproc.model.play import half_gap, measured_play
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell
from postproc.robot.direction import WIDTH_IN_PLAYS
from postproc.simulation import virtual_arm
from tests.conftest import SEED


def test_play_is_as_wide_as_the_gaps(bench_cell: Cell, bench_model: Model) -> None:
    arm: Arm = bench_cell.arm
    fitted = measured_play(bench_model, arm) * WIDTH_IN_PLAYS / 2
    largest = half_gap(bench_model, arm)
    true = virtual_arm(SEED).gears.gap
    off, widest = (np.abs(np.log(g / true)).mean() for g in (fitted, largest))
    assert off < 0.1 and off < widest
    assert (largest >= fitted - 1e-12).all()
