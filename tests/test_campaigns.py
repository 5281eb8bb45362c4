"""Drawn campaigns: what is written is what was measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.stops import pool_readings, stops_of
from postproc.model.kinematics import ArmStates
from tests.calibration.simulator import NJ, random_arm, random_states
from tests.campaign_files import FLOOR, Setup, as_filed, as_informed, placed, write_cell
from tests.campaign_rows import (
    Habit,
    Yielding,
    as_mounted,
    best_possible,
    measure,
    unseen,
)
from tests.campaigns import alike
from tests.reference.weight import torque

HABIT = Habit(12, 2, 2, 2, 1, 4, 1e-6, 1e-5, 1e-5, clock=True)
WALL = (1.0, 0.0, 0.0)


def survey_of(setup: Setup, habit: Habit = HABIT):  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(3)
    arm = as_mounted(random_arm(rng), setup, rng)
    return arm, measure(arm, habit, rng, setup), rng


@pytest.mark.parametrize("rows", ["as measured", "newest first", "shuffled"])
@pytest.mark.parametrize("directions", [True, False])
def test_files_with_times_are_read_in_the_order_of_visits(
    tmp_path: Path, rows: str, directions: bool
) -> None:
    setup = Setup(rows=rows, directions=directions)
    _, survey, _ = survey_of(setup)
    read, _ = as_filed(tmp_path, survey, setup, clock=True)
    np.testing.assert_allclose(read.position, survey.position, atol=1e-7)
    np.testing.assert_allclose(read.states.q, survey.states.q, atol=1e-7)
    later = slice(4, None)  # nobody knows from where the arm came first
    assert (read.states.direction[later] == survey.states.direction[later]).all()
    assert (stops_of(read.states) == survey.visit).all()


def test_a_file_that_says_all_tells_a_fit_more_only_where_something_lacked(
    tmp_path: Path,
) -> None:
    setup = Setup(directions=False)
    _, survey, _ = survey_of(setup)
    told, other = as_informed(tmp_path, survey, setup)
    rows, cell = as_filed(tmp_path, survey, setup, clock=True)
    assert alike(rows, told, cell, other)
    rows, cell = as_filed(tmp_path, survey, setup, clock=False)
    assert not alike(rows, told, cell, other)
    wall = replace(setup, weight=WALL)
    rows, cell = as_filed(tmp_path, survey, wall, clock=True)
    told, other = as_informed(tmp_path, survey, wall)
    assert not alike(rows, told, cell, other)


def test_each_station_has_a_file_in_its_own_frame(tmp_path: Path) -> None:
    setup = Setup(stations=2)
    _, survey, _ = survey_of(setup)
    read, _ = as_filed(tmp_path, survey, setup, clock=True)
    assert len(read.stations) == 2
    for s in range(2):
        rows = read.states.station == s
        T = placed(s)
        back = read.position[rows] @ T[:3, :3].T + T[:3, 3]
        np.testing.assert_allclose(back, survey.position[rows], atol=1e-7)
    assert len(pool_readings(read)) == 48


@pytest.mark.parametrize("weight", [WALL, (0.0, 0.0, 1.0), (0.3, -0.4, -0.8)])
@pytest.mark.parametrize("said", ["mounting", "base"])
def test_a_cell_says_where_weight_pulls(tmp_path: Path, weight, said: str) -> None:  # type: ignore[no-untyped-def]
    arm = write_cell(tmp_path / "cell.toml", weight, said).arm
    along = np.array(weight) / np.linalg.norm(weight)
    np.testing.assert_allclose(arm.weight, along, atol=1e-9)
    states = random_states(20, np.random.default_rng(0))
    assert NJ.file.links is not None
    own = torque(NJ, states.q, np.array(NJ.file.links.mass_kg), along)
    np.testing.assert_allclose(ArmStates(arm, states).loads.gravity, own, atol=1e-4)
    bare = write_cell(tmp_path / "cell.toml", weight, "").arm
    assert tuple(bare.weight) == FLOOR


@pytest.mark.parametrize("stations", [0, 1, 2])
def test_the_best_possible_leaves_little_of_an_arm_that_yields(stations: int) -> None:
    setup = Setup(WALL, "", (5e-8, 2e-7, 1e-6), stations)
    habit = Habit(60, 1, 1, 1, 1, 5, 0.0, 0.0, 1e-6, clock=True)
    arm, survey, rng = survey_of(setup, habit)
    assert isinstance(arm, Yielding)
    left = best_possible(arm, habit, survey, unseen(arm, rng), setup)
    assert left < 0.01
