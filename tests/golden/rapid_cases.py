"""RAPID tasks of some lines, each a construct of the language."""

from __future__ import annotations

from collections.abc import Iterator

from tests.golden.case import HERE, Case

SETUP = "--cell cell.toml --model model.json"
COMPENSATE = f"compensate job.mod {SETUP} -o out/job.mod --report report.json"
NOTHING = "[9E9,9E9,9E9,9E9,9E9,9E9]"
POINTS = {
    "p1": "[[178.13,585.37,466.49],[-0.220315,0.027662,0.972991,0.063117],[0,0,0,0]",
    "p2": "[[356.01,889.41,235.63],[-0.277626,0.050900,0.950898,0.126985],[0,0,0,0]",
    "p3": "[[333.75,1003.73,158.84],[-0.322588,0.118207,0.938969,-0.017357],[0,-1,0,0]",
    "p4": "[[458.24,363.78,107.25],[-0.236527,-0.104290,0.964703,0.050258],[-1,0,-1,0]",
    "p5": "[[138.98,599.19,209.53],[-0.360047,-0.028125,0.930372,-0.063120],[0,-1,0,0]",
    "p6": "[[600.87,1001.8,431.21],[-0.081612,-0.324244,0.939801,-0.070560],[0,0,-1,0]",
}  # fmt: skip
LONG = 1000  # rounds of the large program
TARGETS = {name: f"{text},{NOTHING}]" for name, text in POINTS.items()}
TOOL = (
    "[TRUE,[[95.3,-2.1,352.7],[0.923879533,0,0.382683432,0]],"
    "[12,[40,0,120],[1,0,0,0],0,0,0]]"
)
DATA = (
    f"  TASK PERS tooldata t:={TOOL};",
    '  TASK PERS wobjdata w:=[FALSE,TRUE,"",[[1450,-400,900],[1,0,0,0]],'
    "[[0,0,0],[1,0,0,0]]];",
    f"  CONST jointtarget home:=[[5,-10,15,3,65,10],{NOTHING}];",
    *(f"  CONST robtarget {name}:={text};" for name, text in TARGETS.items()),
)
HOME = r"MoveAbsJ home\NoEOffs,v500,fine,t;"


def go(name: str, word: str = "MoveL", zone: str = "fine") -> str:
    """Write a move to a point."""
    return rf"{word} {name},v200,{zone},t\WObj:=w;"


def module(*body: str, more: str = "", declared: str = "", handler: str = "") -> bytes:
    """Write a module whose main goes home, and does what the lines say."""
    end = ("ERROR", handler) if handler else ()
    lines = ["MODULE job", *DATA, declared, "PROC main()", HOME, r"ConfL \Off;"]
    lines += [r"ConfJ \Off;", *body, *end, "ENDPROC", more, "ENDMODULE", ""]
    return "\n".join(lines).encode()


def proc(name: str, *body: str, kind: str = "PROC", handler: str = "") -> str:
    """Write a routine."""
    head = f"{kind} {name}" + ("()" if kind == "PROC" else "")
    end = ("ERROR", handler) if handler else ()
    return "\n".join([head, *body, *end, f"END{kind}"])


SQUARE = tuple(go(f"p{k}") for k in (1, 2, 3, 4))
ARRAY = "  CONST robtarget list{3}:=[" + ",".join([*TARGETS.values()][:3]) + "];"
HEAVY = "  CONST loaddata part:=[30,[0,0,80],[1,0,0,0],0,0,0];"
TIMED = r"WaitDI di1,1\MaxTime:=2;"
STEP = "PDispSet [[0,0,-40],[1,0,0,0]];"
CONDITIONS = {
    "if": module(go("p1"), "IF di1=1 THEN", go("p2"), "ELSE", go("p4"), "ENDIF",
                 go("p3")),
    "compact-if": module(go("p1"), f"IF n=1 {go('p2')}", go("p3"),
                         declared="  VAR num n;"),
    "test": module(go("p1"), "TEST n", "CASE 1:", go("p2"), "CASE 2,3:", go("p5"),
                   "DEFAULT:", go("p4"), "ENDTEST", go("p3"), declared="  VAR num n;"),
    "while": module(go("p1"), "WHILE di1=1 DO", go("p2"), go("p3"), "ENDWHILE",
                    go("p4")),
    "goto": module(go("p1"), "again:", go("p2"), "IF di1=1 GOTO again;", go("p3")),
    "for": module(go("p1"), "FOR i FROM 1 TO 3 DO", go("Offs(p1,0,20*i,0)"),
                  "ENDFOR", go("p2")),
    "for-unknown": module("FOR i FROM 1 TO n DO", go("p1"), go("p2"), "ENDFOR",
                          go("p3"), declared="  VAR num n:=3;"),
}  # fmt: skip
CALLS = {
    "call": module(go("p1"), "work;", go("p4"), more=proc("work", go("p2"), go("p3"))),
    "call-twice": module("work;", go("p4"), "work;",
                         more=proc("work", go("p2"), go("p3"))),
    "parameter": module("reach p1;", "reach p2;", more="PROC reach(robtarget p)\n"
                        + go("p") + "\nENDPROC"),
    "function": module(go("p1"), "n:=f(2);", go("p2"), declared="  VAR num n;",
                       more="FUNC num f(num a)\nRETURN a*2;\nENDFUNC"),
    "function-moves": module(go("p1"), "n:=f(2);", go("p2"), declared="  VAR num n;",
                             more=f"FUNC num f(num a)\n{go('p3')}\nRETURN a;\nENDFUNC"),
    "late": module(go("p1"), '%"work"%;', go("p2"), more=proc("work", go("p3"))),
    "return": module("work;", go("p4"), more=proc(
        "work", go("p2"), "IF di1=1 RETURN;", go("p3"))),
    "unknown": module(go("p1"), "weld 3;", go("p2"), go("p3")),
    "recursive": module("work;", go("p3"), more=proc(
        "work", go("p1"), "IF n<3 work;", go("p2")), declared="  PERS num n:=0;"),
}  # fmt: skip
LISTS = {
    "array": module(*(go(f"list{{{k}}}") for k in (1, 2, 3)), declared=ARRAY),
    "array-loop": module("FOR i FROM 1 TO 3 DO", go("list{i}"), "ENDFOR",
                         declared=ARRAY),
    "inline": module(*(go(TARGETS[f"p{k}"]) for k in (1, 2, 3))),
    "assigned": module("q:=p1;", go("q"), go("p2"), declared="  VAR robtarget q;"),
    "offset": module(go("p1"), r"MoveL Offs(p1,10,0,-20),v200,z5,t\WObj:=w;",
                     r"MoveL RelTool(p2,0,0,-30\Rz:=5),v200,fine,t\WObj:=w;"),
    "shared": module(go("p1"), go("p2"), go("p3"), go("p2")),
    "taught": module(*SQUARE).replace(b"p2:=", b"p2:= !TAUGHT\n"),
    "displaced": module(go("p1"), STEP, go("p2"), "PDispOff;", go("p3")),
}  # fmt: skip
PROCESSES = {
    "arc-weld": module(r"ArcLStart p1,v200,sm,wd\Weave:=wv,fine,t\WObj:=w;",
                       r"ArcL p2,v200,sm,wd,z1,t\WObj:=w;",
                       r"ArcLEnd p3,v200,sm,wd,fine,t\WObj:=w;", go("p4")),
    "spot-weld": module(r"SpotL p1,v200,g1,sp,t\WObj:=w;",
                        r"SpotL p2,v200,g1,sp,t\WObj:=w;", go("p3")),
    "dispense": module(r"DispL\On,p1,v200,bead,z5,t\WObj:=w;",
                       r"DispL\Off,p2,v200,bead,z5,t\WObj:=w;"),
    "triggers": module("TriggIO tr,10\\DOp:=do1,1;", r"TriggL p1,v200,tr,z5,t\WObj:=w;",
                       go("p2"), declared="  VAR triggdata tr;"),
    "search": module(go("p1"), r"SearchL di1,found,p2,v50,t\WObj:=w;", go("p3"),
                     declared="  VAR robtarget found;"),
    "grip": module(go("p1"), "GripLoad part;", go("p2"), "GripLoad load0;", go("p3"),
                   declared=HEAVY),
    "speed": module("VelSet 50,200;", *SQUARE, "AccSet 40,40;", go("p5")),
}  # fmt: skip
ERRORS = {
    "retry": module(go("p1"), TIMED, go("p2"), handler="RETRY;"),
    "trynext": module(go("p1"), "work;", go("p2"), handler="TRYNEXT;",
                      more=proc("work", go("p3"), TIMED, go("p4"))),
    "return-on-error": module("work;", go("p2"), more=proc(
        "work", go("p1"), go("p3"), handler="RETURN;")),
    "raise": module("work;", go("p2"), handler="IF ERRNO=9 TRYNEXT;", more=proc(
        "work", go("p1"), "IF di1=1 RAISE 9;", go("p3"))),
    "handler-moves": module(go("p1"), go("p2"), handler=f"{go('p3')}\nRETRY;"),
    "trap": module("CONNECT i WITH stop1;", "ISignalDI di1,1,i;", *SQUARE,
                   declared="  VAR intnum i;",
                   more=proc("stop1", 'TPWrite "x";', kind="TRAP")),
    "trap-moves": module("CONNECT i WITH away;", "ISignalDI di1,1,i;", *SQUARE,
                         declared="  VAR intnum i;",
                         more=proc("away", "StopMove;", go("p5"), kind="TRAP")),
}  # fmt: skip
ARCS = {
    "arc": module(go("p1"), r"MoveC p2,p3,v100,fine,t\WObj:=w;", go("p4")),
    "arc-zone": module(go("p1"), r"MoveC p5,p2,v100,z10,t\WObj:=w;", go("p3")),
    "arc-law": module(r"CirPathMode \CirPointOri;", go("p1"),
                      r"MoveC p2,p3,v100,fine,t\WObj:=w;"),
    "zones": module(*(go(f"p{k}", zone="z50") for k in (1, 2, 3)), go("p4")),
    "joint-moves": module(*(go(f"p{k}", "MoveJ", "z10") for k in (1, 2, 3)), go("p4")),
    "wrist": module(r"SingArea \Wrist;", *SQUARE),
}  # fmt: skip
REFUSALS = {
    "no-routine": b"MODULE job\n  VAR num n;\nENDMODULE\n",
    "no-main": module(*SQUARE).replace(b"PROC main", b"PROC other"),
    "string": module('TPWrite "open;', *SQUARE),
    "no-end": module(*SQUARE).replace(b"ENDPROC", b""),
    "not-understood": module(go("p1"), "3 moves here;", go("p2")),
    "no-quaternion": module(go("p1").replace("p1", TARGETS["p1"].replace(
        "-0.220315,0.027662,0.972991,0.063117", "0,0,0,0")), go("p2")),
    "work-object": module(go("p1").replace("w;", "other;"), go("p2")),
}  # fmt: skip


def rapid() -> Iterator[Case]:
    """Return the cases of RAPID."""
    files = {name: (HERE / "rapid" / name).read_bytes() for name in GIVEN}
    groups = (CONDITIONS, CALLS, LISTS, PROCESSES, ERRORS, ARCS, REFUSALS)
    for name, text in (pair for group in groups for pair in group.items()):
        texts = {**files, "job.mod": text}
        back = ("restore out/job.mod -o back/job.mod",)
        yield Case(f"rapid/{name}", (COMPENSATE, *back), texts=texts, quick=True)
    inline = [go(TARGETS[f"p{k}"]) for k in (1, 2, 3, 4)]
    long = {**files, "job.mod": module(*inline * LONG)}
    yield Case("rapid/large", (COMPENSATE,), texts=long)


GIVEN = ("cell.toml", "model.json")
