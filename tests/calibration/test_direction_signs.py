"""Lambda columns that change their sign within a file, or have the other one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.calibration.direction_signs import (
    all_reversed,
    find_change_of_sign,
)
from postproc.calibration.measurements import Measurements
from postproc.calibration.survey_checks import (
    as_surveyed,
    ask_about_steps,
    check_against,
    check_signs,
    check_survey,
)
from postproc.exceptions import MeasurementError
from postproc.model.model import Model
from postproc.robot.arm import Arm
from postproc.robot.state import States
from tests.calibration.simulator import NJ, random_arm, random_states, survey_of

ROWS = 60


def measured(
    seed: int, n: int = ROWS, turned: slice | None = None, step: float = 0.0
) -> Measurements:
    """Measure an arm whose links lag; write some rows with the other sign."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    arm.backlash = -np.abs(arm.backlash) * np.array([1.0, 0.0, 0.0])
    states = random_states(n, rng)
    position = arm.measure(states, rng)[0]
    side, q = states.direction.copy(), states.q.copy()
    if turned is not None:
        side[turned] *= -1.0
    q[n // 2 :, 4] += step
    return survey_of(states.with_(direction=side, q=q), position)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("first", [12, 29, 48])
def test_the_row_of_a_change_is_found(seed: int, first: int) -> None:
    late = measured(seed, turned=slice(first, None))
    rows, place = find_change_of_sign(as_surveyed(late, NJ)) or (np.zeros(1), "")
    assert place == "from" and abs(int(np.argmax(rows)) - first) <= 1
    early = measured(seed, turned=slice(first))
    rows, place = find_change_of_sign(as_surveyed(early, NJ)) or (np.zeros(1), "")
    assert place == "until" and abs(int(rows.sum()) - first) <= 1


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("step", [0.0, 3e-4, 3e-3])
def test_good_rows_and_a_joint_that_stepped_are_not_called_so(
    seed: int, step: float
) -> None:
    sided = as_surveyed(measured(seed, step=step), NJ)
    assert find_change_of_sign(sided) is None and not all_reversed(sided)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("n", [40, 160])
def test_the_row_from_which_a_joint_is_off_is_found(seed: int, n: int) -> None:
    for step in (6e-3, -2e-2):
        found = as_surveyed(measured(seed, n, step=step), NJ).joint_change
        assert found is not None and (found.joint, found.first) == (4, n // 2)
        assert found.by == pytest.approx(-step, abs=1e-3)
    assert as_surveyed(measured(seed, n), NJ).joint_change is None


def test_a_joint_that_is_off_from_a_row_on_is_refused_by_row_and_line() -> None:
    late = measured(4, step=np.deg2rad(0.6))
    with pytest.raises(MeasurementError, match=r"from row .* joint 5 is off by -0\.60"):
        check_survey(late, NJ)
    check_survey(measured(4, step=np.deg2rad(0.1)), NJ)  # left to the fit


def test_rows_of_one_side_after_the_other_are_good() -> None:
    """All poses from one side, then all from the other: lambda itself changes."""
    rng = np.random.default_rng(1)
    arm, states = random_arm(rng), random_states(ROWS, rng)
    again = np.tile(states.q[: ROWS // 2], (2, 1))
    side = np.repeat([[1.0], [-1.0]], ROWS // 2, axis=0) * np.ones(6)
    states = states.with_(q=again, direction=side)
    survey = survey_of(states, arm.measure(states, rng)[0])
    assert find_change_of_sign(as_surveyed(survey, NJ)) is None


def test_a_survey_is_refused_by_row_and_line() -> None:
    survey = measured(3, turned=slice(31, None))
    match = r"survey\.csv:3\d: lambda has the other sign in \d+ of 60 rows, from row 3"
    with pytest.raises(MeasurementError, match=match):
        check_survey(survey, NJ)
    inferred = replace(survey, inferred=np.ones(ROWS, dtype=bool))
    check_survey(inferred, NJ)  # there is no column whose sign could be wrong


def test_fresh_rows_are_refused_against_a_model() -> None:
    """The model knows geometry and backlash; half of the rows are turned."""
    rng = np.random.default_rng(7)
    arm = random_arm(rng)
    arm.backlash = -np.abs(arm.backlash) * np.array([1.0, 0.0, 0.0])

    class Known(Model):
        def __init__(self) -> None:
            """Know the arm as it is."""

        def error(self, nominal: Arm, states: States) -> np.ndarray:
            true = arm.tcp(states.q, states.direction, states.tool)
            plain = type(arm)(arm=nominal)
            nominal_tcp = plain.tcp(states.q, states.direction, states.tool)
            return np.asarray(true - nominal_tcp)

    states = random_states(30, rng)
    survey = survey_of(states, arm.measure(states, rng)[0])
    check_against(survey, NJ, Known())
    side = states.direction.copy()
    side[15:] *= -1.0
    turned = survey.with_states(states.with_(direction=side))
    with pytest.raises(MeasurementError, match="lambda has the other sign in 1"):
        check_against(turned, NJ, Known())


def test_the_other_sign_in_all_rows_is_refused() -> None:
    good, other = measured(2), measured(2, turned=slice(None))
    check_signs(good, as_surveyed(good, NJ))
    with pytest.raises(MeasurementError, match=r"run ahead .*lambda_sign=-1"):
        check_signs(other, as_surveyed(other, NJ))


def test_a_small_step_of_a_joint_is_asked_about() -> None:
    good, late = measured(2), measured(2, step=4e-3)
    assert ask_about_steps(good, as_surveyed(good, NJ)) == ()
    (asked,) = ask_about_steps(late, as_surveyed(late, NJ))
    assert "joint 5 is off by -0.2" in asked
