"""What assigned points hold: budgets, joins, and what else depends on them."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.language.analysis.assigned_points import (
    NO_POINTS,
    AssignedPoint,
    Component,
    Scope,
)
from postproc.language.analysis.symbols import TaskSymbols
from postproc.language.analysis.values import WrittenNumber
from postproc.language.visits import Meaning
from tests.language.krl.test_visits import DATA, job
from tests.language.rapid.test_visits import L, task

HERE = Scope(0, "m", "main")


def point(name, index=(), row=0):
    return AssignedPoint((0, "m", "", name), index, WrittenNumber(float(row)))


def test_an_element_is_forgotten_alone_or_with_its_array():
    held = NO_POINTS.give(point("s", (1,))).give(point("s", (2,))).give(point("q"))
    assert held.held.get(point("s", (2,)).key) == point("s", (2,))
    assert [*held.forget((0, "m", "", "s")).held] == [point("q").key]
    assert held.leave((0, "m", "main")) is held


def test_ways_that_differ_keep_what_they_share():
    one = NO_POINTS.give(point("q")).give(point("r"))
    other = one.give(point("q", row=4))
    assert [*one.join(other).held] == [*other.join(one).held] == [point("r").key]
    assert one.join(one) is one


def test_a_component_is_set_again_and_others_stay():
    first = Component("z", 1.0, 0, 3), Component("x", 2.0, 0, 4)
    held = point("q").with_components(first, frozenset({"h"}))
    held = held.with_components([Component("z", None, 0, 5)], frozenset({"k"}))
    assert [(one.name, one.value, one.row) for one in held.components] == [
        ("x", 2.0, 4), ("z", None, 5),
    ]  # fmt: skip
    assert held.names == {"h", "k"}


def test_as_many_points_as_a_program_assigns_are_known():
    lines = ["FOR i FROM 1 TO 8000 DO", "big{i}:=Offs(p1,0,0,i);", "ENDFOR"]
    moves = [L.format(f"big{{{k}}}") for k in (1, 4000, 8000)]
    found = task(*lines, *moves, more="VAR robtarget big{8000};")
    assert found.visits.target.meaning.tolist() == [Meaning.POSE] * 3
    assert np.diff(found.visits.target.values[:, 2]).tolist() == [3999, 4000]


@pytest.mark.parametrize("rounds", [3, 3000])
def test_copies_of_copies_are_as_deep_as_a_loop_is_long(rounds):
    lines = [f"FOR i FROM 1 TO {rounds} DO", "b:=a;", "a:=b;", "a.trans.z:=i;"]
    more = "VAR robtarget a;\nVAR robtarget b;"
    found = task("a:=p1;", *lines, "ENDFOR", L.format("a"), more=more)
    assert found.visits.target.meaning.tolist() == [Meaning.POSE]
    assert found.visits.target.values[0, 2] == rounds


def test_a_point_may_be_shifted_as_often_as_a_loop_runs():
    lines = ["FOR I=1 TO 2000", "Q={X 0,Y 0,Z 0.5,A 0,B 0,C 0}:Q", "ENDFOR", "LIN Q"]
    found = job("Q=XP1", *lines, data=f"{DATA}DECL E6POS Q\nDECL INT I\n")
    assert found.visits.target.meaning.tolist() == [Meaning.POSE]
    start = job("LIN XP1").visits.target.values[0]
    np.testing.assert_allclose(found.visits.target.values[0, 2], start[2] + 1000.0)


def test_a_point_is_assigned_once_and_each_move_takes_of_it_what_it_can():
    """Two moves to one point without S and T: on a line, and by joints."""
    lines = ["DECL POS q", "DECL E6AXIS r", "q=XLIN", "LIN q", "PTP q"]
    found = job(*lines, "r=XA", "PTP r", "LIN r")
    v = found.visits
    told = [v.reasons[k].text for k in v.reason.tolist()]
    assert told[0] == told[2] == "" and "without S and T" in told[1]
    assert "the move to it is no PTP" in told[3]
    meanings = [Meaning.POSE, Meaning.UNKNOWN, Meaning.JOINTS, Meaning.UNKNOWN]
    assert v.target.meaning.tolist() == meanings


def test_functions_within_functions_cost_what_their_depth_does(monkeypatch):
    calls, real = [], TaskSymbols.value

    def value(self, *given):
        calls.append(given)
        return real(self, *given)

    monkeypatch.setattr(TaskSymbols, "value", value)
    more = "VAR robtarget q;FUNC robtarget f(robtarget a) RETURN Offs(a,0,0,1); ENDFUNC"
    counts = []
    for depth in (3, 5, 7):
        calls.clear()
        move = f"q:={'f(' * depth}q{')' * depth};"
        task("q:=p1;", move, L.format("q"), more=more)
        counts.append(len(calls))
    assert counts[2] < 5 * counts[1] < 25 * counts[0]


# What is added to the place of a point shifts it.

OWN = "VAR robtarget q;\nVAR num n:=7;\n"
ADDED = {
    "a component": (["q:=p1;", "q.trans.z:=q.trans.z+7;"], "0,0,n"),
    "subtracted": (["q:=p1;", "q.trans.z:=q.trans.z-(-7);"], "0,0,n"),
    "the other way": (["q:=p1;", "q.trans.z:=7+q.trans.z;"], "0,0,n"),
    "an instruction": (["q:=p1;", "Add q.trans.z,n;"], "0,0,n"),
    "several": (["q:=p1;", "q.trans.y:=q.trans.y+4+3;", "Add q.trans.x,n;"], "n,7,0"),
    "a place": (["q:=p1;", "q.trans:=q.trans+[0,3,4];", "Add q.trans.z,3;"], "0,3,n"),
    "a shift": (["q:=Offs(p1,1,0,3);", "q.trans.z:=q.trans.z+4;"], "1,0,n"),
    "a copy": (["q:=p1;", "q.trans.x:=q.trans.x+n;", "q2:=q;", "q:=q2;"], "n,0,0"),
}


def target_of(found, k=1):
    """Return where a visit goes, what it moves along with, and why, and so on."""
    v, t = found.visits, found.visits.target
    place = np.round(t.values[k], 9).tolist()
    pinned = v.literals.pinned[t.literal[0]]
    return place, t.follows[k], t.literal[k], v.reasons[v.reason[k]], pinned


@pytest.mark.parametrize("way", ADDED)
def test_what_is_added_to_a_place_shifts_a_point(way):
    lines, by = ADDED[way]
    more = f"{OWN}VAR robtarget q2;\n"
    move = ["n:=7;", L.format("p1")]
    found = task(*move, *lines, L.format("q"), more=more)
    shifted = task(*move, L.format(f"Offs(p1,{by})"), more=more)
    assert target_of(found) == target_of(shifted)
    assert found.visits.target.follows[1] == found.visits.target.literal[0] >= 0


def test_what_is_added_to_a_place_in_krl_shifts_a_point():
    found = job("DECL E6POS Q", "LIN XP1", "Q=XP1", "Q.Z=Q.Z+(7)", "LIN Q")
    start = job("LIN XP1").visits.target.values[0]
    place, follows, literal, why, pinned = target_of(found)
    assert place == [*start[:2], start[2] + 7, *start[3:]]
    assert (follows, literal, why.text, pinned) == (0, -1, "", "")


KEEPS = {
    "set": ["q.trans.z:=7;"],
    "set before": ["q.trans.z:=7;", "q.trans.z:=q.trans.z+1;"],
    "twice itself": ["q.trans.z:=q.trans.z+q.trans.z;"],
    "another component": ["q.trans.z:=q.trans.z+q.trans.x;"],
    "turned": ["q.trans.z:=q.trans.z+1;", "q.rot.q1:=q.rot.q1+0.1;"],
    "reversed": ["q.trans.z:=7-q.trans.z;"],
    "another point": ["q.trans.z:=p1.trans.z+7;"],
    "not known": ["q.trans.z:=q.trans.z+DInput(di1);"],
    "read": ["q.trans.z:=q.trans.z+1;", "n:=q.trans.z;"],
    "one way of two": ["IF di1=1 THEN", "q.trans.z:=q.trans.z+1;", "ENDIF"],
    "each round": ["WHILE di1=1 DO", "q.trans.z:=q.trans.z+1;", "ENDWHILE"],
    "two ways": ["IF di1=1 THEN", "q.trans.z:=10;", "ELSE", "q.trans.z:=3;",
                 "q.trans.z:=q.trans.z+7;", "ENDIF"],
    "alike on two ways": ["IF di1=1 THEN", "q.trans.z:=10;", "ELSE",
                          "q.trans.z:=q.trans.z+7;", "ENDIF"],
}  # fmt: skip


@pytest.mark.parametrize("way", KEEPS)
def test_what_is_no_sure_shift_keeps_the_numbers_of_a_point(way):
    found = task(L.format("p1"), "q:=p1;", *KEEPS[way], L.format("q"), more=OWN)
    *_, why, pinned = target_of(found)
    assert pinned
    assert why or way == "read"
