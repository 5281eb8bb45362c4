"""What routines are called with, and what may change it unseen."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.language.visits import Meaning
from tests.language.rapid.test_traps import routine
from tests.language.rapid.test_visits import END, L, names, once, reasons, task

GO = routine("go", L.format("p"), given="(robtarget p)")
MORE = "VAR num n; VAR robtarget q:=[[7,8,9],[1,0,0,0]," + END + ";\n"


def free(found, name):
    """Return True if a visit of a point may be corrected, in the point's numbers."""
    v, why = found.visits, reasons(found)
    rows = [k for k, own in enumerate(names(found)) if own == name]
    literals = {int(max(v.target.literal[k], v.target.follows[k])) for k in rows}
    return bool(rows) and all(
        k >= 0 and not v.literals.pinned[k] for k in literals
    ) and not any(why[k] for k in rows)  # fmt: skip


def test_a_point_is_a_target_where_its_routine_moves_to_it():
    found = once("go p1;", "go p2;", more=GO)
    assert names(found) == ["p1", "p2"] and free(found, "p1") and free(found, "p2")
    np.testing.assert_allclose(found.visits.target.values[:, 0], [1.0, 4.0])


def test_through_more_than_one_routine():
    outer = routine("outer", "go p;", given="(robtarget p)")
    other = routine("last", L.format("goal"), given="(robtarget goal)")
    found = once("outer p1;", more=GO.replace(L.format("p"), "last p;") + outer + other)
    assert names(found) == ["p1"] and free(found, "p1")


def test_shifts_and_numbers():
    more = routine(
        "place", "MoveL Offs(p,dx,-dx,n*2),v200,fine,t\\WObj:=w;", L.format("p"),
        given="(robtarget p,num dx\\num n)",
    )  # fmt: skip
    found = once("place p1,5\\n:=3;", more=more)
    np.testing.assert_allclose(found.visits.target.values[0, :3], [6.0, -3.0, 9.0])
    assert found.visits.target.follows.tolist() == [0, -1] and free(found, "p1")
    lost = once("place p1,5;", more=more)
    assert lost.visits.target.meaning[0] == Meaning.UNKNOWN and not free(lost, "p1")


def test_a_shift_of_a_shift():
    line = "MoveL RelTool(Offs(p2,1,0,0),0,0,-9),v200,fine,t\\WObj:=w;"
    found = once(line, L.format("p2"))
    np.testing.assert_allclose(found.visits.target.values[0, :3], [5.0, 5.0, 15.0])
    target = found.visits.target
    assert target.follows.tolist() == [target.literal[1], -1] and free(found, "p2")


def test_a_loop_that_counts_what_it_calls_with():
    more = routine("at", "MoveL Offs(p1,x,0,0),v9,fine,t\\WObj:=w;", given="(num x)")
    found = once("FOR i FROM 1 TO 3 DO", "at 2*i;", "ENDFOR", L.format("p1"), more=more)
    np.testing.assert_allclose(found.visits.target.values[:, 0], [3.0, 5.0, 7.0, 1.0])


def test_tools_zones_and_speeds():
    more = routine(
        "go", "MoveL p1,s,z,tt\\WObj:=ww;",
        given="(PERS tooldata tt,PERS wobjdata ww,speeddata s,zonedata z)",
    )  # fmt: skip
    found = once("go t,w,v300,z10;", "go tool0,wobj0,v100,fine;", more=more)
    v = found.visits
    assert reasons(found) == ["", ""] and v.motion.fly.tolist() == [True, False]
    np.testing.assert_allclose(v.speed.linear, [0.3, 0.1])
    np.testing.assert_allclose(v.frame.poses[v.frame.tool][:, 2, 3], [0.3, 0.0])
    np.testing.assert_allclose(v.frame.poses[v.frame.uframe][:, 0, 3], [1.0, 0.0])


# What may change it, or move there unseen.

READS = "n:=p.trans.x;"
TRAPS = {
    "assigned": ("go p1;", GO.replace("MoveL", "p:=q;\nMoveL")),
    "a component": ("go p1;", GO.replace("MoveL", "p.trans.z:=5;\nMoveL")),
    "read": ("go p1;", GO.replace("MoveL", f"{READS}\nMoveL")),
    "handed on": (
        "go p1;",
        GO.replace("MoveL", "change p;\nMoveL")
        + routine("change", "r.trans.x:=1;", given="(INOUT robtarget r)"),
    ),
    "handed to an instruction": ("go p1;", GO.replace("MoveL", "Unheard p;\nMoveL")),
    "handed to a function": (
        "go p1;",
        GO.replace("MoveL", "n:=f(p);\nMoveL")
        + routine("f", "r.trans.x:=1;\nRETURN 1;", kind="FUNC num",
                  given="(VAR robtarget r)").replace("ENDFUNC num", "ENDFUNC"),
    ),
    "data that change": ("go q;\nq.trans.x:=1;", GO),
    "given twice": ("go p1;\nn:=p1.trans.x;", GO),
    "a routine that calls itself": (
        "go p1;",
        GO.replace("ENDPROC", "go p2;\nENDPROC"),
    ),
    "routines that call each other": (
        "go p1;",
        GO.replace("ENDPROC", "back p2;\nENDPROC")
        + routine("back", "go r;", given="(robtarget r)"),
    ),
    "by its name": ('go p1;\n%"go"% p1;', GO),
    "by a name that shows when it runs": ("go p1;\n%name%;", GO),
    "by SetDataVal": ('go p1;\nSetDataVal "q",p2;', GO),
    "in a handler": (
        "sub;\ngo p1;",
        GO + routine("sub", "n:=1/n;", "ERROR", "go p1;", "RETURN;"),
    ),
    "in a trap": (
        "CONNECT i WITH tr;\nISignalDI di1,1,i;\ngo p1;",
        "VAR intnum i;" + GO + "TRAP tr\ngo p1;\nENDTRAP\n",
    ),
    "in a function": (
        "n:=f();\ngo p1;",
        GO + "FUNC num f()\ngo p1;\nRETURN 1;\nENDFUNC\n",
    ),
    "too many arguments": ("go p1,p2;", GO),
    "an argument that is passed on": (
        "sub;",
        GO + routine("sub", "go p1\\a?a;", given="(\\switch a)"),
    ),
    "two routines of one name": ("go p1;", GO + GO),
    "a loop that has its name": (
        "at 5;",
        routine("at", "FOR x FROM 1 TO n DO",
                "MoveL Offs(p1,x,0,0),v9,fine,t\\WObj:=w;", "ENDFOR", L.format("p1"),
                given="(num x)"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("trap", TRAPS)
def test_it_is_left(trap):
    lines, more = TRAPS[trap]
    found = task(*lines.split("\n"), "EXIT;", more=MORE + more)
    assert not free(found, "p1") and not free(found, "p2") and not free(found, "q")


@pytest.mark.parametrize(
    ("change", "why"),
    [("tt.tframe.trans.z:=9;", True), ("n:=1;", False), ("hand tt;", True)],
)
def test_a_tool_that_a_routine_changes(change, why):
    more = routine("go", change, "MoveL p1,v9,fine,tt\\WObj:=w;",
                   given="(PERS tooldata tt)")  # fmt: skip
    more += routine("hand", "y.tframe.trans.z:=9;", given="(PERS tooldata y)")
    found = once("go t;", L.format("p2"), more=MORE + more)
    assert [bool(text) for text in reasons(found)] == [why, why]


def test_a_local_routine_of_another_module_is_not_what_is_called():
    """The routine of this name that the controller finds may change what it gets."""
    other = (
        "MODULE o\nLOCAL " + GO.replace("robtarget", "VAR robtarget") + "ENDMODULE\n"
    )
    found = once("go q;", L.format("q"), L.format("p2"), more=MORE, others=[other])
    assert not free(found, "q") and "may be changed" in "".join(reasons(found))


def test_a_local_routine_that_its_own_module_alone_calls():
    found = once("go p1;", L.format("p2"), more="LOCAL " + GO)
    assert names(found) == ["p1", "p2"] and free(found, "p1")
    other = "MODULE o\nPROC o()\ngo p1;\nENDPROC\nENDMODULE\n"
    assert not free(once("go p1;", more="LOCAL " + GO, others=[other]), "p1")


def test_a_number_that_its_routine_counts_up():
    more = routine("at", "n:=n+1;", "MoveL Offs(p1,n,0,0),v9,fine,t\\WObj:=w;",
                   given="(num n)")  # fmt: skip
    found = once("at 5;", more=more)
    assert found.visits.target.values[0, 0] == 1.0 + 6.0
    assert found.visits.target.literal[0] < 0


def test_copies_of_data_that_change():
    more = routine("at", "n:=n+1;", "MoveL Offs(p1,n,0,0),v9,fine,t\\WObj:=w;",
                   given="(num n)") + "VAR num k;"  # fmt: skip
    found = once("k:=2;", "at k;", "at k;", "k:=k+5;", "at k;", more=more)
    assert found.visits.target.values[:, 0].tolist() == [4.0, 4.0, 9.0]


@pytest.mark.parametrize(("what", "known"), [("", True), ("IF di1=1 ", False)])
def test_data_that_a_routine_changes_by_reference(what, known):
    more = routine("next", f"{what}n:=n+1;", given="(INOUT num n)") + "VAR num k;"
    at = "MoveL Offs(p1,k,0,0),v9,fine,t\\WObj:=w;"
    found = once("k:=2;", "next k;", at, "next k;", at, more=more)
    wanted = [4.0, 5.0] if known else [np.nan, np.nan]
    np.testing.assert_array_equal(found.visits.target.values[:, 0], wanted)


def test_a_point_that_a_routine_sets_by_reference():
    more = routine("take", "q:=p2;", given="(INOUT robtarget q)") + "VAR robtarget v;"
    found = once("take v;", L.format("v"), more=more)
    assert found.visits.target.values[0, :3].tolist() == [4.0, 5.0, 6.0]
    assert found.visits.target.literal[0] >= 0


def test_an_element_that_a_routine_sets_by_reference_is_not_known():
    more = routine("take", "q:=p2;", given="(INOUT robtarget q)")
    found = once("take list{2};", L.format("list{2}"), more=more)
    assert found.visits.target.meaning.tolist() == [Meaning.UNKNOWN]


def test_a_modal_instruction_takes_a_number_of_the_call():
    more = routine("slow", "VelSet x,500;", given="(num x)")
    found = once("slow 50;", L.format("p1"), more=more)
    assert found.visits.speed.override.tolist() == [0.5]


# What is handed over whole.

WHOLE = {
    "an element": ("VAR robtarget p{*}", "p{1}"),
    "an element that is not known": ("robtarget p{*}", "p{n}"),
    "a shifted element": ("robtarget p{*}", "Offs(p{2},0,0,9)"),
}


@pytest.mark.parametrize("kind", WHOLE)
def test_points_of_an_array_that_a_routine_gets_keep_their_numbers(kind):
    given, goal = WHOLE[kind]
    line = L.format(goal).replace(",t\\", ",tool0\\")
    lines = [L.format("list{1}"), "outer list;"]
    more = MORE + routine("go", line, given=f"({given})")
    more += routine("outer", "go x;", given=f"({given.replace('p{', 'x{')})")
    found = once(*lines, more=more)
    assert not free(found, "list{1}")
    alone = once(lines[0], more=more.replace(line, "n:=1;"))
    assert free(alone, "list{1}")


@pytest.mark.parametrize(
    ("goal", "text"),
    [("p{1}", "an element of an array that its routine is called with"),
     ("p{n}", "p is a parameter"), ("p{4}", "p is a parameter")],
)  # fmt: skip
def test_the_reason_names_the_parameter_that_is_an_array(goal, text):
    more = MORE + routine("go", L.format(goal), given="(robtarget p{*})")
    (reason,) = reasons(once("go list;", more=more))
    assert text in reason and "declared" not in reason and "other data" not in reason


# Options and arguments that answer.

ANSWERS = {
    "an option": r"WaitAI ai1\GT,5\MaxTime:=3\ValueAtTimeout:=n;",
    "an option of a function": r"name:=GetTaskName(\TaskNo:=n);",
    "an error number": r"jj:=CalcJointT(p2,t\ErrorNumber:=n);",
    "an argument": "x:=DefAccFrame(list,list,3,k,n);",
}


@pytest.mark.parametrize("kind", ANSWERS)
def test_numbers_that_instructions_and_functions_answer_in(kind):
    more = "VAR num n:=5; VAR num k; VAR pose x; VAR string name; VAR jointtarget jj;\n"
    lines = ["PDispSet [[0,0,n],[1,0,0,0]];", L.format("p1")]
    assert reasons(once(*lines, more=more)) == [""]
    found = once(ANSWERS[kind], *lines, more=more)
    assert "displacement" in reasons(found)[0]


ELEMENTS = "VAR num i;\nVAR robtarget g;\nVAR robtarget list2{2};\n"


@pytest.mark.parametrize(
    ("change", "known"), [("i:=2;", False), ("other;", False), ("n:=2;", True)]
)
def test_an_element_is_the_one_that_the_call_decides(change, known):
    """A reference stands for an element whatever its index is told by later."""
    more = routine("go", change, L.format("r"), given="(INOUT robtarget r)")
    more += routine("other", "i:=2;") + "VAR num n;\n"
    lines = ["list2{1}:=p1;", "list2{2}:=p2;", "i:=1;", "go list2{i};"]
    found = once(*lines, L.format("p2"), more=ELEMENTS + more)
    target = found.visits.target
    assert target.meaning[0] == (Meaning.POSE if known else Meaning.UNKNOWN)
    assert not known or target.values[0, 0] == 1.0
    assert bool(found.visits.literals.pinned[-1]) is not known


def test_what_a_function_returned_is_what_it_was_at_the_call():
    more = routine("go", "g:=p2;", L.format("r"), given="(robtarget r)")
    more += "FUNC robtarget f()\nRETURN g;\nENDFUNC\n"
    found = once("g:=p1;", "go f();", more=ELEMENTS + more)
    assert found.visits.target.values[0, 0] == 1.0
