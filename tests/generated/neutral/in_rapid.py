"""Programs in RAPID."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from postproc.robot.cell import Cell
from tests.generated.neutral.text import Page, Printed, bare_numbers, literal, printed
from tests.generated.neutral.tree import (
    Ask,
    Assign,
    Body,
    Both,
    Call,
    Cond,
    Count,
    Displace,
    Element,
    Expr,
    For,
    Foreign,
    If,
    Inline,
    Less,
    Lift,
    Loop,
    Made,
    MayFail,
    Move,
    Named,
    Not,
    Note,
    Output,
    Place,
    Point,
    Poll,
    Program,
    Read,
    Return,
    Routine,
    SetBase,
    SetElement,
    SetLoad,
    SetPart,
    SetPoint,
    SetSpeed,
    SetTool,
    SetZone,
    Shifted,
    Signal,
    Skip,
    Statement,
    Sum,
    Switch,
    Var,
    Wait,
    counters,
)
from tests.language.neutral_job import (
    OUTSIDE,
    NeutralJob,
    confdata,
    place,
    quaternion,
)

FRAME = "[[0,0,0],[1,0,0,0]]"
NOTES = (
    'TPWrite "at work";', "ConfL\\On;", "AccSet 80,80;", "ClkStart clock1;",
    "SingArea\\Off;",
)  # fmt: skip
HANDLERS = (
    ("ERROR", "{};"),
    ("ERROR (ERR_WAIT_MAXTIME)", "{};"),
    ("ERROR", "IF ERRNO=ERR_WAIT_MAXTIME {};"),
)


def rapid(made: Program, cell: Cell) -> Printed:
    """Write a program as the modules of a task."""
    return Writer(made, cell).written()


def poses(numbers: dict[int, list[float]], made: Program) -> dict[int, np.ndarray]:
    """Return what the numbers of literals say: poses [m], or joint angles [rad]."""
    found = {}
    for k, values in numbers.items():
        if made.places[k].in_joints:
            found[k] = np.deg2rad(values[:6])
            continue
        w, x, y, z = values[3:7]
        found[k] = np.eye(4)
        found[k][:3, :3] = Rotation.from_quat([x, y, z, w]).as_matrix()
        found[k][:3, 3] = np.array(values[:3]) / 1000.0
    return found


class Writer:
    """Writes the statements of a program."""

    def __init__(self, made: Program, cell: Cell) -> None:
        self.made, self.cell = made, cell
        self.pages = [Page("job.mod"), Page("part.mod")]
        self.page = self.pages[0]
        self.depth = 0

    def written(self) -> Printed:
        """Write both modules; the second one only where it holds a routine."""
        for number, page in enumerate(self.pages):
            self.page = page
            self._module(number)
        used = any(routine.file for routine in self.made.routines)
        return printed(self.pages if used else self.pages[:1])

    def _module(self, number: int) -> None:
        made = self.made
        self._emit(f"MODULE {self.page.name.removesuffix('.mod')}")
        self.depth += 1
        for name, (point, file) in made.points.items():
            if file == number:
                kind = "jointtarget" if made.places[point].in_joints else "robtarget"
                scope = "LOCAL CONST" if file else "CONST"
                self._emit(f"{scope} {kind} {name}:={self._literal(point)};")
        if number == 0:
            self._data()
        for routine in made.routines:
            if routine.file == number:
                self._routine(routine)
        if number == 0:
            self._functions()
        self.depth -= 1
        self._emit("ENDMODULE")

    def _data(self) -> None:
        made, emit = self.made, self._emit
        for k in range(len(made.tools)):
            emit(f"PERS tooldata t{k + 1}:={self._tool(k)};")
        emit(f"PERS tooldata tVar:={self._tool(0)};")
        for k in range(len(made.bases)):
            emit(f"PERS wobjdata wobj{k + 1}:={self._base(k)};")
        emit(f"PERS wobjdata wVar:={self._base(0)};")
        for k, (mass, centre) in enumerate(made.loads):
            at = ",".join(f"{x:g}" for x in centre)
            emit(f"PERS loaddata load{k + 1}:=[{mass:g},[{at}],[1,0,0,0],0,0,0];")
        emit("VAR speeddata vVar:=[200,500,5000,1000];")
        for speed in (100, 200):
            emit(f"CONST speeddata v_{speed}:=[{speed},500,5000,1000];")
        emit("VAR zonedata zVar:=[FALSE,5,1,1,1,1,1];")
        for zone in (5, 10):
            emit(f"CONST zonedata z_{zone}:=[FALSE,{zone},1,1,1,1,1];")
        for name, value in made.numbers.items():
            emit(f"VAR num {name}:={value};")
        for name in made.variables:
            emit(f"VAR robtarget {name};")
        for name, count in made.rows.items():
            emit(f"VAR robtarget {name}{{{count}}};")
        for name, row in made.arrays.items():
            text = ",".join(self._literal(k) for k in row)
            scope = "CONST" if made.fixed else "PERS"
            emit(f"{scope} robtarget {name}{{{len(row)}}}:=[{text}];")
        emit("VAR triggdata trig1;")
        emit("VAR clock clock1;")
        emit("VAR errnum MY_ERR:=-1;")
        if made.interrupts:
            emit("VAR intnum ir1;")
            emit("TRAP beep")
            emit("  PulseDO do3;")
            self._inner(made.interrupt)
            emit("ENDTRAP")

    def _tool(self, k: int) -> str:
        pose, mass = self.made.tools[k], self.made.tool_loads[k]
        load = f"[{mass:g},[0,0,100],[1,0,0,0],0,0,0]"
        return f"[TRUE,[{place(pose)},{quaternion(pose)}],{load}]"

    def _base(self, k: int) -> str:
        pose = self.made.bases[k]
        return f'[FALSE,TRUE,"",[{place(pose)},{quaternion(pose)}],{FRAME}]'

    def _literal(self, number: int) -> str:
        where: Place = self.made.places[number]
        if where.in_joints:
            joints = ",".join(f"{v:.5f}" for v in np.rad2deg(where.q))
            return literal(number, f"[[{joints}],{OUTSIDE}]")
        tool, base = self.made.tools[where.tool - 1], self.made.bases[where.base - 1]
        job = NeutralJob(self.cell, tool, base)
        pose = job.pose(where.q)
        parts = place(pose), quaternion(pose), confdata(job, where.q), OUTSIDE
        return literal(number, f"[{','.join(parts)}]")

    def _functions(self) -> None:
        for line in ("PROC look()", "  IF di6=1 RAISE MY_ERR;", "ENDPROC"):
            self._emit(line)
        for own in self.made.functions:
            match own.kind:
                case "sum":
                    lines = [f"RETURN a+{own.number};"]
                case "choice":
                    test = f"IF a<{own.number} RETURN a;"
                    lines = [test, f"RETURN {own.number};"]
                case _:
                    lines = [f"RETURN Offs({own.point},0,0,a+{own.number});"]
            kind = "robtarget" if own.kind == "point" else "num"
            self._emit(f"FUNC {kind} {own.name}(num a)")
            for line in lines:
                self._emit(f"  {line}")
            self._emit("ENDFUNC")

    def _routine(self, routine: Routine) -> None:
        main = routine is self.made.routines[0]
        words = {
            "value": "num",
            "reference": "INOUT num" if len(routine.own) < 2 else "VAR num",
            "point": "robtarget",
        }
        given = ",".join(f"{words[kind]} {name}" for name, kind in routine.parameters)
        self._emit(f"PROC {'main' if main else routine.name}({given})")
        self.depth += 1
        for name in dict.fromkeys([*routine.own, *counters(routine.body)]):
            self._emit(f"VAR num {name};")
        if main:
            self._head()
        self._body(routine.body)
        if main and self.made.ends:
            self._emit("EXIT;")
        word, way = routine.handler
        if word:
            head, line = HANDLERS[way]
            self._emit(head)
            self._inner(routine.repair)
            self._emit("  " + line.format(word))
        self.depth -= 1
        self._emit("ENDPROC")

    def _head(self) -> None:
        self._emit("BookErrNo MY_ERR;")
        self._emit("CirPathMode\\CirPointOri;")
        self._emit("TriggIO trig1,5\\DOp:=do2,1;")
        if self.made.interrupts:
            self._emit("IDelete ir1;")
            self._emit("CONNECT ir1 WITH beep;")
            self._emit("ISignalDI di9,1,ir1;")

    # Statements.

    def _emit(self, text: str, move: int = 0) -> None:
        self.page.emit("  " * self.depth + text, move)

    def _body(self, body: Body) -> None:
        for one in body:
            self._statement(one)

    def _inner(self, body: Body) -> None:
        self.depth += 1
        self._body(body)
        self.depth -= 1

    def _statement(self, one: Statement) -> None:
        emit = self._emit
        match one:
            case Move():
                emit(self._move(one), one.mark)
            case SetTool(number, _):
                emit(f"tVar:=t{number};")
            case SetBase(number, shift, _):
                emit(f"wVar:=wobj{number};")
                if any(shift):
                    at = ",".join(map(str, shift))
                    emit(f"wVar.oframe:=[[{at}],[1,0,0,0]];")
            case Displace(None):
                emit("PDispOff;")
            case Displace(by):
                emit(f"PDispSet [[{','.join(map(str, by or ()))}],[1,0,0,0]];")
            case SetLoad(number):
                emit(f"GripLoad load{number};")
            case SetSpeed(speed):
                emit(f"vVar.v_tcp:={speed};")
            case SetZone(size):
                emit(f"zVar:=z_{size};")
            case Assign(name, value):
                emit(f"{name}:={number_text(value)};")
            case SetPoint(name, value):
                emit(f"{name}:={self._point(value)};")
            case SetElement(name, index, value):
                emit(f"{name}{{{number_text(index)}}}:={self._point(value)};")
            case SetPart(point, axis, Inline(number), _, mark):
                at = literal(mark, bare_numbers(self._literal(number))[axis])
                emit(f"{self._point(point)}.trans.{'xyz'[axis]}:={at};")
            case SetPart(point, axis, of, by):
                part = f".trans.{'xyz'[axis]}"
                value = f"{self._point(of)}{part}+({number_text(by)})"
                emit(f"{self._point(point)}{part}:={value};")
            case Lift(name, by):
                emit(f"{name}.trans.z:={name}.trans.z+({number_text(by)});")
            case Wait(way):
                emit(("WaitTime 0.2;", "WaitDI di8,1;")[way])
            case Output(number, _):
                emit(f"SetDO do{number},1;")
            case MayFail(own):
                emit("look;" if own else "WaitDI di7,1\\MaxTime:=2;")
            case Foreign():
                emit("elsewhere;")
            case Note(way):
                emit(NOTES[way])
            case Call(name, _, True):
                emit(f'%"{name}"%;')
            case Call(name, arguments):
                given = ",".join(self._argument(a) for a in arguments)
                emit(f"{name} {given};" if given else f"{name};")
            case Return(test):
                emit(f"IF {cond(test)} RETURN;")
            case _:
                self._block(one)

    def _block(self, one: Statement) -> None:
        emit, inner = self._emit, self._inner
        match one:
            case If(branches, otherwise):
                for k, (test, body) in enumerate(branches):
                    emit(f"{'ELSEIF' if k else 'IF'} {cond(test)} THEN")
                    inner(body)
                if otherwise:
                    emit("ELSE")
                    inner(otherwise)
                emit("ENDIF")
            case Switch(value, cases, otherwise):
                emit(f"TEST {number_text(value)}")
                for values, body in cases:
                    emit(f"CASE {','.join(map(str, values))}:")
                    inner(body)
                emit("DEFAULT:")
                inner(otherwise)
                emit("ENDTEST")
            case For(name, first, last, step, body):
                by = f" STEP {step}" if step != 1 else ""
                emit(f"FOR {name} FROM {first} TO {last}{by} DO")
                inner(body)
                emit("ENDFOR")
            case Count(name, limit, body, way):
                emit(f"{name}:=0;")
                emit(f"again_{name}:" if way == "label" else f"WHILE {name}<{limit} DO")
                inner(body)
                emit(f"  Incr {name};")
                back = f"IF {name}<{limit} GOTO again_{name};"
                emit(back if way == "label" else "ENDWHILE")
            case Poll(signal, body):
                emit(f"WHILE di{signal}=1 DO")
                inner(body)
                emit("ENDWHILE")
            case Loop(name, before, leave, after):
                emit(f"{name}:=0;")
                emit("WHILE TRUE DO")
                inner(before)
                emit(f"  IF {cond(leave)} GOTO out_{name};")
                emit(f"  IF {name}>=2 GOTO out_{name};")
                inner(after)
                emit(f"  {name}:={name}+1;")
                emit("ENDWHILE")
                emit(f"out_{name}:")
            case Skip(number, test, body):
                emit(f"IF {cond(test)} GOTO over_{number};")
                self._body(body)
                emit(f"over_{number}:")

    def _move(self, one: Move) -> str:
        word = {"joint": "MoveJ", "line": "MoveL", "arc": "MoveC", "axes": "MoveAbsJ"}
        name = "TriggL" if one.trigger else word[one.kind]
        tool = f"t{one.tool}" if one.tool else "tVar"
        base = f"wobj{one.base}" if one.base else "wVar"
        speed = f"v_{one.speed}" if one.speed else "vVar"
        zone = {0: "fine", -1: "zVar"}.get(one.zone, f"z_{one.zone}")
        places = [self._point(p) for p in (one.via, one.to) if p is not None]
        parts = [*places, speed, *["trig1"] * one.trigger, zone, tool]
        frame = "" if one.kind == "axes" else f"\\WObj:={base}"
        return f"{name} {','.join(parts)}{frame};"

    def _point(self, point: Point) -> str:
        match point:
            case Named(name):
                return name
            case Element(name, index):
                return f"{name}{{{number_text(index)}}}"
            case Inline(number):
                return self._literal(number)
            case Shifted(inner, by, in_tool, mark):
                mm = ",".join(number_text(one) for one in by)
                mm = literal(mark, mm) if mark and isinstance(by[2], int) else mm
                return f"{'RelTool' if in_tool else 'Offs'}({self._point(inner)},{mm})"
            case Made(name, argument):
                return f"{name}({number_text(argument)})"

    def _argument(self, given: Expr | Point) -> str:
        if isinstance(given, Named | Element):
            return self._point(given)
        assert isinstance(given, int | Var | Read | Sum | Ask)
        return number_text(given)


def number_text(expr: Expr) -> str:
    """Write a number."""
    match expr:
        case Var(name):
            return name
        case Read():
            return "GInput(giPart)"
        case Sum(a, b):
            return f"{number_text(a)}+{number_text(b)}"
        case Ask(name, argument):
            return f"{name}({number_text(argument)})"
    return str(expr)


def cond(test: Cond) -> str:
    """Write a condition."""
    match test:
        case Less(a, b, equal):
            return f"{number_text(a)}{'=' if equal else '<'}{number_text(b)}"
        case Signal(number):
            return f"di{number}=1"
        case Not(inner):
            return f"NOT ({cond(inner)})"
        case Both(a, b):
            return f"({cond(a)}) AND ({cond(b)})"
