"""What a comment ``! TAUGHT`` speaks of."""

from __future__ import annotations

import pytest

from postproc.language.language import Start
from postproc.language.rapid.language import Rapid
from postproc.language.text.source import Source
from tests.golden.rapid_cases import DATA, TARGETS, go, module

POINT = next(line for line in DATA if "robtarget p1:" in line)
LIST = ",\n".join(TARGETS[name] for name in ("p1", "p2", "p3"))
HELD = "a target that is computed from it is marked as taught"


def read(*lines, declared="", swap=()):
    text = module(*lines, declared=declared).decode()
    for old, new in swap:
        assert old in text
        text = text.replace(old, new)
    return Rapid().read([Source("job.mod", text.encode())], Start()).visits


def taught(visits):
    """Name the literals that are marked."""
    held = zip(visits.literals.name, visits.literals.taught.tolist(), strict=True)
    return [name for name, own in held if own]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("p1:=[[", "p1:=[[ ! TAUGHT\n"),
        ("p1:=[[", "p1:= ! TAUGHT\n[["),
        ("CONST robtarget p1:=", "CONST ! TAUGHT\nrobtarget\np1\n:="),
        ("466.49],[", "466.49], ! TAUGHT\n["),
        ("466.49],[", "466.49],\n! TAUGHT\n["),
        (POINT, POINT.replace("],[", "],\n[") + " ! TAUGHT"),
        (POINT, POINT.replace("];", "]\n; ! taught by hand")),
    ],
)
def test_a_comment_holds_for_its_statement(old, new):
    assert taught(read(go("p1"), go("p2"), swap=[(old, new)])) == ["p1"]


def test_a_comment_holds_for_no_statement_beside_it():
    swap = [(POINT, "! TAUGHT\n" + POINT + "\n! TAUGHT")]
    assert taught(read(go("p1"), go("p2"), swap=swap)) == []


@pytest.mark.parametrize(
    ("old", "new", "held"),
    [
        ("[[356", "! TAUGHT\n[[356", ["list{1}", "list{2}", "list{3}"]),
        ("list{3}:=[", "list{3}:=[ ! TAUGHT\n", ["list{1}", "list{2}", "list{3}"]),
        ("[[178", "[! TAUGHT\n[178", ["list{1}", "list{2}", "list{3}"]),
        ("235.63],", "235.63], ! TAUGHT\n", ["list{2}"]),
        ("[[333.75,", "[[333.75, ! TAUGHT\n", ["list{3}"]),
        ("],\n[[356", "], ! TAUGHT\n[[356", ["list{1}"]),
    ],
)
def test_a_comment_beside_numbers_of_an_array_holds_for_these(old, new, held):
    array = f"CONST robtarget list{{3}}:=[{LIST}];"
    moves = [go(f"list{{{k}}}") for k in (1, 2, 3)]
    text = array.replace(old, new)
    assert text != array and taught(read(*moves, declared=text)) == held


@pytest.mark.parametrize(
    ("move", "pinned"),
    [
        ("MoveL Offs(p1,0,0,n+10),v200,fine,t\\WObj:=w; ! TAUGHT", True),
        ("MoveL Offs(p1,0,0,n+10),! TAUGHT\nv200,fine,t\\WObj:=w;", True),
        ("MoveL RelTool(p1,0,0,n),v200,fine,\nt\\WObj:=w; ! TAUGHT", True),
        ("MoveL Offs(p1,0,0,unknown),v200,fine,t\\WObj:=w; ! TAUGHT", True),
        ("MoveL Offs(p1,0,0,n+10),v200,fine,t\\WObj:=w;", False),
        ("MoveL p1,v200,fine,t\\WObj:=w;", False),
    ],
)
def test_a_computed_target_that_is_taught_holds_its_point(move, pinned):
    visits = read(go("p1"), move, go("p2"), declared="CONST num n:=5;")
    pins = dict(zip(visits.literals.name, visits.literals.pinned, strict=True))
    assert bool(pins["p1"]) == pinned and not pins["p2"]
    if "unknown" not in move:
        assert pins["p1"] in ("", HELD)


@pytest.mark.parametrize(
    "swap",
    [("t:=[", "t:= ! TAUGHT\n["), ("[TRUE,[[95.3", "[TRUE, ! TAUGHT\n[[95.3"),
     (",0,0,0]];", ",0,0,0]\n]; ! TAUGHT")],
)  # fmt: skip
def test_a_tool_that_is_taught_is_so_by_its_statement(swap):
    assert not read(go("p1")).frame.taught.any()
    assert read(go("p1"), swap=[swap]).frame.taught.any()


def test_a_written_shift_is_taught_by_its_statement():
    move = "MoveL Offs(p1,0,0,100),v200,\nfine,t\\WObj:=w; ! TAUGHT"
    visits = read(go("p1"), move)
    assert visits.literals.taught[visits.target.literal[2]]
    assert not visits.literals.taught[visits.target.literal[1]]


def test_a_shift_of_a_point_that_is_computed_keeps_its_numbers():
    points = LIST.replace("0.950898", "0.5+0.45")
    moves = ["FOR i FROM 1 TO 3 DO", go("list{i}"),
             "MoveL Offs(list{i},0,0,20),v200,fine,t\\WObj:=w;", "ENDFOR"]  # fmt: skip
    declared = "CONST robtarget list{{3}}:=[{}];"
    pins = [read(*moves, declared=declared.format(own)).literals.pinned
            for own in (LIST, points)]  # fmt: skip
    assert not any(pins[0]) and any("shifts a point, too" in pin for pin in pins[1])
