"""Corners that points change are deviations from the path of the source."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.paths.arcs import zone_sizes
from postproc.compensation.paths.moved_corners import SourceCorners
from postproc.compensation.paths.path_samples import measure_along, ways_of
from postproc.compensation.program import plan_visits, read_program
from postproc.motion.cycle_time import ProgramCycle, run
from postproc.robot.cell import load_cell
from tests.compensation.paths.test_path_error import CELL as CELL_FILE
from tests.written import program

CELL = load_cell(CELL_FILE)
CHAIN = (
    "$LIN_SPD := 0.25", "$FLY_TYPE := FLY_NORM", "$FLY_PER := 100",
    "MOVE JOINT TO {0.0, 0.0, -90.0, 0.0, 60.0, 0.0}",
    "MOVEFLY LINEAR RELATIVE VEC(0, 100, 0) IN BASE ADVANCE",
    "MOVE LINEAR RELATIVE VEC(100, 0, 0) IN BASE",
)  # fmt: skip
CORNER = 1


@pytest.fixture(scope="module")
def cycle() -> ProgramCycle:
    """Two lines with a corner that is rounded by overlap."""
    visits = read_program({"job.pdl": program(*CHAIN)}, CELL).visits
    return run(CELL.arm, plan_visits(visits, CELL).targets)


def test_what_a_corner_moves_by_is_off_most_there(cycle: ProgramCycle) -> None:
    source = SourceCorners.of(CELL.arm, cycle, np.zeros(3, dtype=bool))
    by = np.array([3e-5, 0.0, -4e-5])
    moved = replace(source, aside=source.aside - by * (np.arange(3) == CORNER)[:, None])
    ways = ways_of(cycle, np.array([1, 2]))
    place = CELL.arm.tcp(ways.q, cycle.targets.tool[ways.visit, :3, 3][ways.way])
    way, _ = measure_along(place, ways)
    assert not source.off(CELL.arm, cycle, ways, way).any()
    off = moved.off(CELL.arm, cycle, ways, way)
    zone = zone_sizes(CELL.arm, cycle, cycle.targets)[CORNER]
    at = ways.first[1]  # the second line begins at the corner
    np.testing.assert_allclose(off[[at - 1, at]], [by, by], atol=1e-12)
    ahead = np.where(ways.way == 1, way, way[at - 1] - way)
    far = ahead > zone
    assert zone > 0.0 and far.any() and not off[far].any()
    assert (np.linalg.norm(off, axis=1) <= 5e-5 + 1e-12).all()


def test_points_and_visits_of_no_source_move_nothing(cycle: ProgramCycle) -> None:
    source = SourceCorners.of(CELL.arm, cycle, np.arange(3) == CORNER)
    own = np.array([0, 2, -1])  # the last visit is not in this part
    told = source.at(own, 4)
    assert np.isnan(told.aside[[1, 2, 3]]).all() and not np.isnan(told.aside[0]).any()
    ways = ways_of(cycle, np.array([1, 2]))
    here = source.at(np.arange(3), 3)
    assert not here.off(CELL.arm, cycle, ways, np.zeros(len(ways.q))).any()
