"""Calls of routines that are not at hand, on the command line."""

from __future__ import annotations

import re

import pytest

from tests.plant import program
from tests.written import cli


def calling(*calls: str) -> bytes:
    """Write a program of four targets, with calls before the last three."""
    text = program("job", 4, 1).decode()
    head, *moves = re.split(r"(?=  MOVE LINEAR)", text)
    inner = "".join(f"  {call}\r\n" for call in calls)
    return "".join([head, moves[0], inner, *moves[1:]]).encode()


CALLS = {"tf": "$par := tf(1,1)", "rtf": "rtf", "update_tool": "update_tool",
         "toolframe": "ToolFrame", "tt_tool": "CALL TT_TOOL",
         "set_tool": "set_tool(2)"}  # fmt: skip


@pytest.mark.parametrize("name", CALLS)
def test_targets_are_left_until_the_cell_says_what_a_routine_does(desk, name):
    job = desk.put("job.pdl", calling(CALLS[name]))
    found = desk.compensate(job)
    assert found.exit_code == 1
    assert "5 visits (2 corrected, 3 runtime)" in found.stderr
    (line,) = re.findall(rf'{name} = "motionless"', found.stderr)
    cell = desk.put("cell.toml", f"{desk.cell.read_text()}\n[routines]\n{line}\n")
    assert desk.compensate(job, "--cell", cell, "--model", desk.model).exit_code == 0


STRICT = ("--set", "compensation.assume_motion=true")


def test_assume_motion_ignores_the_shipped_list(desk):
    source = desk.folder / "src"
    source.mkdir()
    job = desk.put("src/job.pdl", calling("spot(1, 2)"))
    given = ("--cell", desk.cell, "--model", desk.model)
    for strict, code in ((), 0), (STRICT, 1):
        alone = desk.folder / f"alone{code}.pdl"
        assert desk.compensate(job, "-o", alone, *strict).exit_code == code
        out = desk.folder / f"dst{code}"
        assert cli("batch", source, out, *given, "--jobs", 1, *strict).exit_code == code
        assert cli("check", out).exit_code == code
        checked = cli("check", out, *STRICT, "--cell", desk.cell, "--allow-uncorrected")
        assert checked.exit_code == 1 - code  # made strictly, nothing was assumed
        assert ("routine-assumed-motionless" in checked.stderr) is not bool(code)
        told = cli("explain", job, *given, "--report", "-", *strict).stdout
        assert ("spot, which is not in the given files" in told) is bool(code)
        planned = cli("explain", job, *given[:2], "--report", "-", *strict)
        assert planned.exit_code == 0
