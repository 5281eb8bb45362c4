"""What to declare first, and how many targets that frees."""

from __future__ import annotations

from tests.written import FIRST, NEXT, POSE, cli, program


def told(desk, *lines):
    job = desk.put("job.pdl", program(FIRST, *lines))
    given = ("--cell", desk.cell, "--model", desk.model, "-o", desk.folder / "o.pdl")
    return cli("compensate", job, *given).stderr


def test_the_first_cause_is_told_once_with_what_it_frees(desk):
    found = told(desk, "dock", POSE, "undock", NEXT)
    assert found.count("first-cause") == 1
    assert "job.pdl:6: first-cause" in found and "leaves 2 of 3 targets" in found
    assert found.index("first-cause") < found.index("unknown-routine")


def test_nothing_is_told_where_nothing_would_be_freed(desk):
    assert "first-cause" not in told(desk, POSE)
    assert "first-cause" not in told(desk, POSE, NEXT, "dock")
