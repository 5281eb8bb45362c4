"""Every JSON output begins with what it is and the version of its keys."""

from __future__ import annotations

import json

import pytest

from postproc.files import SCHEMAS
from tests.plant import program
from tests.written import cli

COMMANDS = {
    "check": ("check", "out", "--report", "-"),
    "comparison": ("compare", "rows.csv", "--cell", "cell.toml", "--report", "-"),
    "difference": ("diff", "job.pdl", "out/job.pdl", "--report", "-"),
    "explanation": ("explain", "job.pdl", "--cell", "cell.toml", "--report", "-"),
    "fit": (
        "fit", "rows.csv", "--cell", "cell.toml", "-o", "m.json",
        "--effects", "geometry", "--report", "-",
    ),
    "history": ("history", "model.json", "--report", "-"),
    "iso9283": ("iso9283", "poses.csv", "--report", "-"),
    "report": (
        "compensate", "job.pdl", "--cell", "cell.toml", "--model", "model.json",
        "-o", "new.pdl", "--report", "-",
    ),
    "simulation": (
        "simulate", "job.pdl", "--cell", "cell.toml", "--reference", "job.pdl",
        "--report", "-",
    ),
    "tree": (
        "batch", "nominal", "tree", "--cell", "cell.toml", "--model", "model.json",
        "--jobs", "1", "--report", "-",
    ),
}  # fmt: skip
# Looked at where they are made: tests/cli/test_diagnose_path, tests/record/test_robots.
SLOW = {"diagnosis", "robot-check"}


@pytest.fixture(scope="module")
def folder(job_folder, tmp_path_factory):
    """A folder with a cell, a model, a survey, a program and its output."""
    place = tmp_path_factory.mktemp("schemas")
    for name in ("cell.toml", "model.json"):
        (place / name).write_bytes((job_folder / name).read_bytes())
    (place / "rows.csv").write_bytes((job_folder / "survey.csv").read_bytes())
    head = "pose,cycle,x_cmd_mm,y_cmd_mm,z_cmd_mm,x_mm,y_mm,z_mm\n"
    (place / "poses.csv").write_text(head + "P1,1,0,0,0,0,0,1\nP1,2,0,0,0,0,0,2\n")
    (place / "job.pdl").write_bytes(program("job", 2, 1))
    for name in ("out", "nominal"):
        (place / name).mkdir()
    (place / "nominal" / "job.pdl").write_bytes(program("job", 2, 1))
    given = ("--cell", place / "cell.toml", "--model", place / "model.json")
    cli("compensate", place / "job.pdl", *given, "-o", place / "out" / "job.pdl")
    return place


def test_every_schema_is_looked_at():
    assert set(COMMANDS) | SLOW == set(SCHEMAS)


@pytest.mark.parametrize("kind", COMMANDS)
def test_a_json_output_says_what_it_is(folder, monkeypatch, kind):
    monkeypatch.chdir(folder)
    done = cli(*COMMANDS[kind])
    assert done.exit_code in (0, 1), done.stderr
    head = list(json.loads(done.stdout).items())[:2]
    assert head == [("schema", f"postproc-{kind}"), ("version", SCHEMAS[kind])]
