"""The survey program in every language: the same poses, sides, readings and model."""

from __future__ import annotations

import csv
import shutil

import numpy as np
import pytest

from postproc.calibration.fit import fit
from postproc.calibration.survey_program import BACK, write_survey
from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Status
from postproc.compensation.output.sidecar import restore_file
from postproc.compensation.program import plan_visits, read_program
from postproc.compensation.program_files import find_pages
from postproc.language.languages import languages
from postproc.language.measuring_program import SHARE, name_of_file
from postproc.report.simulation import simulate_file
from postproc.robot.cell import load_cell
from tests.any_controller import any_controller
from tests.conftest import ROOT
from tests.written import cli

POSES = 24
SUFFIXES = [language.suffixes[0] for language in languages()]
ARMS = {"nj130-2.6": ".pdl", "irb4600-60-2.05": ".mod", "kr210-r2700-extra": ".src"}
NESTS = "[survey]\npoints_mm = [[100, 0, 100], [0, 100, 150], [-100, 0, 200]]\n"
JOBS = dict(zip(ARMS, (".", "welding", "facing"), strict=True))
MAIN = {"milling.pdl", "Welding.mod", "Facing.src"}
PLACES = ["id", "x_mm", "y_mm", "z_mm"]
LOAD = "[payload]\nmass_kg = 45.5\ncom_mm = [10, -20, 150]\n"


def written(folder, cell, suffix, poses=POSES):
    path = folder / f"s{suffix}"
    write_survey(cell, path, poses)
    return path


def read(path, cell):
    found = read_program({path.name: path.read_bytes()}, cell)
    assert found.diagnostics == ()
    return found.visits


@pytest.fixture(scope="module")
def cell():
    place = ROOT / "programs" / "cell.toml"
    return any_controller(load_cell(place, changes=["survey.reversals=1"]))


@pytest.fixture(scope="module")
def surveys(cell, tmp_path_factory):
    folder = tmp_path_factory.mktemp("survey")
    return [written(folder, cell, suffix) for suffix in SUFFIXES]


def test_all_languages_are_read_back_as_one_survey(cell, surveys):
    first, *others = (read(path, cell) for path in surveys)
    sides = plan_visits(first, cell).plan.direction
    assert len(first) > 4 * POSES  # reversals too
    for other in others:
        np.testing.assert_array_equal(other.target.values[:, :6], first.target.values)
        assert other.place.measure_id == first.place.measure_id
        np.testing.assert_array_equal(plan_visits(other, cell).plan.direction, sides)
        tools = [v.frame.poses[v.frame.tool][:, :3, 3] for v in (first, other)]
        np.testing.assert_allclose(*tools, atol=1e-9)
        assert not other.motion.fly.any()
    assert (first.speed.override == SHARE / 100).all()  # of the axes, by PDL2


@pytest.mark.parametrize(("arm", "suffix"), ARMS.items())
def test_every_arm_gets_the_language_of_its_controller(tmp_path, arm, suffix):
    place = tmp_path / "cell.toml"
    place.write_text(f'[robot]\narm = "{arm}"\n{NESTS}{LOAD}')
    own = load_cell(place)
    path = written(tmp_path, own, suffix)
    visits = read(path, own)
    q = np.deg2rad(visits.target.values[:, :6])
    assert (own.arm.lower <= q).all() and (q <= own.arm.upper).all()
    begins, ends = q[0:-1:2], q[1::2]
    np.testing.assert_allclose(np.abs(ends - begins), BACK, atol=1e-6)
    assert write_survey(own, tmp_path / "plain", POSES)
    text = path.read_bytes().replace(b"MODULE s", b"MODULE plain")
    text = text.replace(b"DEF s", b"DEF plain").replace(b"PROGRAM s", b"PROGRAM plain")
    assert (tmp_path / "plain").read_bytes() == text.replace(b"END s", b"END plain")
    for other in set(SUFFIXES) - {suffix}:
        found = cli("survey", "--cell", place, "-o", tmp_path / f"no{other}")
        assert found.exit_code == 2
        assert f"Write no{suffix}; if the controller is of " in found.stderr
        assert not (tmp_path / f"no{other}").exists()


@pytest.mark.parametrize("suffix", SUFFIXES[1:])
def test_the_load_of_the_cell_is_stated(tmp_path, suffix):
    arm = next(arm for arm, own in ARMS.items() if own == suffix)
    place, robot = tmp_path / "cell.toml", f'[robot]\narm = "{arm}"\n{NESTS}'
    loads = []
    for more in ("", LOAD):
        place.write_text(robot + more)
        own = load_cell(place)
        loads.append(read(written(tmp_path, own, suffix, 20), own).motion.loads)
    assert not np.isfinite(loads[0][:, 0]).any() or (loads[0][:, 0] < 0.01).all()
    np.testing.assert_allclose(loads[1][-1][:4], [45.5, 0.01, -0.02, 0.15])


@pytest.fixture(scope="module")
def models(cell, surveys, tmp_path_factory):
    """Fit a model to readings that name places and ids alone, in every language."""
    folder = tmp_path_factory.mktemp("readings")
    models = []
    for path in surveys:
        simulate_file(path, cell).write(folder / "all.csv")
        with (folder / "all.csv").open() as rows:
            table = [[row[name] for name in PLACES] for row in csv.DictReader(rows)]
        readings = folder / "points.csv"
        with readings.open("w") as out:
            csv.writer(out).writerows([PLACES, *table])
        effects = ("geometry", "backlash")
        models.append(fit(readings, cell=cell, program=path, effects=effects).model)
    return models


def test_readings_give_one_model_in_every_language(models):
    first, *others = models
    for other in others:
        assert other.effects.names == first.effects.names
        np.testing.assert_allclose(other.values, first.values, atol=1e-9)


def test_a_survey_is_compensated_like_any_program(cell, models, surveys, tmp_path):
    outputs = tmp_path / "out"
    first, *others = (compensate(path, cell, models[0]) for path in surveys)
    assert (first.decisions.status == Status.CORRECTED).mean() > 0.8
    for other, path in zip((first, *others), surveys, strict=True):
        np.testing.assert_array_equal(other.decisions.status, first.decisions.status)
        written = other.save(outputs)[-1]
        assert written.name == path.name
        back = restore_file(written, tmp_path / path.name)[0]
        assert back.read_bytes() == path.read_bytes()
    given = ("--cell", cell.path, "--model", tmp_path / "model.json")
    models[0].save(tmp_path / "model.json")
    assert cli("check", outputs, *given, "--allow-uncorrected").exit_code == 0


@pytest.mark.parametrize("arm", ARMS)
def test_a_survey_in_the_folder_of_a_job_is_no_part_of_it(tmp_path, arm):
    folder = tmp_path / "job"
    shutil.copytree(ROOT / "programs" / JOBS[arm], folder)
    job = next(path for path in folder.glob("*") if path.name in MAIN)
    before = find_pages(job)
    place = tmp_path / "cell.toml"
    place.write_text(f'[robot]\narm = "{arm}"\n{NESTS}')
    survey = written(folder, load_cell(place), ARMS[arm])
    assert find_pages(job) == before
    assert find_pages(survey).paths == ()


def test_a_survey_of_one_probe_point_says_what_it_is_worth(tmp_path):
    place = tmp_path / "cell.toml"
    place.write_text('[robot]\narm = "nj220-2.7"\n')
    told = write_survey(load_cell(place), tmp_path / "s.pdl", POSES)
    assert "1 of 3 probe points: the model will hold only for" in told


@pytest.mark.parametrize(
    "name", ["kuka-survey", "2nd", "a_name_that_has_too_many_letters"]
)
def test_a_source_is_called_as_its_file(desk, tmp_path, name):
    place = tmp_path / f"{name}.src"
    found = cli("survey", "--cell", desk.cell, "--poses", "20", "-o", place)
    assert found.exit_code == 2 and name_of_file(name) in found.stderr
    assert not place.exists()
