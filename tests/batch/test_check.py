"""Before an upload: what check finds, and what it lets pass."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from typer.testing import CliRunner

from postproc.batch.check import check, check_tree
from postproc.batch.plan import make_plan
from postproc.batch.run import BatchOptions, batch, default_log
from postproc.cli.commands import app
from postproc.compensation.options import DEFAULT_OPTIONS
from postproc.compensation.outcome import Status
from postproc.exceptions import ProgramError
from postproc.files import TEMPORARY
from postproc.language.text.source import Source
from postproc.language.text.stamp import stamp_line
from postproc.model.model import load_model
from tests.inline import InlinePool
from tests.plant import grow, program

SUFFIX = ".postproc.json"
VALUES = (
    b"p1 POS Priv\r\n X: 100.00 Y: 50.00 Z: 300.00 A: 0.000 E: 180.000 R: 0.000\r\n"
    b" CNFG: ''\r\n"
)
SPOT = b"PROGRAM s\r\nVAR p1: POSITION\r\nBEGIN\r\nMOVE LINEAR TO p1\r\nEND s\r\n"


@pytest.fixture
def trees(tmp_path, job_folder):
    """A source tree, its compensated tree, and the id of the model."""
    source = grow(tmp_path / "src", 2, 1)
    (source / "spot.pdl").write_bytes(SPOT)
    (source / "spot.lsv").write_bytes(VALUES)
    (source / "spot.cod").write_bytes(b"compiled")
    plan = make_plan(
        None, job_folder / "cell.toml", job_folder / "model.json", DEFAULT_OPTIONS
    )
    target = tmp_path / "dst"
    order = BatchOptions(source, target, plan, default_log(target), False)
    assert batch(order, lambda plan: InlinePool(plan.setups)).exit_code == 0
    (target / "spot.cod").unlink()
    return source, target, plan.setups[0].model.id


def codes(checked):
    return {(f.place, f.code) for f in checked.findings}


def test_a_fresh_tree_may_be_uploaded(trees):
    source, target, model = trees
    found = check_tree(target, lambda place: model, source)
    assert found.findings == ()
    assert (found.programs, found.exit_code) == (3, 0)


def test_uncompensated_programs_and_values_are_found(trees):
    _, target, _ = trees
    (target / "raw.pdl").write_bytes(program("raw", 1, 1))
    (target / "raw2.lsv").write_bytes(VALUES)
    (target / "numbers.lsv").write_bytes(b"n INT Priv\r\n 3\r\n")
    found = check(target)
    assert codes(found) == {
        ("raw.pdl", "uncompensated"),
        ("raw2.lsv", "uncompensated"),
    }
    assert found.exit_code == 1


def test_an_older_model_is_listed(trees):
    _, target, _ = trees
    found = check_tree(target, lambda place: "newer" if "spot" in place else None)
    assert codes(found) == {("spot.pdl", "older-model")}


def test_targets_left_alone_are_found_and_may_be_accepted(trees):
    _, target, _ = trees
    path = target / ("spot.pdl" + SUFFIX)
    record = json.loads(path.read_text())
    told = record["files"]["spot.lsv"]["targets"]
    told["status"] = str(int(Status.REJECTED)) * len(told["line"])
    path.write_text(json.dumps(record))
    found = check(target)
    assert codes(found) == {("spot.lsv", "left-alone")}
    assert "1 visits are not corrected, lines 2 of" in found.findings[0].message
    assert found.exit_code == 1 and found.allow_uncorrected().exit_code == 0
    command = ["check", str(target)]
    assert CliRunner().invoke(app, command).exit_code == 1
    assert CliRunner().invoke(app, [*command, "--allow-uncorrected"]).exit_code == 0


@pytest.mark.parametrize("name", ["line000/job00000.pdl", "spot.lsv"])
def test_a_changed_output_is_found(trees, name):
    _, target, _ = trees
    (target / name).write_bytes((target / name).read_bytes() + b"-- touched\r\n")
    assert codes(check(target)) == {(name, "changed")}


@pytest.mark.parametrize("name", ["line000/job00000.pdl", "spot.pdl", "spot.lsv"])
def test_a_changed_source_is_found(trees, name):
    source, target, _ = trees
    (source / name).write_bytes((source / name).read_bytes() + b"-- touched\r\n")
    assert codes(check(target, source=source)) == {(name, "source-changed")}


def test_an_unstamped_program_that_was_changed_is_found(trees):
    # Only its values were corrected: it came out as it went in.
    source, target, _ = trees
    (target / "spot.pdl").write_bytes(SPOT.replace(b"p1\r\nEND", b"p1\r\n\r\nEND"))
    assert codes(check(target)) == {("spot.pdl", "changed")}
    assert codes(check(target, source=source)) == {("spot.pdl", "changed")}


def test_an_older_record_does_not_tell_who_changed_an_unstamped_program(trees):
    source, target, _ = trees
    path = target / ("spot.pdl" + SUFFIX)
    record = json.loads(path.read_text())
    del record["read"]
    path.write_text(json.dumps(record))
    assert check(target, source=source).findings == ()
    (target / "spot.pdl").write_bytes(SPOT.replace(b"p1\r\nEND", b"p1\r\n\r\nEND"))
    (found,) = check(target, source=source).findings
    assert found.code == "source-changed" and "does not tell which" in found.message


def test_a_record_that_is_missing_or_broken_or_of_another_file(trees):
    _, target, _ = trees
    record = target / f"line000/job00000.pdl{SUFFIX}"
    text = record.read_bytes()
    record.unlink()
    assert codes(check(target)) == {("line000/job00000.pdl", "no-record")}
    record.write_bytes(b"{}")
    assert codes(check(target)) == {("line000/job00000.pdl", "no-record")}
    record.write_bytes(text.replace(b"job00000", b"job00001"))
    assert codes(check(target)) == {("line000/job00000.pdl", "no-record")}


def test_what_was_not_compensated_is_missed(trees):
    source, target, _ = trees
    (source / "new.pdl").write_bytes(program("new", 1, 1))
    assert codes(check(target, source=source)) == {("new.pdl", "absent")}


def test_the_compiled_form_of_the_source_is_found(trees):
    source, target, _ = trees
    (target / "spot.cod").write_bytes(b"compiled")
    assert codes(check(target, source=source)) == {("spot.cod", "uncompensated")}
    (target / "spot.cod").write_bytes(b"compiled anew")
    assert check(target, source=source).exit_code == 0


def test_what_a_killed_run_has_left_is_found(trees):
    _, target, _ = trees
    (target / f".job.pdl.x{TEMPORARY}").write_bytes(b"")
    assert {code for _, code in codes(check(target))} == {"unfinished"}


def test_json_and_trouble(trees, tmp_path):
    _, target, _ = trees
    (target / "raw.pdl").write_bytes(b"x")
    data = json.loads(check(target).to_json())
    assert data["programs"] == 4
    assert data["findings"][0]["code"] == "uncompensated"
    with pytest.raises(ProgramError, match="is no folder"):
        check(tmp_path / "none")


def test_the_command_says_it_by_its_exit_code(trees, job_folder, tmp_path):
    source, target, _ = trees
    call = ["check", str(target), "--model", str(job_folder / "model.json")]
    runner = CliRunner()
    assert runner.invoke(app, [*call, "--source", str(source)]).exit_code == 0
    (target / "raw.pdl").write_bytes(b"x")
    found = runner.invoke(app, [*call, "--report", "-"])
    assert found.exit_code == 1
    assert json.loads(found.stdout)["findings"][0]["place"] == "raw.pdl"
    assert runner.invoke(app, ["check", str(tmp_path / "none")]).exit_code == 2


def test_the_command_takes_each_program_s_model_from_the_plan(trees, job_folder):
    _, target, _ = trees
    plan = job_folder / "check.toml"
    rule = '[[rule]]\npattern = "{}"\ncell = "cell.toml"\nmodel = "{}"\n'
    loaded = load_model(job_folder / "model.json")
    replace(loaded, rows=loaded.rows + 1).save(job_folder / "other.json")
    plan.write_text(
        rule.format("line000/**", "model.json") + rule.format("**", "other.json")
    )
    found = CliRunner().invoke(app, ["check", str(target), "--plan", str(plan)])
    assert found.exit_code == 1
    assert found.stderr.count("older-model") == 1
    assert "spot.pdl: older-model" in found.stderr


def test_modules_of_a_task_with_two_models_are_found(tmp_path):
    for name, model in (("a.mod", "one"), ("b.mod", "two"), ("c/d.mod", "three")):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        source = Source(name, b"MODULE m\nENDMODULE\n")
        line = stamp_line("1.0", model, source, "!")
        path.write_bytes(b"MODULE m\n" + line + b"ENDMODULE\n")
    assert ("b.mod", "mixed-models") in codes(check(tmp_path))
    told = codes(check_tree(tmp_path, lambda place: "one"))
    assert not {place for place, code in told if code == "mixed-models"}
    (tmp_path / "b.mod").unlink()
    assert "mixed-models" not in {code for _, code in codes(check(tmp_path))}
