"""Commands in a folder with a project file need no further option there."""

from __future__ import annotations

import shutil

import pytest

from postproc.cli import project as project_file
from postproc.cli.project import NAME, find_project
from tests.written import FIRST, POSE, cli, program

PROJECT = """\
cell = "cell.toml"
model = "model.json"
source = "programs"
output = "compensated"
"""


@pytest.fixture
def project(job_folder, tmp_path, monkeypatch):
    """A project's folder, with a cell, a model and a program; the working folder."""
    for name in ("cell.toml", "model.json"):
        shutil.copy(job_folder / name, tmp_path)
    (tmp_path / NAME).write_text(PROJECT)
    (tmp_path / "programs" / "line").mkdir(parents=True)
    (tmp_path / "programs" / "line" / "job.pdl").write_bytes(program(FIRST, POSE))
    monkeypatch.chdir(tmp_path)
    return tmp_path


JOB = "programs/line/job.pdl"
OUTPUT = "compensated/line/job.pdl"


def test_compensate_finds_cell_model_and_output(project):
    given = ("--cell", "cell.toml", "--model", "model.json", "-o", "whole.pdl")
    assert cli("compensate", JOB, *given).exit_code == 0
    assert cli("compensate", JOB).exit_code == 0
    assert (project / OUTPUT).read_bytes() == (project / "whole.pdl").read_bytes()


def test_a_wrong_program_makes_no_folder(project):
    (project / JOB).write_text("PROGRAM job\nVAR\n")
    assert cli("compensate", JOB).exit_code == 2
    assert not (project / "compensated").exists()


def test_the_project_file_is_read_once(project, monkeypatch):
    read = []
    own = project_file.read_project
    monkeypatch.setattr(
        project_file, "read_project", lambda path: read.append(path) or own(path)
    )
    assert cli("compensate", JOB).exit_code == 0
    assert len(read) == 1


@pytest.mark.parametrize("folder", ["programs/line", ".."])
def test_the_project_of_the_program_counts(project, monkeypatch, folder):
    job = (project / JOB).absolute()
    monkeypatch.chdir(project / folder)
    assert cli("compensate", job).exit_code == 0
    assert (project / OUTPUT).exists()


def test_the_nearest_project_counts(project):
    (project / "programs" / "line" / NAME).write_text('cell = "none.toml"\n')
    found = cli("compensate", JOB, "--model", "model.json")
    assert found.exit_code == 2 and "none.toml: cannot be read" in found.stderr


def test_the_project_of_the_working_folder_is_next(project, tmp_path_factory):
    other = tmp_path_factory.mktemp("other") / "away.pdl"
    other.write_bytes(program(FIRST, POSE))
    assert cli("compensate", other).exit_code == 0
    assert (project / "compensated" / "away.pdl").exists()


def test_an_option_counts_before_the_project(project):
    (project / NAME).write_text(PROJECT.replace("cell.toml", "none.toml"))
    assert cli("compensate", JOB).exit_code == 2
    assert cli("compensate", JOB, "--cell", "cell.toml").exit_code == 0


def test_trees_of_the_project(project):
    assert cli("batch", "--jobs", "1").exit_code == 0
    assert (project / OUTPUT).exists()
    assert cli("check", "--set", "verify.second_opinion=false").exit_code == 0
    (project / OUTPUT).unlink()
    found = cli("check", "--set", "verify.second_opinion=false")
    assert found.exit_code == 1 and "job.pdl" in found.stderr


def test_standard_input_has_no_project(project):
    found = cli("compensate", "-", stdin=program(FIRST, POSE))
    assert found.exit_code == 2
    assert "standard input belongs to no project. Give --cell" in found.stderr
    found = cli("compensate", "-", "--cell", "cell.toml", stdin=program(FIRST, POSE))
    assert found.exit_code == 2 and "Give --model MODEL.json" in found.stderr
    given = ("--cell", "cell.toml", "--model", "model.json")
    found = cli("compensate", "-", *given, stdin=program(FIRST, POSE))
    assert found.exit_code == 0 and found.stdout
    assert not (project / "compensated").exists()


def test_without_a_project_the_option_is_asked_for(project):
    (project / NAME).unlink()
    assert find_project() is None
    for command, said in (
        (("compensate", JOB), "no cell: give --cell CELL.toml, or write a project"),
        (("compensate", JOB, "--cell", "cell.toml"), "no model: give --model MODEL"),
        (("fit", "m.csv", "--cell", "cell.toml"), "no model: give -o MODEL.json"),
        (("batch",), "batch: give SRC and DST, or write a project"),
        (("check",), "check: give DIR, or write a project"),
    ):
        found = cli(*command)
        assert found.exit_code == 2 and said in found.stderr, found.stderr
    given = ("--cell", "cell.toml", "--model", "model.json")
    assert cli("compensate", JOB, *given).exit_code == 0
    assert (project / "programs/line/job.compensated.pdl").exists()


def test_explain_shows_the_plan_until_there_is_a_model(project):
    assert "shares" not in cli("explain", JOB).stderr
    with_model = cli("explain", JOB).stdout
    (project / "model.json").unlink()
    plan = cli("explain", JOB)
    assert plan.exit_code == 0 and plan.stdout != with_model
    found = cli("compensate", JOB)
    assert found.exit_code == 2
    assert f"{NAME}: model.json does not exist. Fit it first" in found.stderr


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            'cell = "cell.toml"\nmodle = "m"\n',
            f"{NAME}:2: unknown key @ $.modle. Known",
        ),
        ('cell = "cell.toml"\n\nmodel = 3\n', f"{NAME}:3: Input should be a valid str"),
        ('cell = "cell.toml"\nmodel = \n', f"{NAME}:2: is not valid TOML"),
        (
            'cell = "cell.toml"\n',
            f"no model: give --model MODEL.json, or name it in {NAME}",
        ),
    ],
)
def test_a_wrong_project_file_is_named_with_its_line(project, text, said):
    (project / NAME).write_text(text)
    found = cli("compensate", JOB)
    assert found.exit_code == 2 and said in found.stderr, found.stderr
    assert not (project / "compensated").exists()


# A survey, from init on.


def test_from_an_empty_folder_to_a_model(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = cli(
        "init", "--arm", "kr210-r2700-extra", "--tool", "10,0,250,0,90,0",
        "--nest", "80,-40,150", "--nest", "-60,70,210", "--nest", "20,20,330",
        "--absolute-accuracy", "off", "--instrument", "AT960",
    )  # fmt: skip
    assert made.exit_code == 0, made.stderr
    assert "next: postproc survey --poses 300 -o survey.src" in made.stderr
    assert cli("survey", "--poses", 40, "-o", "survey.src").exit_code == 0
    assert cli("simulate", "survey.src", "-o", "m.csv").exit_code == 0
    assert cli("read", "m.csv").exit_code == 0
    quick = ("fit", "m.csv", "--effects", "geometry")
    assert cli(*quick).exit_code == 0
    model = (tmp_path / "model.json").read_bytes()
    found = cli(*quick)
    assert found.exit_code == 2 and "exists already. Overwrite it with --force" in (
        found.stderr
    )
    assert (tmp_path / "model.json").read_bytes() == model
    assert cli(*quick, "--force").exit_code == 0
    assert cli(*quick, "-o", "model.json").exit_code == 0  # who names it means it
