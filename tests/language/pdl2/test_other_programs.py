"""Other programs of a folder that change variables which a program exports."""

from __future__ import annotations

import pytest

from postproc.files import FolderListing
from postproc.language.language import Start
from postproc.language.pdl2.language import Pdl2
from postproc.language.pdl2.other_programs import find_other_programs
from postproc.language.text.source import Source
from tests.language.pdl2.test_opaque_calls import program

P = "POS({}, 2, 3, 0, 180, 0, '')"
VALUES = """g POS Arm: 1 Xport
 X: 1.00  Y: 2.00  Z: 3.00  A: 0.00  E: 180.00  R: 0.00
 CNFG: ''
f POS Arm: 1 Xport
 X: 10.00  Y: 0.00  Z: 0.00  A: 0.00  E: 0.00  R: 0.00
 CNFG: ''
"""
HEAD = ["VAR g, f : POSITION EXPORTED FROM job"]
OTHER = ["VAR f : POSITION EXPORTED FROM job"]
SET = f"f := {P.format(4)}"
MOVES = ["$UFRAME := f", "MOVE LINEAR TO g"]


def reasons(*body, change=SET, head=OTHER, **said):
    files = {
        "job.pdl": program("job", HEAD, list(body)),
        "PROGRAMS/o.pdl": program("o", list(head), change.splitlines()),
        "job.lsv": VALUES,
    }
    sources = [Source(name, text.encode()) for name, text in files.items()]
    found = Pdl2().read(sources, Start(**said))
    assert found.visits.files == tuple(files)
    assert [text.source.name for text in found.texts] == [*files]
    v = found.visits
    return [v.reasons[k].text for k in v.reason.tolist()]


@pytest.mark.parametrize(
    "change",
    [SET, "f.X := 5", "find(f)", "READ lun (f)", "IF $DIN[1] THEN\nf := g\nENDIF"],
)
def test_what_another_program_changes_is_not_known(change):
    (why,) = reasons(*MOVES, change=change)
    assert "may be changed by o.pdl (line" in why


def test_a_target_that_another_program_changes_is_not_known():
    (why,) = reasons("MOVE LINEAR TO f")
    assert "may be changed by o.pdl (line" in why


@pytest.mark.parametrize(
    ("change", "head"),
    [
        ("MOVE LINEAR TO f", OTHER),
        (SET, ["VAR f : POSITION EXPORTED FROM another"]),
        (SET, ["VAR f : POSITION"]),
    ],
)
def test_what_is_not_shared_does_no_harm(change, head):
    assert reasons(*MOVES, change=change, head=head) == [""]


def test_what_the_cell_calls_constant_is_known():
    assert reasons(*MOVES, constant=("job.f",)) == [""]


def test_what_a_program_sets_is_known_until_others_may_run():
    found = reasons(f"f := {P.format(5)}", *MOVES, "DELAY 10", *MOVES)
    assert not found[0] and found[1]


START = ["MOVE TO {0, 0, -90, 0, 90, 0}"]
ROUTINE = ["ROUTINE sub EXPORTED FROM job", "ROUTINE sub", "BEGIN", "MOVE LINEAR TO g",
           "END sub"]  # fmt: skip


def test_frames_of_who_calls_the_program_are_not_known():
    found = reasons(*START, "MOVE LINEAR TO g", change="CALL job", head=[])
    assert all("JOB is called by o.pdl (line" in why for why in found)
    own = ["$UFRAME := POS(0,0,0,0,0,0,'')", "$TOOL := POS(0,0,0,0,0,0,'')",
           "$BASE := POS(0,0,0,0,0,0,'')"]  # fmt: skip
    found = reasons(*own, *START, "MOVE LINEAR TO g", change="CALL job", head=[])
    assert found == ["", ""]


@pytest.mark.parametrize("change", ["CALL another", "x := 1"])
def test_a_program_that_nothing_calls_begins_as_the_cell_says(change):
    assert reasons(*START, "MOVE LINEAR TO g", change=change, head=[]) == ["", ""]


@pytest.mark.parametrize("head", [["ROUTINE sub EXPORTED FROM job"], ["IMPORT 'job'"]])
def test_a_routine_that_others_call_begins_anywhere_too(head):
    files = {
        "job.pdl": program("job", ROUTINE, [*START, "sub"]),
        "PROGRAMS/o.pdl": program("o", head, ["sub"]),
        "job.lsv": VALUES,
    }
    kept = {"job.pdl": files["job.pdl"], "job.lsv": VALUES}
    for given, known in ((files, False), (kept, True)):
        sources = [Source(name, text.encode()) for name, text in given.items()]
        v = Pdl2().read(sources, Start()).visits
        texts = [v.reasons[k].text for k in v.reason.tolist()]
        assert any(texts) is not known
        assert known or any("SUB is called by o.pdl (line" in text for text in texts)


OTHERS = {
    "changes": (SET, OTHER, True),
    "reads": ("MOVE LINEAR TO f", OTHER, False),
    "its own": (SET, ["VAR f : POSITION EXPORTED FROM o"], False),
    "calls": ("CALL job", [], True),
    "calls another": ("CALL x", [], False),
    "of another": (SET, ["VAR f : POSITION EXPORTED FROM x"], False),
}


@pytest.mark.parametrize(("change", "head", "expected"), OTHERS.values(), ids=OTHERS)
def test_programs_that_are_read(tmp_path, change, head, expected):
    (tmp_path / "job.pdl").write_text(program("job", HEAD, MOVES))
    (tmp_path / "o.pdl").write_text(program("o", list(head), [change]))
    found = find_other_programs(tmp_path / "job.pdl", FolderListing())
    assert [path.name for path in found] == ["o.pdl"] * expected
