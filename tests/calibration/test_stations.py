"""Several stations of the tracker: each its own registration, or a step by name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from postproc.calibration.fit import fit_measurements, into_base_frame
from postproc.calibration.measurements import Measurements, concatenate
from postproc.calibration.monuments import ReferenceRows
from postproc.calibration.survey_checks import check_stops, check_survey
from postproc.exceptions import MeasurementError
from postproc.model.effects.placement import Placement
from postproc.model.effects.station_shift import StationShift
from postproc.model.kinematics import ArmStates
from postproc.model.model import load_model
from postproc.robot.cell import load_cell
from tests.calibration.simulator import (
    NJ,
    PLATE,
    TOOL,
    random_arm,
    random_states,
    survey_of,
)
from tests.slow import slow

EFFECTS = ("geometry", "backlash")
PLACES = (((4.0, -3.0, 1.5), 2.0), ((-2.5, 2.6, 1.1), -0.7), ((0.5, 4.0, 0.8), 1.0))


@pytest.fixture
def cell(tmp_path: Path):  # type: ignore[no-untyped-def]
    path = tmp_path / "cell.toml"
    xyz = (TOOL * 1e3).tolist()
    path.write_text(f'[robot]\narm = "nj220-2.7"\n[survey]\npoints_mm = [{xyz}]\n')
    return load_cell(path)


def files(
    rows: tuple[int, ...], moved: bool, stations: tuple[str, ...] = ()
) -> tuple[list[Measurements], Measurements]:
    """Measure an arm in several files, and other poses for a check, base frame."""
    rng = np.random.default_rng(5)
    arm = replace(random_arm(rng), backlash=random_arm(rng).backlash * [1, 0, 0])
    parts = []
    for k, n in enumerate(rows):
        states = random_states(n, rng)
        seen, _ = arm.measure(states, rng)
        where = stations[k] if stations else ""
        if moved:
            at, turn = PLACES[(sorted(set(stations)).index(where) if stations else k)]
            R = Rotation.from_euler("ZYX", [turn, 0.05, -0.1]).as_matrix()
            seen = (seen - np.array(at)) @ R
        part = survey_of(states, seen)
        ids = tuple(f"{k}-{i}" for i in part.ids)
        parts.append(replace(part, path=Path(f"{k}.csv"), ids=ids, stations=(where,)))
    states = random_states(200, rng)
    return parts, survey_of(states, arm.tcp(states.q, states.direction, states.tool))


def off(found, check: Measurements) -> float:  # type: ignore[no-untyped-def]
    """Return the mean true error that a model leaves [mm]."""
    predicted = found.model.error(NJ, check.states)
    left = check.position - ArmStates(NJ, check.states).walk.tcp - predicted
    return float(np.linalg.norm(left, axis=1).mean() * 1e3)


def readings_off(found, survey: Measurements) -> float:  # type: ignore[no-untyped-def]
    """Return what the predicted readings are off by [mm]."""
    placed = found.model.registration
    states = placed.on_probes(survey.states)
    read = found.model.reading(NJ, states).error
    left = placed.to_base(survey.position, states.station)
    left = left - ArmStates(NJ, states).walk.tcp - read
    return float(np.linalg.norm(left, axis=1).mean() * 1e3)


@pytest.mark.parametrize(
    "rows", [(90, 90), (160, 8), *slow([((150, 30),), ((60, 60, 60),), ((180,),)])]
)
def test_each_file_has_a_registration(cell, tmp_path: Path, rows) -> None:  # type: ignore[no-untyped-def]
    parts, _ = files(rows, moved=True)
    survey = concatenate(parts)
    found = fit_measurements(survey, cell, effects=EFFECTS, frame="tracker")
    placed = found.model.registration
    assert placed is not None and len(placed.transforms) == len(rows)
    for k, T in enumerate(placed.transforms):
        assert np.linalg.norm(T[:3, 3] - PLACES[k][0]) < 0.03
    assert found.report.after.mean_mm < 0.06
    assert readings_off(found, survey) < 0.06
    found.model.save(tmp_path / "m.json")
    again = load_model(tmp_path / "m.json").registration
    assert again is not None and again.stations == placed.stations
    np.testing.assert_array_equal(again.transforms, placed.transforms)


def test_files_of_one_station_share_its_registration(cell) -> None:  # type: ignore[no-untyped-def]
    names = ("north", "south", "north")
    parts, _ = files((60, 60, 4), moved=True, stations=names)
    survey = concatenate(parts)
    assert survey.stations == ("north", "south")
    found = fit_measurements(survey, cell, effects=EFFECTS, frame="tracker")
    assert found.report.after.mean_mm < 0.06
    assert len(found.model.registration.transforms) == 2


@pytest.mark.parametrize("split", [(40, 40), (24, 76), (76, 24)])
def test_a_tracker_that_was_moved_within_a_station_is_named_by_the_row(
    split: tuple[int, int],
) -> None:
    parts, _ = files(split, True)
    survey = concatenate([replace(p, stations=("hall",)) for p in parts])
    match = rf"{split[1]} of {sum(split)} rows, from row 1-1 on, .* another place"
    with pytest.raises(MeasurementError, match=match):
        into_base_frame(survey, NJ)


def test_rows_that_are_off_for_another_reason_are_not_called_so() -> None:
    (part,), _ = files((60,), True)
    unlike = part.position.copy()
    unlike[::3] += 0.3 * np.random.default_rng(2).standard_normal((20, 3))
    with pytest.raises(MeasurementError) as other:
        check_survey(into_base_frame(replace(part, position=unlike), NJ)[0], NJ)
    assert "another place" not in str(other.value)


@pytest.mark.parametrize("few", [2, 5])
def test_a_station_of_few_stops_is_refused(few: int) -> None:
    parts, _ = files((60, few), moved=True)
    with pytest.raises(MeasurementError, match=r"of station 1\.csv.*column station"):
        into_base_frame(concatenate(parts), NJ)


def test_stops_about_one_line_are_refused() -> None:
    parts, _ = files((40,), moved=True)
    near = parts[0].states.with_(
        q=parts[0].states.q[0] + 1e-3 * np.arange(40)[:, None] * np.eye(6)[0]
    )
    with pytest.raises(MeasurementError, match="all about one line"):
        check_stops(parts[0].with_states(near), NJ)


@pytest.mark.parametrize(
    "step", [(5e-4, 2e-4), (1e-3, 0.0), (0.0, 3e-4), (3e-3, 2e-3), (1e-4, 5e-5)]
)
@pytest.mark.parametrize("count", [2, *slow([3])])
def test_a_step_between_files_of_the_base_frame_has_a_name(  # type: ignore[no-untyped-def]
    cell, step: tuple[float, float], count: int
) -> None:
    parts, check = files((80,) * count, moved=False)
    for k in range(1, count):
        turn = Rotation.from_rotvec([0, step[1] * k, step[1]]).as_matrix()
        moved = parts[k].position @ turn.T + [step[0], 0.0, -step[0] * k / 2]
        parts[k] = replace(parts[k], position=moved)
    found = fit_measurements(concatenate(parts), cell, effects=EFFECTS)
    names = [e.name for e in found.model.effects.effects]
    assert StationShift.name in names
    assert any("1.csv lies" in w and "0.csv" in w for w in found.report.warnings)
    assert off(found, check) < 0.02


def test_files_of_one_base_frame_have_no_step(cell) -> None:  # type: ignore[no-untyped-def]
    parts, check = files((80, 80), moved=False)
    found = fit_measurements(concatenate(parts), cell, effects=EFFECTS)
    assert StationShift.name not in [e.name for e in found.model.effects.effects]
    assert off(found, check) < 0.02


def test_columns_of_a_station_are_those_of_its_rows() -> None:
    states = random_states(6, np.random.default_rng(0), PLATE).with_(
        station=np.array([0, 0, 1, 1, 2, 2])
    )
    batch = ArmStates(NJ, states)
    for effect, first in (
        (Placement.propose(NJ, states), 0),
        (StationShift.propose(NJ, states), 1),
    ):
        columns = effect.columns(batch)
        assert columns.shape[2] == len(effect.parameters())
        for s in range(first, 3):
            own = columns[:, :, 6 * (s - first) : 6 * (s - first) + 6]
            assert np.abs(own[states.station != s]).max() == 0
            assert np.abs(own[states.station == s]).max() > 0


# The prior of a probe.


def never_turned(n: int, rng: np.random.Generator, free: bool = False):  # type: ignore[no-untyped-def]
    """Draw poses whose tool points down, turned about the vertical where free."""
    q = random_states(n, rng).q.copy()
    q[:, 3:5] = 0.0, -0.5
    states = random_states(n, rng).with_(q=q.copy())
    flange = ArmStates(NJ, states).walk.flange
    turn = flange[0] if not free else None
    for k in range(n):

        def gap(wrist: np.ndarray, k: int = k) -> np.ndarray:
            joints = np.r_[q[k, :3], wrist]
            R = ArmStates(NJ, states[:1].with_(q=joints[None])).walk.flange[0]
            return (R[:, 2] - flange[0][:, 2]) if turn is None else (R - turn).ravel()

        q[k, 3:] = least_squares(gap, q[k, 3:]).x
    return states.with_(q=q)


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("far", [0.05, *slow([0.0, 0.2])])
def test_a_tool_that_never_turned_leaves_its_probe_at_the_prior(  # type: ignore[no-untyped-def]
    free: bool, far: float
) -> None:
    rng = np.random.default_rng(2)
    states = never_turned(60, rng, free)
    arm = random_arm(rng)
    there = states.with_(tool=states.tool + far * np.eye(3)[2])
    seen, _ = arm.measure(there, rng)
    moved = (seen - [4.0, -3.0, 1.5]) @ Rotation.from_euler("z", 2.0).as_matrix()
    survey = survey_of(states, moved)
    placed, found = into_base_frame(survey, NJ)
    assert np.abs(found.probes[0] - TOOL).max() < 0.1
    told = [w for w in placed.warnings if "the tool" in w]
    how = "turned about one axis only" if free else "never turned"
    assert len(told) == 1 and how in told[0] and "+- 300 mm" in told[0]


@pytest.mark.parametrize("wobble", [0.0, *slow([0.003, 0.01])])
@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("far", [0.05, *slow([0.0, 0.2])])
def test_readings_with_the_tool_turned_otherwise_are_as_unsure_as_the_probe(  # type: ignore[no-untyped-def]
    cell, tmp_path: Path, wobble: float, free: bool, far: float
) -> None:
    """The probe's prior counts beside the survey's orientations, not among them."""
    rng = np.random.default_rng(2)
    states = never_turned(120, rng, free)
    states = states.with_(q=states.q + wobble * rng.standard_normal((120, 6)))
    arm, R = random_arm(rng), Rotation.from_euler("z", 2.0).as_matrix()
    tool = TOOL + far * np.eye(3)[2]

    def seen(states):  # type: ignore[no-untyped-def]
        read, _ = arm.measure(states.with_(tool=np.tile(tool, (len(states), 1))), rng)
        return survey_of(states, (read - [4.0, -3.0, 1.5]) @ R)

    survey, other = seen(states), seen(random_states(200, rng))
    found = fit_measurements(
        survey[np.arange(80)], cell, effects=EFFECTS, frame="tracker", validate=False
    )
    found.model.save(tmp_path / "m.json")
    model = load_model(tmp_path / "m.json")

    def of(rows: Measurements) -> tuple[float, float]:
        placed = model.registration
        assert placed is not None
        states = placed.on_probes(rows.states)
        read = model.reading(NJ, states)
        at = placed.to_base(rows.position) - ArmStates(NJ, states).walk.tcp
        held = np.abs(at - read.error) < 1.96 * read.std
        return float(held.mean()), float(read.std.mean())

    alike, unlike = of(survey[np.arange(80, 120)]), of(other)
    assert alike[0] > 0.9 and alike[1] < 3e-4
    assert unlike[0] > 0.95
    assert unlike[1] > (0.1 if wobble == 0.0 else 2e-3)


@pytest.mark.parametrize("far", [0.3, 2.5, *slow([1.0])])
@pytest.mark.parametrize("stated", [True, False])
def test_longer_tools_are_found(far: float, stated: bool) -> None:
    rng = np.random.default_rng(1)
    states = random_states(80, rng)
    arm = random_arm(rng, tool=False)
    there = states.with_(tool=states.tool + far * np.eye(3)[1])
    seen, _ = arm.measure(there, rng)
    moved = (seen - [4.0, -3.0, 1.5]) @ Rotation.from_euler("z", 2.0).as_matrix()
    if not stated:
        states = states.with_(tool=np.zeros((80, 3)))
    placed, found = into_base_frame(survey_of(states, moved), NJ)
    assert np.linalg.norm(found.probes[0] - there.tool[0]) < 5e-3
    assert not any("the tool" in w for w in placed.warnings)


# Fixed points that several stations have read.

PILLARS = np.array([[2.0, 2.0, 0.5], [-1.5, 2.5, 1.5], [1.0, -2.5, 1.0], [0.0, 3.0, 2]])


def with_pillars(
    rows: tuple[int, ...], pillars: int, apart: float = 0.0
) -> list[Measurements]:
    """Measure in several files, each of a station that read fixed points once."""
    rng, parts = np.random.default_rng(9), []
    for k, part in enumerate(files(rows, moved=True)[0]):
        at, turn = PLACES[k]
        R = Rotation.from_euler("ZYX", [turn, 0.05, -0.1]).as_matrix()
        there = np.array(PILLARS[:pillars])
        there[0, 0] += apart * k
        seen = (there - np.array(at)) @ R + 1e-5 * rng.standard_normal(there.shape)
        fixed = ReferenceRows(
            part.path, tuple(f"p{i}" for i in range(pillars)), seen,
            np.full(pillars, np.nan), np.arange(pillars) - 0.5, np.arange(pillars),
        )  # fmt: skip
        parts.append(replace(part, references=fixed))
    return parts


@pytest.mark.parametrize("rows", [(90, 90), (120, 4), (60, 5, 60)])
@pytest.mark.parametrize("pillars", [3, *slow([4])])
def test_fixed_points_tie_stations(cell, rows: tuple[int, ...], pillars: int) -> None:  # type: ignore[no-untyped-def]
    """Even those of which too few stops were read for a registration of their own."""
    survey = concatenate(with_pillars(rows, pillars))
    assert survey.stations == ("0.csv",)
    assert sum("registered to 0.csv by" in w for w in survey.warnings) == len(rows) - 1
    found = fit_measurements(
        survey, cell, effects=EFFECTS, frame="tracker", validate=False
    )
    placed = found.model.registration
    assert placed is not None and len(placed.transforms) == 1
    assert found.report.after.mean_mm < 0.06
    assert len(found.model.monuments) == pillars
    there = np.array([xyz for _, xyz in found.model.monuments])
    assert np.linalg.norm(there - PILLARS[:pillars], axis=1).max() < 0.03


def test_two_fixed_points_leave_stations_apart() -> None:
    survey = concatenate(with_pillars((60, 60), 2))
    assert len(survey.stations) == 2


def test_a_fixed_point_that_was_moved_ties_nothing() -> None:
    survey = concatenate(with_pillars((60, 60), 4, apart=2e-3))
    assert len(survey.stations) == 2
    (said,) = [w for w in survey.warnings if "stations are not joined" in w]
    assert "1.csv" in said and "differ by up to" in said and "from 0.csv" in said
