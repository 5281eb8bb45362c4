"""Files that begin a project: of options, of answers; never over others."""

from __future__ import annotations

import pytest

from postproc.cli import setup
from postproc.cli.commands import app
from postproc.cli.project import NAME, read_project
from postproc.robot.cell import load_cell
from tests.written import cli

ARM = ("--arm", "irb6640-185-2.8")


def test_options_make_a_cell(tmp_path):
    place = tmp_path / "cell7"
    made = cli(
        "init", place, *ARM, "--tool", "1,2,3,10,20,30", "--nest", "80,-40,150",
        "--nest", "1,2,3", "--frame", "tracker", "--instrument", 'AT "960"',
        "--absolute-accuracy", "off",
    )  # fmt: skip
    assert made.exit_code == 0, made.stderr
    assert "-o " in made.stderr and "survey.mod" in made.stderr
    cell = load_cell(place / "cell.toml")
    assert cell.tool.record == (1, 2, 3, 10, 20, 30)
    assert cell.probes.tolist() == [[0.08, -0.04, 0.15], [0.001, 0.002, 0.003]]
    assert cell.measurements.frame == "tracker"
    assert cell.measurements.instrument == 'AT "960"'
    assert cell.file.robot.absolute_accuracy is False
    assert "absolute_accuracy" in cell.file.robot.model_fields_set
    project = read_project(place / NAME)
    assert project.cell == place / "cell.toml" and project.source.is_dir()


def test_what_is_not_stated_is_not_written(tmp_path):
    assert cli("init", tmp_path, *ARM).exit_code == 0
    file = load_cell(tmp_path / "cell.toml").file
    assert file.model_fields_set == {"robot"}
    assert file.robot.model_fields_set == {"arm"}


def test_another_language_than_the_arms(tmp_path):
    made = cli("init", tmp_path, "--arm", "ur10", "--language", "krl")
    assert made.exit_code == 0 and "survey.src" in made.stderr
    assert load_cell(tmp_path / "cell.toml").controllers == ("kuka",)


def test_an_arm_file_is_named_from_the_cell(tmp_path, monkeypatch, job_folder):
    from postproc.robot.arm_file import ARMS

    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_bytes((ARMS / "ur10.toml").read_bytes())
    assert cli("init", "cell7", "--arm", "mine.toml").exit_code == 0
    assert load_cell("cell7/cell.toml").arm.name == "ur10"


@pytest.mark.parametrize("name", ["cell.toml", NAME])
def test_no_file_is_overwritten(tmp_path, name):
    (tmp_path / name).write_text("mine")
    made = cli("init", tmp_path, *ARM)
    assert made.exit_code == 2
    assert f"{name}: exists already and is not overwritten. Edit it" in made.stderr
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((), "no arm and no terminal to ask on: give --arm NAME"),
        (("--arm", "irb"), "irb"),
        ((*ARM, "--tool", "1,2"), "--tool 1,2: give 3 or 6 numbers between commas"),
        ((*ARM, "--language", "fanuc"), "give one of pdl2, rapid, krl"),
        ((*ARM, "--nest", "1;2;3"), "--nest 1;2;3: give 3 numbers"),
        ((*ARM, "--tool", "1,2,90000"), "is it in mm?"),
    ],
)
def test_a_wrong_answer_writes_nothing(tmp_path, given, said):
    made = cli("init", tmp_path / "new", *given)
    assert made.exit_code == 2 and said in made.stderr, made.stderr
    assert not (tmp_path / "new").exists()


def test_a_person_is_asked(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    monkeypatch.setattr(setup, "_asks", lambda: True)
    answers = ["kuka", "kr210-r2700-extra", "", "1,2,3", "80,-40,150; 1,2,3", "tracker",
               "AT960", "off"]  # fmt: skip
    found = CliRunner().invoke(app, ["init", str(tmp_path)], input="\n".join(answers))
    assert found.exit_code == 0, found.output
    assert "kr120-r2500-pro, kr210-r2700-extra, kr340-r3330" in found.stderr
    cell = load_cell(tmp_path / "cell.toml")
    assert cell.arm.name == "kr210-r2700-extra" and len(cell.probes) == 2
    assert cell.controllers == ("kuka",)
    assert cell.measurements.frame == "tracker"


@pytest.mark.parametrize(("nests", "warned"), [(2, True), (3, False)])
def test_too_few_reflectors_are_said_at_once(tmp_path, nests, warned):
    given = [("--nest", f"{100 * k},0,100") for k in range(nests)]
    arm = ("--arm", "irb6640-185-2.8")
    found = cli("init", tmp_path, *arm, *(word for pair in given for word in pair))
    assert found.exit_code == 0
    assert (f"{nests} of 3 probe points" in found.stderr) is warned
