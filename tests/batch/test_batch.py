"""A tree of programs: what is written, what is not, and what a second run does."""

from __future__ import annotations

import json
import os
import signal
import sys
from types import SimpleNamespace

import pytest

from postproc.batch.plan import make_plan
from postproc.batch.run import BatchOptions, batch, check_room, default_log, lock_folder
from postproc.batch.workers import LocalPool
from postproc.compensation.options import DEFAULT_OPTIONS
from postproc.compensation.output.sidecar import restore_file
from postproc.exceptions import CellError, DiskFullError, OutputError, PostprocError
from postproc.language.text.stamp import read_stamp
from tests.inline import InlinePool
from tests.plant import contents, grow, pages, program

SUFFIX = ".postproc.json"


@pytest.fixture
def plan(job_folder):
    return make_plan(
        None, job_folder / "cell.toml", job_folder / "model.json", DEFAULT_OPTIONS
    )


@pytest.fixture
def run(tmp_path, plan):
    """Run a batch from src to dst, by default in this process."""

    def go(resume=False, jobs=0, source=None, target=None, plan=plan):
        source, target = source or tmp_path / "src", target or tmp_path / "dst"
        order = BatchOptions(source, target, plan, default_log(target), resume)
        made = []

        def gather(plan):
            pool = LocalPool(plan.setups, jobs) if jobs else InlinePool(plan.setups)
            made.append(pool)
            return pool

        summary = batch(order, gather)
        summary.tasks = made[0].tasks if made and not jobs else []
        return summary

    return go


def test_mirrors_the_tree(tmp_path, run):
    source = grow(tmp_path / "src", 12, 2)
    (source / "image.bin").write_bytes(bytes(range(256)))
    summary = run()
    target = tmp_path / "dst"
    there = contents(target)
    assert summary.exit_code == 0
    assert there["image.bin"] == contents(source)["image.bin"]
    assert there["line000/notes.txt"] == contents(source)["line000/notes.txt"]
    programs = [p for p in contents(source) if p.endswith(".pdl")]
    assert set(there) == set(contents(source)) | {p + SUFFIX for p in programs}
    for place in programs:
        assert read_stamp((target / place).read_bytes()) is not None
        restore_file(target / place)
        assert (target / place).read_bytes() == (source / place).read_bytes()


def test_same_bytes_on_any_number_of_workers(tmp_path, run):
    grow(tmp_path / "src", 12, 2)
    run(target=tmp_path / "a")
    run(target=tmp_path / "b", jobs=1)
    run(target=tmp_path / "c", jobs=2)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")
    assert contents(tmp_path / "a") == contents(tmp_path / "c")


def test_a_bad_file_is_absent_and_listed_and_stops_no_other(tmp_path, run):
    source = grow(tmp_path / "src", 3, 2)
    (source / "bad.pdl").write_bytes(b"PROGRAM x\0\r\n")
    (source / "stamped.pdl").write_bytes(
        b"-- postproc 0.1.0 model=x source=" + b"0" * 64 + b"\r\n" + program("s", 1, 1)
    )
    (tmp_path / "dst").mkdir()
    (tmp_path / "dst/bad.pdl").write_bytes(b"of an earlier run")
    (tmp_path / f"dst/bad.pdl{SUFFIX}").write_bytes(b"{}")
    summary = run()
    assert summary.exit_code == 2
    assert {place for place, _ in summary.problems} == {"bad.pdl", "stamped.pdl"}
    assert not {p for p in contents(tmp_path / "dst") if "bad" in p or "stamped" in p}
    assert summary.counts["done"].files == 3
    log = [json.loads(x) for x in default_log(tmp_path / "dst").open()][1:]
    errors = {line["file"]: line["error"] for line in log if line["exit"] == 2}
    assert "binary" in errors["bad.pdl"]
    assert "compensated already" in errors["stamped.pdl"]


def test_targets_left_alone_make_exit_code_1(tmp_path, run):
    (tmp_path / "src").mkdir()
    text = program("far", 2, 1).replace(b"END far", b"  MOVE LINEAR TO "
           b"POS(9000, 0, 0, 0, 180, 0, '')\r\nEND far")  # fmt: skip
    (tmp_path / "src/far.pdl").write_bytes(text)
    summary = run()
    assert summary.exit_code == 1
    assert summary.left == [("far.pdl", 1)]
    assert "far.pdl" in contents(tmp_path / "dst")


def test_resume_does_only_what_has_changed(tmp_path, run):
    source = grow(tmp_path / "src", 6, 2)
    (source / "other.txt").write_bytes(b"1")
    run()
    before = contents(tmp_path / "dst")
    assert run(resume=True).tasks == []
    (source / "line000/job00002.pdl").write_bytes(program("job00002", 3, 99))
    (tmp_path / "dst/line000/job00003.pdl").write_bytes(b"damaged")
    (tmp_path / f"dst/line000/job00004.pdl{SUFFIX}").unlink()
    (source / "other.txt").write_bytes(b"2")
    summary = run(resume=True)
    redone = {f"line000/job0000{i}.pdl" for i in (2, 3, 4)}
    assert {task.unit.program for task in summary.tasks} == redone
    after = contents(tmp_path / "dst")
    changed = {place for place in after if after[place] != before[place]}
    want = "line000/job00002.pdl"
    assert changed == {want, want + SUFFIX, "other.txt"}
    assert summary.counts["done"].files == 6
    assert summary.counts["done"].skipped == 3


def test_resume_redoes_all_with_another_cell_model_or_option(tmp_path, run, job_folder):
    grow(tmp_path / "src", 2, 1)
    run()
    text = (job_folder / "cell.toml").read_text()
    cell, model = tmp_path / "cell.toml", job_folder / "model.json"
    cell.write_text(text + "\n")  # the same cell in another place: nothing to do
    assert not run(
        resume=True, plan=make_plan(None, cell, model, DEFAULT_OPTIONS)
    ).tasks
    cell.write_text(text + "[limits]\ncorrection_mm = 4.0\n")
    assert (
        len(run(resume=True, plan=make_plan(None, cell, model, DEFAULT_OPTIONS)).tasks)
        == 2
    )


def test_resume_redoes_all_with_another_release(tmp_path, run, job_folder, monkeypatch):
    grow(tmp_path / "src", 2, 1)
    run()
    files = (job_folder / "cell.toml", job_folder / "model.json")
    assert not run(resume=True, plan=make_plan(None, *files, DEFAULT_OPTIONS)).tasks
    monkeypatch.setattr("postproc.batch.plan.__version__", "99.0.0")
    assert (
        len(run(resume=True, plan=make_plan(None, *files, DEFAULT_OPTIONS)).tasks) == 2
    )


def test_resume_survives_a_torn_or_foreign_log(tmp_path, run):
    grow(tmp_path / "src", 3, 1)
    run()
    log = default_log(tmp_path / "dst")
    lines = log.read_bytes().splitlines(keepends=True)
    log.write_bytes(b"".join(lines[:-1]) + b"[]\n3\n\xff\n" + lines[-1][:25])
    before = contents(tmp_path / "dst")
    summary = run(resume=True)
    assert summary.counts["done"].skipped == 2
    assert contents(tmp_path / "dst") == before


def test_outputs_without_a_source_are_removed_unless_changed(tmp_path, run):
    source = grow(tmp_path / "src", 3, 1)
    run()
    (tmp_path / "dst/mine.txt").write_bytes(b"not of a run")
    for name in ("job00001.pdl", "job00002.pdl"):
        (source / "line000" / name).unlink()
    (tmp_path / "dst/line000/job00002.pdl").write_bytes(b"edited by hand")
    summary = run(resume=True)
    there = contents(tmp_path / "dst")
    assert "line000/job00001.pdl" not in there
    assert "line000/job00002.pdl" in there
    assert "mine.txt" in there
    assert f"line000/job00001.pdl{SUFFIX}" in summary.removed


def test_variables_stay_with_their_program(tmp_path, run):
    source = tmp_path / "src"
    source.mkdir()
    text = (
        b"PROGRAM Spot\r\nVAR p1 : POSITION\r\nBEGIN\r\n  MOVE LINEAR TO p1\r\nEND Spot"
    )
    values = (
        b"p1 POS Priv\r\n X: 100.00 Y: 50.00 Z: 300.00 A: 0.000 E: 180.000 R: 0.000\r\n"
        b" CNFG: ''\r\n"
    )
    (source / "Spot.PDL").write_bytes(text)
    (source / "SPOT.LSV").write_bytes(values)
    (source / "lost.lsv").write_bytes(values)
    (source / "plain.lsv").write_bytes(b"n INT Priv\r\n 3\r\n")
    (source / "Spot.cod").write_bytes(b"\0compiled")
    summary = run()
    target = tmp_path / "dst"
    assert (target / "Spot.PDL").read_bytes() == text
    assert read_stamp((target / "SPOT.LSV").read_bytes()) is not None
    assert [place for place, _ in summary.problems] == ["lost.lsv"]
    assert "plain.lsv" in contents(target)
    assert [place for place, _ in summary.notes] == ["Spot.cod"]
    restore_file(target / "Spot.PDL")
    assert (target / "SPOT.LSV").read_bytes() == values


def test_pages_are_one_flow(tmp_path, run, job_cell, job_model):
    pages(tmp_path / "src", 3, 4)
    summary = run()
    assert [task.unit.pages for task in summary.tasks] == [
        ("page1.pdl", "page2.pdl", "page3.pdl")
    ]
    assert summary.counts["done"].visits == 13
    for name in ("main", "page1", "page2", "page3"):
        out = tmp_path / f"dst/{name}.pdl"
        assert read_stamp(out.read_bytes()) is not None
        restore_file(out)
        assert out.read_bytes() == (tmp_path / f"src/{name}.pdl").read_bytes()


def test_imports_do_not_leave_the_folder(tmp_path, run):
    source = pages(tmp_path / "src/job", 1, 1)
    text = (source / "main.pdl").read_bytes()
    names = [b"'../page2'", rb"'C:\\page2'", b"'/page2'", b"'..'"]
    more = b"".join(b"IMPORT " + name + b"\r\n" for name in names)
    (source / "main.pdl").write_bytes(text.replace(b"BEGIN", more + b"BEGIN"))
    (tmp_path / "src/page2.pdl").write_bytes(program("page2", 1, 1))
    summary = run()
    units = {task.unit.program: task.unit.pages for task in summary.tasks}
    assert units == {"job/main.pdl": ("job/page1.pdl",), "page2.pdl": ()}
    assert len(summary.notes) == 4


def test_links_are_not_followed(tmp_path, run):
    source = grow(tmp_path / "src", 1, 1)
    secret = tmp_path / "secret.pdl"
    secret.write_bytes(program("secret", 1, 1))
    (source / "link.pdl").symlink_to(secret)
    (source / "folder").symlink_to(tmp_path)
    summary = run()
    assert {place for place, _ in summary.problems} == {"link.pdl", "folder"}
    assert "link.pdl" not in contents(tmp_path / "dst")


def test_a_plan_serves_many_arms(tmp_path, run, job_folder):
    grow(tmp_path / "src", 21, 1)
    other = tmp_path / "other.toml"
    text = (job_folder / "cell.toml").read_text()
    other.write_text(text.replace("1600.0", "1650.0"))
    file = tmp_path / "batch.toml"
    model = (job_folder / "model.json").as_posix()
    file.write_text(
        f'[[rule]]\npattern = "line000/*.pdl"\ncell = "other.toml"\nmodel = "{model}"\n'
        f'[[rule]]\npattern = "line001/**"\nmodel = "{model}"\n'
        f'cell = "{(job_folder / "cell.toml").as_posix()}"\n'
    )
    made = make_plan(file, None, None, DEFAULT_OPTIONS)
    summary = run(plan=made)
    assert {(t.unit.program[:7], t.unit.setup) for t in summary.tasks} == {
        ("line000", 0),
        ("line001", 1),
    }
    assert [place for place, _ in summary.problems] == ["line002/job00020.pdl"]


def test_a_plan_maps_arms_to_cells_and_models(tmp_path, run, job_folder):
    source = tmp_path / "src"
    source.mkdir()
    move = "MOVE JOINT TO {5.0, 10.0, -95.0, 20.0, 50.0, 30.0}"
    for name, head in (("a", ", PROG_ARM = 2"), ("b", ""), ("c", " PROG_ARM=1")):
        calls = "CALL a\n" if name == "b" else ""
        text = f"PROGRAM {name}{head}\nBEGIN\n{calls}{move}\nEND {name}\n"
        (source / f"{name}.pdl").write_text(text)
    cell = (job_folder / "cell.toml").read_text()
    for number in (1, 2):
        text = cell.replace("[robot]", f"[robot]\narm_number = {number}")
        text += '\n[routines]\na = "motionless"\n'
        (tmp_path / f"r{number}.toml").write_text(text)
    model = (job_folder / "model.json").as_posix()
    rule = '[[rule]]\npattern = "**"\narm = {}\ncell = "r{}.toml"\nmodel = "{}"\n'
    file = tmp_path / "batch.toml"
    file.write_text(rule.format(2, 2, model) + rule.format(1, 1, model))
    summary = run(plan=make_plan(file, None, None, DEFAULT_OPTIONS))
    assert {(t.unit.program, t.unit.pages, t.unit.setup) for t in summary.tasks} == {
        ("a.pdl", (), 0), ("b.pdl", (), 1), ("c.pdl", (), 1),
    }  # fmt: skip
    assert summary.exit_code == 0 and len(contents(tmp_path / "dst")) == 6
    file.write_text(rule.format(1, 2, model))
    with pytest.raises(CellError, match=r"r2\.toml: is of arm 2.*of arm 1.*arm_number"):
        make_plan(file, None, None, DEFAULT_OPTIONS)


def test_a_program_of_another_arm_is_absent(tmp_path, run):
    source = tmp_path / "src"
    source.mkdir()
    (source / "a.pdl").write_text("PROGRAM a PROG_ARM = 2\nBEGIN\nEND a\n")
    summary = run()
    assert summary.exit_code == 2 and contents(tmp_path / "dst") == {}
    ((place, why),) = summary.problems
    assert place == "a.pdl" and "arm_number = 2" in why


def test_a_bad_plan_is_refused(tmp_path, job_folder):
    file = tmp_path / "batch.toml"
    file.write_text('[[rule]]\npattern = "*"\ncell = "c"\nmodel = "m"\nrobot = "r1"\n')
    with pytest.raises(CellError, match="unknown key"):
        make_plan(file, None, None, DEFAULT_OPTIONS)
    with pytest.raises(PostprocError, match="--plan"):
        make_plan(None, job_folder / "cell.toml", None, DEFAULT_OPTIONS)


def test_one_run_at_a_time(tmp_path, run):
    grow(tmp_path / "src", 1, 1)
    with lock_folder(tmp_path / "dst"), pytest.raises(OutputError, match="another run"):
        run()
    assert run().exit_code == 0


@pytest.mark.parametrize("target", ["src", "src/inside", "."])
def test_trees_must_not_overlap(tmp_path, run, target):
    grow(tmp_path / "src", 1, 1)
    before = contents(tmp_path / "src")
    with pytest.raises(OutputError, match="overlaps"):
        run(target=tmp_path / target)
    assert contents(tmp_path / "src") == before


def test_too_little_room_is_said_before_anything_is_written(tmp_path):
    with pytest.raises(DiskFullError, match="are needed"):
        check_room(tmp_path, 10**17, 0)


def test_a_lost_worker_costs_only_the_file_that_kills_it(tmp_path, run):
    source = grow(tmp_path / "src", 6, 1)
    (source / "killer.pdl").write_bytes(program("killer", 1, 1))
    summary = run(jobs=2, plan=_Killing())
    died = [place for place, why in summary.problems if "worker died" in why]
    assert died == ["killer.pdl"]
    assert sum("reached" in why for _, why in summary.problems) == 6


class _Killing:
    """A plan whose setup ends the process that compensates one program."""

    def __init__(self):
        self.setups = (_KillingSetup(),)

    def setup_of(self, program, arm):
        return 0


class _KillingSetup:
    digest = "x"
    options = DEFAULT_OPTIONS
    model = None

    @property
    def cell(self):
        frame = sys._getframe(1)
        if "tasks" not in frame.f_locals:  # the tree is being listed
            return SimpleNamespace(arm_number=1, path="cell.toml")
        if any(t.unit.program == "killer.pdl" for t in frame.f_locals["tasks"]):
            os.kill(os.getpid(), signal.SIGKILL)
        raise PostprocError("reached")


def test_an_edited_output_is_overwritten_with_a_note(tmp_path, run):
    grow(tmp_path / "src", 2, 1)
    assert run().notes == ()
    (path,) = (tmp_path / "dst").rglob("job00000.pdl")
    written = path.read_bytes()
    path.write_bytes(written + b"-- taught again\r\n")
    summary = run(resume=True)
    assert path.read_bytes() == written and summary.exit_code == 0
    ((place, told),) = summary.notes
    assert place.endswith("job00000.pdl") and "was edited after" in told
    assert '"overwritten"' in default_log(tmp_path / "dst").read_text()
    assert run(resume=True).notes == ()


def test_a_library_that_nobody_calls_is_not_passed_off_as_compensated(tmp_path, run):
    source = pages(tmp_path / "src", 1, 1)
    text = (source / "main.pdl").read_bytes()
    (source / "other.pdl").write_bytes(text.replace(b"main", b"other"))
    summary = run()
    assert summary.exit_code == 1
    assert ("page1.pdl", 1) in summary.left


def test_a_file_that_is_too_long_is_not_read(tmp_path, run, monkeypatch):
    source = grow(tmp_path / "src", 1, 1)
    monkeypatch.setattr("postproc.batch.tree.LARGEST", 2000)
    (source / "huge.pdl").write_bytes(program("huge", 100, 1))
    assert [place for place, _ in run().problems] == ["huge.pdl"]


def test_names_cannot_steer_the_terminal_or_the_log(tmp_path, run):
    source = tmp_path / "src"
    source.mkdir()
    (source / "a\x1b[31m\n.pdl").write_bytes(b"PROGRAM x\0")
    summary = run()
    text = default_log(tmp_path / "dst").read_bytes()
    assert b"\x1b" not in text
    assert text.count(b"\n") == 2
    assert summary.problems[0][0] == "a\x1b[31m\n.pdl"
