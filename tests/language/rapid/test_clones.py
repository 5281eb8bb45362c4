"""Points of RAPID that moves share, and points of their own for them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import PurePosixPath

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.options import Options
from postproc.compensation.outcome import Status
from postproc.compensation.output.sidecar import restore
from postproc.compensation.program import read_program
from postproc.language.rapid.files import RapidFileName
from postproc.report.simulation import setup_of
from postproc.simulation import land, virtual_arm
from tests.conftest import SEED
from tests.fuzz.case import records_of
from tests.language.neutral_job import drawn, rapid

CLONE = Options(shared_points="clone")


def shared(cell, seed):
    """Return a job that goes to its named points twice, from different sides."""
    job = drawn(cell, seed, 16)
    moves = [replace(m, name=f"Shared{k}") if not m.in_joints and m.via is None else m
             for k, m in enumerate(job.moves)]  # fmt: skip
    again = [m for m in reversed(moves) if m.name]
    return rapid(replace(job, moves=(*moves, *again)))


def run(source, cell, model, options=CLONE, pages=None):
    pages = pages or {}
    return compensate(source, cell, model, name="job.mod", pages=pages, options=options)


def notes(outcome, code):
    return [d.message for d in outcome.diagnostics if d.code == code]


def corrected(outcome):
    return int((outcome.decisions.status == Status.CORRECTED).sum())


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_arm_lands_where_it_is_to(bench_cell, bench_model, seed):
    source = shared(bench_cell, seed)
    plain = run(source, bench_cell, bench_model, Options(shared_points="leave"))
    found = run(source, bench_cell, bench_model)
    assert corrected(found) > corrected(plain) + 10 and notes(found, "cloned")
    output = found.outputs["job.mod"]
    record = records_of(found.sidecar)["job.mod"]
    assert restore(output, record, "job.mod") == source
    setup = setup_of(bench_cell)
    body = virtual_arm(SEED, tool=setup.tool)
    given, made = (
        read_program({"job.mod": text}, bench_cell).visits for text in (source, output)
    )
    landing, rows = land(body, setup, given, made), found.decisions
    safe = (rows.why == 0) & ~found.visits.motion.fly & ~found.visits.motion.via
    sure = (safe & (rows.direction != 0).all(axis=1))[landing.visit]
    miss = 1e3 * np.linalg.norm(landing.error, axis=1)[sure & (landing.visit > 0)]
    assert len(miss) > 10 and miss.max() <= 0.1


def moves(cell, *lines, declared="", extra=""):
    """Write a job that goes to its points from two sides, in lines of the test."""
    job = drawn(cell, 1, 8)
    text = rapid(replace(job, moves=[replace(m, name="") for m in job.moves])).decode()
    point = next(x for x in text.splitlines() if "MoveJ [[" in x and "fine" in x)
    numbers = point[point.index("[[") : point.rindex("],v") + 1]
    body, end = text.split("    EXIT;")
    body = body.replace(
        "  PROC main()", declared.replace("#", numbers) + extra + "  PROC main()"
    )
    return (body + "\n".join(lines) + "\n    EXIT;" + end).encode()


TWICE = (
    "MoveAbsJ [[25,-20,-100,20,40,10],[9E9,9E9,9E9,9E9,9E9,9E9]],vWork,fine,tWork;",
    "MoveJ {0},vWork,fine,tWork\\WObj:=wPart;{1}",
    "MoveAbsJ [[15,-30,-120,40,60,30],[9E9,9E9,9E9,9E9,9E9,9E9]],vWork,fine,tWork;",
    "MoveJ {0},vWork,fine,tWork\\WObj:=wPart;",
)
P = "  CONST robtarget pShared:=#;\n"


def twice(name="pShared", more=""):
    return [line.format(name, more) for line in TWICE]


def test_what_is_written(bench_cell, bench_model):
    source = moves(bench_cell, *twice(), declared=P.replace("\n", " ! seam\n"))
    found = run(source, bench_cell, bench_model)
    text = found.outputs["job.mod"].decode()
    assert text.count("CONST robtarget pShared:=") == 1
    assert text.count("  CONST robtarget pShared__2:=[[") == 1
    assert text.count("MoveJ pShared__2,vWork") == 1
    assert len(notes(found, "cloned")) == 1


LONG = "p" + 29 * "x"
TRAPS = {
    "other code beside it": (twice(), P[:-1] + " VAR num other;\n", ""),
    "an element of an array": (twice("pShared{1}"),
                               "  CONST robtarget pShared{1}:=[#];\n", ""),
    "a parameter": (["go pShared;"], P, "  PROC go(robtarget p)\n"
                    + "\n".join(twice("p")) + "\n  ENDPROC\n"),
    "a name that gets too long": (twice(LONG), P.replace("pShared", LONG), ""),
    "numbers in the moves": (twice("#"), "", ""),
    "one move from two sides": (
        ["FOR i FROM 1 TO 2 DO",
         "IF diSide=1 MoveAbsJ [[25,-20,-100,20,40,10],[9E9,9E9,9E9,9E9,9E9,9E9]],"
         "vWork,fine,tWork;", TWICE[1].format("pShared", ""), TWICE[2],
         "ENDFOR"], P, ""),
    "shifted, and read": ([*twice(), "MoveL Offs(pShared,0,0,3*3),vWork,fine,tWork"
                           "\\WObj:=wPart;", "TPWrite NumToStr(pShared.trans.x,2);"],
                          P, ""),
    "points that change": ([*twice(), "pShared.trans.x:=pShared.trans.x+1;"],
                           P.replace("CONST", "VAR"), ""),
}  # fmt: skip


@pytest.mark.parametrize("trap", TRAPS)
def test_it_is_not_cloned(bench_cell, bench_model, trap):
    lines, declared, extra = TRAPS[trap]
    source = moves(bench_cell, *lines, declared=declared, extra=extra)
    found = run(source, bench_cell, bench_model)
    plain = run(source, bench_cell, bench_model, Options())
    assert not notes(found, "cloned") and found.exit_code == plain.exit_code
    assert corrected(found) == corrected(plain)


def test_words_that_look_alike(bench_cell, bench_model):
    """Names in comments and strings are no moves; a name that is there is passed."""
    extra = '  VAR string pShared__2:="MoveJ pShared";\n'
    source = moves(
        bench_cell, *twice(more=" ! to pShared"), declared=P, extra=extra
    )  # fmt: skip
    text = run(source, bench_cell, bench_model).outputs["job.mod"].decode()
    assert "MoveJ pShared__3,vWork" in text and '"MoveJ pShared"' in text
    assert "! to pShared\n" in text


def test_what_another_reads_keeps_its_numbers(bench_cell, bench_model):
    lines = [*twice(), "TPWrite NumToStr(pShared.trans.x,2);"]
    source = moves(bench_cell, *lines, declared=P)
    text = run(source, bench_cell, bench_model).outputs["job.mod"].decode()
    old = next(x for x in source.decode().splitlines() if "robtarget pShared:" in x)
    assert old in text and "MoveJ pShared," not in text


def test_clones_that_would_keep_their_numbers_are_not_made(bench_cell, bench_model):
    lines = [*twice(), "GetDataVal sName,pOther;"]
    more = '  VAR string sName:="pShared"; VAR robtarget pOther;\n'
    source = moves(bench_cell, *lines, declared=P, extra=more)
    found = run(source, bench_cell, bench_model)
    assert "keep their numbers" in notes(found, "not-cloned")[0]
    assert b"pShared__" not in found.outputs["job.mod"]


def test_several_moves_on_a_line_keep_their_point(bench_cell, bench_model):
    more = " MoveJ pShared,vWork,fine,tWork\\WObj:=wPart;"
    source = moves(bench_cell, *twice(more=more), declared=P)
    text = run(source, bench_cell, bench_model).outputs["job.mod"].decode()
    line = next(x for x in text.splitlines() if x.count("MoveJ pShared") == 2)
    assert "pShared__" not in line


def test_a_point_of_a_system_module(bench_cell, bench_model):
    source = moves(bench_cell, *twice(), declared=P)
    old = next(x for x in source.decode().splitlines() if "robtarget pShared:" in x)
    system = RapidFileName("T/SYSMOD/user.sys").name_for(PurePosixPath("T/P/a.mod"))
    pages = {system: f"MODULE user(SYSMODULE)\n{old}\nENDMODULE\n".encode()}
    source = source.replace(old.encode() + b"\n", b"")
    found = run(source, bench_cell, bench_model, pages=pages)
    plain = run(source, bench_cell, bench_model, Options(), pages)
    text = found.outputs["job.mod"].decode()
    assert system not in found.outputs and text.count("robtarget pShared__") == 2
    assert corrected(found) == corrected(plain) + 2
    record = records_of(found.sidecar)["job.mod"]
    assert restore(found.outputs["job.mod"], record, "job.mod") == source


@pytest.mark.parametrize(
    "first", ["  RECORD r\n  num a;\n  ENDRECORD\n", "  ALIAS num a;\n"]
)
def test_data_stand_behind_types(bench_cell, bench_model, first):
    source = moves(bench_cell, *twice(), declared=P)
    old = next(x for x in source.decode().splitlines() if "robtarget pShared:" in x)
    system = RapidFileName("T/SYSMOD/user.sys").name_for(PurePosixPath("T/P/a.mod"))
    pages = {system: f"MODULE user(SYSMODULE)\n{old}\nENDMODULE\n".encode()}
    source = source.replace(old.encode() + b"\n", b"")
    source = source.replace(b"MODULE job\n", b"MODULE job\n" + first.encode())
    found = run(source, bench_cell, bench_model, pages=pages)
    assert "defines types" in notes(found, "not-cloned")[0]
    assert b"pShared__" not in found.outputs["job.mod"]


def test_the_nearest_of_two_names_is_meant(bench_cell, bench_model):
    own = "    VAR robtarget pShared:=#;\n"
    source = moves(bench_cell, *twice(), declared=P.replace("#", "[[1,2,3],[1,0,0,0],"
                   "[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"))  # fmt: skip
    numbers = moves(bench_cell, declared=P).decode()
    numbers = next(x for x in numbers.splitlines() if "robtarget pShared:" in x)
    own = own.replace("#", numbers.split(":=")[1].rstrip(";"))
    source = source.replace(b"  PROC main()\n", b"  PROC main()\n" + own.encode())
    text = run(source, bench_cell, bench_model).outputs["job.mod"].decode()
    assert "\n    VAR robtarget pShared__2:=" in text
    assert "CONST robtarget pShared__2" not in text
