"""Moves that a program ends on their way: CANCEL, EXIT CYCLE."""

from __future__ import annotations

import pytest

from postproc.language.visits import ELSEWHERE
from tests.language.pdl2.test_external_routines import (
    FIRST,
    followed,
    handler,
    reasons,
    routine,
)

AHEAD = "MOVE LINEAR TO POS(110, 400, 150, 0, 175, 0, '') ADVANCE"
LAST = "MOVE LINEAR TO POS(300, 300, 200, 0, 175, 0, '')"
ENDING = (
    "CANCEL CURRENT", "CANCEL ALL", "CANCEL CURRENT SEGMENT", "cancel current",
    "CANCEL ALL FOR ARM[1]", "CANCEL CURRENT FOR ARM[2], ARM[1]", "CANCEL ALL FOR ALL",
)  # fmt: skip


def unknown(*body, **more):
    """Return for every visit whether the arm may come from anywhere."""
    visits = followed(*body, **more).visits
    return [ELSEWHERE in visits.graph.predecessors(k) for k in range(len(visits))]


@pytest.mark.parametrize("line", ENDING)
def test_what_follows_begins_anywhere(line):
    assert unknown(FIRST, AHEAD, line, LAST) == [False, False, True]
    assert unknown(*handler(line), FIRST, LAST) == [True, True]


@pytest.mark.parametrize(
    "line", ["CANCEL sem", "CANCEL CURRENT FOR ARM[2]", "WAIT sem"]
)
def test_nothing_of_our_arm_ends(line):
    assert unknown(FIRST, AHEAD, line, LAST) == [False] * 3
    assert unknown(*handler(line), FIRST, LAST) == [False] * 2


def test_an_arm_that_is_not_known_may_be_ours():
    head = ["VAR n : INTEGER"]
    line = "CANCEL CURRENT FOR ARM[n]"
    assert unknown("READ (n)", FIRST, AHEAD, line, LAST, head=head)[2]


def test_a_move_that_has_ended_cannot_be_ended():
    assert unknown(FIRST, "CANCEL ALL", LAST) == [False, False]


def test_a_routine_may_end_a_move():
    head = routine("stop_it", "CANCEL CURRENT")
    assert unknown(FIRST, AHEAD, "stop_it", LAST, head=head) == [False, False, True]
    assert unknown(*handler("stop_it"), FIRST, LAST, head=head) == [True, True]


def test_a_cycle_that_is_left_ends_a_move():
    body = ("CYCLE", FIRST, AHEAD, "IF $DIN[1] THEN", "EXIT CYCLE", "ENDIF", LAST)
    assert unknown(*body) == [True, False, False]
    head = routine("leave_it", "EXIT CYCLE")
    body = ("CYCLE", FIRST, AHEAD, "leave_it")
    found = followed(*body, head=head).visits
    assert ELSEWHERE in found.graph.predecessors(0)


def test_a_handler_may_leave_any_statement_of_the_cycle():
    kind, plain = "$MOVE_TYPE := {}", "MOVE TO POS(1, 2, 3, 0, 180, 0, '')"
    cycle = (plain, kind.format("LINEAR"), plain, kind.format("JOINT"))
    body = (kind.format("JOINT"), "CYCLE", *cycle)
    found = followed(*handler("EXIT CYCLE"), *body)
    assert "trajectory" in reasons(found)[0] and not reasons(found)[1]
    assert ELSEWHERE in found.visits.graph.predecessors(0)
    assert not any(reasons(followed(*body)))


def test_a_handler_that_moves_leaves_what_it_may_interrupt():
    move = "MOVE JOINT TO {9, 0, 0, 0, 0, 0}"
    found = reasons(followed(*handler(move), FIRST, LAST))
    assert all(found) and sum("may move the arm" in why for why in found) == 2
    assert not any(reasons(followed(*handler("CANCEL ALL"), FIRST, LAST)))
