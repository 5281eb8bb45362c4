"""A robot's life from the command line: checks, an event, a refresh, stale programs."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result
from typer.testing import CliRunner

from postproc.cli.commands import app
from postproc.files import schema
from postproc.model.model import load_model
from postproc.record.database import open_record
from postproc.record.rows import ModelRow, ProgramRow, VerdictRow
from tests.record.conftest import Drawn
from tests.record.drawn_robots import (
    PROGRAMS,
    check_poses,
    measure,
    write_cell,
    write_readings,
)

MOVED = 4e-4  # [rad] zero of joint 3


@pytest.fixture(scope="module")
def home(drawn: Drawn, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a project with a program and readings of checks."""
    folder = tmp_path_factory.mktemp("plant")
    write_cell(folder / "cell.toml", "R010")
    drawn.model.save(folder / "model.json")
    (folder / "nominal").mkdir()
    shutil.copy(PROGRAMS / "drilling.pdl", folder / "nominal")
    (folder / "postproc.toml").write_text(
        'cell = "cell.toml"\nmodel = "model.json"\nsource = "nominal"\n'
        'output = "compensated"\n'
    )
    theta = drawn.robot.dh_theta.copy()
    theta[2] += MOVED
    moved, rng = replace(drawn.robot, dh_theta=theta), np.random.default_rng(3)
    for name, robot in (
        ("check1", drawn.robot), ("check2", drawn.robot), ("moved", moved),
        ("fresh", moved), ("later", moved),
    ):  # fmt: skip
        write_readings(folder / f"{name}.csv", measure(robot, *drawn.poses, rng))
    return folder


def run(*words: str) -> Result:
    return CliRunner().invoke(app, [*words])


@pytest.fixture(autouse=True)
def _there(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(home)


def test_a_life_is_told_from_survey_to_refreshed_programs(home: Path) -> None:
    assert run("robot", "add", "R010", "--line", "3").exit_code == 0
    assert run("batch").exit_code == 0
    for k in (1, 2):
        found = run("robot", "check", "R010", f"check{k}.csv", "--at", f"2031-0{k}-01")
        assert found.exit_code == 0, found.output
    found = run("robot", "check", "R010", "moved.csv", "--at", "2031-03-01")
    assert found.exit_code == 1
    assert "zero of joint 3" in found.stdout
    assert "postproc robot event R010 remastered --joints 3" in found.stdout
    words = (
        "robot",
        "event",
        "R010",
        "remastered",
        "--joints",
        "3",
        "--at",
        "2031-03-02",
    )
    assert run(*words).exit_code == 0
    words = (
        "robot",
        "refresh",
        "R010",
        "fresh.csv",
        "-o",
        "new.json",
        "--at",
        "2031-03-03",
    )
    found = run(*words)
    assert found.exit_code == 1, found.output  # the program is stale
    assert "drilling.pdl" in found.stdout
    new = load_model(home / "new.json")
    before = load_model(home / "model.json")
    theta = new.effects.names.index("geometry.theta3")
    old = before.effects.names.index("geometry.theta3")
    assert abs(new.values[theta] - before.values[old] - MOVED) < 5e-5
    found = run("robot", "check", "R010", "later.csv", "--at", "2031-04-01")
    assert found.exit_code == 0, found.output


def test_stale_programs_alone_are_made_again(home: Path) -> None:
    text = (home / "postproc.toml").read_text()
    (home / "postproc.toml").write_text(text.replace("model.json", "new.json"))
    assert "1 " in run("robot", "list").stdout
    before = (home / "compensated" / "drilling.pdl").read_bytes()
    assert run("batch", "--stale").exit_code == 0
    assert (home / "compensated" / "drilling.pdl").read_bytes() != before
    with open_record(home / "plant.sqlite") as record:
        last = record.rows(ProgramRow, "R010")[-1]
        current = [m for m in record.rows(ModelRow) if m.state == "current"]
    assert [m.id for m in current] == [last.model]
    words = "compensate", "nominal/drilling.pdl", "-o", "x.pdl"
    old = run(*words, "--model", "model.json")
    assert f"but {last.model} (new.json) is the newest" in old.stderr
    new = run(*words)
    assert "is the newest" not in new.stderr
    made = (home / "compensated" / "drilling.pdl").stat().st_mtime_ns
    assert run("batch", "--stale").exit_code == 0
    assert (home / "compensated" / "drilling.pdl").stat().st_mtime_ns == made


def test_the_same_readings_are_recorded_once(home: Path) -> None:
    with open_record(home / "plant.sqlite") as record:
        before = len(record.rows(VerdictRow))
    words = "later.csv", "--at", "2031-04-01", "--report", "-"
    found = run("robot", "check", "R010", *words)
    told = json.loads(found.stdout)
    assert [*told.items()][:2] == [*schema("robot-check").items()]
    assert (told["robot"], told["in_control"]) == ("R010", True)
    with open_record(home / "plant.sqlite") as record:
        assert len(record.rows(VerdictRow)) == before


def test_a_page_shows_every_robot_and_asks_the_network_for_nothing(home: Path) -> None:
    assert run("robot", "page", "-o", "plant.html").exit_code == 0
    page = (home / "plant.html").read_text()
    assert page.count("<circle") == 4
    assert "remastered 3" in page
    schemas = "http://schemas.openxmlformats.org"  # names, which nothing asks for
    assert "http" not in page.replace("http-equiv", "").replace(schemas, "")
    found = run("robot", "show", "R010")
    assert [line.split()[1] for line in found.stdout.splitlines()[1:]].count(
        "check:"
    ) == 4


def test_another_robot_takes_over_its_programs(home: Path, drawn: Drawn) -> None:
    write_cell(home / "cell11.toml", "R011")
    provenance = drawn.model.provenance
    drawn_model = replace(drawn.model, provenance=provenance and replace(
        provenance, serial_number="R011"))  # fmt: skip
    drawn_model.save(home / "model11.json")
    words = ["robot", "add", "R011", "--cell", "cell11.toml", "--model", "model11.json"]
    assert run(*words).exit_code == 0
    (home / "nominal" / "drilling.pdl").rename(home / "drilling.away")
    try:  # the record beside the compensated program gives it back
        found = run("robot", "replace", "R010", "R011", "-o", "taken")
    finally:
        (home / "drilling.away").rename(home / "nominal" / "drilling.pdl")
    assert "1 of 1 programs written" in found.stdout, found.output
    assert len([*(home / "taken").glob("*.pdl")]) == 1
    found = run("robot", "replace", "R010", "R011", "-o", "taken")
    assert found.exit_code == 2
    assert "replaced by R011 already" in found.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["show", "R099"], "has no robot R099. Add it"),
        (["event", "R010", "holiday"], "no event 'holiday'. One of remastered"),
        (["event", "R010", "tool", "--joints", "2"], "Leave --joints out"),
        (["event", "R010", "motor", "--joints", "7"], "numbered 1 to 6"),
        (["event", "R010", "motor", "--joints", "x"], "Write numbers, as 2,3"),
        (["event", "R010", "motor", "--at", "soon"], "write a date"),
        (["event", "R010", "motor", "--at", "2001-01-01"], "before"),
        (["check", "R010", "none.csv"], "none.csv"),
        (["check", "R010", "check1.csv", "--at", "2001-01-01"], "before"),
        (["add", "R012"], "is of the robot R010, not of R012"),
        (["list", "--record", "cell.toml"], "no record of robots"),
    ],
)
def test_wrong_input_is_refused_with_a_cure(
    home: Path, words: list[str], said: str
) -> None:
    found = run("robot", *words)
    assert found.exit_code == 2, found.output
    assert said in found.stderr


def test_few_readings_are_refused(home: Path, drawn: Drawn) -> None:
    q, side = check_poses(np.random.default_rng(9))
    rows = measure(drawn.robot, q[:1], side[:1], np.random.default_rng(9))
    write_readings(home / "few.csv", rows)
    found = run("robot", "check", "R010", "few.csv")
    assert found.exit_code == 2
    assert "readings of the arm" in found.stderr
