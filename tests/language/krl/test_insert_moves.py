"""Which moves of KRL get points, and how these are written."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.language.insert_moves import ArcPiece
from postproc.language.krl.language import Krl
from postproc.language.text.source import CloneError, Source, apply

HERE = "{X 1,Y 2,Z 3,A 0,B 0,C 0,S 2,T 10,E1 0,E2 0,E3 0,E4 0,E5 0,E6 0}"
LINE = 3  # of the move that is asked about


def source(*moves: str) -> Source:
    lines = ["DEF job ( )", "LIN p", *moves, "END", "DEF other ( )", "END", ""]
    return Source("job.src", "\r\n".join(lines).encode("latin-1"))


def hinders(*moves: str, line: int = LINE) -> str:
    return Krl().splitter([source(*moves)]).hinders(0, line)


@pytest.mark.parametrize(
    "move",
    ["LIN p", "SLIN p WITH $VEL.CP=0.2 C_SPL ; seam", f"CIRC {HERE},p C_DIS"],
)
def test_plain_moves_may_be_split(move: str) -> None:
    assert hinders(move) == ""


@pytest.mark.parametrize(
    ("moves", "said"),
    [
        (["LIN_REL {X 10}"], "neither a line nor an arc"),
        ([f"CIRC {HERE},p,CA 90"], "angle"),
        (["LIN p", "CONTINUE", "$OUT[1]=TRUE"], "CONTINUE"),
        (["LIN p", "x=$POS_BACK.X"], "begins or ends"),
        (["LIN p", "INTERRUPT DECL 7 WHEN $IN[1] DO other ( )", "x=$POS_INT.X"],
         "interrupt"),
        (["LIN p", "TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE", "LIN q"],
         "TRIGGER"),
        (["LIN p", "TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE", "other ( )"],
         "TRIGGER"),
    ],
)  # fmt: skip
def test_moves_that_something_hangs_on_are_not(moves: list[str], said: str) -> None:
    assert said in hinders(*moves)


def test_a_trigger_forbids_its_move_and_those_beside_it_alone() -> None:
    moves = ["LIN p", "LIN q", "TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE"]
    moves += ["LIN r", "LIN s", "LIN t"]
    own = {line: hinders(*moves, line=line) for line in (3, 4, 6, 7, 8)}
    assert [line for line, why in own.items() if why] == [4, 6, 7]


def test_interrupts_of_every_inline_program_forbid_nothing() -> None:
    declared = "INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )"
    assert hinders("LIN p", declared, "x=$POS_ACT.X") == ""


def test_points_of_splines_and_moves_of_inline_forms_stay() -> None:
    assert "spline" in hinders("SPLINE", "SLIN p", "ENDSPLINE", line=LINE + 1)
    form = ";FOLD LIN P1 Vel=2 m/s CPDAT1;%{PE}%R 5.6"
    assert "inline form" in hinders(form, "LIN XP1", ";ENDFOLD", line=LINE + 1)


def test_the_arm_stops_once_more_only_where_nothing_began() -> None:
    for before, may in (("$VEL.CP=0.1", True), ("BAS(#CP_PARAMS,1)", True),
                        ("$OUT[1]=TRUE", False)):  # fmt: skip
        splitter = Krl().splitter([source(before, "LIN p")])
        assert splitter.stops(0, LINE + 1) is may


NUMBERS = np.array([[1.0, 2.5, -3.12345, 10.0, 20.0, 30.0, -1, -1]])
PLACE = "{X 1.000,Y 2.500,Z -3.123,A 10.0000,B 20.0000,C 30.0000}"


@pytest.mark.parametrize(
    ("move", "stop", "written"),
    [
        ("LIN p", False, f"LIN {PLACE} C_DIS"),
        ("LIN p", True, f"LIN {PLACE}"),
        ("SLIN p", False, f"SLIN {PLACE} WITH $APO.CDIS=0.3 C_SPL"),
        ("SLIN p WITH $VEL.CP=0.2 C_SPL", False,
         f"SLIN {PLACE} WITH $VEL.CP=0.2,$APO.CDIS=0.3 C_SPL"),
        ("SLIN p WITH $APO=SAPO(L) C_SPL", False,
         f"SLIN {PLACE} WITH $APO=SAPO(L) C_SPL"),
        ("SLIN p WITH $VEL.CP=0.2", True, f"SLIN {PLACE} WITH $VEL.CP=0.2"),
    ],
)  # fmt: skip
def test_points_are_written_as_the_move(move: str, stop: bool, written: str) -> None:
    given = source(move)
    edit = Krl().splitter([given]).points(0, LINE, NUMBERS, "", stop)
    lines = apply(given.data, [edit]).decode("latin-1").split("\r\n")
    assert lines[LINE - 1 : LINE + 1] == [f"{written} ; postproc: inserted", move]


def test_pieces_of_an_arc_stand_before_it_and_it_is_the_last() -> None:
    given = source(f"CIRC {HERE},p ; seam")
    pieces = [ArcPiece(NUMBERS[0], None), ArcPiece(None, NUMBERS[0], True)]
    edits = Krl().splitter([given]).arc(0, LINE, pieces, NUMBERS[0], "", False)
    lines = apply(given.data, edits).decode("latin-1").split("\r\n")
    assert lines[LINE - 1 : LINE + 2] == [
        f"LIN {PLACE} C_DIS ; postproc: inserted",
        f"CIRC {PLACE},{HERE} C_DIS ; postproc: inserted (via)",
        f"CIRC {PLACE},p ; seam",
    ]


@pytest.mark.parametrize("via", ["r", "r[2]"])
def test_an_arc_through_a_named_point_is_not_cut(via: str) -> None:
    splitter = Krl().splitter([source(f"CIRC {via},p")])
    with pytest.raises(CloneError, match="on its way"):
        splitter.arc(0, LINE, [ArcPiece(None, None, True)], np.zeros(8), "", False)
