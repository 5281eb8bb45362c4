"""`check` and `compensate` with a second opinion, and without its libraries."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from postproc.cli.commands import app
from postproc.verify import extra
from tests.verify.judged import PROGRAMS

ASKING = "\n[verify]\nsecond_opinion = true\n"
INSIST = ("--set", "verify.second_opinion=true")
ALONE = ("--set", "verify.second_opinion=false")


def run(*arguments: object):
    return CliRunner().invoke(app, list(map(str, arguments)))


@pytest.fixture(scope="module")
def desk(tmp_path_factory, bench_model) -> Path:
    """A model, two cells, and a compensated tree."""
    folder = tmp_path_factory.mktemp("desk")
    bench_model.save(folder / "model.json")
    text = (PROGRAMS / "cell.toml").read_text()
    (folder / "cell.toml").write_text(text)
    (folder / "asking.toml").write_text(text + ASKING)
    source = folder / "nominal"
    source.mkdir()
    for name in ("handling.pdl", "spot.pdl", "spot.lsv"):
        shutil.copy(PROGRAMS / name, source / name)
    made = run("batch", source, folder / "made", "--jobs", 1, *given(folder))
    assert made.exit_code <= 1, made.output  # 1: handling shares points
    return folder


@pytest.fixture
def tree(desk, tmp_path) -> Path:
    return Path(shutil.copytree(desk / "made", tmp_path / "made"))


def given(desk: Path) -> tuple[object, ...]:
    return "--cell", desk / "cell.toml", "--model", desk / "model.json"


@pytest.fixture
def nothing_installed(monkeypatch) -> None:
    monkeypatch.setattr(extra, "find_spec", lambda name: None)


def test_check_gives_it_where_cell_and_model_are_given(desk, tree, tmp_path):
    done = run(
        "check",
        tree,
        "--allow-uncorrected",
        *given(desk),
        "--report",
        tmp_path / "told.json",
    )
    assert done.exit_code == 0, done.output
    assert "second opinion: agrees" in done.stderr
    told = json.loads((tmp_path / "told.json").read_text())["second_opinion"]
    assert told["agrees"] and told["programs"] == 2 and not told["skipped"]
    rows = {row["what"]: row for row in told["rows"]}
    assert rows["output: approach directions"]["compared"] > 800
    assert rows["source: place"]["compared"] == rows["output: place"]["compared"] > 100


def test_a_wrong_direction_is_exit_1_and_named(desk, tree):
    record = tree / "handling.pdl.postproc.json"
    told = json.loads(record.read_text())
    targets = told["files"]["handling.pdl"]["targets"]
    k = targets["direction"].index("+", 120)
    flipped = targets["direction"][:k] + "-" + targets["direction"][k + 1 :]
    targets["direction"] = flipped
    record.write_text(json.dumps(told))
    assert run("check", tree, "--allow-uncorrected", *ALONE).exit_code == 0
    done = run("check", tree, "--allow-uncorrected", *given(desk))
    assert done.exit_code == 1
    assert "1 differ" in done.stderr and f"axis {k % 6 + 1}" in done.stderr
    assert "second opinion: disagrees" in done.stderr


def test_a_changed_program_is_judged_by_check_alone(desk, tree):
    text = (tree / "handling.pdl").read_bytes()
    (tree / "handling.pdl").write_bytes(text + b"-- more\r\n")
    done = run("check", tree, "--allow-uncorrected", *given(desk))
    assert done.exit_code == 1 and "handling.pdl: changed" in done.stderr
    assert "second opinion: agrees" in done.stderr


def test_another_model_is_no_ground_for_an_opinion(desk, tree, tmp_path):
    model = json.loads((desk / "model.json").read_text())
    record = tree / "spot.pdl.postproc.json"
    told = json.loads(record.read_text())
    record.write_text(json.dumps(told | {"model": "another"}))
    done = run("check", tree, "--allow-uncorrected", *given(desk))
    assert f"was made with model another, not with {model['id']}" in done.stderr


def test_without_a_cell_there_is_a_note(desk, tree):
    done = run("check", tree, "--allow-uncorrected")
    assert done.exit_code == 0
    assert done.stderr.count("no second opinion on the motion: it needs --cell") == 1
    asked = run("check", tree, "--allow-uncorrected", *INSIST)
    assert asked.exit_code == 2 and "--cell and --model" in asked.stderr


def test_without_its_libraries_there_is_a_note(desk, tree, nothing_installed):
    done = run("check", tree, "--allow-uncorrected", *given(desk))
    assert done.exit_code == 0
    assert done.stderr.count("no second opinion: pin and toppra not installed") == 1
    quiet = run("check", tree, "--allow-uncorrected", *given(desk), *ALONE)
    assert quiet.exit_code == 0 and "opinion" not in quiet.stderr
    asked = run("check", tree, "--allow-uncorrected", *given(desk), *INSIST)
    assert asked.exit_code == 2 and "pip install pin toppra" in asked.stderr


def test_a_broken_library_is_none(desk, tree, monkeypatch):
    monkeypatch.setattr(extra, "find_spec", str)
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    done = run("check", tree, "--allow-uncorrected", *given(desk))
    assert done.exit_code == 0 and "a library is broken" in done.stderr
    asked = run("check", tree, *INSIST, *given(desk))
    assert asked.exit_code == 2 and "pip install pin toppra" in asked.stderr


def compensate(desk: Path, cell: str, folder: Path):
    return run(
        "compensate", PROGRAMS / "spot.pdl", "--cell", desk / cell,
        "--model", desk / "model.json", "-o", folder / "out.pdl",
        "--report", folder / "out.json", "--report", folder / "out.html",
    )  # fmt: skip


def test_compensate_gives_it_where_the_cell_asks(desk, tmp_path):
    done = compensate(desk, "asking.toml", tmp_path)
    assert "second opinion: agrees" in done.stderr
    told = json.loads((tmp_path / "out.json").read_text())["second_opinion"]
    assert told["agrees"] and len(told["rows"]) > 15
    page = (tmp_path / "out.html").read_text()
    assert "<h2>Second opinion</h2>" in page
    assert all(row["what"] in page for row in told["rows"])
    plain = compensate(desk, "cell.toml", tmp_path)
    assert plain.exit_code == 0 and "opinion" not in plain.stderr
    assert "second_opinion" not in json.loads((tmp_path / "out.json").read_text())


def test_compensate_says_that_a_library_is_broken(desk, tmp_path, monkeypatch):
    monkeypatch.setattr(extra, "find_spec", str)
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    done = compensate(desk, "asking.toml", tmp_path)
    assert done.exit_code == 2 and "a library is broken" in done.stderr
    assert not list(tmp_path.iterdir())


def test_compensate_writes_nothing_where_it_cannot(desk, tmp_path, nothing_installed):
    done = compensate(desk, "asking.toml", tmp_path)
    assert done.exit_code == 2 and "pip install pin toppra" in done.stderr
    assert not list(tmp_path.iterdir())
    assert compensate(desk, "cell.toml", tmp_path).exit_code == 0
