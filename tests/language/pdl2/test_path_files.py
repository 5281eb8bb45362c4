"""Programs whose points are nodes of paths in their variable file, from end to end."""

from __future__ import annotations

import re

import pytest

from postproc.language.pdl2.language import Pdl2
from postproc.report.diff import target_name
from tests.written import FIRST, LISTED, cli, program

NUMBERS = " Y: 200.00  Z: 150.00  A: 0.000  E: 175.000  R: 0.000"
JOINTS = " 1: 5.00 2: 10.00 3: -95.00 4: 20.00 5: 50.00 6: 30.00"
VALUES = f"""{LISTED}pth PATH nd Priv
 NODE[1]
 $MAIN_POS POS
 X: 100.00 {NUMBERS}
 CNFG: ''
 NODE[2]:
 $MAIN_JNTP JNTP Arm: 1 Ax: 6
 {JOINTS}
 NODE[3]
 $MAIN_XTND XTND Arm: 1 Ax: 1 X: 140.00 {NUMBERS} 1: 90 CNFG: ''
 k INT
 140
seam PATH nd Priv
 NODE[1]
 $MAIN_POS POS
 X: 180.00 {NUMBERS}
 CNFG: ''
rec AREC[2] rt Xport
 [2]:
 p POS
 X: 220.00 {NUMBERS}
 CNFG: ''
""".replace("\r\n", "\n").replace("\n", "\r\n")
MOVES = (
    FIRST,
    "MOVE LINEAR TO pth.NODE[1]",
    "MOVE LINEAR TO pth.NODE[3].$MAIN_XTND",
    "MOVE JOINT TO pth.NODE[2]",
    "MOVE LINEAR TO seam.NODE[1]",
    "MOVE LINEAR TO rec[2].p",
    "MOVE ALONG seam",
)
DECLARED = "pth, seam : PATH OF nd\r\n  rec : ARRAY[2] OF rt"
MOVED = ["pth.NODE[1].$MAIN_POS", "pth.NODE[2].$MAIN_JNTP", "pth.NODE[3].$MAIN_XTND"]


@pytest.fixture
def made(desk):
    """The program, compensated, and where it was written."""
    source = desk.put("job.pdl", program(*MOVES, declared=DECLARED))
    desk.put("job.lsv", VALUES)
    out = desk.folder / "out"
    out.mkdir()
    found = desk.compensate(source, "-o", out / "job.pdl")
    assert found.exit_code == 1, found.stderr  # seam and rec are left alone
    return source, out, found


def masked(line: str) -> str:
    return re.sub(r"(?<=: )-?\d+\.\d+", "#", line)


def test_the_nodes_change_and_nothing_else(made):
    _, out, found = made
    stamp, *lines = (out / "job.lsv").read_bytes().decode().splitlines(keepends=True)
    assert stamp.startswith("-- postproc ")
    before = VALUES.splitlines(keepends=True)
    assert [*map(masked, lines)] == [*map(masked, before)]
    pairs = zip(before, lines, strict=True)
    differ = [at for at, (old, new) in enumerate(pairs, start=1) if old != new]
    assert differ == [5, 9, 11]
    assert "MOVE ALONG seam goes to it too" in found.stderr
    assert "job.pdl:11: rejected: other programs may read this variable" in found.stderr


def test_it_is_restored_and_checked(made):
    source, out, _ = made
    checked = cli("check", out)
    assert checked.exit_code == 1
    assert "left-alone" in checked.output
    assert "lines 17, 22 of the source" in checked.output
    assert cli("restore", out / "job.pdl").exit_code == 0
    assert (out / "job.pdl").read_bytes() == source.read_bytes()
    assert (out / "job.lsv").read_bytes() == VALUES.encode()


def test_the_rows_of_diff_name_the_nodes(made):
    source, out, _ = made
    found = cli("diff", source, out / "job.pdl")
    rows = [
        line for line in found.output.splitlines() if "->" in line and "job.lsv" in line
    ]
    assert [name for row in rows for name in MOVED if name in row] == MOVED
    left = found.output.partition("\nnot corrected:")[2]
    assert "seam.NODE[1].$MAIN_POS" in left
    assert "rec[2].p" in left


def test_shared_parts_are_edited_where_that_is_wanted(made, desk):
    source, out, _ = made
    assert b"X: 220.00 " in (out / "job.lsv").read_bytes()
    desk.compensate(
        source,
        "-o",
        desk.folder / "other.pdl",
        "--set",
        "compensation.edit_exported=true",
    )
    assert b"X: 220.00 " not in (desk.folder / "other.lsv").read_bytes()


def test_a_node_is_not_cloned(desk):
    far = ("MOVE JOINT TO {-20.0, -15.0, -130.0, -60.0, 20.0, -80.0}",
           "MOVE JOINT TO {20.0, 25.0, -80.0, 60.0, 80.0, 80.0}")  # fmt: skip
    moves = [line for start in far for line in (start, "MOVE JOINT TO pth.NODE[1]")]
    source = desk.put("job.pdl", program(FIRST, *moves, declared=DECLARED))
    desk.put("job.lsv", VALUES)
    found = desk.compensate(source, "--shared-points", "clone")
    assert found.exit_code == 0 and "arrivals-averaged" in found.stderr
    text = "elements of arrays, records and paths are not cloned"
    assert f"not-cloned: {text}" in found.stderr


def test_a_point_that_holds_a_node_is_not_cloned(desk):
    moves = ["p := pth.NODE[1].$MAIN_POS"]
    for side in ("{-20.0, -15.0, -130.0, -60.0, 20.0, -80.0}",
                 "{20.0, 25.0, -80.0, 60.0, 80.0, 80.0}"):  # fmt: skip
        moves += [f"MOVE JOINT TO {side}", "MOVE JOINT TO p"]
    declared = f"p : POSITION\r\n  {DECLARED}"
    source = desk.put("job.pdl", program(FIRST, *moves, declared=declared))
    desk.put("job.lsv", VALUES)
    found = desk.compensate(source, "--shared-points", "clone")
    assert "not-cloned: p holds a copy of pth.NODE[1].$MAIN_POS" in found.stderr


def test_names_of_lines_whatever_their_layout():
    text = VALUES.replace("\r\n ", "\r\n")
    lines = text.encode().split(b"\r\n")
    names = [*Pdl2().target_names("job.lsv", lines, [0, 1, 5, 9, 11, 17, 22])]
    assert names == [
        "",
        "",
        MOVED[0],
        MOVED[1],
        MOVED[2],
        "seam.NODE[1].$MAIN_POS",
        "rec[2].p",
    ]
    assert target_name(lines[4].decode()) == "X"


def test_a_line_that_the_original_has_not_has_no_name():
    lines = [b"p1 POS Priv", b"X: 1.0", b"p2 POS Priv"]
    assert [*Pdl2().target_names("job.lsv", lines, [0, 2, 3])] == ["", "p1", "p2"]
    lines = [b"pth PATH nd Priv", b"x STR 'open", b"p1 POS Priv"]
    assert [*Pdl2().target_names("job.lsv", lines, [1, 3])] == ["", ""]
