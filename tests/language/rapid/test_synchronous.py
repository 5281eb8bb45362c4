"""Procedures that a move calls on its way, while the program runs ahead."""

from __future__ import annotations

import pytest

from postproc.language.language import Start
from postproc.language.visits import ELSEWHERE
from tests.language.rapid.test_visits import L, codes, origins, reasons, task

MORE = "PERS pose d:=[[0,0,9],[1,0,0,0]]; VAR num n;"
SHIFT = "displacement"
LINE = r'MoveLSync p1,v200,{},t\WObj:=w,"{}";'
NEXT = tuple(L.format(name) for name in ("p2", "list{1}"))


def job(body, *lines, name="my", zone="z10", start=None, first=""):
    more = f"{MORE}\nPROC my()\n" + "\n".join(body) + "\nENDPROC"
    return task(first, LINE.format(zone, name), *lines, more=more, start=start)


@pytest.mark.parametrize("move", [
    LINE.format("z10", "my"), LINE.format("z10", "my").replace("MoveL", "MoveJ"),
    r'MoveCSync p2,p1,v200,z10,t\WObj:=w,"my";',
])  # fmt: skip
def test_what_a_procedure_may_set_is_unknown_behind_the_move(move):
    more = f"{MORE}\nPROC my()\nPDispSet d;\nENDPROC"
    found = reasons(task(L.format("list{2}"), move, *NEXT, "PDispOff;", more=more))
    assert not any(SHIFT in why for why in found[:-2])
    assert all(SHIFT in why for why in found[-2:])


def test_it_is_known_where_it_is_set_again_behind_a_stop():
    found = reasons(job(["PDispSet d;"], NEXT[0], "PDispOff;", NEXT[1]))
    assert SHIFT in found[1] and not found[2]


def test_the_program_runs_ahead_of_the_procedure():
    fly = NEXT[0].replace("fine", "z5")
    found = reasons(job(["PDispSet d;"], "PDispOff;", fly, NEXT[1], "PDispOff;"))
    assert SHIFT in found[1] and SHIFT in found[2]


def test_it_is_known_where_both_values_are_the_same():
    found = job(["PDispSet d;"], *NEXT, first="PDispSet d;")
    assert reasons(found)[1] == ""


def test_a_procedure_that_changes_no_mode_changes_nothing():
    found = job(["Set do1;", "n:=n+1;", 'TPWrite "x";'], *NEXT)
    assert reasons(found) == [""] * 3 and origins(found)[1] == [0]


@pytest.mark.parametrize("body", [[L.format("p2")], ["weld;"], ['%"x"%;']])
def test_a_procedure_that_may_move_may_do_anything(body):
    found = job(body, *NEXT)
    assert SHIFT in reasons(found)[1] and origins(found)[1] == [ELSEWHERE]


def test_a_procedure_that_is_not_given_may_do_anything():
    found = job([], *NEXT, name="other")
    assert SHIFT in reasons(found)[1] and origins(found)[1] == [ELSEWHERE]
    assert "motion-unknown" in codes(found)
    still = job([], *NEXT, name="other", start=Start(motionless=("other",)))
    assert reasons(still) == [""] * 3


@pytest.mark.parametrize("line", ["PDispSet d;", "ConfL \\Off;\nSoftAct 1,20;"])
def test_a_trap_that_a_trigger_calls_leaves_everything(line):
    more = f"{MORE} VAR triggdata g; VAR intnum i;\nTRAP t\n{line}\nENDTRAP"
    set_ = ("CONNECT i WITH t;", "TriggInt g,5,i;")
    found = task(*set_, r"TriggL p1,v200,g,z5,t\WObj:=w;", *NEXT, more=more)
    assert all("TRAP" in why for why in reasons(found))
