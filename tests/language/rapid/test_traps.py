"""Programs of RAPID whose targets are not where, or not from where, they seem to be."""

from __future__ import annotations

import pytest

from postproc.language.visits import (
    ELSEWHERE,
    START,
    Meaning,
    OrientationLaw,
    Switch,
)
from tests.language.rapid.test_visits import END, L, names, once, origins, reasons, task

MORE = (
    "PERS pose d:=[[0,0,9],[1,0,0,0]]; VAR num n; VAR num k:=1; VAR intnum i;\n"
    "PERS pose many{2}:=[[[0,0,9],[1,0,0,0]],[[0,0,9],[1,0,0,0]]];\n"
)
P1, P2, AT_N = L.format("p1"), L.format("p2"), L.format("list{n}")
SET = "PDispSet d;"


def routine(name, *lines, kind="PROC", given="()"):
    return "\n".join([f"{kind} {name}{given}", *lines, f"END{kind.split()[0]}", ""])


def reached(found, name):
    """Return where the visits of a point come from."""
    pairs = zip(names(found), origins(found), strict=True)
    return [origin for own, origin in pairs if own == name]


# Routines that call themselves.


@pytest.mark.parametrize("again", ["sub;", "other;", "IF di1=1 sub;"])
def test_a_routine_that_calls_itself_begins_where_it_does_so(again):
    more = routine("sub", P1, L.format("list{2}"), again) + routine("other", "sub;")
    assert reached(once("sub;", more=MORE + more), "p1") == [[START, 1]]


@pytest.mark.parametrize("again", ["sub;", "other;"])
def test_a_routine_that_calls_itself_begins_with_what_holds_there(again):
    more = routine("sub", P1, SET, again) + routine("other", "sub;")
    assert "displacement" in reasons(once("sub;", more=MORE + more))[0]


def test_main_may_call_itself():
    assert reached(once(P1, P2, "main;"), "p1") == [[START, 1]]


# Searches write where they end, and nothing else.

FOUND = "VAR robtarget found:=[[7,8,9],[1,0,0,0]," + END + "; VAR bool hit;\n"
SEARCHES = {
    "line": r"SearchL\Stop,di1,{0},p1,v9,t\WObj:=w;",
    "arc": r"SearchC\Stop,di1,{0},p2,p1,v9,t\WObj:=w;",
    "by a flag": r"SearchL\PStop,hit,{0},p1,v9,t\WObj:=w;",
    "behind a condition": r"IF hit SearchL di1,{0},p1,v9,t\WObj:=w;",
    "an element": r"SearchL di1,list{{2}},p1,v9,t\WObj:=w;",
    "external axes": r"SearchExtJ di1,{0},j,v9;",
}


@pytest.mark.parametrize("search", SEARCHES)
def test_what_a_search_writes_is_not_known(search):
    written = "list{2}" if search == "an element" else "found"
    line = SEARCHES[search].format("found")
    why = reasons(once(P2, line, L.format(written), more=MORE + FOUND))
    assert why[0] == "" and "may be changed" in why[-1]


@pytest.mark.parametrize("search", ["line", "arc", "by a flag"])
def test_a_search_leaves_its_tool_and_its_other_points(search):
    found = once(SEARCHES[search].format("found"), P2, more=MORE + FOUND)
    (before,) = origins(found)[-1]
    assert reasons(found)[-1] == ""
    assert found.visits.target.meaning[before] == Meaning.UNKNOWN  # it ends anywhere


def test_a_routine_that_is_named_like_a_search_may_write_all():
    own = routine("SearchL", "x:=t2;", given="(INOUT tooldata x)")
    load = "[1,[0,0,1],[1,0,0,0],0,0,0]"
    more = f"{MORE}{own}PERS tooldata t2:=[TRUE,[[0,0,9],[1,0,0,0]],{load}];\n"
    visits = once("SearchL t;", P1, more=more).visits
    assert visits.frame.poses[visits.frame.tool[0]][2, 3] == pytest.approx(0.009)


# Names of instructions and functions that the task takes for its own.

OWN = {
    "function": (
        "n:=Abs(k);",
        "FUNC num Abs(INOUT num x)\nx:=2;\nRETURN 1;\nENDFUNC\n",
    ),
    "instruction": ("TPWrite k;", routine("TPWrite", "x:=2;", given="(INOUT num x)")),
}


@pytest.mark.parametrize("kind", OWN)
def test_a_routine_of_the_task_may_change_what_it_gets(kind):
    line, more = OWN[kind]
    found = once(line, L.format("list{k}"), more=MORE + more)
    if kind == "instruction":
        assert found.visits.target.values[0, 0] == 2.0
    else:
        assert "element or value that is not known" in reasons(found)[0]


def test_a_function_of_the_task_that_is_called_offs():
    more = f"FUNC robtarget Offs(robtarget p,num x)\nRETURN p2;\nENDFUNC\n{MORE}"
    found = once(P1, "MoveL Offs(p1,0,0,9),v200,fine,t\\WObj:=w;", more=more)
    assert reasons(found)[1] and found.visits.target.follows.tolist() == [-1, -1]


# Functions that set modes.

FUNCTION = f"FUNC num asks()\n{SET}\nRETURN 1;\nENDFUNC\n"
WITHIN = "FUNC num also()\nIF asks()=1 n:=2;\nRETURN 1;\nENDFUNC\n"


def test_a_trap_that_asks_a_function_which_sets_modes_leaves_everything():
    trap = routine("t1", "n:=asks();", kind="TRAP", given="")
    assert "TRAP" in reasons(once(P1, more=MORE + FUNCTION + trap))[0]


def test_a_function_that_asks_another_which_sets_modes():
    found = once("n:=also();", P1, more=MORE + FUNCTION + WITHIN)
    assert "displacement" in reasons(found)[0]


def test_a_function_that_calls_itself_by_another_which_sets_modes():
    one = "FUNC num one()\nIF two()=1 n:=2;\nPDispSet d;\nRETURN 1;\nENDFUNC\n"
    two = "FUNC num two()\nIF n=1 n:=one();\nRETURN 1;\nENDFUNC\n"
    more = MORE + one + two
    for line in ("n:=one();", "n:=two();"):
        trap = routine("t1", line, kind="TRAP", given="")
        lines = ["n:=one();", "PDispOff;", "n:=two();", P1]
        assert "displacement" in reasons(once(*lines, more=more))[0]
        assert "TRAP" in reasons(once(P1, more=more + trap))[0]


def test_a_procedure_on_the_way_that_asks_a_function_which_sets_modes():
    move = 'MoveLSync p1,v200,z10,t\\WObj:=w,"my";'
    found = once(move, P2, more=MORE + FUNCTION + routine("my", "n:=asks();"))
    assert reached(found, "p2") == [[ELSEWHERE]] and reasons(found)[1]


def test_a_handler_that_asks_a_function_which_sets_modes():
    sub = routine("sub", P1, "ERROR", "n:=asks();", "TRYNEXT;")
    assert "handler" in reasons(once("sub;", more=MORE + FUNCTION + sub))[0]


# Moves that run beside what is followed.

SUB = routine("sub1", P1)
BESIDE = {
    "text": ([P1, SET, '%"sub1"%;'], ""),
    "text-with-module": ([P1, SET, '%"m:sub1"%;'], ""),
    "compact": ([P1, SET, 'IF di1=1 %"sub1"%;'], ""),
    "late": ([P1, SET, '%"sub"+"1"%;'], ""),
    "by-number": ([P1, SET, 'CallByVar "sub",k;'], ""),
    "called-too": (["sub1;", SET, '%"sub1"%;'], ""),
    "function": ([P1, "n:=f();"], "FUNC num f()\nsub1;\nRETURN 1;\nENDFUNC\n"),
    "handler": ([P1, "fails;"], routine("fails", P2, "ERROR", P1, "RETRY;")),
    "on-the-way": ([P1, 'MoveLSync p2,v200,z10,t\\WObj:=w,"sub1";'], ""),
}


@pytest.mark.parametrize("kind", BESIDE)
def test_a_target_of_moves_that_run_beside_keeps_its_numbers(kind):
    lines, more = BESIDE[kind]
    found = once(*lines, more=MORE + more + SUB)
    first = int(found.visits.target.literal[0])
    assert any("goes there too" in why and first in rows.tolist()
               for why, rows in found.visits.literals.pins.items())  # fmt: skip


def test_a_routine_that_nothing_calls_pins_nothing():
    assert not once(P1, more=MORE + SUB).visits.literals.pins


# Elements that only the run tells.


@pytest.mark.parametrize("end", ["list{n}", "Offs(list{n},1,2,3)"])
def test_an_element_that_only_the_run_tells_may_be_any(end):
    found = once(L.format("list{1}"), SET, L.format(end), P2, more=MORE).visits
    ((why, own),) = found.literals.pins.items()
    assert "element of list" in why and own == found.target.literal[:1]


# Moves that do not reach their target.


@pytest.mark.parametrize("end", ["p1", "Offs(p1,0,0,5)"])
def test_a_target_that_a_search_goes_towards_keeps_its_numbers(end):
    search = f"SearchL di1,q,{end},v50,t\\WObj:=w;"
    more = MORE + f"VAR robtarget q:=[[0,0,0],[1,0,0,0],{END};\n"
    found = once(search, P1, more=more)
    (why,) = found.visits.literals.pins
    assert "search" in why


# An own handler that skips a statement.


def test_a_handler_may_skip_a_move_whose_index_is_not_known():
    found = task(P1, AT_N, P2, "EXIT;", "ERROR", "TRYNEXT;", more=MORE)
    assert reached(found, "p2") == [[0, 1]]


@pytest.mark.parametrize("line", ["PDispSet many{n};", "sets many{n};"])
def test_a_handler_may_skip_what_sets_modes(line):
    more = MORE + routine("sets", "PDispOff;", given="(pose x)")
    lines = [SET, line, P1, "EXIT;", "ERROR", "TRYNEXT;"]
    assert "displacement" in reasons(task(*lines, more=more))[0]


def test_a_handler_may_skip_a_move_that_goes_on_beside():
    move = "MoveL \\Conc,list{1},v200,fine,t\\WObj:=w;"
    found = task(P1, move, P2, "EXIT;", "ERROR", "TRYNEXT;")
    assert reached(found, "p2") == [[0, 1]]


def test_a_handler_may_skip_the_end_of_a_coupling():
    lines = ["SyncMoveOn a,b;", "SyncMoveOff a;", P1, "EXIT;", "ERROR", "TRYNEXT;"]
    assert "another arm" in reasons(task(*lines))[0]


@pytest.mark.parametrize("word", ["RETRY;", "RAISE;", "EXIT;"])
def test_a_handler_that_skips_nothing_changes_nothing(word):
    found = task(P1, AT_N, P2, "EXIT;", "ERROR", word, more=MORE)
    assert reached(found, "p2") == [[1]]


def test_plain_moves_and_modes_are_not_skipped():
    lines = [P1, SET, "PDispOff;", P2, "EXIT;", "ERROR", "TRYNEXT;"]
    found = task(*lines, more=MORE)
    assert reasons(found) == ["", ""] and origins(found) == [[START], [0]]


# Couplings of which there may be several.

COUPLED = {
    "same": (["CorrCon a;", "CorrDiscon a;"], ""),
    "other": (["CorrCon a;", "CorrCon b;", "CorrDiscon a;"], "sensor"),
    "both": (["CorrCon a;", "CorrCon b;", "CorrDiscon b;", "CorrDiscon a;"], ""),
    "all": (["CorrCon a;", "CorrCon b;", "CorrClear;"], ""),
    "element": (["CorrCon a{n};", "CorrDiscon a{n};"], "sensor"),
    "conveyors": (["WaitWObj wa;", "WaitWObj wb;", "DropWObj wa;"], "conveyor"),
    "conveyor": (["WaitWObj wa;", "DropWObj wa;"], ""),
    "axes": (["SoftAct 1,20;", "SoftAct 2,20;", "SoftDeact;"], ""),
}


@pytest.mark.parametrize("kind", COUPLED)
def test_a_coupling_ends_where_all_of_them_have_ended(kind):
    lines, why = COUPLED[kind]
    found = reasons(once(*lines, P1))[0]
    assert (why in found) if why else found == ""


# The next cycle of main.


def test_main_begins_again_where_it_ends():
    found = task(P1, "IF di1=1 RETURN;", P2)
    assert reached(found, "p1") == [[START, 0, 1]]


def test_what_ends_the_program_does_not_begin_main_again():
    assert reached(task(P1, P2, "EXIT;"), "p1") == [[START]]
    found = task(P1, "IF di1=1 EXIT;", P2)
    assert reached(found, "p1") == [[START, 1]]


def test_an_error_that_ends_main_begins_it_from_anywhere():
    found = task(P1, "WaitTime 1;", P2, "ERROR", "RETURN;")
    assert ELSEWHERE in reached(found, "p1")[0]


def test_all_modes_go_on_into_the_next_cycle():
    arc = f"MoveC p2,[[9,9,9],[1,0,0,0],{END},v200,fine,t\\WObj:=w;"
    found = task(
        P1, arc, "ConfL\\Off;", "SingArea\\Wrist;", "CirPathMode\\CirPointOri;"
    )
    v = found.visits
    assert v.motion.orientation_law.tolist() == [OrientationLaw.UNKNOWN] * 3
    assert (v.motion.care == Switch.UNKNOWN).all()


SOMETIMES = {
    "displacement": ("PDispSet [[0,0,9],[1,0,0,0]];", "displacement"),
    "load": ("GripLoad [5,[0,0,9],[1,0,0,0],0,0,0];", "carries"),
}


@pytest.mark.parametrize("kind", SOMETIMES)
def test_what_only_some_ways_set_goes_on_into_the_next_cycle(kind):
    line, why = SOMETIMES[kind]
    assert why in reasons(task(P1, "IF di1=1 THEN", line, "ENDIF"))[0]
    assert not reasons(once(P1, "IF di1=1 THEN", line, "ENDIF"))[0]


def test_what_an_unknown_call_may_set_does_not_go_on():
    assert not reasons(task(P1, "ours;", "PDispOff;", "ours;"))[0]


def test_a_main_that_sets_its_modes_first_knows_them():
    found = task("ConfL\\Off;", "SingArea\\Off;", P1, "ConfL\\On;", "SingArea\\Wrist;")
    v = found.visits
    assert v.motion.orientation_law.tolist() == [OrientationLaw.ONE_AXIS]
    assert (v.motion.care == Switch.OFF).all()


# Statements that are not understood.

AS_BEFORE = [
    "PDispOff;", "GripLoad load0;", r"ConfL\On;", r"ConfJ\On;", r"SingArea\Off;",
    r"CirPathMode\PathFrame;",
]  # fmt: skip


@pytest.mark.parametrize(
    "line", ["p9.trans.z:=1 ?? 2;", "?? t;", "?? w;", "IF n ?? d;"]
)
def test_a_statement_that_is_not_understood_may_change_what_it_names(line):
    more = MORE + f"VAR robtarget p9:=[[4,5,6],[0,1,0,0],{END};\n"
    found = once(line, *AS_BEFORE, SET, L.format("p9"), more=more)
    assert reasons(found)[-1]


JUMPING = {
    "label": ([SET, "IF n=1 ?? GOTO out;", *AS_BEFORE, "out:", P2], ""),
    "routine": (["sub;", P2], routine("sub", SET, "?? RETURN;", *AS_BEFORE)),
    "cycle": ([P2, *AS_BEFORE, SET, "?? ExitCycle;", *AS_BEFORE], ""),
    "condition": ([SET, "IF n=1 GOTO out ?? 2;", *AS_BEFORE, "out:", P2], ""),
}


@pytest.mark.parametrize("kind", JUMPING)
def test_a_statement_that_is_not_understood_may_lead_elsewhere(kind):
    lines, more = JUMPING[kind]
    found = task(P1, *lines, more=MORE + more)
    last = names(found).index("p1" if kind == "cycle" else "p2")
    assert ELSEWHERE in origins(found)[last]
    assert "displacement" in reasons(found)[last]


def test_a_statement_that_is_not_understood_leads_nowhere_without_such_a_word():
    found = once(P1, "?? n;", *AS_BEFORE, "VelSet 100,500;", "out:", P2, more=MORE)
    assert reasons(found) == ["", ""]


def test_a_handler_that_is_not_understood_may_go_on():
    lines = ["sub;", P2, "EXIT;", "ERROR", "?? TRYNEXT;"]
    found = task(*lines, more=MORE + routine("sub", SET, "WaitDI d1,1;", *AS_BEFORE))
    assert reasons(found)[-1]


def test_a_move_that_is_not_understood_sets_nothing():
    found = once(r"MoveL p2 ?? v200,fine,t\WObj:=w;", *AS_BEFORE, "VelSet 100,500;", P2)
    assert reasons(found)[-1] == "" and any(found.visits.literals.pins)
