"""Trees of which a plan leaves programs out."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from postproc.cli.commands import app
from tests.verify.judged import PROGRAMS

INSIST = ("--set", "verify.second_opinion=true")


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, list(map(str, arguments)))


@pytest.fixture(scope="module")
def desk(tmp_path_factory, bench_model) -> Path:
    """A model, a compensated tree of two programs, and a plan for one of them."""
    folder = Path(tmp_path_factory.mktemp("plans"))
    bench_model.save(folder / "model.json")
    shutil.copy(PROGRAMS / "cell.toml", folder)
    (folder / "nominal").mkdir()
    for name in ("handling.pdl", "spot.pdl", "spot.lsv"):
        shutil.copy(PROGRAMS / name, folder / "nominal")
    given = "--cell", folder / "cell.toml", "--model", folder / "model.json"
    run("batch", folder / "nominal", folder / "made", "--jobs", 1, *given)
    rule = 'pattern = "spot*"\ncell = "cell.toml"\nmodel = "model.json"\n'
    (folder / "plan.toml").write_text(f"[[rule]]\n{rule}")
    return folder


@pytest.mark.parametrize(("asked", "code"), [((), 0), (INSIST, 2)])
def test_a_program_without_a_rule_is_named(desk, tmp_path, asked, code) -> None:
    told = tmp_path / "told.json"
    done = run(
        "check", desk / "made", "--allow-uncorrected", "--plan", desk / "plan.toml",
        "--report", told, *asked,
    )  # fmt: skip
    assert done.exit_code == code, done.stderr
    assert done.stderr.count("handling.pdl: no second opinion: no rule") == 1
    (skipped,) = json.loads(told.read_text())["second_opinion"]["skipped"]
    assert skipped["place"] == "handling.pdl"


def test_a_cell_for_the_rest_gives_an_opinion_on_all(desk) -> None:
    rest = "--cell", desk / "cell.toml", "--model", desk / "model.json"
    done = run(
        "check", desk / "made", "--allow-uncorrected", "--plan", desk / "plan.toml",
        *rest, *INSIST
    )  # fmt: skip
    assert done.exit_code == 0, done.stderr
    assert "no second opinion" not in done.stderr
