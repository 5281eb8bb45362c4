"""Several tools under one name, and a nest that slipped, are told from noise."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.calibration.effect_selection import fit_survey
from postproc.calibration.fit import (
    fit_measurements,
    into_base_frame,
    points_of_cell,
    wrong_nests,
)
from postproc.calibration.measurements import Measurements
from postproc.calibration.nest_check import ToolGroups, find_groups, find_wrong_nest
from postproc.calibration.survey_checks import check_survey
from postproc.exceptions import MeasurementError
from postproc.model.effects import BASE_EFFECTS
from postproc.model.kinematics import ArmStates
from postproc.robot.cell import Cell, load_cell
from tests.calibration.simulator import (
    NJ,
    PLATE,
    random_arm,
    random_states,
    survey_of,
)


def shifted(tool: np.ndarray, by: list[float], seed: int = 0, n: int = 240):  # type: ignore[no-untyped-def]
    """Survey an arm, some rows with a tool that lies elsewhere [mm]."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    states = random_states(n, rng)
    moved = states.tool + tool[:, None] * np.array(by) * 1e-3
    measured, _ = arm.measure(states.with_(tool=moved), rng)
    return survey_of(states, measured)


@pytest.mark.parametrize("share", [0.5, 0.1])
@pytest.mark.parametrize("by", [[30.0, 10.0, 60.0], [0.0, 5.0, -5.0]])
def test_rows_of_two_tools_are_refused(share: float, by: list[float]) -> None:
    which = (np.random.default_rng(1).random(240) < share).astype(float)
    which[0] = 0.0
    first = int(np.argmax(which)) + 1
    with pytest.raises(
        MeasurementError, match=r"with 2 tools .*Add a column tool_id"
    ) as e:
        check_survey(shifted(which, by), NJ)
    assert f"rows 1, {first})" in str(e.value) and e.value.line == first + 1


def test_three_nests_without_tool_id_are_counted() -> None:
    rng = np.random.default_rng(2)
    states = random_states(240, rng)
    nests = np.array([[0.0, 0, 0], [-0.14, 0.14, 0.05], [-0.03, 0.13, 0.17]])
    moved = states.with_(tool=states.tool + nests[np.arange(240) % 3])
    survey = survey_of(states, random_arm(rng).measure(moved, rng)[0])
    with pytest.raises(MeasurementError, match="with 3 tools"):
        check_survey(survey, NJ)


def test_a_step_is_found_in_spite_of_a_stray_row() -> None:
    which = np.repeat([0, 1], [150, 90])
    centre = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    assert ToolGroups(which, centre).step == 150
    which[[40, 200]] = [1, 0]
    assert ToolGroups(which, centre).step == 150
    assert ToolGroups(np.arange(240) % 2, centre).step is None
    assert ToolGroups(np.repeat([0, 1, 0], 80), centre).step is None


def test_one_tool_is_one_heap() -> None:
    for seed in range(6):
        survey = shifted(np.zeros(240), [0, 0, 0], seed)
        check_survey(survey, NJ)
        flange = ArmStates(NJ, survey.states).walk.flange
        noise = np.random.default_rng(seed).standard_normal((240, 3))
        assert find_groups(noise, flange) is None


@pytest.fixture
def cell(tmp_path) -> Cell:  # type: ignore[no-untyped-def]
    path = tmp_path / "cell.toml"
    path.write_text('[robot]\narm = "nj220-2.7"\n[tool]\nxyz_mm = [80, -40, 150]\n')
    return load_cell(path)


@pytest.mark.slow
def test_a_nest_that_slips_is_told_with_its_row(cell: Cell) -> None:
    after = (np.arange(240) >= 150).astype(float)
    effects = ("geometry", "backlash", "backlash_profile")
    slipped = shifted(after, [0.3, 0.0, -0.2])
    (told,) = fit_measurements(slipped, cell, effects=effects).report.warnings
    assert "at row 151: run postproc diagnose" in told
    found = fit_measurements(slipped, cell)
    assert "slipped at row 151: fitted as tool_shift" in found.report.warnings[0]
    assert "tool_shift" not in {e.name for e in found.model.compensable()[0].effects}
    assert found.report.after.mean_mm < 0.06
    steady = shifted(after, [0.0, 0.0, 0.0])
    assert not fit_measurements(steady, cell, effects=effects).report.warnings


def plate_survey(seed: int, nest: int, off: list[float]) -> Measurements:
    """Measure three nests, of which one is not where it should be."""
    rng = np.random.default_rng(seed)
    arm, states = random_arm(rng), random_states(300, rng, PLATE)
    moved = np.where(states.tool_id[:, None] == nest, np.array(off), 0.0)
    position, _ = arm.measure(states.with_(tool=states.tool + moved), rng)
    return survey_of(states, position)


def told_of(survey: Measurements) -> tuple[str, ...]:
    return wrong_nests(fit_survey(survey, NJ, BASE_EFFECTS, None, ("probe",)))


@pytest.mark.parametrize("axis", range(3))
def test_a_nest_that_is_off_is_named_and_fitted(axis: int) -> None:
    off = [0.0, 0.0, 0.0]
    off[axis] = 5e-4
    survey = plate_survey(1, 1, off)
    fit = fit_survey(survey, NJ, BASE_EFFECTS, None, ("probe",))
    assert (fit.rows.weight == 1).mean() > 0.99  # no row of it is weighed down
    (told,) = wrong_nests(fit)
    assert told.startswith("nest 1 lies (")
    seen = [float(x) for x in re.findall(r"-?\d\.\d\d", told.split(")")[0])]
    assert np.linalg.norm(np.array(seen) - np.array(off) * 1e3) < 0.25


def test_a_nest_that_cannot_be_told_is_one_of_a_group() -> None:
    (told,) = told_of(plate_survey(2, 2, [5e-4, 0.0, 0.0]))
    assert told.startswith("one of the nests is not where the cell has it, 2 or 1")


def test_nests_in_order_are_not_mentioned() -> None:
    for seed in range(3):
        assert told_of(plate_survey(seed, 0, [0.0, 0.0, 0.0])) == ()


def test_of_two_nests_nobody_knows_which_is_off() -> None:
    offset = np.array([[2e-4, 0, 0], [-2e-4, 0, 0]])
    found = find_wrong_nest((4, 7), offset, 1e-10 * np.eye(6))
    assert found is not None and set(found.tool_ids) == {4, 7}
    assert find_wrong_nest((4,), offset[:1], 1e-10 * np.eye(3)) is None


def told_in_tracker_frame(survey: Measurements) -> tuple[str, ...]:
    """Fit rows that are seen by a tracker that stands anywhere."""
    turn = Rotation.from_euler("zyx", [0.7, -0.3, 0.2]).as_matrix()
    seen = replace(survey, position=(survey.position - [3.0, -2.0, 1.5]) @ turn)
    points, (placed, found) = points_of_cell(seen), into_base_frame(seen, NJ)
    assert points is not None
    fit = fit_survey(placed, NJ, BASE_EFFECTS, found.tracker, ("registration",))
    return wrong_nests(fit, points)


def test_in_the_trackers_frame_a_nest_is_named_too() -> None:
    (told,) = told_in_tracker_frame(plate_survey(1, 1, [1e-3, 0.0, 0.0]))
    assert "nest 1 lies (" in told
    for seed in (0, 7, 22):
        assert told_in_tracker_frame(plate_survey(seed, 0, [0.0, 0.0, 0.0])) == ()


def test_nests_that_the_cell_has_at_one_place_are_not_asked_about() -> None:
    survey = plate_survey(1, 1, [1e-3, 0.0, 0.0])
    tool = np.tile(PLATE[0], (len(survey), 1))
    same = survey.with_states(survey.states.with_(tool=tool))
    assert points_of_cell(same) is None
    one = survey[np.flatnonzero(survey.states.tool_id == 0)]
    assert points_of_cell(one) is None
