"""Targets that fast JOINT moves reach: how far they are off if links run on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.findings.timing_comparison import run_visits
from postproc.compensation.options import DEFAULT_OPTIONS
from postproc.compensation.paths.fast_stops import predict_fast_stops
from postproc.compensation.program import prepare_cell, read_program
from postproc.model.backlash_width import half_widths
from postproc.model.model import CONFIRMED, Model
from postproc.motion.cycle_time import ProgramCycle
from postproc.robot.cell import Cell

JOB = b"""PROGRAM job
BEGIN
  MOVE JOINT TO {0, 0, -90, 0, 60, 0}
  MOVE JOINT TO {30, 0, -90, 0, 60, 0}
  MOVE LINEAR TO POS(1500.0, 900.0, 900.0, 0.0, 120.0, 0.0, '')
END job
"""


@pytest.fixture(scope="module")
def cell(bench_cell: Cell, bench_model: Model) -> Cell:
    return prepare_cell(bench_cell, bench_model, DEFAULT_OPTIONS)


@pytest.fixture(scope="module")
def cycle(cell: Cell) -> ProgramCycle:
    return run_visits(read_program({"job.pdl": JOB}, cell).visits, cell)


def test_a_target_is_off_by_the_gap_of_a_joint_that_arrives_fast(
    cell: Cell, bench_model: Model, cycle: ProgramCycle
) -> None:
    found = predict_fast_stops(cycle, cell, bench_model, 20.0)
    q, arm = cycle.path.q[1], cell.arm
    lever = np.linalg.norm(
        arm.jacobian(q[None], cycle.targets.tool[1, :3, 3])[0, :3, 0]
    )
    gap = 2.0 * half_widths(bench_model, arm, q[None])[0, 0]
    assert found[1] == pytest.approx(lever * gap, rel=0.01)
    assert found[1] > 1e-5
    assert not found[[0, 2]].any()  # from nowhere, and on a line


def test_slow_stops_and_confirmed_joints_are_no_matter(
    cell: Cell, bench_model: Model, cycle: ProgramCycle
) -> None:
    slow = replace(cycle.targets, override=np.full(3, 0.15))
    found = predict_fast_stops(replace(cycle, targets=slow), cell, bench_model, 20.0)
    assert not found.any()
    known = replace(bench_model, history=({"in_motion": {"1": CONFIRMED}},))
    assert not predict_fast_stops(cycle, cell, known, 20.0).any()
