"""Which moves must stay in one piece as their text says, and how points are written."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.language.insert_moves import ArcPiece
from postproc.language.languages import language_of
from postproc.language.pdl2.language import Pdl2
from postproc.language.text.source import CloneError, Source, apply
from tests.written import program

PLACE = "POS(100.0, 200.0, 150.0, 0.0, 175.0, 0.0, '')"
FIRST = f"MOVE LINEAR TO {PLACE}"
LINE = 6  # of the move that is asked about


def source(*moves: str) -> Source:
    return Source("job.pdl", program(FIRST, *moves))


def hinders(*moves: str) -> str:
    return Pdl2().splitter([source(*moves)]).hinders(0, LINE)


@pytest.mark.parametrize(
    "move",
    [
        f"MOVE LINEAR TO {PLACE}",
        f"MOVEFLY LINEAR TO {PLACE} WITH $LIN_SPD = 0.1 -- ADVANCE, TIL",
        "MOVE ARM[1] LINEAR TO p",
        "MOVE TO p",
    ],
)  # fmt: skip
def test_plain_moves_may_be_split(move: str) -> None:
    assert hinders(move) == ""


@pytest.mark.parametrize(
    ("move", "said"),
    [
        (f"MOVE LINEAR TO {PLACE} TIL $DIN[1]", "TIL"),
        (f"MOVE LINEAR TO {PLACE} WITH CONDITION[3]", "WITH CONDITION"),
        ("MOVE LINEAR TO p SYNCMOVE ARM[2] TO r", "another arm"),
        ("MOVE LINEAR AWAY 50.0", "TO a place"),
        ("MOVE LINEAR TO p WITH $LIN_SPD = speed(3)", "routine"),
        ("p := r", "alone"),
    ],
)
def test_moves_that_something_runs_along_are_not(move: str, said: str) -> None:
    assert said in hinders(move)


def test_a_move_on_several_lines_is_not() -> None:
    assert "lines" in hinders("MOVE LINEAR TO p,", "  WITH $LIN_SPD = 0.1,", "ENDMOVE")


def test_what_runs_while_it_moves_must_be_a_move() -> None:
    split = f"MOVEFLY LINEAR TO {PLACE} ADVANCE"
    assert hinders(split, "MOVE LINEAR TO p") == ""
    assert "ADVANCE" in hinders(split, "$DOUT[3] := TRUE")


@pytest.mark.parametrize(
    ("event", "forbidden"),
    [
        ("WHEN TIME 100 BEFORE END DO", True),
        ("WHEN AT VIA DO", True),
        ("WHEN DISTANCE 20 AFTER START DO", True),
        ("WHEN PERCENT 50 AFTER START DO", True),
        ("WHEN $DIN[7] DO -- at the end of a segment", False),
    ],
)
def test_conditions_on_segments_forbid_all(event: str, forbidden: bool) -> None:
    handler = ("CONDITION[1] :", event, "  $DOUT[1] := TRUE", "ENDCONDITION")
    assert bool(hinders(f"MOVE LINEAR TO {PLACE}", *handler)) is forbidden


def test_conditions_of_other_files_forbid_all() -> None:
    said = hinders(f"MOVE LINEAR TO {PLACE}", "ENABLE CONDITION[12]")
    assert "do not define" in said


def test_the_arm_stops_once_more_only_where_nothing_began() -> None:
    splitter = Pdl2().splitter([source("$LIN_SPD := 0.1", "MOVE LINEAR TO p")])
    assert splitter.stops(0, LINE + 1)
    splitter = Pdl2().splitter([source("$DOUT[2] := TRUE", "MOVE LINEAR TO p")])
    assert not splitter.stops(0, LINE + 1)  # that may light an arc
    splitter = Pdl2().splitter([source("weld_on", "MOVE LINEAR TO p")])
    assert not splitter.stops(0, LINE + 1)


def test_points_stand_before_the_move_as_it_is_written() -> None:
    given = source("MOVE ARM[1] LINEAR TO p WITH $LIN_SPD = 0.1 -- seam")
    splitter = Pdl2().splitter([given])
    numbers = np.array([[1.0, 2.5, -3.12345, 0.0, 175.0, 90.0], [2.0] * 6])
    edit = splitter.points(0, LINE, numbers, "S W", True)
    lines = apply(given.data, [edit]).decode("latin-1").split("\r\n")
    assert lines[LINE - 1 : LINE + 2] == [
        "  MOVE ARM[1] LINEAR TO POS(1.000, 2.500, -3.123, 0.0000, 175.0000, 90.0000,"
        " 'S W') WITH $LIN_SPD = 0.1 -- postproc: inserted",
        "  MOVEFLY ARM[1] LINEAR TO POS(2.000, 2.000, 2.000, 2.0000, 2.0000, 2.0000,"
        " 'S W') ADVANCE WITH $LIN_SPD = 0.1 -- postproc: inserted",
        "  MOVE ARM[1] LINEAR TO p WITH $LIN_SPD = 0.1 -- seam",
    ]
    told = [language_of("a.pdl").is_inserted(line.encode("latin-1")) for line in lines]
    assert np.flatnonzero(told).tolist() == [LINE - 1, LINE]


def test_pieces_of_an_arc_stand_before_it_and_it_is_the_last() -> None:
    via = "POS(10.5, 0, 150.25, 0, 175, 0, 'S')"
    given = source(f"MOVE ARM[1] CIRCULAR TO p VIA {via} WITH $LIN_SPD = 0.1 -- seam")
    splitter = Pdl2().splitter([given])
    one, two = np.full(6, 1.0), np.full(6, 2.0)
    pieces = [ArcPiece(one, None), ArcPiece(None, two, True), ArcPiece(two, one)]
    edits = splitter.arc(0, LINE, pieces, np.full(6, 3.0), "S W", False)
    lines = apply(given.data, edits).decode("latin-1").split("\r\n")
    first, second, third = (
        f"POS({k}.000, {k}.000, {k}.000, {k}.0000, {k}.0000, {k}.0000, 'S W')"
        for k in (1, 2, 3)
    )
    end, mark = "ADVANCE WITH $LIN_SPD = 0.1", "-- postproc: inserted"
    assert lines[LINE - 1 : LINE + 3] == [
        f"  MOVEFLY ARM[1] LINEAR TO {first} {end} {mark}",
        f"  MOVEFLY ARM[1] CIRCULAR TO {via} VIA {second} {end} {mark} (via)",
        f"  MOVEFLY ARM[1] CIRCULAR TO {second} VIA {first} {end} {mark}",
        f"  MOVE ARM[1] CIRCULAR TO p VIA {third} WITH $LIN_SPD = 0.1 -- seam",
    ]
    language = language_of("a.pdl")
    rows = [line.encode("latin-1") for line in lines]
    found = [[told(row) for row in rows] for told in
             (language.is_inserted, language.ends_at_via)]  # fmt: skip
    assert [np.flatnonzero(one).tolist() for one in found] == [
        [LINE - 1, LINE, LINE + 1],
        [LINE],
    ]


def test_an_arc_through_a_variable_is_not_cut() -> None:
    splitter = Pdl2().splitter([source("MOVE CIRCULAR TO p VIA r")])
    with pytest.raises(CloneError, match="on its way"):
        splitter.arc(0, LINE, [ArcPiece(None, None, True)], np.zeros(6), "", False)
