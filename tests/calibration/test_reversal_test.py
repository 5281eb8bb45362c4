"""Reversals of a survey say which gaps are sharp, on gears of four kinds."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.fit import fit
from postproc.calibration.reversal_design import MORE, STEPS
from postproc.calibration.reversal_test import (
    Reversals,
    flank_widths,
    newer_widths,
    split_reversals,
    tell_open,
    tell_widths,
)
from postproc.calibration.survey_files import read_measurements
from postproc.language.measuring_program import SHARE
from postproc.model.backlash_width import SHARP, ahead, half_gap, on_the_way
from postproc.model.effects import BASE_EFFECTS
from postproc.model.flank_hypotheses import verdict_of
from postproc.model.kinematics import ArmStates
from postproc.model.model import UNCERTAIN, UNLIKE, UNTOLD, Model, Width, load_model
from postproc.robot.cell import load_cell
from tests.compensation.paths.test_path_error import CELL, SEED, done
from tests.written import cli

POSES, EACH = 150, 4


def surveyed(folder: Path, gears: str, seed: int = SEED, percent: int = SHARE) -> Path:
    """A survey with reversals of an arm whose gears are of one kind."""
    rows, written = folder / f"{gears}{seed}-{percent}.csv", folder / "survey.pdl"
    design = ("--poses", POSES, "--set", f"survey.reversals={EACH}")
    done("survey", "--cell", CELL, *design, "-o", written)
    speed = "$PROG_SPD_OVR := {}"
    text = written.read_text().replace(speed.format(SHARE), speed.format(percent))
    written.write_text(text)
    arm = (f"simulation.seed={seed}", f"simulation.backlash_model={gears}")
    done("simulate", written, "--cell", CELL, "--set", arm[0], "--set", arm[1],
         "-o", rows)  # fmt: skip
    return rows


def fitted(rows: Path, *changes: str) -> Model:
    return fit(rows, cell=load_cell(CELL, changes=changes), effects=BASE_EFFECTS).model


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("reversals")


@pytest.fixture(scope="module")
def sharp(folder: Path) -> Path:
    return surveyed(folder, "sharp")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gears", "seeds"), [("sharp", (SEED, 44)), ("elastic", (SEED, 44))]
)
def test_widths_hold_what_the_gears_do(
    folder: Path, gears: str, seeds: tuple[int, ...]
) -> None:
    true = {"sharp": 1.0, "elastic": 4.0}[gears]
    for seed in seeds:
        widths = np.array(fitted(surveyed(folder, gears, seed)).flank_widths)
        assert (widths[:, 0] <= true).all() and (widths[:, 1] >= true).all()
        told = widths[:, 1] <= SHARP
        assert told.sum() >= 4 if gears == "sharp" else not told.any()
        assert ((widths[:, 0] > SHARP).sum() >= 3) == (gears == "elastic")


@pytest.mark.parametrize("gears", ["gravity", "inertia"])
def test_other_gears_are_not_taken_for_sharp_ones(folder: Path, gears: str) -> None:
    rows = surveyed(folder, gears, percent=100)
    model = fitted(rows, "measurements.lambda_sign=1")
    verdicts = [*map(verdict_of, model.flank_widths)]
    # About a vertical axis weight pushes nothing: that gear is as a sharp one. Those
    # that weight holds on one flank have no gap that steps could tell.
    loaded = verdicts if gears == "inertia" else verdicts[1:]
    assert "sharp" not in loaded and ("unlike" in loaded) == (gears == "inertia")


def test_a_gentle_survey_finds_links_pushed_by_their_drives(folder: Path) -> None:
    """Links that run on as an arm brakes do not where it is as slow as on paths."""
    sign = "measurements.lambda_sign=1"
    pushed = fitted(surveyed(folder, "inertia"), sign)
    run_on = fitted(surveyed(folder, "inertia", percent=100), sign)
    assert not ahead(pushed, load_cell(CELL).arm).any()
    assert ahead(run_on, load_cell(CELL).arm).all()
    assert {*map(verdict_of, pushed.flank_widths)} == {"sharp"}


def test_reversals_are_no_rows_of_the_fit(sharp: Path) -> None:
    cell = load_cell(CELL)
    all_rows = read_measurements(sharp, cell=cell)
    rest, found = split_reversals(all_rows, cell.arm)
    assert found is not None
    many = np.bincount(found.drive)
    assert (many >= EACH).all() and (many <= MORE * EACH).all()
    assert len(rest) == 2 * POSES and not any("." in name for name in rest.ids)
    for i in range(len(found)):
        own = found.rows.ids[found.first[i] : found.first[i + 1]]
        pose, drive, _ = own[0].split(".")
        assert own == tuple(f"{pose}.{drive}.{k}" for k in range(len(STEPS) + 1))
        assert int(drive) == found.drive[i] + 1
    assert fitted(sharp).rows <= len(rest)


def test_rows_without_reversals_stay_as_they_are(sharp: Path) -> None:
    cell = load_cell(CELL)
    rest, _ = split_reversals(read_measurements(sharp, cell=cell), cell.arm)
    again, found = split_reversals(rest, cell.arm)
    assert found is None and again is rest


def test_steps_that_go_on_are_no_reversal(sharp: Path) -> None:
    """Steps the way a drive came tell nothing of its gap."""
    cell = load_cell(CELL)
    rows = read_measurements(sharp, cell=cell)
    other = rows.with_states(rows.states.with_(direction=-rows.states.direction))
    assert split_reversals(other, cell.arm)[1] is None


def test_a_joint_that_steps_otherwise_than_its_gap_is_not_known(sharp: Path) -> None:
    cell = load_cell(CELL)
    model = fitted(sharp)
    _, found = split_reversals(read_measurements(sharp, cell=cell), cell.arm)
    assert found is not None
    wider = replace(model, values=np.where(
        [name.startswith("backlash.") for name in model.effects.names],
        2.0 * model.values, model.values,
    ))  # fmt: skip
    assert flank_widths(wider, cell.arm, found)[:3] == (UNLIKE,) * 3
    rng = np.random.default_rng(1)
    knocked = found.rows.position + 2e-4 * rng.normal(size=found.rows.position.shape)
    loose = Reversals(replace(found.rows, position=knocked), found.first, found.drive)
    assert flank_widths(model, cell.arm, loose) == (UNLIKE,) * 6


def test_the_model_keeps_what_they_tell(sharp: Path, tmp_path: Path) -> None:
    told = cli("fit", sharp, "--cell", CELL, "-o", tmp_path / "m.json",
               "--effects", ",".join(BASE_EFFECTS))  # fmt: skip
    assert "flanks at stops: joint 1, 2, 3" in " ".join(told.stdout.split())
    model = load_model(tmp_path / "m.json")
    assert len(model.flank_widths) == 6
    widths = ((2.0, 6.0), UNTOLD, *model.flank_widths[2:5], UNLIKE)
    other = replace(model, flank_widths=widths)
    other.save(tmp_path / "again.json")
    again = load_model(tmp_path / "again.json")
    assert again.flank_widths == other.flank_widths and again.id == other.id
    said = [*map(verdict_of, again.flank_widths)]
    assert said[:3] == ["elastic", "", "sharp"]
    asked = {str(joint): UNCERTAIN for joint in range(1, 7)}
    older = replace(again, history=({"in_motion": dict.fromkeys(asked, "not sure")},))
    assert older.in_motion == asked


def test_joints_without_new_reversals_stay_as_they_were_known(sharp: Path) -> None:
    cell, model = load_cell(CELL), fitted(sharp)
    survey = read_measurements(sharp, cell=cell)
    _, found = split_reversals(survey, cell.arm)
    assert found is not None
    few = Reversals(found.rows, found.first[: EACH + 1], found.drive[:EACH])
    drives = sorted({int(drive) for drive in few.drive})
    known = ((2.0, 6.0),) * 6
    widths = newer_widths(known, model, cell.arm, few)
    told = flank_widths(model, cell.arm, few)
    for joint in range(6):
        assert widths[joint] == (told[joint] if joint in drives else (2.0, 6.0))
    assert 0 < len(drives) < 6
    assert newer_widths((), model, cell.arm, few) == told
    assert newer_widths(known, model, cell.arm, None) == known


@pytest.mark.slow
def test_diagnose_reads_the_reversals_of_a_new_survey(
    sharp: Path, tmp_path: Path
) -> None:
    model = tmp_path / "m.json"
    replace(fitted(sharp), flank_widths=()).save(model)
    report = tmp_path / "told.json"
    told = cli("diagnose", sharp, "--cell", CELL, "--model", model, "-o",
               tmp_path / "better.json", "--report", report)  # fmt: skip
    said = json.loads(report.read_bytes())["flanks_at_stops"]
    assert said.startswith("flanks at stops: joint 1, 2, 3")
    assert said in " ".join(told.stdout.split())
    assert len(load_model(tmp_path / "better.json").flank_widths) == 6


def test_a_link_on_its_way_goes_from_flank_to_flank() -> None:
    side = np.linspace(-2.0, 2.0, 41)
    for width in (1.0, 4.0):
        lies = on_the_way(side, width)
        assert (np.diff(lies) >= 0).all()
        assert lies[0] == -1.0 and lies[-1] == 1.0 and abs(lies[20]) < 1e-12
    np.testing.assert_allclose(on_the_way(side, 1.0), np.clip(side, -1, 1))


def test_widths_in_words() -> None:
    sharp, wide = (1.0, 1.25), (1.0, 4.0)
    assert tell_widths((sharp, sharp, wide, UNTOLD, sharp, wide)) == (
        "flanks at stops: joint 1, 2, 5 sharp; joint 3, 6 1 to 4 gaps; "
        "joint 4 uncertain"
    )


def test_what_stays_open_is_told_with_what_it_costs(sharp: Path) -> None:
    cell, model = load_cell(CELL), fitted(sharp)
    rest, _ = split_reversals(read_measurements(sharp, cell=cell), cell.arm)
    jacobian = ArmStates(cell.arm, rest.states).jacobian

    def told(*widths: Width) -> str:
        return tell_open(replace(model, flank_widths=widths), cell.arm, jacobian)

    known, wide, elastic = (1.0, 1.25), (1.0, 2.5), (2.0, 4.0)
    assert tell_open(replace(model, flank_widths=()), cell.arm, jacobian) == ""
    assert told(*[known] * 6) == told(elastic, *[known] * 5)
    assert "no flank" in told(*[known] * 6)
    said = told(known, wide, *[known] * 4)
    joint, cost = re.findall(r"joint (\d) ([0-9.]+) mm", said)[0]
    lever = np.linalg.norm(jacobian[:, :, 1], axis=1).max()
    step = 2e3 * lever * half_gap(model, cell.arm)[1]
    lacks = (1 + np.sin(np.pi / 2 * (1 - 2 / 2.5))) / 2
    assert joint == "2" and float(cost) == pytest.approx(lacks * step, abs=6e-3)
    more = told(known, UNTOLD, *[known] * 4)
    assert float(re.findall(r"([0-9.]+) mm", more)[0]) > float(cost)
