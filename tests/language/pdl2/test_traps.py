"""Programs of PDL2 whose targets are not where, or not from where, they seem to be."""

from __future__ import annotations

import pytest

from postproc.language.visits import START
from tests.language.pdl2.test_opaque_calls import AT, program, resolved, routine

MOVE = f"MOVE LINEAR TO {AT}"
SHIFT = "$UFRAME := POS(100, 0, 0, 0, 0, 0, '')"
POINTS = ["VAR i : INTEGER", "a : ARRAY[3] OF POSITION"]
GIVEN = [f"a[{k}] := {AT}" for k in (1, 2, 3)]


def read(head, body):
    v = resolved(program("job", head, body)).visits
    return v, [v.reasons[k].text for k in v.reason.tolist()]


@pytest.mark.parametrize("head", [
    "ROUTINE r(q : POSITION)\nBEGIN\np.X := 9\nMOVE LINEAR TO q\nEND r",
    "ROUTINE s\nBEGIN\np.X := 9\nEND s\n"
    "ROUTINE r(q : POSITION)\nBEGIN\ns\nMOVE LINEAR TO q\nEND r",
])  # fmt: skip
def test_a_parameter_is_the_variable_that_is_given_for_it(head):
    v, _ = read(["VAR p : POSITION", *head.split("\n")], [f"p := {AT}", "r(p)"])
    assert v.target.values[0, :3].tolist() == [9.0, 2.0, 3.0]


@pytest.mark.parametrize("line", ["i := i + 1", "inc(i)", "also"])
def test_a_loop_whose_variable_changes_is_not_followed_round_by_round(line):
    head = [*POINTS, *routine("inc", "x := x + 1", takes="(x : INTEGER)"),
            *routine("also", "i := i + 1")]  # fmt: skip
    body = [*GIVEN, "FOR i := 1 TO 3 DO", "MOVE LINEAR TO a[i]", line, "ENDFOR"]
    assert all(read(head, body)[1])


def test_an_element_that_only_the_run_tells_may_be_any():
    body = [*GIVEN, "MOVE LINEAR TO a[1]", "READ(i)", SHIFT, "MOVE LINEAR TO a[i]"]
    v, why = read(POINTS, body)
    assert why[0] == "" and why[1]
    assert "only the run tells which element a move uses" in v.literals.pins


@pytest.mark.parametrize("line", [
    "n := f", "IF f = 1 THEN\nENDIF", f"{MOVE} WITH $LIN_SPD = f",
    "WHILE f = 1 DO\nENDWHILE",
])  # fmt: skip
def test_a_function_that_sets_frames_does_so_in_any_expression(line):
    head = [
        "VAR n : INTEGER",
        "ROUTINE f : INTEGER",
        "BEGIN",
        SHIFT,
        "RETURN(1)",
        "END f",
    ]
    assert "$UFRAME is not known" in read(head, [*line.split("\n"), MOVE])[1][-1]


def test_a_cycle_begins_where_and_with_what_it_ends():
    v, why = read([], ["CYCLE", MOVE, MOVE, SHIFT])
    assert v.graph.predecessors(0).tolist() == [START, 1] and all(why)


def test_a_routine_that_calls_itself_is_left():
    again = routine("r", MOVE, SHIFT, "IF $DIN[1] THEN", "r", "ENDIF")
    assert "calls itself" in read(again, ["r"])[1][0]


# Lines that are not understood.


@pytest.mark.parametrize("line", [
    "IF $DIN[1] THEN CANCEL ALL ENDIF", "IF $DIN[1] THEN; CANCEL ALL; ENDIF",
    "WHILE $DIN[1] DO CANCEL ALL ENDWHILE", "REPEAT CANCEL ALL UNTIL $DIN[1]",
    "SELECT i OF CASE (1): CANCEL ALL ENDSELECT", "i := 1 ; CANCEL ALL",
    "i := 1 CANCEL ALL", "DELAY 100 ; CANCEL ALL", "IF $DIN[1] THEN grip ENDIF",
    "IF i = 1 THEN\nELSE CANCEL ALL ?? 1\nENDIF",
])  # fmt: skip
def test_a_line_that_is_not_understood_may_hold_a_second_statement(line):
    _, why = read(POINTS, [MOVE, f"{MOVE} ADVANCE", *line.split("\n"), MOVE])
    assert why[:2] == ["", ""] and "not understood" in why[-1]


@pytest.mark.parametrize("line", [
    "IF $DIN[1] THEN i := 2 ENDIF", "WRITE ('CANCEL ALL; x' ?? 3)", "WAIT FOR ?? 3",
])  # fmt: skip
def test_a_line_that_is_not_understood_may_be_harmless(line):
    assert read(POINTS, [MOVE, line, MOVE])[1] == ["", ""]


def test_a_head_that_is_not_understood_may_set_what_it_names():
    lines = [f"WHILE $DIN[1] DO {SHIFT}", "ENDWHILE", MOVE]
    assert "$UFRAME" in read(POINTS, [MOVE, *lines])[1][-1]


JUMPING = {
    "label": ([SHIFT, "IF $DIN[1] THEN GOTO out ENDIF", "$UFRAME := POS(0)", "out::"],
              []),
    "routine": (["sub"], routine("sub", SHIFT, "IF $DIN[1] THEN RETURN ENDIF",
                                 "$UFRAME := POS(0)")),
    "cycle": (["CYCLE", "IF $DIN[1] THEN EXIT CYCLE ENDIF"], []),
}  # fmt: skip


@pytest.mark.parametrize("kind", JUMPING)
def test_a_line_that_is_not_understood_may_lead_elsewhere(kind):
    lines, more = JUMPING[kind]
    assert "block structure" in read([*POINTS, *more], [*lines, MOVE])[1][-1]
