"""What compensate leaves, check finds and diff lists: every line, with its reason."""

from __future__ import annotations

import json
import re

import pytest

from tests.plant import ARM_AT, program
from tests.written import cli

VALUES = (
    b"p1 POS Priv\r\n X: 100.00 Y: 50.00 Z: 300.00 A: 0.000 E: 180.000 R: 0.000\r\n"
    b" CNFG: ''\r\n"
)
MOVE = "  MOVE LINEAR TO POS(100, {}, 250, 0, 180, 0, '')\r\n"


def with_dead_routine(name: str) -> bytes:
    """Write a program of one target, and two in a routine that nobody calls."""
    moves = "".join(MOVE.format(y) for y in (50, 60))
    routine = f"ROUTINE never\r\nBEGIN\r\n{moves}END never\r\n"
    return program(name, 1, 1).decode().replace("BEGIN", f"{routine}BEGIN", 1).encode()


def unread(name: str) -> bytes:
    text = program(name, 2, 1).decode()
    return text.replace(ARM_AT, ARM_AT + "  FROBNICATE 3\r\n").encode()


PROGRAMS = {
    "dead": (with_dead_routine("dead"), [5, 6], "never-reached"),
    "unread": (unread("unread"), [5, 6, 7], "not known here"),
}


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.parametrize("by", ["compensate", "batch"])
def test_check_and_diff_name_every_line_that_was_left(desk, name, by):
    text, lines, why = PROGRAMS[name]
    (desk.folder / "src").mkdir()
    (desk.folder / "dst").mkdir()
    job = desk.put(f"src/{name}.pdl", text)
    out = desk.folder / "dst" / job.name
    given = ("--cell", desk.cell, "--model", desk.model)
    if by == "compensate":
        assert desk.compensate(job, "-o", out).exit_code == 1
    else:
        assert cli("batch", job.parent, out.parent, *given).exit_code == 1
    found = cli("check", out.parent, "--report", "-")
    assert found.exit_code == 1
    (finding,) = json.loads(found.stdout)["findings"]
    assert finding["code"] == "left-alone" and why in finding["message"]
    assert f"{len(lines)} visits are not corrected, " in finding["message"]
    assert f"lines {lines[0]}-{lines[-1]} of" in finding["message"]
    assert cli("check", out.parent, "--allow-uncorrected").exit_code == 0
    told = json.loads(cli("diff", job, out, "--report", "-").stdout)
    assert [row["line"] for row in told["uncorrected"]] == lines
    assert all(row["status"] == "runtime" for row in told["uncorrected"])
    assert "\nnot corrected:" in cli("diff", job, out).stdout


def test_targets_in_a_program_of_which_only_the_values_change_are_found(desk):
    lines = ["PROGRAM s", "VAR p1: POSITION", "BEGIN", "MOVE LINEAR TO p1", "ext",
             "MOVE LINEAR TO p1", "END s"]  # fmt: skip
    job = desk.put("s.pdl", "\r\n".join(lines))
    desk.put("s.lsv", VALUES)
    out = desk.folder / "out" / "s.pdl"
    out.parent.mkdir()
    assert desk.compensate(job, "-o", out).exit_code == 1
    checked = cli("check", out.parent, "--report", "-")
    (finding,) = json.loads(checked.stdout)["findings"]
    assert "ext, which is not in the given files" in finding["message"]
    count = re.search(r"(\d+) visits", finding["message"])
    left = desk.report(job)["targets"]
    assert count and int(count[1]) == sum(t["status"] != "corrected" for t in left)


def test_a_message_names_all_lines_that_are_never_reached(desk):
    job = desk.put("dead.pdl", with_dead_routine("dead"))
    assert "never reached from the start: 2 (lines 5-6)" in desk.compensate(job).stderr
