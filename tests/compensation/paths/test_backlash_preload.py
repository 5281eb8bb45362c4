"""Drives that cross their gaps alone: from where to where, and how the tool turns."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.arrays import Floats
from postproc.compensation.options import DEFAULT_OPTIONS, Clock, Job, no_progress
from postproc.compensation.paths.backlash_preload import cross_at_once, find_drive_turns
from postproc.compensation.program import prepare_cell, read_program
from postproc.language.visits import OrientationLaw, Visits
from postproc.model.backlash_width import half_widths
from postproc.model.model import Model
from postproc.robot.cell import Cell
from postproc.robot.pose import rotation_from_vector


def crossing(*sides: float) -> Floats:
    out = np.zeros((len(sides), 6))
    out[:, 2] = sides
    return out


@pytest.mark.parametrize(
    ("side", "meant"),
    [
        ((-1, -1, -0.5, 0.5, 1, 1), (-1, -1, 1, 1, 1, 1)),  # across, and stays
        ((-1, -0.5, 0.2, 0.2, 0.2), (-1, -0.5, 0.2, 0.2, 0.2)),  # never arrives
        ((-1, -1, -0.5, 0.2), (-1, -1, 1, 1)),  # under way where the move ends
        ((-1, -1, -0.9, -0.8), (-1, -1, -0.9, -0.8)),  # .. by little
        ((1, 0.4, -1, -0.2, 1), (1, -1, -1, 1, 1)),  # there and back
        ((-1, 0.0, -1, -1), (-1, 1, -1, -1)),  # turns back before it arrives
        ((-1, -0.8, -1, -1), (-1, -0.8, -1, -1)),  # .. at once
        ((-1, -0.5, -0.5, 0.2, 1), (-1, 1, 1, 1, 1)),  # rests on its way
        ((1, 1, 1), (1, 1, 1)),
    ],
)
def test_a_drive_that_crosses_has_crossed_where_it_begins_to(
    side: tuple[float, ...], meant: tuple[float, ...]
) -> None:
    found = cross_at_once(np.tile(crossing(*side), (2, 1)), len(side) * np.arange(3))
    assert found[:, 2].tolist() == [*meant, *meant]
    assert not found[:, [0, 1, 3, 4, 5]].any()


JOB = b"""PROGRAM job
BEGIN
  MOVE JOINT TO {0, 0, -90, 0, 60, 0}
  MOVE LINEAR TO POS(1500.0, 100.0, 900.0, 0.0, 120.0, 0.0, '')
END job
"""


@pytest.fixture(scope="module")
def setting(bench_cell: Cell, bench_model: Model) -> Job:
    cell = prepare_cell(bench_cell, bench_model, DEFAULT_OPTIONS)
    return Job(cell, bench_model, DEFAULT_OPTIONS, Clock(no_progress))


def visits(cell: Cell, law: OrientationLaw) -> Visits:
    found = read_program({"job.pdl": JOB}, cell).visits
    return found.with_columns(orientation_law=np.full(len(found), law))


def test_the_tool_turns_as_far_as_the_drives_turn_it(setting: Job) -> None:
    rng = np.random.default_rng(5)
    q = rng.uniform(-1.0, 1.0, (20, 6))
    tool = rotation_from_vector(rng.normal(size=(1, 3)))[0]
    crossed = rng.uniform(-2.0, 2.0, (20, 6))
    known = visits(setting.cell, OrientationLaw.ONE_AXIS)
    turn = find_drive_turns(setting, known, 1, tool, q, crossed)
    arm = setting.cell.arm
    half = half_widths(setting.model, arm, q) * (setting.gap > 0.0)
    assert (half > 0).any(axis=0).sum() > 2
    behind = q + np.linalg.solve(arm.coupling, (crossed * half).T).T
    wanted = arm.flange(behind)[:, :3, :3] @ tool
    found = arm.flange(q)[:, :3, :3] @ tool @ rotation_from_vector(turn)
    assert found == pytest.approx(wanted, abs=1e-9)
    assert 1e-5 < np.abs(turn).max() < 1e-2


def test_it_does_not_where_nothing_says_how_it_turns_on_the_way(
    setting: Job,
) -> None:
    q, crossed = np.zeros((1, 6)), np.full((1, 6), 2.0)
    unknown = visits(setting.cell, OrientationLaw.UNKNOWN)
    assert not find_drive_turns(setting, unknown, 1, np.eye(3), q, crossed).any()
