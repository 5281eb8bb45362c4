"""Errors of RAPID that leave a routine: where the program goes on, and with what."""

from __future__ import annotations

import pytest

from postproc.language.visits import ELSEWHERE
from tests.language.rapid.test_visits import L, origins, reasons, task

MORE = "PERS pose d:=[[0,0,9],[1,0,0,0]]; VAR num n; VAR errnum MY:=-1;"
TIMED = r"WaitDI di1,1\MaxTime:=2;"


def sub(*lines: str, name: str = "sub") -> str:
    return f"PROC {name}()\n" + "\n".join(lines) + "\nENDPROC\n"


def behind(handler, body, *routines, head="ERROR", call="sub;"):
    """Read a job whose second move stands behind a call that may fail."""
    lines = (L.format("p1"), call, L.format("p2"), "EXIT;", head, *handler)
    more = MORE + sub(*body) + "".join(routines)
    found = task(*lines, more=more)
    assert reasons(found)[0] == ""
    return found


def at_end(found):
    """Say whether the last move of main begins anywhere, and why it stays."""
    names = [found.visits.target.names[k] for k in found.visits.target.name.tolist()]
    last = len(names) - 1 - names[::-1].index("p2")
    return ELSEWHERE in origins(found)[last], reasons(found)[last]


MOVING = (L.format("list{1}"), TIMED, L.format("list{2}"))
DISPLACED = ("PDispSet d;", TIMED, "PDispOff;")


@pytest.mark.parametrize("word", ["TRYNEXT;", "RETRY;"])
def test_behind_a_call_that_fails_the_place_is_unknown(word):
    assert at_end(behind([word], MOVING)) == (word == "TRYNEXT;", "")


def test_a_routine_that_is_called_again_begins_anywhere():
    found = behind(["RETRY;"], MOVING)
    assert [ELSEWHERE in at for at in origins(found)] == [False, True, False, False]


def test_modes_at_the_error_are_kept():
    assert "displacement" in at_end(behind(["TRYNEXT;"], DISPLACED))[1]
    assert at_end(behind(["RETRY;"], DISPLACED))[1] == ""
    shown = (L.format("list{1}"), *DISPLACED)
    assert "displacement" in reasons(behind(["RETRY;"], shown))[1]


def test_return_leaves_the_caller_as_well():
    more = sub("inner;", L.format("list{3}"), "ERROR", "RETURN;")
    inner = sub(*DISPLACED, name="inner")
    found = task("sub;", L.format("p2"), more=MORE + more + inner)
    unknown, why = at_end(found)
    assert unknown and "displacement" in why


def test_an_error_goes_up_two_levels():
    inner = sub(*DISPLACED, name="inner")
    unknown, why = at_end(behind(["TRYNEXT;"], ("inner;",), inner))
    assert unknown and "displacement" in why


def test_raise_in_a_handler_goes_one_level_up():
    again = (*DISPLACED, "ERROR", "RAISE;")
    assert at_end(behind(["TRYNEXT;"], again))[0]
    stays = (*DISPLACED, "ERROR", "TRYNEXT;")
    assert at_end(behind(["TRYNEXT;"], stays)) == (False, "")


NO_PATH = {
    "stop": ["Stop;"],
    "exit": ["EXIT;"],
    "end": ['TPWrite "failed";'],
    "raise-to-the-top": ["RAISE;"],
    "another-number": ["IF ERRNO=ERR_WHLSEARCH TRYNEXT;"],
    "another-case": ["TEST ERRNO", "CASE ERR_WHLSEARCH:", "TRYNEXT;", "ENDTEST"],
    "own-number": ["IF ERRNO=MY THEN", "TRYNEXT;", "ENDIF"],
}


@pytest.mark.parametrize("name", NO_PATH)
def test_a_handler_that_never_goes_on_makes_no_path(name):
    assert at_end(behind(NO_PATH[name], DISPLACED)) == (False, "")


PATHS = {
    "its-number": ["IF ERRNO=ERR_WAIT_MAXTIME TRYNEXT;"],
    "one-of-two": ["IF ERRNO=ERR_WHLSEARCH OR ERRNO=ERR_WAIT_MAXTIME THEN", "TRYNEXT;",
                   "ENDIF"],
    "case": ["TEST ERRNO", "CASE ERR_X,ERR_WAIT_MAXTIME:", "TRYNEXT;", "ENDTEST"],
    "default": ["TEST ERRNO", "CASE ERR_WHLSEARCH:", "RAISE;", "DEFAULT:", "TRYNEXT;",
                "ENDTEST"],
    "else": ["IF ERRNO=ERR_WHLSEARCH THEN", "RAISE;", "ELSE", "TRYNEXT;", "ENDIF"],
    "condition": ["IF n<3 THEN", "Incr n;", "TRYNEXT;", "ENDIF"],
    "unknown-number": ["IF ERRNO=ERR_NEW TRYNEXT;"],
}  # fmt: skip


@pytest.mark.parametrize("name", PATHS)
def test_a_handler_that_may_go_on_makes_a_path(name):
    unknown, why = at_end(behind(PATHS[name], DISPLACED))
    assert unknown and "displacement" in why


@pytest.mark.parametrize(("numbers", "wanted"), [
    ("ERR_WHLSEARCH", False), ("ERR_WAIT_MAXTIME", True), ("LONG_JMP_ALL_ERR", True),
])  # fmt: skip
def test_a_list_of_errors_narrows_it(numbers, wanted):
    found = behind(["TRYNEXT;"], DISPLACED, head=f"ERROR({numbers})")
    assert at_end(found)[0] is wanted


def test_a_list_takes_its_errors_over_handlers_between():
    inner = sub(*DISPLACED, name="inner")
    body = ("inner;", "PDispOff;", "ERROR", "TRYNEXT;")
    for head, wanted in (("ERROR", False), ("ERROR(ERR_WAIT_MAXTIME)", True)):
        found = behind(["TRYNEXT;"], body, inner, head=head)
        assert ("displacement" in at_end(found)[1]) is wanted


def test_errors_in_a_handler_or_out_of_a_trap_stop():
    inside = (L.format("list{1}"), "ERROR", "WaitTime 1;")
    assert at_end(behind(["TRYNEXT;"], inside)) == (False, "")
    trap = f"TRAP t\n{TIMED}\nRAISE MY;\nENDTRAP\n"
    assert at_end(behind(["TRYNEXT;"], ("n:=n+1;",), trap))[1] == ""


def test_a_move_that_its_process_ends_is_left_on_its_way():
    arc = r"ArcL p1,v200,s,w,fine,t\WObj:=w;"
    found = task(arc, L.format("p2"), "ERROR", "TRYNEXT;")
    assert ELSEWHERE in origins(found)[1]
    assert ELSEWHERE not in origins(task(arc, L.format("p2")))[1]


def test_a_cycle_that_ends_early_begins_with_its_modes():
    body = (L.format("p1"), "PDispSet d;", "IF di1=1 ExitCycle;", "PDispOff;")
    found = task(*body, more=MORE)
    assert "displacement" in reasons(found)[0] and ELSEWHERE in origins(found)[0]
    assert "routine-unknown" not in {d.code for d in found.diagnostics}
    last = task(*body, L.format("p2"), more=MORE)
    assert reasons(last)[1] == ""


def test_a_handler_may_end_the_cycle():
    found = behind(["ExitCycle;"], ("PDispOff;", TIMED))
    assert ELSEWHERE in origins(found)[0]


def test_a_handler_in_a_block_is_read_to_its_end():
    """No controller loads it, and no text stops the reader."""
    handler = ["DEFAULT:", "TRYNEXT;", "ENDTEST"]
    found = behind(handler, MOVING, head="TEST n\nCASE 1:\nERROR")
    assert any(reasons(found)) or any(ELSEWHERE in at for at in origins(found)[1:])


def test_a_loop_that_ends_behind_a_handler_is_followed():
    loop = ("FOR k FROM 1 TO 2 DO", L.format("p1"), "ERROR", "TRYNEXT;", "ENDFOR")
    assert len(task(*loop).visits) == 1


P1, P2, P3 = (L.format(f"list{{{k}}}") for k in (1, 2, 3))
HANDLED = "the error handler of its routine"


def moved(*handler, main=(), more=""):
    """Read a job that calls a routine with a handler, and moves behind the call."""
    body = sub(P1, "ERROR", *handler, "RETRY;")
    return task(L.format("p1"), "sub;", L.format("p2"), *main, more=MORE + body + more)


def test_a_handler_that_moves_acts_in_its_routine_alone():
    found = moved(P2)
    assert [HANDLED in why for why in reasons(found)] == [False, True, False]
    assert at_end(found) == (True, "")


def test_what_a_handler_may_set_is_unknown_behind_its_routine():
    assert "displacement" in at_end(moved(P2, "PDispSet d;"))[1]
    again = moved(P2, "PDispSet d;", main=("PDispOff;", L.format("p2")))
    assert "displacement" not in reasons(again)[-1]


def test_a_handler_acts_in_routines_that_its_own_calls():
    found = moved("TRYNEXT;", main=("EXIT;", "ERROR", P2, "RETRY;"))
    assert all(HANDLED in why for why in reasons(found))


def test_an_error_that_leaves_a_routine_leaves_its_handler():
    body = sub(P1, "ERROR", P2, "RAISE;")
    found = task("sub;", L.format("p2"), "EXIT;", "ERROR", "TRYNEXT;", more=MORE + body)
    assert HANDLED not in reasons(found)[-1]


def test_a_process_error_acts_behind_its_routine():
    found = moved(P2, main=(r"ProcerrRecovery \SyncLastMoveInst;",))
    assert HANDLED in reasons(found)[-1]
