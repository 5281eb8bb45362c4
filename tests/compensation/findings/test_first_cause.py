"""What to declare first, and how many targets that frees."""

from __future__ import annotations

from postproc.compensation.findings.first_cause import read_with_cause
from tests.language.krl.test_visits import CONFIG, DATA
from tests.written import FIRST, NEXT, POSE, cli, program


def told(desk, *lines):
    job = desk.put("job.pdl", program(FIRST, *lines))
    given = ("--cell", desk.cell, "--model", desk.model, "-o", desk.folder / "o.pdl")
    return cli("compensate", job, *given).stderr


def test_the_first_cause_is_told_once_with_what_it_frees(desk):
    found = told(desk, "dock", POSE, "undock", NEXT)
    assert found.count("first-cause") == 1
    assert "job.pdl:6: first-cause" in found
    assert "2 of 3 targets are not corrected" in found
    assert found.index("first-cause") < found.index("unknown-routine")


def test_nothing_is_told_where_nothing_would_be_freed(desk):
    assert "first-cause" not in told(desk, POSE)
    assert "first-cause" not in told(desk, POSE, NEXT, "dock")


def test_targets_that_are_read_only_once_it_is_known_count(job_cell):
    lines = ["PTP XP1", "ours( )", "LIN XP1", "LIN XP2"]
    source = "\n".join(["DEF m( )", "BAS(#TOOL,1)", "BAS(#BASE,2)", *lines, "END\n"])
    lists = {"m.dat": f"DEFDAT m\n{DATA}ENDDAT\n", "$config.dat": CONFIG}
    files = {"m.src": source, **lists}
    found = read_with_cause({k: v.encode() for k, v in files.items()}, job_cell)
    assert "2 of 3 targets are not corrected" in found.diagnostics[0].message
