"""What can change a move: every row of the table, and every word of the lists."""

from __future__ import annotations

from pathlib import Path

import pytest

from postproc.language.rapid.errors import EXIT_CYCLE
from postproc.language.rapid.instructions import MOTIONS, read_known_instructions
from postproc.language.visits import ELSEWHERE, START, OrientationLaw, Switch, ZoneRule
from tests.language.rapid.test_visits import L, origins, reasons, task

PAGE = Path(__file__).parents[3] / "docs" / "rapid.md"
WORDS = Path(__file__).with_name("words.txt")
MORE = """PERS pose d:=[[0,0,9],[1,0,0,0]]; VAR num n; VAR intnum i; VAR triggdata g;
  PERS loaddata part:=[3,[0,0,1],[1,0,0,0],0,0,0];
  PROC sub()
    PDispSet d;
    WaitDI di1,1\\MaxTime:=2;
    PDispOff;
  ENDPROC
  PROC wait()
    WaitDI di1,1\\MaxTime:=2;
  ENDPROC
  PROC away()
    PDispSet d;
  ENDPROC
  FUNC num moving()
    MoveL list{3},v200,fine,t\\WObj:=w;
    RETURN 1;
  ENDFUNC
"""
P1, P2, P3 = (L.format(name) for name in ("p1", "p2", "list{1}"))
SHIFT = "displacement"


def after(*lines, handler=(), more=""):
    """Tell how the move behind some lines begins, and why it is not corrected."""
    ends = ("ERROR", *handler) if handler else ()
    found = task(P1, *lines, P2, *ends, more=MORE + more)
    names = [found.visits.target.names[k] for k in found.visits.target.name.tolist()]
    last = len(names) - 1 - names[::-1].index("p2")
    return ELSEWHERE in origins(found)[last], reasons(found)[last], found.visits, last


def mass(visits, visit):
    """Return the mass that the program states to be carried at a visit [kg]."""
    return visits.motion.loads[visits.motion.load[visit]][0]


def anywhere(*lines, **more):
    unknown, why, *_ = after(*lines, **more)
    return unknown and SHIFT in why


def left(word, *lines, **more):
    return word in after(*lines, **more)[1]


def known(*lines, **more):
    return after(*lines, **more)[:2] == (False, "")


RAISED = "PROC bad()\n%s\nENDPROC"
CHECKS = {
    "`SearchL`, `SearchC`": lambda: (
        "search" in reasons(task(r"SearchL di1,q,p2,v50,t\WObj:=w;",
                                 more=MORE + "VAR robtarget q;"))[0]),
    "`StorePath`, `ClearPath`, `StopMoveReset`": lambda: all(
        anywhere(f"{one};") for one in ("StorePath", "ClearPath", "StopMoveReset")),
    "an error in a called routine, `TRYNEXT` in a caller": lambda: anywhere(
        "sub;", handler=["TRYNEXT;"]),
    "an error in a called routine, `RETRY` in a caller": lambda: (
        ELSEWHERE in origins(task(P1, "far;", P2, "ERROR", "RETRY;", more=MORE
                 + f"PROC far()\n{P3}\nwait;\nENDPROC"))[1]),
    "an error, `RETURN` in a handler": lambda: anywhere(
        "bad;", more=RAISED % "sub;\nERROR\nRETURN;"),
    "an error that the own handler answers with `TRYNEXT`": lambda: (
        0 in origins(task(P1, L.format("list{n}"), P2, "ERROR", "TRYNEXT;",
                          more=MORE))[2]),
    "`RAISE`": lambda: left(SHIFT, "bad;", handler=["TRYNEXT;"], more=RAISED
                            % "IF n=1 THEN\nPDispSet d;\nRAISE 5;\nENDIF"),
    "a handler that ends in `Stop`, `EXIT` or at its end": lambda: all(
        known("sub;", handler=[one]) for one in ("Stop;", "EXIT;", "n:=n+1;")),
    "a list of errors, `IF ERRNO=..`, `TEST ERRNO`": lambda: known(
        "sub;", handler=["IF ERRNO=ERR_WHLSEARCH TRYNEXT;"]),
    "an error of a process move (`ArcL`, `CapL`, ..), own handler": lambda: (
        after(r"ArcL p1,v200,s,x,fine,t\WObj:=w;", handler=["TRYNEXT;"])[0]),
    "the end of `main`, `RETURN` in it": lambda: (
        origins(task(P1, P2))[0] == [START, 1]
        and origins(task(P1, P2, "EXIT;"))[0] == [START]),
    "`ExitCycle`": lambda: ELSEWHERE in origins(
        task(P1, "IF n=1 ExitCycle;", P2, more=MORE))[0],
    "an error handler that moves": lambda: left("handler", handler=[P3, "RETRY;"]),
    "a `TRAP` that moves or changes modes, also by `TriggInt`": lambda: left(
        "TRAP", "CONNECT i WITH x;", "TriggInt g,5,i;",
        more="TRAP x\nPDispSet d;\nENDTRAP"),
    "`WaitDI`, `WaitTime`, `Stop`, `TPReadNum` and the like behind a zone": lambda: all(
        task(P1.replace("fine", "z10"), f"{line};", P2).visits.zone.rule[0]
        == ZoneRule.UNKNOWN
        for line in ("WaitDI di1,1", "WaitTime 1", "Stop", 'TPReadNum n,"?"')),
    "`StopMove`, `StorePath`, a statement that may move the arm, behind a zone": lambda:
        all(task(P1.replace("fine", "z10"), line, P2, more=MORE).visits.zone.rule[0]
            == ZoneRule.UNKNOWN
            for line in ("StopMove;", "StorePath;", "weld 3;", "?? n;")),
    "`MoveLSync`, `MoveJSync`, `MoveCSync`": lambda: left(
        SHIFT, r'MoveLSync p1,v200,z10,t\WObj:=w,"away";'),
    '`%"name"%`, `CallByVar`': lambda: (
        anywhere('%"sub"%;') and anywhere('CallByVar "sub",n;')),
    "a function that moves or changes modes": lambda: (
        anywhere("n:=moving();")
        and left("TRAP", more="TRAP x\nn:=moving();\nENDTRAP")),
    "a routine that calls itself": lambda: (
        anywhere("again;", more="PROC again()\nagain;\nENDPROC")),
    "a routine of the task named like an instruction or function": lambda: left(
        SHIFT, "TPErase;", more="PROC TPErase()\nPDispOn p1,t;\nENDPROC"),
    "a routine in no file": lambda: anywhere("weld 3;"),
    "`IndAMove`, `EGMRunPose`, `FCAct`, `PathRecMoveBwd` and the like": lambda: all(
        anywhere(f"{one} x;") for one in
        ("IndAMove", "EGMRunPose", "FCAct", "PathRecMoveBwd")),
    "`PDispOn`, `PDispSet`, `PDispOff`": lambda: (
        left(SHIFT, r"PDispOn p1,t;") and known("PDispSet d;")
        and known("PDispOn p1,t;", "PDispOff;")),
    "`EOffsOn`, `EOffsSet`, `CorrCon`, `SoftAct`, `SyncMoveOn`, `WaitWObj`": lambda: (
        all(not known(f"{one} x;") for one in ("EOffsOn", "EOffsSet", "CorrCon",
                                               "SoftAct", "SyncMoveOn", "WaitWObj"))
        and known("SoftAct 1,20;", "SoftDeact;")),
    "`GripLoad`, `\\TLoad`, the mass of a tooldata": lambda: (
        mass(*after("GripLoad part;")[2:]) == 4.0),
    "`ConfL`, `ConfJ`": lambda: (
        (lambda v, k: v.motion.care[k][0] == Switch.OFF)(*after("ConfL \\Off;")[2:])),
    "`SingArea`, `CirPathMode`": lambda: (
        (lambda v, k: v.motion.orientation_law[k] == OrientationLaw.WRIST_JOINTS)(
            *after("SingArea \\Wrist;")[2:])),
    "`VelSet`, `SpeedLimAxis`": lambda: (
        (lambda v, k: v.speed.override[k] == 0.5)(*after("VelSet 50,500;")[2:])),
    "`Load`, `UnLoad`, `StartLoad`": lambda: left(SHIFT, 'Load "x.mod";'),
    "`SetDataVal`, `SetAllDataVal`": lambda: (
        "run" in reasons(task(L.format("list{1}"), 'SetDataVal "list",n;',
                              more=MORE))[0]),
    "a statement that is not understood": lambda: (
        anywhere("?? n;") and "run" in reasons(task(
            L.format("list{1}"), "?? list;", more=MORE))[0]),
    ".. with `GOTO`, `RETURN`, `ExitCycle`, `RAISE`": lambda: (
        anywhere("?? GOTO out;", "PDispOff;", "out:") and anywhere(
            "x;", more="PROC x()\n?? RETURN;\nPDispOff;\nENDPROC")),
}  # fmt: skip


def rows():
    text = PAGE.read_text(encoding="utf-8").split("\n\n")[2]
    return [line.strip("|").split(" | ")[0].strip() for line in text.splitlines()[2:]]


def test_every_row_has_its_check():
    assert rows() == list(CHECKS)


@pytest.mark.parametrize("row", CHECKS)
def test_a_row_of_the_table_holds(row):
    assert CHECKS[row]()


def test_every_instruction_is_in_a_list():
    lines = WORDS.read_text(encoding="utf-8").splitlines()
    words = {w.lower() for line in lines if line[:1] != "#" for w in line.split()}
    known = {*MOTIONS, *read_known_instructions(), EXIT_CYCLE}
    assert len(words) > 400 and not words - known


def test_no_instruction_is_in_two_lists():
    assert not {*MOTIONS} & {*read_known_instructions()}


@pytest.mark.parametrize(
    "name", ["AInput", "DInput", "GInput", "GInputDnum", "GOutput"]
)
def test_a_function_that_reads_a_signal_leaves_place_and_settings(name):
    unknown, why, *_ = after(f"n:={name}(signal);")
    assert not unknown and not why
