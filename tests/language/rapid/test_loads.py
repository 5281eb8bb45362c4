"""What a RAPID task states that the arm carries."""

from __future__ import annotations

import numpy as np
import pytest

from tests.language.rapid.test_visits import END, reasons, task

TOOL = "PERS tooldata {}:=[TRUE,[[0,0,300],[1,0,0,0]],[{},[0,0,100],[1,0,0,0],0,0,0]];"
DATA = f"""
  {TOOL.format("heavy", 10)}
  {TOOL.format("light", 0.01)}
  TASK PERS wobjdata w:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS loaddata part:=[30,[10,0,100],[1,0,0,0],0,0,0];
  PERS loaddata none:=[0.001,[0,0,0.001],[1,0,0,0],0,0,0];
  VAR loaddata open;
  CONST robtarget p1:=[[1,2,3],[1,0,0,0],{END};
"""
HEAVY, LIGHT = (f"MoveL p1,v200,fine,{name}\\WObj:=w;" for name in ("heavy", "light"))


def loads(*lines, more=""):
    """Return the loads that the moves of a task state."""
    visits = task(*lines, data=DATA, more=more).visits
    return visits.motion.loads[visits.motion.load]


def why(*lines):
    return reasons(task(*lines, data=DATA))[-1]


def test_the_mass_of_the_tool_is_the_load():
    assert loads(HEAVY).tolist() == [[10.0, 0.0, 0.0, 0.1]]


def test_a_placeholder_states_nothing():
    assert np.isnan(loads(LIGHT)).all() and why(LIGHT) == ""


def test_a_part_in_the_hand_is_added_at_its_place():
    (found,) = loads("GripLoad part;", HEAVY)
    np.testing.assert_allclose(found, [40.0, 0.0075, 0.0, (10 * 0.1 + 30 * 0.4) / 40])


@pytest.mark.parametrize("name", ["load0", "none"])
def test_an_empty_hand_adds_nothing(name):
    found = loads("GripLoad part;", HEAVY, f"GripLoad {name};", HEAVY)
    assert found[:, 0].tolist() == [40.0, 10.0]


def test_the_total_of_a_move_counts_alone():
    total = HEAVY.replace(";", "\\TLoad:=part;")
    assert loads("GripLoad part;", total).tolist() == [[30.0, 0.01, 0.0, 0.1]]
    assert loads(HEAVY.replace(";", "\\TLoad:=load0;"))[0, 0] == 10.0


@pytest.mark.parametrize("lines", [
    ["GripLoad open;", HEAVY], ["IF a GripLoad part;", HEAVY], ["weld;", HEAVY],
    ["GripLoad part;", LIGHT], [HEAVY.replace(";", "\\TLoad:=open;")],
])  # fmt: skip
def test_a_load_that_is_not_known_leaves_the_target(lines):
    assert why(*lines)


def test_a_load_goes_on_into_the_next_cycle():
    assert "carries" in reasons(task(HEAVY, "GripLoad part;", data=DATA))[0]
    assert not reasons(task(HEAVY, "GripLoad part;", "GripLoad load0;", data=DATA))[0]


def test_the_same_load_on_both_ways_is_known():
    lines = ("IF a THEN", "GripLoad part;", "ELSE", "GripLoad part;", "ENDIF", HEAVY)
    assert loads(*lines, "GripLoad load0;")[0, 0] == 40.0
