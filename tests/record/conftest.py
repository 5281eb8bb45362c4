"""One drawn robot with the model of its survey, for all tests of the record."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.fit import fit_measurements
from postproc.model.model import Model
from postproc.robot.cell import Cell, load_cell
from tests.calibration.simulator import NJ, PLATE
from tests.record.drawn_robots import (
    Robot,
    check_poses,
    draw_poses,
    draw_robot,
    measure,
    write_cell,
)

SURVEYED = 120


@dataclass(frozen=True)
class Drawn:
    """A robot, its cell, its model, and the poses of its checks."""

    robot: Robot
    cell: Cell
    cell_file: Path
    model: Model
    poses: tuple[np.ndarray, np.ndarray]


@pytest.fixture(scope="session")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Drawn:
    rng = np.random.default_rng(641)
    robot = draw_robot(rng)
    place = write_cell(tmp_path_factory.mktemp("robot") / "cell.toml", "R010")
    cell = load_cell(place)
    rows = measure(robot, *draw_poses(SURVEYED, rng), rng, len(PLATE))
    effects = ["geometry", "backlash", "transmission"]
    found = fit_measurements(
        rows, cell, effects=effects, frame="tracker", validate=False
    )
    assert found.model.arm_id == NJ.id
    return Drawn(robot, cell, place, found.model, check_poses(rng))
