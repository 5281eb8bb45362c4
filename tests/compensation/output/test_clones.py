"""Points of their own for moves that cannot share one."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.options import Options
from postproc.compensation.outcome import Status
from postproc.compensation.output.sidecar import FileRecord, restore
from postproc.compensation.program import read_program
from postproc.diagnostics import Code
from postproc.report.simulation import setup_of
from postproc.simulation import land, virtual_arm
from tests.conftest import SEED
from tests.written import LISTED, entry

HIGH = "MOVE JOINT TO {12.0, 20.0, -85.0, 30.0, 60.0, 45.0}"
LOW = "MOVE JOINT TO {-12.0, -8.0, -140.0, -40.0, 20.0, -60.0}"
RECORD = "100.0, 200.0, 150.0, 0.0, 175.0, 0.0"
SET = f"p := POS({RECORD}, '')"
TO_P = "MOVE JOINT TO p"
BOTH = (HIGH, TO_P, LOW, TO_P)


def text_of(*lines: str, declared: str = "p : POSITION", before: str = "") -> bytes:
    head = f"PROGRAM job\r\nVAR\r\n  {declared}\r\n{before}BEGIN\r\n"
    return (head + "".join(f"  {x}\r\n" for x in lines) + "END job\r\n").encode()


@pytest.fixture
def run(job_cell, job_model):
    def compensated(source: bytes, variables=None, shared=False, clone=True, **more):
        return compensate(
            source,
            job_cell,
            job_model,
            name="job.pdl",
            variables=variables,
            options=Options(
                shared_points="clone" if clone else "mean", edit_exported=shared
            ),
            **more,
        )

    return compensated


def notes(outcome, code: str) -> list[str]:
    return [d.message for d in outcome.diagnostics if d.code == code]


def given_back(outcome) -> dict[str, bytes]:
    """Undo every file of an outcome."""
    records = json.loads(outcome.sidecar)["files"]
    return {
        name: restore(data, FileRecord.read(records[name]), name)
        for name, data in outcome.outputs.items()
        if name in records
    }


def all_safe(outcome) -> bool:
    return set(outcome.decisions.status.tolist()) == {int(Status.CORRECTED)}


def masked(data: bytes) -> list[str]:
    """Return the lines of an output without its stamp and decimals."""
    lines = data.decode("latin-1").split("\r\n")[1:]
    return [line.partition("(")[0].rstrip() for line in lines]


def test_moves_that_disagree_get_points_of_their_own(run, job_cell):
    source = text_of(SET + " -- where", *BOTH)
    plain, outcome = run(source, clone=False), run(source)
    codes = [plain.decisions.reasons[k].code for k in plain.decisions.why]
    assert codes == [None, Code.ARRIVALS_AVERAGED, None, Code.ARRIVALS_AVERAGED]
    assert all_safe(plain) and plain.exit_code == 0
    assert all_safe(outcome) and outcome.exit_code == 0
    assert masked(outcome.outputs["job.pdl"])[2:7] == [
        "  p : POSITION",
        "  p__2 : POSITION",
        "BEGIN",
        "  p := POS",
        "  p__2 := POS",
    ]
    assert b"  MOVE JOINT TO p__2\r\nEND" in outcome.outputs["job.pdl"]
    assert notes(outcome, "cloned") == ["p: the moves of lines 9 go to p__2 now"]
    assert outcome.visits.place.line.tolist() == [6, 7, 8, 9]
    assert outcome.visits.literals.line.tolist() == [5, 5, 6, 8]
    assert given_back(outcome) == {"job.pdl": source}
    wanted = read_program({"job.pdl": source}, job_cell).visits
    done = read_program(dict(outcome.outputs), job_cell).visits
    landing = land(virtual_arm(SEED), setup_of(job_cell), wanted, done)
    size = 1e3 * np.linalg.norm(landing.error, axis=1)
    assert len(size) == 4 and size[1:].max() < 0.06  # the start's sides are not known
    assert size[1:].mean() < 0.03


def test_one_correction_helps_each_of_two_arrivals(run, job_cell):
    source = text_of(SET, *BOTH)
    outcome = run(source, clone=False)
    wanted = read_program({"job.pdl": source}, job_cell).visits
    done = read_program(dict(outcome.outputs), job_cell).visits
    arm, setup = virtual_arm(SEED), setup_of(job_cell)
    before, after = (
        1e3 * np.linalg.norm(land(arm, setup, wanted, ran).error, axis=1)[[1, 3]]
        for ran in (wanted, done)
    )
    assert (after < before - 0.1).all()
    assert abs(after[0] - after[1]) < 0.06  # the worst of them is as good as it can be
    stated = 1e3 * np.linalg.norm(outcome.decisions.std_error[[1, 3]], axis=1)
    assert (stated > 0.9 * after).all()


def test_arrivals_farther_apart_than_the_limit_end_with_exit_1(job_cell, job_model):
    limits = job_cell.limits.model_copy(update={"averaged_mm": 0.05})
    cell, source = replace(job_cell, limits=limits), text_of(SET, *BOTH)
    outcome = compensate(source, cell, job_model, name="job.pdl")
    assert all_safe(outcome) and outcome.exit_code == 1
    (note,) = notes(outcome, Code.ARRIVALS_FAR_APART)
    assert note.startswith("p: its arrivals need different corrections")


def test_fly_points_have_no_correction_for_several_arrivals(run):
    flown = [line.replace("MOVE ", "MOVEFLY ") for line in BOTH]
    outcome = run(text_of(SET, *flown), clone=False)
    codes = {one.code for one in outcome.decisions.reasons}
    assert Code.ARRIVALS_AVERAGED not in codes
    assert Code.ARRIVALS_FAR_APART not in codes


def test_moves_that_agree_go_on_sharing(run):
    again = text_of(SET, *BOTH, HIGH, TO_P, LOW, TO_P)
    outcome = run(again)
    assert all_safe(outcome)
    assert notes(outcome, "cloned") == ["p: the moves of lines 9, 13 go to p__2 now"]
    agree = text_of(SET, HIGH, TO_P, HIGH, TO_P)
    assert run(agree).outputs == run(agree, clone=False).outputs


@pytest.mark.parametrize(
    ("declared", "value"),
    [
        ("p : POSITION", SET),
        (f"a ,P, b :POSITION (POS({RECORD}, '')) NOSAVE -- points", "DELAY 1"),
        ("j, p : JOINTPOS FOR ARM[1]", "P := {2.0, 15.0, -90.0, 20.0, 50.0, 30.0}"),
        ("p : XTNDPOS FOR ARM[1]", SET),
    ],
)
def test_declarations_stay_legal(run, declared, value):
    source = text_of(value, *BOTH, declared=declared)
    outcome = run(source)
    assert all_safe(outcome)
    out = outcome.outputs["job.pdl"]
    new = out.split(b"\r\n")[4].decode()
    assert new.lower().startswith("  p__2")
    assert new.split(":", 1)[1].split("(")[0] == declared.split(":", 1)[1].split("(")[0]
    assert "--" not in new and ("NOSAVE" in new) == ("NOSAVE" in declared)
    assert given_back(outcome) == {"job.pdl": source}


@pytest.mark.parametrize("newline", ["\r\n", "\n"])
@pytest.mark.parametrize("end", ["", "\r\n"])
def test_entries_of_variable_files_are_copied(run, newline, end):
    source = text_of(*BOTH, "MOVE JOINT TO r", declared="p, r : XTNDPOS FOR ARM[1]")
    values = (LISTED + entry("r", 300.0) + entry("P")).rstrip() + end
    values = values.replace("\r\n", newline).encode()
    outcome = run(source, values)
    assert all_safe(outcome)
    lines = outcome.outputs["job.lsv"].decode().split(newline)[2:]
    heads = [line.split()[0] for line in lines if "XTND" in line]
    assert heads == ["r", "P", "p__2"]
    assert lines.count(" CNFG: ''") == 3
    assert given_back(outcome) == {"job.pdl": source, "job.lsv": values}


def test_a_local_variable_is_cloned_in_its_routine(run):
    routine = (
        "ROUTINE r\r\nVAR p : POSITION\r\nBEGIN\r\n"
        + "".join(f"  {line}\r\n" for line in (SET, *BOTH))
        + "END r\r\n"
    )
    source = text_of("r", declared="q : POSITION", before=routine)
    outcome = run(source)
    assert all_safe(outcome)
    out = outcome.outputs["job.pdl"]
    assert b"VAR p : POSITION\r\n  p__2 : POSITION\r\nBEGIN" in out


def test_names_do_not_collide(run):
    outcome = run(text_of(SET, *BOTH, declared="p, P__2 : POSITION"))
    assert all_safe(outcome) and b"  p__3 : POSITION" in outcome.outputs["job.pdl"]


def test_one_point_with_two_tools(run):
    tools = [f"$TOOL := POS({x}, -40, 150, 0, 0, 0, '')" for x in (80, 30)]
    outcome = run(text_of(SET, tools[0], HIGH, TO_P, tools[1], HIGH, TO_P))
    assert all_safe(outcome)
    assert b"p__2" in outcome.outputs["job.pdl"]


def test_a_point_that_something_else_depends_on_stays(run):
    outcome = run(text_of(SET, HIGH, TO_P, "$UFRAME := p", declared="p : POSITION"))
    assert all_safe(outcome)
    out = outcome.outputs["job.pdl"]
    assert SET.encode() in out and b"MOVE JOINT TO p__2" in out
    assert b"$UFRAME := p\r\n" in out


def test_each_value_is_given_to_the_clone(run):
    """In both rounds the second move comes from the other side."""
    other = SET.replace("100.0", "130.0")
    body = (f"IF i = 2 THEN\r\n  {other}\r\n  ENDIF", *BOTH)
    loop = (SET, "FOR i := 1 TO 2 DO", *body, "ENDFOR")
    outcome = run(text_of(*loop, declared="i : INTEGER\r\n  p : POSITION"))
    visits, status = outcome.visits, outcome.decisions.status
    named = [
        visits.target.names[k] for k in visits.target.name[status == Status.CORRECTED]
    ]
    assert named.count("p") == named.count("p__2") == 2
    assert outcome.outputs["job.pdl"].count(b"p__2 := POS") == 2


KEPT = [
    ("p : ARRAY[2] OF POSITION", "p[1]", (), "elements of arrays"),
    ("p : POSITION EXPORTED FROM lib", "p", (), ""),
    (f"{'p' * 30} : POSITION", "p" * 30, (), "longer than 32"),
    ("p : XTNDPOS FOR ARM[1]", "p.POS", ("p.AUX[1] := 5",), "one by one|plain"),
]


@pytest.mark.parametrize(("declared", "name", "more", "why"), KEPT)
def test_what_is_in_doubt_is_left_and_listed(run, declared, name, more, why):
    target = name.removesuffix(".POS")
    lines = [SET.replace("p", name, 1), *more, *BOTH]
    lines = [line.replace("TO p", f"TO {target}") for line in lines]
    source = text_of(*lines, declared=declared)
    outcome = run(source)
    assert b"__2" not in outcome.outputs["job.pdl"]
    codes = {one.code for one in outcome.decisions.reasons}
    assert outcome.exit_code == 1 or Code.ARRIVALS_AVERAGED in codes
    said = notes(outcome, "not-cloned")
    assert said == [] if not why else any(w in said[0] for w in why.split("|"))


def test_a_constant_is_not_cloned(run):
    before = f"CONST\r\n  p = POS({RECORD}, '')\r\n"
    outcome = run(text_of(*BOTH, declared="q : POSITION", before=before))
    assert b"__2" not in outcome.outputs["job.pdl"]


def test_a_copy_is_not_cloned(run):
    outcome = run(text_of(SET, "q := p", *BOTH[:3], "MOVE JOINT TO q"))
    out = outcome.outputs["job.pdl"]
    assert b"MOVE JOINT TO q\r\n" in out and b"MOVE JOINT TO p__2\r\n" in out
    assert all_safe(outcome)


def test_a_move_that_disagrees_with_itself_keeps_its_point(run):
    routine = f"ROUTINE r\r\nBEGIN\r\n  {TO_P}\r\nEND r\r\n"
    outcome = run(text_of(SET, HIGH, "r", LOW, "r", before=routine))
    assert "disagree" in notes(outcome, "not-cloned")[0]
    assert b"__2" not in outcome.outputs["job.pdl"]


def test_a_move_that_may_find_another_value_keeps_its_point(run):
    maybe = "IF $DIN[1] THEN\r\n  READ lun (p)\r\n  ENDIF"
    outcome = run(text_of(SET, HIGH, TO_P, LOW, TO_P, maybe, TO_P))
    out = outcome.outputs["job.pdl"].split(b"\r\n")
    assert [x for x in out if x.startswith(b"  MOVE JOINT TO p")] == [
        b"  MOVE JOINT TO p__2", b"  MOVE JOINT TO p__3", b"  MOVE JOINT TO p",
    ]  # fmt: skip
    assert f"  p := POS({RECORD}, '')".encode() in out


def test_exported_points_are_cloned_with_shared_only(run):
    source = text_of(SET, *BOTH, declared="p : POSITION EXPORTED FROM job NOSAVE")
    kept = run(source)
    assert b"__2" not in kept.outputs["job.pdl"]
    outcome = run(source, shared=True)
    assert all_safe(outcome)
    assert b"  p__2 : POSITION NOSAVE\r\n" in outcome.outputs["job.pdl"]


def test_long_lines_stay_within_what_the_language_allows(run):
    blanks = " " * (254 - len("  MOVE JOINT TO p"))
    source = text_of(SET, *BOTH[:3], f"MOVE JOINT{blanks} TO p")
    outcome = run(source)
    assert "longer than 254" in notes(outcome, "not-cloned")[0]
    wide = text_of(SET + f" -- {'x' * 400}", *BOTH[:3], f"MOVE JOINT{blanks} TO p")
    assert all_safe(run(wide))


def test_the_via_point_of_an_arc(run):
    arc = "MOVE CIRCULAR TO POS(150.0, 250.0, 150.0, 0.0, 175.0, 0.0, '') VIA p"
    source = text_of(SET, HIGH, TO_P, LOW, "MOVE JOINT TO POS(50.0, 250.0, 150.0, "
                     "0.0, 175.0, 0.0, '')", arc)  # fmt: skip
    outcome = run(source)
    assert b"VIA p__2\r\n" in outcome.outputs["job.pdl"]
    assert given_back(outcome) == {"job.pdl": source}


@pytest.mark.parametrize(("change", "averages"), [("UFRAME", True), ("TOOL", False)])
def test_joint_angles_hold_in_every_user_frame(run, change, averages):
    """What the TCP of one tool needs does not ask for the frame of poses."""
    joints = "p := {2.0, 5.0, -110.0, 10.0, 40.0, 10.0}"
    frame = f"${change} := POS(1.0, 2.0, 3.0, 0.0, 0.0, 0.0, '')"
    source = text_of(joints, *BOTH[:2], frame, *BOTH[2:], declared="p : JOINTPOS")
    codes = {one.code for one in run(source, clone=False).decisions.reasons}
    assert (Code.ARRIVALS_AVERAGED in codes) == averages
