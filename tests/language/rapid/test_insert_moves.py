"""Which moves of RAPID get points, and how these are written."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.language.insert_moves import ArcPiece
from postproc.language.rapid.language import Rapid
from postproc.language.text.source import CloneError, Source, apply

HERE = "[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
LINE = 5  # of the move that is asked about


def source(*moves: str, declared: str = "VAR num n;", more: str = "") -> Source:
    lines = ["MODULE job", f"  {declared}", "  PROC main()", "    MoveL p,v100,fine,t;"]
    lines += [*(f"    {move}" for move in moves), "  ENDPROC", more, "ENDMODULE", ""]
    return Source("job.mod", "\r\n".join(lines).encode("latin-1"))


def hinders(*moves: str, declared: str = "VAR num n;", more: str = "") -> str:
    splitter = Rapid().splitter([source(*moves, declared=declared, more=more)])
    said = splitter.hinders(0, LINE)
    if not said:
        try:
            splitter.layout(0, LINE)
        except CloneError as problem:
            return str(problem)
    return said


@pytest.mark.parametrize(
    "move",
    [
        "MoveL p,v100,fine,t;",
        "MoveL p, v100\\V:=50, z10\\Inpos:=inpos50, t\\WObj:=w\\TLoad:=load1; ! seam",
        f"MoveC {HERE},p,v100,z10,t;",
    ],
)
def test_plain_moves_may_be_split(move: str) -> None:
    assert hinders(move) == ""


@pytest.mark.parametrize(
    ("move", "said"),
    [
        ("MoveLDO p,v100,fine,t,do1,1;", "only MoveL and MoveC"),
        ("TriggL p,v100,trig1,fine,t;", "only MoveL and MoveC"),
        ("ArcL p,v100,seam1,weld1,fine,t;", "only MoveL and MoveC"),
        ("MoveL\\Conc,p,v100,fine,t;", "conc"),
        ("MoveL p,v100\\T:=5,fine,t;", "t of it"),
        ("IF n=1 MoveL p,v100,fine,t;", "alone"),
        ("n:=1; MoveL p,v100,fine,t;", "alone"),
        ("MoveL p,v100,\r\n  fine,t;", "lines"),
    ],
)
def test_moves_that_something_hangs_on_are_not(move: str, said: str) -> None:
    assert said in hinders(move)


def test_what_the_program_says_itself_forbids_points() -> None:
    move = "MoveL p,v100,fine,t;"
    zone = "CONST zonedata z0:=[FALSE,50,50,50,1,50,1];"
    assert "declares z0" in hinders(move, declared=zone)
    trap = "  TRAP t1\r\n    n:=CPos(\\Tool:=t);\r\n  ENDTRAP"
    assert "TRAP" in hinders(move, more=trap)
    assert hinders(move, more="  TRAP t1\r\n    n:=1;\r\n  ENDTRAP") == ""


def test_the_arm_stops_once_more_only_where_nothing_began() -> None:
    move = "MoveL p,v100,fine,t;"
    for before, may in (("ConfL \\Off;", True), ("SetDO do1,1;", False)):
        assert Rapid().splitter([source(before, move)]).stops(0, LINE + 1) is may


def test_points_stand_before_the_move_as_it_is_written() -> None:
    given = source("MoveL p, v100\\V:=50, z10, t\\WObj:=w; ! seam")
    numbers = np.array([[1.0, 2.5, -3.12345, 1, 0, 0, 0, -1, 0, 1, 4], [2.0] * 11])
    edit = Rapid().splitter([given]).points(0, LINE, numbers, "", True)
    lines = apply(given.data, [edit]).decode("latin-1").split("\r\n")
    unused = "[9E9,9E9,9E9,9E9,9E9,9E9]]"
    ones = "[1.000,2.500,-3.123],[1.000000,0.000000,0.000000,0.000000],[-1,0,1,4]"
    twos = "[2.000,2.000,2.000],[2.000000,2.000000,2.000000,2.000000],[2,2,2,2]"
    end = ",t\\WObj:=w; ! postproc: inserted"
    assert lines[LINE - 1 : LINE + 2] == [
        f"    MoveL [{ones},{unused},v100\\V:=50,fine{end}",
        f"    MoveL [{twos},{unused},v100\\V:=50,z0{end}",
        "    MoveL p, v100\\V:=50, z10, t\\WObj:=w; ! seam",
    ]


def test_pieces_of_an_arc_stand_before_it_and_it_is_the_last() -> None:
    given = source(f"MoveC {HERE}, p, v100, fine, t;")
    one, two = np.full(11, 1.0), np.full(11, 2.0)
    pieces = [ArcPiece(one, None), ArcPiece(None, two, True)]
    edits = Rapid().splitter([given]).arc(0, LINE, pieces, np.full(11, 3.0), "", False)
    lines = apply(given.data, edits).decode("latin-1").split("\r\n")
    first, second, last = lines[LINE - 1 : LINE + 2]
    assert first.startswith("    MoveL [[1.000,")
    assert second.startswith("    MoveC [[2.000,")
    assert second.endswith(f",{HERE},v100,z0,t; ! postproc: inserted (via)")
    assert last.startswith("    MoveC [[3.000,") and last.endswith(
        ", p, v100, fine, t;"
    )
    assert Rapid().ends_at_via(second.encode())


@pytest.mark.parametrize("via", ["r", "r{2}"])
def test_an_arc_through_a_named_point_is_not_cut(via: str) -> None:
    splitter = Rapid().splitter([source(f"MoveC {via},p,v100,fine,t;")])
    with pytest.raises(CloneError, match="on its way"):
        splitter.arc(0, LINE, [ArcPiece(None, None, True)], np.zeros(11), "", False)
