"""Readings of one stop become one row."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.fit import fit_measurements
from postproc.calibration.measurements import Measurements, concatenate
from postproc.calibration.stops import pool_readings, stops_of
from postproc.exceptions import MeasurementError
from postproc.model.noise import poses_of
from postproc.robot.cell import load_cell
from tests.calibration.simulator import PLATE, random_arm, random_states, survey_of

CELL = load_cell("programs/cell.toml", changes=("measurements.lambda_sign=1",))


def repeated(poses: int, repeats: int, seed: int = 0, shift: float = 0.0) -> tuple:  # type: ignore[type-arg]
    """Read every pose some times while the arm stands, each stop off by a shift."""
    rng = np.random.default_rng(seed)
    arm, states = random_arm(rng), random_states(poses, rng)
    true = arm.tcp(states.q, states.direction, states.tool)
    stop = true + shift * rng.standard_normal(true.shape)
    rows = np.repeat(np.arange(poses), repeats)
    read = stop[rows] + 1e-5 * rng.standard_normal((len(rows), 3))
    some = states[rows].with_(order=np.arange(len(rows), dtype=float))
    return arm, survey_of(some, read)


def test_readings_are_averaged_and_their_scatter_is_kept() -> None:
    _, survey = repeated(8, 3)
    found = pool_readings(survey)
    assert len(found) == 8 and (found.states.readings == 3.0).all()
    by_stop = survey.position.reshape(8, 3, 3)
    np.testing.assert_allclose(found.position, by_stop.mean(axis=1))
    square = ((by_stop - by_stop.mean(axis=1, keepdims=True)) ** 2).sum(axis=(1, 2))
    np.testing.assert_allclose(found.states.scatter, square)
    assert "24 readings at 8 stops" in found.warnings[-1]


def test_single_readings_stay_as_they_are() -> None:
    _, survey = repeated(8, 1)
    assert pool_readings(survey) is survey


def test_nests_of_a_stop_share_its_order() -> None:
    states = random_states(4, np.random.default_rng(1))
    rows = np.repeat(np.arange(4), 6)
    nest = np.tile([0, 0, 1, 1, 2, 2], 4)
    states = states[rows].with_(
        tool=PLATE[nest], tool_id=nest, order=np.arange(24, dtype=float)
    )
    found = pool_readings(survey_of(states, np.zeros((24, 3)) + 1.0))
    assert len(found) == 12
    assert found.states.order.tolist() == np.repeat([0.0, 6, 12, 18], 3).tolist()
    assert found.states.tool_id.tolist() == [0, 1, 2] * 4


def test_a_pose_that_is_visited_again_is_another_stop() -> None:
    states = random_states(3, np.random.default_rng(2))
    there = states[np.array([0, 1, 0, 0, 2])]
    assert stops_of(there).tolist() == [0, 1, 2, 2, 3]
    other = there.with_(direction=there.direction * np.array([1, 1, 1, -1, 1])[:, None])
    assert stops_of(other).tolist() == [0, 1, 2, 3, 4]


def test_a_clock_tells_whether_the_arm_can_have_left() -> None:
    states = random_states(3, np.random.default_rng(3))[np.array([0, 0, 1, 1, 2])]
    at_once = states.with_(time=np.array([0.0, 1, 11, 12, 22]))
    assert stops_of(at_once).tolist() == [0, 0, 1, 1, 2]
    away = states.with_(time=np.array([0.0, 60, 70, 71, 81]))
    assert stops_of(away).tolist() == [0, 1, 2, 2, 3]


def test_a_visit_column_decides() -> None:
    states = random_states(2, np.random.default_rng(4))[np.array([0, 0, 0, 1])]
    assert stops_of(states, np.array([1, 2, 1, 2])).tolist() == [0, 1, 0, 2]


def test_rows_without_a_visit_follow_the_rule() -> None:
    states = random_states(2, np.random.default_rng(4))[np.array([0, 1, 0, 0, 1, 0])]
    visit = np.array([7, 7, 7, -1, -1, -1])
    assert stops_of(states, visit).tolist() == [0, 1, 0, 2, 3, 4]


def test_a_file_without_visits_leaves_those_of_another_file() -> None:
    states = random_states(2, np.random.default_rng(4))[np.array([0, 1, 0])]
    states = states.with_(order=np.arange(3.0))
    one = replace(survey_of(states, np.zeros((3, 3))), visit=np.array([0, 1, 0]))
    other = replace(survey_of(states, np.zeros((3, 3))), ids=("a", "b", "c"))
    other = replace(other, path=Path("other.csv"))
    both = concatenate([one, other, replace(one, path=Path("c"), ids=("d", "e", "f"))])
    assert both.visit is not None
    assert both.visit.tolist() == [0, 1, 0, -1, -1, -1, 2, 3, 2]


def test_stations_that_read_one_visit_are_not_averaged() -> None:
    """Two trackers read every stop, each in a frame of its own."""
    states = random_states(2, np.random.default_rng(5))[np.array([0, 0, 1, 1])]
    states = states.with_(station=np.array([0, 1, 0, 1]))
    assert stops_of(states).tolist() == [0, 1, 2, 3]
    assert stops_of(states, np.array([1, 1, 2, 2])).tolist() == [0, 1, 2, 3]


def test_a_reading_that_disagrees_with_its_stop_is_listed() -> None:
    _, survey = repeated(20, 4)
    position = np.array(survey.position)
    position[41] += [0.0, 3e-4, 0.0]
    found = pool_readings(replace(survey, position=position))
    assert [d.id for d in found.dropped] == [survey.ids[41]]
    assert "0.295 mm from" in found.dropped[0].why and found.states.readings[10] == 3.0


def test_of_two_readings_that_disagree_the_fit_finds_the_wrong_one() -> None:
    """Their mean would be off by half, and count as scatter of the tracker."""
    _, survey = repeated(60, 2)
    position = np.array(survey.position)
    position[41] += [1e-3, 0.0, 0.0]
    wrong = replace(survey, position=position)
    assert len(pool_readings(survey)) == 60 and len(pool_readings(wrong)) == 61
    good, found = (
        fit_measurements(rows, CELL, effects=("geometry", "backlash"), validate=False)
        for rows in (survey, wrong)
    )
    assert [d.id for d in found.report.dropped] == [survey.ids[41]]
    assert abs(found.model.noise.tracker / good.model.noise.tracker - 1.0) < 0.1


@pytest.mark.parametrize("tracker", [2e-6, 4e-6, 1e-5])
def test_readings_with_two_decimals_do_not_disagree(tracker: float) -> None:
    """In steps of 0.01 mm most readings of a stop are equal in a coordinate."""
    _, survey = repeated(60, 3)
    read = np.repeat(survey.position[::3], 3, axis=0)
    read += tracker * np.random.default_rng(1).standard_normal(read.shape)
    found = pool_readings(replace(survey, position=np.round(read, 5)))
    assert not found.dropped and len(found) == 60


def test_repeated_readings_are_worth_no_more_than_their_mean() -> None:
    """A stop that scatters by 0.08 mm is no surer for being read five times."""
    arm, survey = repeated(60, 5, seed=7, shift=8e-5)
    effects = ("geometry", "backlash")

    def left(rows: Measurements) -> tuple[float, float]:
        found = fit_measurements(rows, CELL, effects=effects, validate=False)
        states = random_states(200, np.random.default_rng(9))
        off = arm.tcp(states.q, states.direction, states.tool)
        nominal = CELL.arm.tcp(states.q, states.tool)
        predicted = found.model.predict(CELL.arm, states)
        error = np.linalg.norm(predicted.error - (off - nominal), axis=1)
        return float(error.mean()), float(predicted.std_model.mean())

    once = replace(
        survey[np.arange(0, 300, 5)],
        position=survey.position.reshape(60, 5, 3).mean(axis=1),
    )
    (many, stated), (mean, alone) = left(survey), left(once)
    assert many < 1.1 * mean
    assert stated > 0.8 * alone


@pytest.mark.parametrize("digit", [1e-4, 1e-3])
def test_angles_that_were_read_back_are_of_one_pose(digit: float) -> None:
    """They differ in the last digit: on both sides of any step that rounds them."""
    rng = np.random.default_rng(6)
    states = random_states(50, rng)[np.repeat(np.arange(50), 6)]
    jitter = np.deg2rad(digit) * rng.choice([-1, 0, 1], states.q.shape)
    nest = np.tile([0, 0, 1, 1, 2, 2], 50)
    read = states.with_(
        q=states.q + jitter, tool=PLATE[nest], tool_id=nest, order=np.arange(300.0)
    )
    pose = poses_of(read).reshape(50, 6)
    assert (pose == pose[:, :1]).all() and len(np.unique(pose)) == 50
    visit = np.repeat(np.arange(50), 6)
    assert (stops_of(read, visit) == visit).all()
    assert (stops_of(read) == visit).all()
    moving = read.with_(heading=np.tile([1.0, 0.0, 0.0], (300, 1)))
    assert len(np.unique(poses_of(moving))) == 300


def test_steps_of_a_reversal_are_poses_of_their_own() -> None:
    """A survey turns drives back in steps of 1e-4 rad and more."""
    states = random_states(1, np.random.default_rng(8))[np.zeros(6, dtype=np.int64)]
    q = states.q + 1e-4 * np.arange(6)[:, None] * np.eye(6)[2]
    there = states.with_(q=q, order=np.arange(6.0))
    assert len(np.unique(poses_of(there))) == 6
    assert stops_of(there).tolist() == [0, 1, 2, 3, 4, 5]


def test_a_refusal_counts_rows_as_the_file_has_them() -> None:
    _, survey = repeated(1, 30)
    with pytest.raises(MeasurementError, match="30 rows, 1 poses"):
        fit_measurements(survey, CELL)


# Angles that were read back from the controller.


def read_back(  # type: ignore[no-untyped-def]
    jitter_deg: float, poses: int = 30, repeats: int = 4, nests: int = 1
):
    """Read poses whose angles come back a little different each time."""
    rng = np.random.default_rng(12)
    arm, states = random_arm(rng), random_states(poses, rng)
    rows = np.repeat(np.arange(poses), repeats * nests)
    nest = np.tile(np.repeat(np.arange(nests), repeats), poses)
    states = states[rows].with_(
        tool=PLATE[nest], tool_id=nest, order=np.arange(len(rows), dtype=float)
    )
    true = arm.tcp(states.q, states.direction, states.tool)
    off = np.deg2rad(jitter_deg) * rng.uniform(-1.0, 1.0, states.q.shape)
    back = states.with_(q=states.q + off)
    return states.q, survey_of(back, true + 1e-5 * rng.standard_normal(true.shape))


@pytest.mark.parametrize("jitter_deg", [0.0005, 0.002, 0.005, 0.02])
@pytest.mark.parametrize("nests", [1, 3])
def test_angles_that_are_read_back_are_of_one_stop(
    jitter_deg: float, nests: int
) -> None:
    commanded, survey = read_back(jitter_deg, nests=nests)
    found = pool_readings(survey)
    assert len(found) == 30 * nests and (found.states.readings == 4.0).all()
    assert len(np.unique(poses_of(found.states))) == 30
    off = np.abs(found.states.q - commanded[::4][: len(found)])
    assert off.max() < 0.75 * np.deg2rad(jitter_deg) + 1e-12
    assert (found.states.q[::nests] == found.states.q[nests - 1 :: nests]).all()


@pytest.mark.parametrize("jitter_deg", [0.005, 0.02])
def test_a_visit_column_decides_where_angles_are_read_back(jitter_deg: float) -> None:
    _, survey = read_back(jitter_deg)
    visit = np.repeat(np.arange(60), 2)
    found = pool_readings(replace(survey, visit=visit))
    assert len(found) == 60 and (found.states.readings == 2.0).all()


@pytest.mark.parametrize("step_deg", [0.005, 0.01, 0.04])
def test_small_steps_of_one_joint_are_poses_of_their_own(step_deg: float) -> None:
    states = random_states(20, np.random.default_rng(0))
    rows = np.repeat(np.arange(20), 5)
    q = np.array(states.q[rows])
    q[:, 2] += np.deg2rad(step_deg) * np.tile(np.arange(5), 20)
    assert len(np.unique(stops_of(states[rows].with_(q=q)))) == 100


@pytest.mark.parametrize("away_deg", [0.05, 0.2, 0.4])
def test_poses_that_lie_near_each_other_stay_apart(away_deg: float) -> None:
    """Nothing parts the differences of readings from those of neighbouring poses."""
    rng = np.random.default_rng(1)
    near = random_states(1, rng)[np.zeros(40, dtype=np.int64)]
    q = near.q + np.deg2rad(away_deg) * rng.uniform(-1.0, 1.0, near.q.shape)
    assert len(np.unique(stops_of(near.with_(q=q)))) == 40
    steps = q + np.deg2rad(0.02) * rng.uniform(-1.0, 1.0, near.q.shape)
    both = near[np.arange(40).repeat(2)].with_(q=np.stack([q, steps], 1).reshape(80, 6))
    assert len(np.unique(stops_of(both))) == 80


def test_readings_whose_angles_are_equal_keep_them_to_the_last_bit() -> None:
    _, survey = repeated(8, 3)
    assert (pool_readings(survey).states.q == survey.states.q[::3]).all()


@pytest.mark.parametrize("both", [True, False])
def test_two_approaches_that_count_as_one_stop_are_asked_about(both: bool) -> None:
    """The file has no directions: every pose looks as if it was read twice."""
    rng = np.random.default_rng(4)
    arm, states = random_arm(rng), random_states(40, rng)
    q = np.repeat(states.q, 2, axis=0)
    side = np.repeat(states.direction, 2, axis=0)
    side[1::2] *= -1.0 if both else 1.0
    rows = states[np.repeat(np.arange(40), 2)].with_(q=q, direction=side)
    position = arm.measure(rows, rng)[0]
    unknown = rows.with_(direction=np.zeros_like(side), order=np.arange(80.0))
    survey = survey_of(unknown, position)
    found = fit_measurements(survey, CELL, effects=("geometry",), validate=False)
    asked = [w for w in found.report.warnings if "not readings of one stop" in w]
    assert len(asked) == both
