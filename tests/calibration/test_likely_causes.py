"""Bad rows: the likely cause is found by trying it, and named with its first row."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from postproc.calibration.effect_selection import model_of
from postproc.calibration.fit import into_base_frame
from postproc.calibration.measurements import Measurements
from postproc.calibration.regression import fit_effects
from postproc.calibration.survey_checks import check_against, check_survey
from postproc.exceptions import MeasurementError
from postproc.model.effects import propose
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from tests.calibration.simulator import (
    NJ,
    Simulated,
    random_arm,
    random_states,
    survey_of,
)
from tests.slow import slow

N = 60
Spoil = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def measured(seed: int, n: int = N, arm: Simulated | None = None) -> Measurements:
    rng = np.random.default_rng(seed)
    states = random_states(n, rng)
    return survey_of(states, (arm or our_arm()).measure(states, rng)[0])


@cache
def our_arm() -> Simulated:
    arm = random_arm(np.random.default_rng(7))
    return replace(arm, backlash=arm.backlash * [1, 0, 0])


@cache
def our_model() -> Model:
    survey = measured(1, 200)
    effects = propose(("geometry", "backlash"), NJ, survey.states)
    fitted = fit_effects(ArmStates(NJ, survey.states), survey.position, effects)
    return model_of(fitted, survey)


def spoilt(
    survey: Measurements, spoil: Spoil, rows: slice | np.ndarray
) -> Measurements:
    q, xyz = np.array(survey.states.q), np.array(survey.position)
    mended_q, mended = spoil(q.copy(), xyz.copy())
    q[rows], xyz[rows] = mended_q[rows], mended[rows]
    return replace(survey.with_states(survey.states.with_(q=q)), position=xyz)


def offset(joint: int, deg: float) -> Spoil:
    return lambda q, p: (q - np.deg2rad(deg) * np.eye(6)[joint], p)


MISTAKES: dict[str, tuple[Spoil, str, str]] = {
    "metres": (lambda q, p: (q, p * 1e-3), "look like metres", "look like metres"),
    "inches": (lambda q, p: (q, p / 25.4), "look like inches", "look like inches"),
    "radians": (
        lambda q, p: (np.deg2rad(q), p), "look like radians", "look like radians",
    ),
    "missed": (
        lambda q, p: (q, np.roll(p, -1, axis=0)),
        "position of the next one: a reading was missed",
        "position of the next one: move the positions down by one row",
    ),
    "twice": (
        lambda q, p: (q, np.roll(p, 1, axis=0)),
        "position of the previous one: a reading was written twice",
        "position of the previous one: move the positions up by one row",
    ),
    "sign": (
        lambda q, p: (q * [1, 1, -1, 1, 1, 1], p),
        "joint 3 has the other sign", "Joint 3 looks like it has the other sign",
    ),
    "order": (
        lambda q, p: (q[:, [0, 1, 2, 5, 4, 3]], p),
        "joints 4 and 6 are swapped", "Joints 4 and 6 look swapped",
    ),
    "offset": (
        offset(2, 3.0),
        r"joint 3 is off by \+(2\.9|3\.0)\d deg", "Joint 3 looks off",
    ),
}  # fmt: skip
PLACES = {
    "from": (slice(25, None), "from row 26 on"),
    "from near the end": (slice(52, None), "from row 53 on"),
    "until": (slice(0, 20), "until row"),
    "some": (np.arange(N) % 3 == 1, "rows"),
}


def checks(name: str) -> Callable[[Measurements], object]:
    if name == "fit":
        return lambda survey: check_survey(survey, NJ)
    if name == "model":
        return lambda survey: check_against(survey, NJ, our_model())
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])

    def tracker(survey: Measurements) -> object:
        away = (survey.position * 1.0 - 0.0) @ turn
        return into_base_frame(replace(survey, position=away), NJ)

    return tracker


@pytest.mark.parametrize("check", ["fit", "model", *slow(["tracker"])])
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_of_some_rows_is_named_with_the_first(
    mistake: str, place: str, check: str
) -> None:
    spoil, look, _ = MISTAKES[mistake]
    if place == "some" and mistake in ("missed", "twice"):
        pytest.skip("positions shift from a row on, or until one")
    rows, where = PLACES[place]
    with pytest.raises(MeasurementError, match=look) as refused:
        checks(check)(spoilt(measured(2), spoil, rows))
    assert where in str(refused.value) and refused.value.line is not None


@pytest.mark.parametrize("check", ["fit", "model", "tracker"])
@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_of_all_rows_is_named(mistake: str, check: str) -> None:
    spoil, _, whole = MISTAKES[mistake]
    with pytest.raises(MeasurementError, match=whole):
        checks(check)(spoilt(measured(3), spoil, slice(None)))


@pytest.mark.parametrize("check", ["fit", "model", "tracker"])
@pytest.mark.parametrize("far", [0.004, 0.03, 0.5])
@pytest.mark.parametrize("count", [0, 2, *slow([1])])
def test_single_bad_rows_are_left_to_the_fit(
    count: int, far: float, check: str
) -> None:
    survey = measured(4)
    xyz = np.array(survey.position)
    xyz[[11, 40][:count]] += far
    checks(check)(replace(survey, position=xyz))


@pytest.mark.parametrize("seed", [0, *slow([1, 2, 3])])
def test_an_arm_that_is_far_off_is_no_mistake(seed: int) -> None:
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    arm = replace(arm, link=6.0 * arm.link)
    check_survey(measured(seed, 80, arm), NJ)


def test_another_frame_is_named() -> None:
    survey = measured(5)
    moved = replace(survey, position=survey.position + np.array([3.0, 1.0, 0.5]))
    for check in (checks("fit"), checks("model")):
        with pytest.raises(MeasurementError, match="frame=tracker"):
            check(moved)


# Directions, against a model that knows the backlash.

SIDES: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str]] = {
    "sign": (lambda s: -s, "lambda has the other sign in every row"),
    "reverse": (lambda s: s[:, ::-1], "reverse order"),
    "swapped": (lambda s: s[:, [1, 0, 2, 3, 4, 5]], "lambda1 and lambda2 look swapped"),
    "shifted": (lambda s: np.roll(s, 1, axis=1), "shifted by"),
}


@pytest.mark.parametrize("n", [20, 200, *slow([60])])
@pytest.mark.parametrize("name", SIDES)
def test_directions_that_are_wrong_in_all_rows_are_asked_about(
    name: str, n: int
) -> None:
    survey = measured(6, n)
    spoil, told = SIDES[name]
    states = survey.states.with_(direction=spoil(np.array(survey.states.direction)))
    with pytest.raises(MeasurementError, match=told):
        check_against(survey.with_states(states), NJ, our_model())


CHANGED: dict[str, Callable[[Simulated], Simulated]] = {
    "nothing": lambda a: a,
    "more backlash": lambda a: replace(a, backlash=2.0 * a.backlash),
    "no backlash": lambda a: replace(a, backlash=0.0 * a.backlash),
    "one gap turned": lambda a: replace(
        a, backlash=a.backlash * [[1.0], [-1.0], [1.0], [1.0], [1.0], [1.0]]
    ),
    "mastered again": lambda a: replace(a, dh_theta=a.dh_theta + 1e-3 * np.eye(6)[1]),
    "moved": lambda a: replace(a, base=a.base + np.array([3e-3, 0, 0, 0, 0, 1e-3])),
    "a longer link": lambda a: replace(a, dh_d=a.dh_d + 5e-4 * np.eye(6)[3]),
}


@pytest.mark.parametrize("n", [12, 60])
@pytest.mark.parametrize("name", CHANGED)
def test_an_arm_that_changed_is_left_to_the_search(name: str, n: int) -> None:
    check_against(measured(8, n, CHANGED[name](our_arm())), NJ, our_model())


@pytest.mark.parametrize("seed", [0, 1, *slow([2, 3, 4])])
def test_rows_of_another_arm_are_refused(seed: int) -> None:
    other = random_arm(np.random.default_rng(100 + seed))
    with pytest.raises(MeasurementError, match="does not fit these rows"):
        check_against(measured(9, N, other), NJ, our_model())
