"""Before an upload: the other files that a job was read from."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from postproc.batch.check import check
from postproc.compensation.compensate import compensate
from postproc.robot.cell import load_cell
from postproc.robot.trajectory import Motion
from tests.batch.test_krl_archive import archive, batch  # noqa: F401
from tests.language.neutral_job import LANGUAGES, drawn

JOB, CONFIG = "R1/Program/weld/job", "R1/System/$config.dat"
SETS = "R1/Program/weld/sets.src"
POINTS = b"DEFDAT points PUBLIC\r\nDECL GLOBAL E6POS XQ1={X 1}\r\nENDDAT\r\n"


@pytest.fixture
def trees(archive, job_folder, job_cell):  # noqa: F811
    """An archive with a job that has all its points in its list, and its output.

    A program beside it changes a frame, so that the job is read with it.
    """
    job = drawn(job_cell, 5, 8)
    lines = [
        replace(move, name=f"P{k}", via=None, motion=Motion.LINEAR)
        for k, move in enumerate(job.moves)
        if not move.in_joints
    ]
    starts = [move for move in job.moves if move.in_joints][:1]
    files = LANGUAGES["job.src"](replace(job, moves=[*starts, *lines]))
    start = re.search(rb"PTP (\{[^}]*\})", files["job.src"])[1]
    files["job.src"] = files["job.src"].replace(start, b"XSTART")
    end = b"DECL E6AXIS XSTART=%s\nENDDAT" % start
    files["job.dat"] = files["job.dat"].replace(b"ENDDAT", end)
    for name, data in files.items():
        (archive / f"KRC/R1/Program/weld/{name}").write_bytes(data)
    (archive / "KRC" / CONFIG).write_bytes(
        b"DEFDAT $CONFIG\r\nDECL FRAME BASE_DATA[32]\r\nENDDAT\r\n"
    )
    sets = b"DEF sets( )\r\nBASE_DATA[5].X=5\r\nEND\r\n"
    (archive / "KRC" / SETS).write_bytes(sets)
    run = batch(archive, job_folder)
    assert run.exit_code in (0, 1), run.output
    source, target = archive / "KRC", archive / "out"
    assert (source / f"{JOB}.src").read_bytes() == (target / f"{JOB}.src").read_bytes()
    assert (source / f"{JOB}.dat").read_bytes() != (target / f"{JOB}.dat").read_bytes()
    return source, target


def found_in(checked):
    """Return places and codes, but for targets left alone."""
    return {(f.place, f.code) for f in checked.allow_uncorrected().findings}


def touch(path):
    path.write_bytes(path.read_bytes() + b";touched\r\n")


BOTH = (f"{JOB}.src", f"{JOB}.dat")


def test_a_tree_as_it_was_written_may_be_uploaded(trees):
    source, target = trees
    assert found_in(check(target, source=source)) == set()


@pytest.mark.parametrize("with_source", [False, True])
def test_a_program_of_which_only_the_list_changed_is_compared_too(trees, with_source):
    source, target = trees
    touch(target / f"{JOB}.src")
    found = check(target, source=source if with_source else None)
    assert found_in(found) == {(f"{JOB}.src", "changed")}


@pytest.mark.parametrize("read", [CONFIG, SETS])
def test_what_a_job_only_reads_is_compared_in_both_trees(trees, read):
    source, target = trees
    touch(source / read)
    expected = {(place, "source-changed") for place in BOTH}
    assert found_in(check(target)) == set()
    found = check(target, source=source)
    assert found_in(found) == expected | {(SETS, "source-changed")}
    assert any(read.rpartition("/")[2] in str(f.message) for f in found.findings)
    (target / read).write_bytes((source / read).read_bytes())
    edited = (SETS,) if read == SETS else (*BOTH, SETS)
    assert found_in(check(target)) == {(place, "changed") for place in edited}


def test_a_read_file_that_is_gone_from_the_sources_is_found(trees):
    source, target = trees
    (source / CONFIG).unlink()
    expected = {(place, "source-changed") for place in (*BOTH, SETS)}
    assert found_in(check(target, source=source)) == expected


def test_a_program_that_changes_what_a_job_reads_since_then_is_found(trees):
    source, target = trees
    text = (source / SETS).read_bytes().replace(b"sets", b"more")
    (source / SETS).with_name("more.src").write_bytes(text)
    found = check(target, source=source)
    expected = {(f"{JOB}.src", "source-changed"), (SETS, "source-changed")}
    absent = {(SETS.replace("sets", "more"), "absent")}
    assert found_in(found) == expected | absent
    assert any(
        "more.src of the source tree changes" in f.message for f in found.findings
    )
    assert found_in(check(target)) == set()


def test_a_page_of_another_source_than_the_program_was_read_with_is_found(trees):
    source, target = trees
    touch(source / f"{JOB}.dat")
    expected = {(place, "source-changed") for place in BOTH}
    assert found_in(check(target, source=source)) == expected


def test_a_list_without_a_source_is_compared(trees, job_folder):
    source, target = trees
    (source / "R1/Program/weld/points.dat").write_bytes(POINTS)
    job = source / f"{JOB}.src"
    job.write_bytes(job.read_bytes().replace(b"\nEND", b"\nLIN XQ1\r\nEND"))
    run = batch(source.parent, job_folder)
    assert run.exit_code in (0, 1), run.output
    assert found_in(check(target, source=source)) == set()
    touch(target / "R1/Program/weld/points.dat")
    found = found_in(check(target, source=source))
    assert found == {("R1/Program/weld/points.dat", "changed")}


def test_the_record_of_bytes_names_no_file_of_another_folder(trees, job_model):
    source, _ = trees
    found = compensate(
        (source / f"{JOB}.src").read_bytes(), load_cell(source.parent / "cell.toml"),
        job_model, name="job.src",
        pages={"job.dat": (source / f"{JOB}.dat").read_bytes(),
               "$config.dat": (source / CONFIG).read_bytes()},
    )  # fmt: skip
    assert found.record.read.keys() == {"job.src", "job.dat"}
