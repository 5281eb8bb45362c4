"""Readings of fixed points tell the arm's warming-up from the tracker's drift."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.diagnosis.diagnose import extend_model
from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.fit import drifts
from postproc.calibration.measurements import (
    Measurements,
    concatenate,
    read_survey_file,
)
from postproc.calibration.monuments import ReferenceRows, tracker_motion
from postproc.calibration.tables import TableFormat
from postproc.exceptions import MeasurementError
from postproc.model.effects import BASE_EFFECTS
from postproc.model.effects.effect import Effect
from postproc.model.effects.thermal import Thermal
from postproc.model.model import Model, load_model
from postproc.report.diagnosis import tell
from postproc.robot.state import make_states
from postproc.simulation import stream
from tests.calibration.planted import ARM, TRACKER, Campaign, campaign
from tests.slow import slow

ONE = np.array([[1.5, 1.0, 0.5]])
THREE = np.array([[1.5, 1.0, 0.5], [-1.5, 1.5, 0.2], [1.0, -2.0, 1.5]])
EVERY = 20  # rows between two readings


def monuments(c: Campaign, places: np.ndarray) -> ReferenceRows:
    """Read points of the hall with the campaign's own tracker, all along."""
    rows = np.r_[0 : len(c.states) : EVERY, len(c.states) - 1]
    some, rng = c.arrivals[rows], stream(c.arm.seed, "monument")
    fixed, grows = c.arm.tracker_noise
    seen = [c.arm.simulate_readings(some, np.tile(p, (len(rows), 1))) for p in places]
    position = np.concatenate(seen)
    sigma = fixed + grows * np.linalg.norm(position - TRACKER, axis=1)
    names = [f"m{k}" for k in range(len(places)) for _ in rows]
    return ReferenceRows(
        Path("s.csv"),
        tuple(names),
        position + rng.normal(size=position.shape) * sigma[:, None],
        np.tile(some.time, len(places)),
        np.tile(some.order + 0.5, len(places)),
        np.arange(len(names)),
    )


def survey_of(c: Campaign, places: np.ndarray | None) -> Measurements:
    """Write a campaign without a thermometer as a survey."""
    n = len(c.states)
    states = c.states.with_(temperature=np.full(n, np.nan))
    read = Measurements(
        Path("s.csv"), states, c.position, tuple(map(str, range(n))), np.arange(n),
        np.zeros(n, dtype=bool), "x",
        references=None if places is None else monuments(c, places),
    )  # fmt: skip
    return concatenate([read])


def fitted(c: Campaign, places: np.ndarray | None) -> tuple[Model, tuple[str, ...]]:
    """Fit what the rows give evidence for."""
    survey = survey_of(c, places)
    fit = fit_survey(survey, ARM, None, TRACKER)
    return model_of(fit, survey), (*survey.warnings, *drifts(fit))


def in_time(effects: tuple[Effect, ...]) -> set[str]:
    """Name the effects that pass with time."""
    return {e.name for e in effects} & {"thermal", "tracker_drift"}


@pytest.mark.parametrize("seed", [305, *slow([321])])
@pytest.mark.parametrize("places", [ONE, THREE], ids=["one", "three"])
def test_a_warm_up_beside_a_tracker_that_stands_is_the_arms(
    places: np.ndarray, seed: int, tmp_path: Path
) -> None:
    c = campaign(seed, ("warmup",), 1.0)
    model, told = fitted(c, places)
    assert "did not move" in told[0]
    assert ("turns cannot be determined" in told[1]) == (len(places) == 1)
    assert told[-1].endswith("Predictions are for the arm as warm as at the end")
    assert in_time(model.compensable()[0].effects) == {"thermal"}
    assert in_time(model.effects.effects) == {"thermal"}
    model.save(tmp_path / "m.json")
    again = load_model(tmp_path / "m.json")
    assert "thermal" in in_time(again.compensable()[0].effects)
    assert again.statistics["reference_drift_mm"] == 0.0
    # A program does not say how warm the arm is: it is as warm as it was measured last.
    at = make_states(np.full((1, 6), 0.3))
    end = at.with_(time=np.full(1, c.states.time.max()))
    np.testing.assert_allclose(again.error(ARM, at), again.error(ARM, end))
    cold = again.error(ARM, at.with_(time=np.zeros(1)))
    assert np.linalg.norm(cold - again.error(ARM, at)) > 3e-5


@pytest.mark.parametrize("seed", [308, *slow([333])])
@pytest.mark.parametrize("places", [None, ONE, THREE], ids=["none", "one", "three"])
def test_a_drift_of_the_tracker_is_never_compensated(
    places: np.ndarray | None, seed: int
) -> None:
    c = campaign(seed, ("tracker_drift",), 1.0)
    model, told = fitted(c, places)
    assert not in_time(model.compensable()[0].effects)
    if places is None:
        return
    assert "the tracker moved by up to" in told[0]
    there = np.tile(places[0], (len(c.states), 1))
    true = c.arm.simulate_readings(c.arrivals, there) - there
    motion = survey_of(c, places).motion
    assert motion is not None and motion.drifts
    left = motion.move(c.states.time, there) - true
    left = left - left.mean(axis=0)  # where a point stands is not known
    true = true - true.mean(axis=0)
    size = np.linalg.norm(true, axis=1).mean()
    assert np.linalg.norm(left, axis=1).mean() < 0.35 * size
    assert model.statistics["reference_drift_mm"] > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("seed", [308, 333])
def test_a_tracker_that_was_knocked_is_no_step_of_the_base(seed: int) -> None:
    """Three fixed points show the jump: neither arm nor base has moved."""
    c = campaign(seed, (), 1.0)
    shift, turn = np.array([2e-4, -1e-4, 1e-4]), np.array([0.0, 5e-5, -5e-5])
    at = len(c.states) / 2

    def knocked(position: np.ndarray, order: np.ndarray) -> np.ndarray:
        moved = shift + np.cross(turn, position)
        return position + np.where(order[:, None] > at, moved, 0.0)

    survey = replace(survey_of(c, None), position=knocked(c.position, c.states.order))
    points = monuments(c, THREE)
    points = replace(points, position=knocked(points.position, points.order))
    with_points = concatenate([replace(survey, references=points)])
    motion = with_points.motion
    assert motion is not None and motion.drifts and motion.jump is not None
    assert any("the tracker jumped at" in text for text in motion.tell())
    own = points.time if motion.drift.clock == "time" else points.order
    gap = np.unique(own)
    near = np.searchsorted(gap, motion.jump)
    assert gap[near - 1] <= motion.jump <= gap[near]
    fit = fit_survey(with_points, ARM, None, TRACKER)
    steady = fit_survey(survey_of(c, None), ARM, None, TRACKER)
    assert not {e.name for e in fit.combination.effects} & {"base_shift", "joint_step"}
    there = c.states
    away = model_of(fit, with_points).error(ARM, there) - model_of(
        steady, survey_of(c, None)
    ).error(ARM, there)
    assert np.linalg.norm(away, axis=1).mean() < 1.5e-5


def test_a_tracker_that_drifts_slowly_did_not_jump() -> None:
    for seed in (308, 333):
        motion = survey_of(campaign(seed, ("tracker_drift",), 1.0), THREE).motion
        assert motion is not None and motion.jump is None


@pytest.mark.slow
@pytest.mark.parametrize("seed", [305, 321])
def test_without_fixed_points_nothing_of_a_warm_up_is_compensated(seed: int) -> None:
    """Predictions are those of the rows' mean, as without the effect."""
    c = campaign(seed, ("warmup",), 1.0)
    model, told = fitted(c, None)
    assert "thermal" in in_time(model.effects.effects)
    assert not in_time(model.compensable()[0].effects)
    assert "may be tracker_drift, so it is not compensated" in told[-1]
    (thermal,) = (e for e in model.effects.effects if isinstance(e, Thermal))
    plain = fit_survey(survey_of(c, None), ARM, BASE_EFFECTS, TRACKER)
    without = model_of(plain, survey_of(c, None)).error(ARM, c.states)
    away = np.linalg.norm(model.error(ARM, c.states) - without, axis=1).mean()
    warm, _ = fitted(c, THREE)
    far = np.linalg.norm(warm.error(ARM, _untimed(c)) - without, axis=1).mean()
    assert thermal.level > 0.1 and away < 0.5 * far


def _untimed(c: Campaign):  # type: ignore[no-untyped-def]
    return c.states.with_(time=np.full(len(c.states), np.nan))


@pytest.mark.slow
@pytest.mark.parametrize("places", [None, THREE], ids=["none", "three"])
def test_a_diagnosis_says_whose_the_warm_up_is(places: np.ndarray | None) -> None:
    survey = survey_of(campaign(321, ("warmup",), 1.0), places)
    given = model_of(fit_survey(survey, ARM, BASE_EFFECTS, TRACKER), survey)
    found = extend_model(survey, ARM, given, tracker=TRACKER)
    (finding,) = (f for f in found.diagnosis.findings if f.effect == "thermal")
    assert finding.of_setup == (places is None)
    assert finding.settings["told"] == (places is not None)
    named = in_time(found.model.compensable()[0].effects)
    assert named == (set() if places is None else {"thermal"})
    stood = " monuments: the tracker did not move"
    assert (stood in tell(found.diagnosis)) == (places is not None)
    assert bool(found.diagnosis.to_dict()["monuments"]) == (places is not None)


def test_readings_that_cover_a_part_of_the_survey_leave_it_in_doubt() -> None:
    c = campaign(321, ("warmup",), 1.0)
    rows = monuments(c, THREE)
    motion = tracker_motion(rows[rows.order < 150], c.states.time, c.states.order)
    assert motion.covered < 0.5 and not motion.leaves(1e-3)
    assert "span 35% of the survey" in motion.tell()[-1]
    whole = tracker_motion(rows, c.states.time, c.states.order)
    assert whole.leaves(1e-3) and not whole.leaves(2 * whole.unsure)


def test_readings_at_both_ends_only_leave_it_in_doubt() -> None:
    """A tracker that went and came back was seen where it started, twice."""
    c = campaign(321, ("warmup",), 1.0)
    rows = monuments(c, THREE)
    ends = np.isin(rows.order, [rows.order.min(), rows.order.max()])
    motion = tracker_motion(rows[ends], c.states.time, c.states.order)
    assert motion.covered > 0.9 and motion.unseen > 0.9 and not motion.drifts
    assert not motion.stands and not motion.leaves(1e-3)
    assert motion.tell()[0].endswith("did not move while they were read")
    assert "lie between two readings of monuments" in motion.tell()[-1]


def test_a_moving_tracker_whose_turns_nobody_sees_leaves_it_in_doubt() -> None:
    c = campaign(308, ("tracker_drift",), 1.0)
    for places in (ONE, THREE[:2], THREE):
        motion = tracker_motion(monuments(c, places), c.states.time, c.states.order)
        assert motion.drifts and motion.leaves(1e-3) == (len(places) == 3)


# Files.

HEAD = "id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,time_s,reference"
LINES = [
    "a,0,0,0,0,10,0,1900,0,2100,0,",
    "r1,,,,,,,1500,1000,500,5,M1",
    "b,10,0,0,0,20,0,1900,100,2100,10,0",
    "c,20,0,0,0,20,0,1900,200,2100,20,false",
    "r2,,,,,,,1500.01,1000,500,25,m1",
]


def read(tmp_path: Path, lines: list[str], **reading: object) -> Measurements:
    """Read a file with these lines."""
    path = tmp_path / "s.csv"
    path.write_text("\n".join(lines) + "\n")
    form = TableFormat(**reading)  # type: ignore[arg-type]
    return concatenate([read_survey_file(path, ARM, np.zeros((1, 3)), reading=form)])


def test_rows_on_fixed_points_are_no_rows_of_the_arm(tmp_path: Path) -> None:
    found = read(tmp_path, [HEAD, *LINES])
    assert found.ids == ("a", "b", "c")
    rows = found.references
    assert rows is not None and rows.name == ("m1", "m1")
    assert rows.line.tolist() == [3, 6] and rows.order.tolist() == [0.5, 2.5]
    np.testing.assert_allclose(rows.time, [5, 25])
    plain = read(tmp_path, [HEAD, *(x for x in LINES if not x.startswith("r"))])
    assert plain.references is None and plain.motion is None
    np.testing.assert_array_equal(plain.position, found.position)
    np.testing.assert_array_equal(plain.states.direction, found.states.direction)


def test_a_column_map_keeps_names_of_fixed_points(tmp_path: Path) -> None:
    columns = {c: c for c in HEAD.split(",")} | {"reference": "Monument", "id": "No"}
    text = "[columns]\n" + "\n".join(f'{ours} = "{c}"' for ours, c in columns.items())
    (tmp_path / "map.toml").write_text(text)
    head = HEAD.replace("reference", "Monument").replace("id,", "No,", 1)
    found = read(tmp_path, [head, *LINES], columns=tmp_path / "map.toml")
    assert found.ids == ("a", "b", "c")
    assert found.references is not None and found.references.name == ("m1", "m1")


def test_a_lost_beam_on_a_fixed_point_is_left_out(tmp_path: Path) -> None:
    found = read(tmp_path, [HEAD, *LINES, "r3,,,,,,,0,0,0,30,m1"])
    assert found.references is not None and len(found.references.name) == 2
    assert [(d.id, d.line) for d in found.dropped] == [("m1", 7)]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([*LINES, "r3,,,,,,,1500,,500,30,m1"], r":7: .*has no y_mm"),
        (LINES[:-1], r":3: monument 'm1' was read once"),
        ([LINES[1], LINES[4]], r"has rows on monuments only"),
        (
            [*LINES, "r3,,,,,,,1600,1000,500,30,m1"],
            r":7: .* is 100\.0 mm from its place",
        ),
        ([*LINES, "d,,0,0,0,20,0,1900,300,2100,30,"], r":7: '' in column q1_deg"),
    ],
    ids=["no coordinate", "once", "only", "apart", "no angle"],
)
def test_what_cannot_be_used_is_refused(
    tmp_path: Path, lines: list[str], message: str
) -> None:
    with pytest.raises(MeasurementError, match=message):
        read(tmp_path, [HEAD, *lines])


def test_a_drift_is_told_by_the_order_of_rows_where_no_time_is() -> None:
    c = campaign(308, ("tracker_drift",), 1.0)
    rows = monuments(c, THREE)
    none = np.full(len(c.states), np.nan)
    untimed = replace(rows, time=np.full(len(rows.name), np.nan))
    motion = tracker_motion(untimed, none, c.states.order)
    assert motion.drift.clock == "order" and motion.drifts
