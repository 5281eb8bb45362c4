"""Fly points behind which the arm may go anywhere: it stops there, or passes them."""

from __future__ import annotations

import pytest

from postproc.compensation.program import read_program
from postproc.compensation.solver.targets import find_open_corners

RAPID = """MODULE job
PERS wobjdata w:=[FALSE,TRUE,"",[[600,1300,2300],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
PERS tooldata t:=[TRUE,[[0,0,300],[1,0,0,0]],[80,[0,0,100],[1,0,0,0],0,0,0]];
PROC main()
MoveL [[100,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v200,z50,t\\WObj:=w;
%s
MoveL [[200,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v200,fine,t\\WObj:=w;
EXIT;
ENDPROC
ENDMODULE
"""
KRL = """DEF job( )
$TOOL=$NULLFRAME
$BASE=$NULLFRAME
$APO.CDIS=30
LIN {X 100,Y 0,Z 0,A 0,B 0,C 0} C_DIS
%s
LIN {X 200,Y 0,Z 0,A 0,B 0,C 0}
END
"""
PDL2 = """PROGRAM job
BEGIN
  $FLY_TYPE := FLY_CART
  $FLY_DIST := 30
  MOVEFLY LINEAR TO POS(100, 0, 0, 0, 90, 0, '') ADVANCE
  %s
  MOVE LINEAR TO POS(200, 0, 0, 0, 90, 0, '')
END job
"""
JOBS = {"mod": RAPID, "src": KRL, "pdl": PDL2}


@pytest.mark.parametrize(
    ("kind", "line", "open_"),
    [
        ("mod", "", False),
        ("mod", "WhatIsIt;", True),
        ("mod", "StopMove;", True),
        ("mod", "StorePath;", True),
        ("mod", "WaitTime 2;", True),
        ("mod", "Set do1;", False),
        ("mod", "WaitTime 2;\nEXIT;", False),  # it stops there
        ("src", "", False),
        ("src", "WHAT_IS_IT( )", True),
        ("src", "WAIT SEC 2", False),  # it stops there
        ("pdl", "", False),
        ("pdl", "what_is_it", True),
        ("pdl", "FROBNICATE p WITH 3", True),
        ("pdl", "CANCEL ALL", True),
        ("pdl", "DELAY 200", True),
        ("pdl", "$DOUT[1] := TRUE", False),
        ("pdl", "DELAY 200\n  RETURN", False),  # it stops there
    ],
)
def test_where_it_may_pass_or_stop(
    kind: str, line: str, open_: bool, bench_cell
) -> None:
    text = JOBS[kind] % line
    visits = read_program({f"job.{kind}": text.encode()}, bench_cell).visits
    first = next(k for k in range(len(visits)) if visits.target.values[k, 0] == 100.0)
    assert bool(find_open_corners(visits)[first]) == open_
