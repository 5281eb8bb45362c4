"""Programs of which little or nothing can be compared."""

from __future__ import annotations

from dataclasses import replace

import pytest

from postproc.robot.arm import load_arm
from tests.verify.judged import compensated, model_of, row

EMPTY = b"PROGRAM e\r\nBEGIN\r\nEND e\r\n"
UNKNOWN = (
    b"PROGRAM j\r\nVAR a, b: JOINTPOS\r\nBEGIN\r\na := JNTP(0, 0, -90, 0, 30, 0)\r\n"
    b"b := JNTP(10, 5, -95, 0, 40, 0)\r\nMOVE TO a\r\nMOVE TO b\r\nMOVE TO a\r\n"
    b"END j\r\n"
)
NO_ROTATION = (
    b"MODULE M\r\n PROC main()\r\n"
    b"  MoveJ [[1500,0,1500],[0,0,0,0],[0,0,0,0],"
    b"[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;\r\n ENDPROC\r\nENDMODULE\r\n"
)
LOOP = (
    b"PROGRAM l\r\nVAR i: INTEGER\r\nBEGIN\r\n$MOVE_TYPE := JOINT\r\n"
    b"FOR i := 1 TO 3 DO\r\nMOVE TO {0, 0, -90, 0, 30, 0}\r\n"
    b"MOVE TO {10, 5, -95, 0, 40, 0}\r\nENDFOR\r\nEND l\r\n"
)


@pytest.mark.parametrize(
    ("name", "source"),
    [("e.pdl", EMPTY), ("j.pdl", UNKNOWN), ("m.mod", NO_ROTATION), ("l.pdl", LOOP)],
)
def test_it_ends_in_a_table(name, source, bench_cell, bench_model) -> None:
    job = compensated({name: source}, bench_cell, bench_model)
    opinion = job.opinion()
    assert opinion.agrees, opinion.to_dict()
    for label in ("source", "output"):
        found = row(opinion, f"{label}: joint targets")
        places = row(opinion, f"{label}: place")
        told = found.compared + places.compared
        lost = sum(found.skipped.values()) + sum(places.skipped.values())
        assert told + lost == len(job.outcome.visits)


LINES = (
    b"PROGRAM u\r\nBEGIN\r\nMOVE JOINT TO {0, -60, 90, 0, 60, 0}\r\n"
    b"MOVE JOINT TO {10, -55, 85, 5, 60, 0}\r\n"
    b"MOVE LINEAR TO POS(500, 100, 600, 0, 120, 0, '')\r\n"
    b"MOVE JOINT TO {0, -60, 90, 0, 60, 0}\r\nEND u\r\n"
)


def test_an_arm_whose_branches_nobody_names(bench_cell, bench_model) -> None:
    cell = replace(bench_cell, arm=load_arm("ur10"))
    job = compensated({"u.pdl": LINES}, cell, model_of(cell, bench_model))
    opinion = job.opinion()
    assert opinion.agrees, opinion.to_dict()
    branches = [r for r in opinion.rows if "branch" in r.what]
    assert [(r.compared, sum(r.skipped.values())) for r in branches] == [(0, 4)] * 2
    assert row(opinion, "output: joint targets").compared == 3
    assert row(opinion, "output: approach directions").compared > 5


def test_an_empty_program_lacks_nothing(bench_cell, bench_model) -> None:
    """An arm has its links, though no target of the program asks for them."""
    opinion = compensated({"e.pdl": EMPTY}, bench_cell, bench_model).opinion()
    assert not [r.what for r in opinion.rows if r.compared or r.skipped]
