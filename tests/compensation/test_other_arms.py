"""What belongs to another arm of the controller is never corrected with our model."""

from __future__ import annotations

from dataclasses import replace

import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Status
from postproc.exceptions import ProgramError

OURS = "MOVE JOINT TO {5.0, 10.0, -95.0, 20.0, 50.0, 30.0}"
NEXT = "{15.0, 20.0, -85.0, 30.0, 60.0, 45.0}"
LAST = "MOVE JOINT TO {12.0, 20.0, -85.0, 30.0, 60.0, 45.0}"
POINT = "POS(100.0, 200.0, 150.0, 0.0, 175.0, 0.0, '')"


def text(*lines, declared="", attributes=""):
    head = f"PROGRAM job {attributes}\nVAR n : INTEGER\n{declared}\nBEGIN\n"
    return (head + "\n".join(lines) + "\nEND job\n").encode()


@pytest.fixture
def run(job_cell, job_model):
    def compensated(*lines, arm=1, values=None, pages=None, **more):
        cell = replace(job_cell, arm_number=arm)
        return compensate(
            text(*lines, **more), cell, job_model, name="job.pdl",
            variables=values, pages=pages or {},
        )  # fmt: skip

    return compensated


def lines_of(outcome, name="job.pdl"):
    return outcome.outputs[name].decode().splitlines()[1:]


def statuses(outcome):
    return [Status(s).name for s in outcome.decisions.status]


@pytest.mark.parametrize(
    ("attributes", "arm"), [("PROG_ARM = 2", 1), ("EZ, PROG_ARM=1, HOLD", 2)]
)
def test_a_program_of_another_arm_is_refused(run, attributes, arm):
    said = attributes.split("ARM")[1].strip(" =")[0]
    with pytest.raises(ProgramError, match=rf"job\.pdl:1: .*arm {said}.*arm_number"):
        run(OURS, attributes=attributes, arm=arm)


def test_a_program_of_the_arm_of_the_cell_is_corrected(run):
    outcome = run(OURS, LAST, attributes="PROG_ARM = 2", arm=2)
    assert outcome.exit_code == 0 and statuses(outcome) == ["CORRECTED"] * 2
    assert run(OURS, LAST, arm=2).exit_code == 0


POINTS_OF_TWO = [
    (f"j := {NEXT}", "MOVE JOINT TO j", "j : JOINTPOS FOR ARM[2]"),
    ("", "MOVE JOINT TO j", f"j : JOINTPOS FOR ARM[2] ({NEXT})"),
    (f"j := {NEXT}\nk := j", "MOVE JOINT TO k",
     "j : JOINTPOS FOR ARM[2]\nk : JOINTPOS FOR ARM[1]"),
    (f"x.POS := {POINT}", "MOVE LINEAR TO x", "x : XTNDPOS FOR ARM[2]"),
    (f"t[1] := {NEXT}", "MOVE JOINT TO t[1]", "t : ARRAY[2] OF JOINTPOS FOR ARM[2]"),
    (f"k := {NEXT}\nj := k", "MOVE JOINT TO k",
     "j : JOINTPOS FOR ARM[2]\nk : JOINTPOS FOR ARM[1]"),
    (f"k := {NEXT}", "r(k)", "k : JOINTPOS\nROUTINE r(p : JOINTPOS FOR ARM[2])\n"
     "BEGIN\nMOVE JOINT TO p\nEND r"),
]  # fmt: skip


@pytest.mark.parametrize(("set_", "move", "declared"), POINTS_OF_TWO)
def test_a_point_of_another_arm_keeps_its_numbers(run, set_, move, declared):
    outcome = run(OURS, set_, move, declared=declared)
    whole = text(OURS, set_, move, declared=declared).decode().splitlines()
    changed = [
        old for old, new in zip(whole, lines_of(outcome), strict=True) if old != new
    ]
    assert changed == [OURS]
    assert outcome.exit_code == 1
    assert any("arm 2" in why for why in outcome.list_uncorrected())
    one = replace_arms(declared)
    assert run(OURS, set_, move, declared=one).exit_code == 0


def replace_arms(text):
    return text.replace("ARM[2]", "ARM[1]")


def test_a_point_of_another_arm_in_the_variable_file(run):
    values = b"j JNTP Arm: {} Ax: 6 Priv\n 1: 15 2: 20 3: -85 4: 30 5: 60 6: 45\n"
    for arm, declared in ((b"1", "[2]"), (b"2", "")):
        outcome = run(
            OURS,
            "MOVE JOINT TO j",
            declared=f"j : JOINTPOS{' FOR ARM' if declared else ''}{declared}",
            values=values.replace(b"{}", arm),
        )
        assert outcome.exit_code == 1 and "job.lsv" not in outcome.outputs
        assert "arm 2" in outcome.list_uncorrected()[0]


@pytest.mark.parametrize(
    ("set_", "attributes"),
    [
        ("$DFT_ARM := 2", ""),
        ("$DFT_ARM := 2", "PROG_ARM = 1"),
        ("$DFT_ARM := n", ""),
        ("$PROG_ARM := 2", "PROG_ARM = 1"),
        ("IF n = 1 THEN\n$DFT_ARM := 2\nENDIF", ""),
    ],
)
def test_moves_without_an_arm_after_the_default_arm_is_another(run, set_, attributes):
    given = OURS, set_, f"MOVE JOINT TO {NEXT}", LAST
    outcome = run(*given, attributes=attributes)
    assert statuses(outcome) == ["CORRECTED", "RUNTIME", "RUNTIME"]
    assert outcome.exit_code == 1
    assert all("_ARM" in line for line in outcome.list_uncorrected())
    back = run(*given, "$DFT_ARM := 1", "$PROG_ARM := 1", OURS, LAST)
    assert statuses(back)[-1] == "CORRECTED"


def test_a_tool_that_is_set_for_another_arm_is_not_ours(run):
    tool = "$TOOL := POS(10, 20, 300, 0, 0, 0, '')"
    pose = f"MOVE LINEAR TO {POINT}"
    outcome = run(OURS, "$DFT_ARM := 2", tool, "$DFT_ARM := 1", pose)
    assert statuses(outcome) == ["CORRECTED", "RUNTIME"]


def test_moves_that_name_another_arm_are_listed(run):
    outcome = run(
        OURS,
        f"MOVE ARM[2] JOINT TO {NEXT}",
        "MOVE ARM[2] JOINT TO $HOME",
        f"MOVE ARM[1] JOINT TO {NEXT} SYNCMOVE ARM[2] LINEAR TO {POINT}",
        LAST,
    )
    found = [d for d in outcome.diagnostics if d.code == "other-arm"]
    assert [d.line for d in found] == [6, 8]
    assert all("arm 2" in d.message and "arm_number" in d.message for d in found)
    assert statuses(outcome) == ["CORRECTED"] * 3 and outcome.exit_code == 1
    assert lines_of(outcome)[5] == f"MOVE ARM[2] JOINT TO {NEXT}"
    assert lines_of(outcome)[7].endswith(f"SYNCMOVE ARM[2] LINEAR TO {POINT}")


def test_a_page_of_another_arm_is_left_and_listed(run):
    page = f"PROGRAM page PROG_ARM = 2\nBEGIN\nMOVE JOINT TO {NEXT}\nEND page\n"
    outcome = run(OURS, "CALL page", LAST, pages={"page.pdl": page.encode()})
    assert outcome.exit_code == 1 and "page.pdl" not in outcome.outputs
    assert "PROG_ARM" in outcome.list_uncorrected()[0]
