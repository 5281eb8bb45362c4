"""From measurement files to a model, as a user does it."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.effect_selection import fit_survey, model_of
from postproc.calibration.fit import fit
from postproc.calibration.measurements import DroppedRow
from postproc.calibration.report import FitReport, find, report_fit
from postproc.calibration.survey_files import read_measurements
from postproc.exceptions import MeasurementError, PostprocError
from postproc.model.effects import BASE_EFFECTS
from postproc.model.kinematics import ArmStates
from postproc.model.model import load_model
from postproc.model.statistics import ErrorStatistics
from postproc.report.fit import tell_fit
from postproc.robot.cell import Cell, load_cell
from tests.calibration.simulator import (
    NJ,
    PLATE,
    TOOL,
    random_arm,
    random_states,
    survey_of,
)
from tests.written import cli


def write(path: Path, n: int = 200, seed: int = 0, points: int = 1) -> Path:
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    states = random_states(n, rng, PLATE[:points])
    measured, _ = arm.measure(states, rng)
    measured[7] = 0.0
    measured[9] += [0.003, 0.0, 0.0]
    names = [f"q{j}_deg" for j in range(1, 7)] + [f"lambda{j}" for j in range(1, 7)]
    lines = [",".join(["id", *names, "x_mm,y_mm,z_mm,tool_id"])]
    for k in range(n):
        q = [f"{v:.6f}" for v in np.rad2deg(states.q[k])]
        side = [str(int(v)) for v in states.direction[k]]
        xyz = [f"{v:.5f}" for v in measured[k] * 1e3]
        lines.append(",".join([str(k + 1), *q, *side, *xyz, str(states.tool_id[k])]))
    path.write_text("\n".join(lines) + "\n")
    return path


def cell(tmp_path: Path, points: int = 1) -> Cell:
    path = tmp_path / "cell.toml"
    plate = ", ".join(
        str([float(round(v, 6)) for v in p * 1e3]) for p in PLATE[:points]
    )
    path.write_text(
        '[robot]\narm = "nj220-2.7"\n[tool]\nxyz_mm = [80.0, -40.0, 150.0]\n'
        f"[survey]\npoints_mm = [{plate}]\n[measurements]\nlambda_sign = 1\n"
    )
    return load_cell(path)


def test_a_survey_becomes_a_model_with_a_report(tmp_path: Path) -> None:
    found = fit(write(tmp_path / "s.csv"), cell=cell(tmp_path), effects=BASE_EFFECTS)
    report = found.report
    assert report.before.mean_mm > 1.0 > 0.06 > report.after.mean_mm
    assert [d.id for d in report.dropped] == ["8", "10"]
    assert "beam" in report.dropped[0].why and "disagree" in report.dropped[1].why
    assert sum(report.shares.values()) == pytest.approx(1.0, abs=0.01)
    row = next(r for r in report.parameters if r.name == "backlash.b2")
    assert row.unit == "mrad" and row.std_error < 0.05 and row.determined > 0.9
    pairs = [{u.name, *u.partners} for u in report.unseen]
    assert any({"geometry.base_z", "geometry.d1"} <= p for p in pairs)
    assert found.model.rows == 198
    found.model.save(tmp_path / "m.json")
    assert load_model(tmp_path / "m.json").id == found.model.id


def test_the_same_files_give_the_same_model(tmp_path: Path) -> None:
    path = write(tmp_path / "s.csv")
    ids = {
        fit(path, cell=cell(tmp_path), effects=BASE_EFFECTS).model.id for _ in range(2)
    }
    assert len(ids) == 1


def test_a_probe_plate_has_nests_of_the_set_up(tmp_path: Path) -> None:
    path = write(tmp_path / "s.csv", points=3)
    model = fit(path, cell=cell(tmp_path, 3), effects=BASE_EFFECTS).model
    assert "probe" in {e.name for e in model.effects.effects}
    assert "probe" not in {e.name for e in model.compensable()[0].effects}
    assert model.ranges.see_all_rotations


def test_methods_of_the_source_are_fitted_from_files(tmp_path: Path) -> None:
    path = write(tmp_path / "s.csv")
    found = fit(path, cell=cell(tmp_path), method="elm", seed=4)
    assert found.model.method == "elm" and not found.report.parameters
    held = random_states(10, np.random.default_rng(0), TOOL[None])
    assert found.model.predict(NJ, held).error.shape == (10, 3)
    told = tell_fit(found.report)
    assert "measured error" in told and "repeatability" not in told  # never estimated


def test_all_rows_from_one_side_name_the_backlash(tmp_path: Path) -> None:
    path = write(tmp_path / "s.csv")
    rows = [line.split(",") for line in path.read_text().splitlines()]
    for row in rows[1:]:
        row[7:13] = ["1"] * 6
    path.write_text("\n".join(",".join(r) for r in rows) + "\n")
    report = fit(path, cell=cell(tmp_path), effects=("geometry", "backlash")).report
    named = {n for u in report.unseen for n in (u.name, *u.partners)}
    assert {"backlash.b1", "backlash.b2", "backlash.b3"} <= named


def test_what_cannot_be_fitted_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "s.csv")
    with pytest.raises(PostprocError, match="needs the payload"):
        fit(path, cell=cell(tmp_path), effects=("geometry", "payload"))
    with pytest.raises(PostprocError, match="no effect 'gravity'"):
        fit(path, cell=cell(tmp_path), effects=("gravity",))
    few = tmp_path / "few.csv"
    few.write_text("\n".join(path.read_text().splitlines()[:7]) + "\n")
    with pytest.raises(MeasurementError, match="determine"):
        fit(few, cell=cell(tmp_path))


def test_fit_prints_what_an_engineer_reads(tmp_path: Path) -> None:
    data = write(tmp_path / "s.csv")
    cell(tmp_path)
    found = cli(
        "fit", data, "--cell", tmp_path / "cell.toml", "-o", tmp_path / "m.json",
        "--effects", ",".join(BASE_EFFECTS),
    )  # fmt: skip
    assert found.exit_code == 0, found.stderr
    lines = found.stdout.splitlines()
    assert lines[0].startswith("error expected on new poses 0.0")
    assert lines[1].split() == "found joint rms mm max mm evidence".split()
    rows = [line.split() for line in lines if re.match(r"(geometry|backlash) ", line)]
    sizes = [float(row[-3]) for row in rows]
    assert sizes == sorted(sizes, reverse=True) and sizes[0] > 0.1
    assert {row[-1] for row in rows} <= {"likely", "strong"}
    assert "nats" not in found.stdout
    assert "row 8 (line 9): position 0, 0, 0: beam lost" in lines
    assert any("parameters not determined by the rows, " in line for line in lines)
    assert len(lines) < 40


def test_all_of_a_fit_is_in_its_report(tmp_path: Path) -> None:
    data = write(tmp_path / "s.csv")
    cell(tmp_path)
    found = cli(
        "fit", data, "--cell", tmp_path / "cell.toml", "-o", tmp_path / "m.json",
        "--effects", ",".join(BASE_EFFECTS), "--report", "-",
    )  # fmt: skip
    assert found.exit_code == 0, found.stderr
    report = json.loads(found.stdout)
    named = {row["name"]: row for row in report["parameters"]}
    row = named["geometry.a2"]
    assert row["unit"] == "mm" and 0 < row["std_error"] < 0.02 and row["share"] > 0
    shares = report["shares"].values()
    assert len(shares) == 3 and sum(shares) == pytest.approx(1.0, abs=0.01)
    pairs = report["correlated"]
    assert pairs and all(abs(value) > 0.9 for _, _, value in pairs)
    dropped = {row["line"]: row["why"] for row in report["dropped"]}
    assert dropped[9] == "position 0, 0, 0: beam lost"
    said = r"dropped: off by [\d.]+ mm, [\d.]+ sigma; its neighbours disagree"
    assert re.fullmatch(said, dropped[11])


@pytest.mark.slow
def test_what_free_forms_predict_is_told(
    job_folder, free_model, tmp_path: Path
) -> None:
    """By `fit` of its rows, by `predict` of every row; `none` where there are none."""
    data, given = job_folder / "survey.csv", ("--cell", job_folder / "cell.toml")
    model, out = tmp_path / "free.json", tmp_path / "predicted.csv"
    free_model.save(model)
    found = cli("predict", data, *given, "--model", model, "-o", out)
    assert found.exit_code == 0, found.stderr
    rows = np.genfromtxt(out, delimiter=",", names=True)
    error, std = (
        np.stack([rows[f"free_{k}{axis}_mm"] for axis in "xyz"], axis=1) for k in "ds"
    )
    rms, sure = (np.sqrt((v**2).sum(axis=1).mean()) for v in (error, std))
    told = f"of it free forms (joint_map, elm): {rms:.3f} +- {sure:.3f} mm rms"
    assert told in found.stderr + found.stdout
    named = cli("predict", data, *given, "--model", job_folder / "model.json")
    assert "free" not in named.stdout + named.stderr
    for names, wanted in (
        (BASE_EFFECTS, "free forms: none, the named effects predict every correction"),
        ((*BASE_EFFECTS, "joint_map", "elm"), told.removeprefix("of it ")),
    ):
        fitted = cli("fit", data, *given, "-o", model, "--effects", ",".join(names))
        assert wanted in fitted.stdout.splitlines()


def test_predict_knows_where_the_payload_hangs(tmp_path: Path) -> None:
    """Rows are read as a survey's are: the cell tells the payload's centre of mass."""
    data, setup = write(tmp_path / "loaded.csv", 60), tmp_path / "cell.toml"
    header, *rows = data.read_text().splitlines()
    loaded = [f"{header},payload_kg", *(f"{row},120" for row in rows)]
    data.write_text("\n".join(loaded) + "\n")
    bare = cell(tmp_path)
    with setup.open("a") as file:
        file.write("[payload]\nmass_kg = 120.0\ncom_mm = [-300.0, 0.0, -100.0]\n")
    model, out, given = tmp_path / "m.json", tmp_path / "out.csv", ("--cell", setup)
    found = cli("fit", data, *given, "-o", model, "--effects", "geometry,compliance")
    assert found.exit_code == 0, found.stderr
    assert cli("predict", data, *given, "--model", model, "-o", out).exit_code == 0
    told = np.genfromtxt(out, delimiter=",", names=True)
    moved = np.stack([told[f"d{axis}_mm"] for axis in "xyz"], axis=1)
    kept, setups = ~np.isnan(moved[:, 0]), (load_cell(setup), bare)
    right, wrong = (
        load_model(model)
        .predict(one.arm, read_measurements(data, cell=one).states)
        .error
        for one in setups
    )
    np.testing.assert_allclose(moved[kept], right * 1e3, atol=1e-5)
    assert np.abs(right - wrong).max() > 1e-5


def test_rows_without_a_payload_carry_that_of_the_cell(tmp_path: Path) -> None:
    """Compensation takes it to hang there; a fit without it would count it twice."""
    bare = write(tmp_path / "bare.csv", 60)
    header, *rows = bare.read_text().splitlines()
    told, some = tmp_path / "told.csv", tmp_path / "some.csv"
    for path, kept in ((told, 60), (some, 40)):
        ends = [",120" if k < kept else "," for k in range(len(rows))]
        loaded = [f"{header},payload_kg", *map("".join, zip(rows, ends, strict=True))]
        path.write_text("\n".join(loaded) + "\n")
    cell(tmp_path)
    with (tmp_path / "cell.toml").open("a") as file:
        file.write("[payload]\nmass_kg = 120.0\ncom_mm = [-300.0, 0.0, -100.0]\n")
    given = load_cell(tmp_path / "cell.toml")
    whole, *others = (
        read_measurements(path, cell=given) for path in (told, bare, some)
    )
    assert not any("payload" in text for text in whole.warnings)
    for other, which in zip(others, ("rows", "20 rows"), strict=True):
        np.testing.assert_array_equal(other.states.payload, whole.states.payload)
        said = f"no payload_kg: {which} assumed to be measured with the payload of the"
        assert any(text.startswith(said) for text in other.warnings)


def test_what_physics_forbids_is_marked(tmp_path: Path) -> None:
    """A joint that rises under its load has no negative stiffness."""
    rng = np.random.default_rng(5)
    states = random_states(300, rng)
    batch = ArmStates(NJ, states)
    torque = batch.loads.gravity[:, 1]
    told = {}
    for sign in (1.0, -1.0):
        lifted = sign * 2e-7 * torque[:, None] * batch.jacobian[:, :, 1]
        noise = 2e-5 * rng.standard_normal((300, 3))
        survey = survey_of(states, batch.walk.tcp + lifted + noise)
        fitted = fit_survey(survey, NJ, ("geometry", "compliance"), None)
        told[sign] = report_fit(fitted, survey, model_of(fitted, survey))
    assert not any(f.impossible for f in told[1.0].found)
    bad = [f for f in told[-1.0].found if f.impossible]
    assert [(f.effect, f.joint) for f in bad] == [("compliance", 2)]
    assert "k2 = -0.2" in bad[0].impossible[0] and "is negative" in bad[0].impossible[0]
    assert "IMPOSSIBLE: k2 = -0.2" in tell_fit(told[-1.0])


def test_sizes_and_evidence_are_those_of_what_was_planted() -> None:
    rng = np.random.default_rng(6)
    states = random_states(300, rng)
    batch = ArmStates(NJ, states)
    gap = 1.5e-4 * states.direction[:, 2, None] * batch.jacobian[:, :, 2]
    noise = 2e-5 * rng.standard_normal((300, 3))
    survey = survey_of(states, batch.walk.tcp + gap + noise)
    found = find(fit_survey(survey, NJ, BASE_EFFECTS, None))
    planted = next(f for f in found if (f.effect, f.joint) == ("backlash", 3))
    true = np.linalg.norm(gap, axis=1) * 1e3
    assert planted.size_mm == pytest.approx(np.sqrt((true**2).mean()), rel=0.02)
    assert planted.max_mm == pytest.approx(true.max(), rel=0.02)
    assert planted.evidence > 500
    others = [f for f in found if f.effect == "backlash" and f.joint != 3]
    assert max(f.evidence for f in others) < 3.0


def test_a_report_says_what_is_suspect_in_few_lines() -> None:
    rows = tuple(DroppedRow(str(k), k, "dropped") for k in range(50))
    spared = tuple(map(str, range(60, 80)))
    nothing = ErrorStatistics.of(np.zeros((3, 3)))
    report = FitReport((), {}, (), rows, spared, (), nothing, nothing, 0, 0, 0, ())
    told = tell_fit(report).splitlines()
    assert "and 42 more rows that count less" in told
    assert sum(line.startswith("row ") for line in told) == 8
    kept = next(line for line in told if line.startswith("suspect, but used"))
    assert kept.endswith("row 60, 61, 62, 63, 64, 65, 66, 67 and 12 more")


def test_a_fit_says_what_the_arm_file_leaves_out(tmp_path: Path) -> None:
    data = write(tmp_path / "s.csv")
    whole = cell(tmp_path)
    file = whole.arm.file
    joints = file.joints.model_copy(
        update={"velocity_deg_s": None, "acceleration_deg_s2": None}
    )
    bare = file.model_copy(update={"links": None, "opw": None, "joints": joints})
    poor = replace(whole, arm=replace(whole.arm, file=bare))
    told = fit(data, cell=poor, effects=BASE_EFFECTS).report.warnings
    assert [re.findall(r"no (\[?\w+\]?):", t) for t in told] == [["[links]"]]
    assert fit(data, cell=whole, effects=BASE_EFFECTS).report.warnings == ()
    lines = [line.split(",") for line in data.read_text().splitlines()]
    data.write_text("\n".join(",".join(x[:7] + x[13:]) for x in lines) + "\n")
    told = fit(data, cell=poor, effects=BASE_EFFECTS).report.warnings
    assert "drive_coupling" in told[-1]
