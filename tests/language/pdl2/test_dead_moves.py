"""Moves that a program never comes to are told; those of other arms are not."""

from __future__ import annotations

from postproc.diagnostics import Code
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.program import parse
from postproc.language.text.source import Source
from postproc.language.visits import never_reached

POINT = "MOVE LINEAR TO POS(1, 2, 3, 0, 180, 0, '')"


def lines(*body, routine=()):
    text = "\n".join(["PROGRAM a", *routine, "BEGIN", *body, "END a", ""])
    missed = resolve(parse(Source("a.pdl", text.encode()))).missed
    found = never_reached(missed, "the start", "program")
    assert {d.code for d in found} <= {Code.NEVER_REACHED}
    return [(d.line, int(d.message.split(": ")[1].split()[0])) for d in found]


def test_all_that_is_reached_is_silent():
    assert lines(POINT, "MOVE TO $HOME", "MOVE AWAY 10") == []
    assert lines("IF x THEN", POINT, "ELSE", POINT, "ENDIF") == []


def test_a_routine_that_nobody_calls_is_told():
    routine = ("ROUTINE r", "BEGIN", POINT, POINT, "END r")
    assert lines(POINT, routine=routine) == [(4, 2)]
    assert lines(POINT, "r", routine=routine) == []


def test_moves_behind_the_end_are_told():
    assert lines(POINT, "RETURN", POINT) == [(5, 1)]


def test_moves_behind_a_label_or_a_case_that_is_never_taken_are_told():
    assert lines("RETURN", f"on:: {POINT}") == [(4, 1)]
    cases = ("SELECT 1 OF", f"CASE (1): {POINT}", f"ELSE: {POINT}", "ENDSELECT")
    assert lines(*cases) == [(5, 1)]
    cases = ("SELECT 2 OF", f"CASE (1): {POINT}", f"ELSE: {POINT}", "ENDSELECT")
    assert lines(*cases) == [(4, 1)]


def test_moves_without_a_target_and_of_other_arms_are_not():
    moves = ("MOVE TO $HOME", "MOVE AWAY 10", "MOVE ARM[2] LINEAR TO p")
    assert lines("RETURN", *moves) == []
    assert lines("MOVE ARM[2] JOINT TO {1, 2, 3, 4, 5, 6}") == []
