"""Programs in PDL2."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

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
    Move,
    Named,
    Not,
    Note,
    Output,
    Point,
    Poll,
    Program,
    Read,
    Return,
    Routine,
    SetBase,
    SetElement,
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
    loops,
    own_points,
)
from tests.language.neutral_job import NeutralJob, configuration, record

NOTES = (
    "-- at work", "$TERM_TYPE := FINE", "WRITE LUN_CRT ('at work', NL)",
    "$STRESS_PER := 50", "$JNT_OVR[1] := 50",
)  # fmt: skip
WORDS = {"joint": "JOINT", "axes": "JOINT", "line": "LINEAR", "step": "LINEAR",
         "arc": "CIRCULAR"}  # fmt: skip
TYPES = {"value": "INTEGER", "reference": "INTEGER", "point": "POSITION"}
JOB, PART = "job", "part"


def pdl2(made: Program, cell: Cell) -> Printed:
    """Write a program, another one that it uses, and its list of variables."""
    return Writer(made, cell).written()


def poses(numbers: dict[int, list[float]], made: Program) -> dict[int, np.ndarray]:
    """Return what the numbers of literals say: poses [m], or joint angles [rad]."""
    found = {}
    for k, values in numbers.items():
        if made.places[k].in_joints:
            # A list has the number of the joint before each.
            found[k] = np.deg2rad(values[1::2] if len(values) == 12 else values[:6])
            continue
        found[k] = np.eye(4)
        found[k][:3, :3] = Rotation.from_euler("ZYZ", values[3:6], True).as_matrix()
        found[k][:3, 3] = np.array(values[:3]) / 1000.0
    return found


def frame(pose: np.ndarray) -> str:
    """Write a frame."""
    return f"POS({record(pose)}, '')"


class Writer:
    """Writes the statements of a program.

    Points of the program have their values in its list of variables where its array
    never changes, else they are assigned. The other program assigns its own.
    """

    def __init__(self, made: Program, cell: Cell) -> None:
        self.made, self.cell = made, cell
        self.page = Page(f"{JOB}.pdl", "\r\n")
        self.depth = 0
        self.file = 0

    def written(self) -> Printed:
        """Write all files; the other program only where it holds a routine."""
        pages = [self.page]
        self._job()
        if self.made.fixed:
            pages.append(self._listed())
        if any(routine.file for routine in self.made.routines):
            self.page, self.file = Page(f"{PART}.pdl"), 1
            pages.append(self.page)
            self._part()
        return printed(pages)

    # Data.

    def _variables(self) -> Iterator[tuple[str, str]]:
        """Yield names and types of what the program has."""
        made = self.made
        yield ", ".join(self._frames()), "POSITION"
        for name, (number, file) in made.points.items():
            if not file:
                joints = made.places[number].in_joints
                yield name, "JOINTPOS" if joints else "POSITION"
        for name in made.variables:
            if not name.startswith("w"):  # others are declared in their routine
                yield name, "POSITION"
        for name, numbers in made.arrays.items():
            yield name, f"ARRAY[{len(numbers)}] OF POSITION"
        for name, count in made.rows.items():
            yield name, f"ARRAY[{count}] OF POSITION"
        yield ", ".join(made.numbers), "INTEGER"

    def _frames(self) -> list[str]:
        tools, bases = range(len(self.made.tools)), range(len(self.made.bases))
        return [*(f"tool{k + 1}" for k in tools), *(f"base{k + 1}" for k in bases)]

    def _literal(self, number: int) -> str:
        where = self.made.places[number]
        if where.in_joints:
            joints = ", ".join(f"{v:.5f}" for v in np.rad2deg(where.q))
            return f"{{{literal(number, joints)}}}"
        numbers, flags = self._numbers(number)
        return f"POS({literal(number, ', '.join(numbers))}, '{flags}')"

    def _numbers(self, number: int) -> tuple[list[str], str]:
        """Return the numbers of a position, and its configuration."""
        where, made = self.made.places[number], self.made
        tool, base = made.tools[where.tool - 1], made.bases[where.base - 1]
        job = NeutralJob(self.cell, tool, base)
        return record(job.pose(where.q)).split(", "), configuration(job, where.q)

    def _listed(self) -> Page:
        """Write the values of the program's points as its list of variables."""
        page, made = Page(f"{JOB}.lsv", self.page.end), self.made
        scope = "Xport" if made.shared else "Priv"
        page.emit("--$$  ARM: 1 AXES: 6 AUX: 0 MASK: 63")
        for point, (number, file) in made.points.items():
            if file:
                continue
            if made.places[number].in_joints:
                page.emit(f"{point} JNTP Arm: 1 Ax: 6 {scope}")
                angles = enumerate(np.rad2deg(made.places[number].q), 1)
                text = " ".join(f"{k}: {v:.5f}" for k, v in angles)
                page.emit(f" {literal(number, text)}")
            else:
                page.emit(f"{point} POS {scope}")
                self._list_position(page, number)
        for row, numbers in made.arrays.items():
            page.emit(f"{row} APOS[{len(numbers)}] {scope}")
            for k, number in enumerate(numbers):
                page.emit(f" [{k + 1}]:")
                self._list_position(page, number)
        return page

    def _list_position(self, page: Page, number: int) -> None:
        numbers, flags = self._numbers(number)
        named = zip("XYZAER", numbers, strict=True)
        text = "  ".join(f"{name}: {value}" for name, value in named)
        page.emit(f"  {literal(number, text)}")
        page.emit(f"  CNFG: '{flags}'")

    # Programs and routines.

    def _job(self) -> None:
        made, emit = self.made, self._emit
        others = [routine for routine in made.routines if routine.file]
        emit(f"PROGRAM {JOB}")
        if others:
            emit(f"IMPORT '{PART}'")
        emit("VAR")
        scope = f" EXPORTED FROM {JOB}" if made.shared else ""
        for names, kind in self._variables():
            emit(f"  {names} : {kind}{scope}")
        self._locals(made.routines[0])
        emit("ROUTINE elsewhere EXPORTED FROM nowhere")
        for routine in others:
            emit(f"{self._head(routine)} EXPORTED FROM {PART}")
        self._functions()
        for routine in made.routines[1:]:
            if not routine.file:
                self._routine(routine)
        emit("BEGIN")
        self.depth += 1
        self._begin()
        self._body(made.routines[0].body)
        self.depth -= 1
        emit(f"END {JOB}")

    def _part(self) -> None:
        made, emit = self.made, self._emit
        emit(f"PROGRAM {PART}")
        emit(f"IMPORT '{JOB}'")
        emit("VAR")
        for names, kind in self._variables():
            emit(f"  {names} : {kind} EXPORTED FROM {JOB}")
        for name, (_, file) in made.points.items():
            if file:
                emit(f"  {name} : POSITION")
        emit("ROUTINE elsewhere EXPORTED FROM nowhere")
        for own in made.functions:
            kind = "POSITION" if own.kind == "point" else "INTEGER"
            emit(f"ROUTINE {own.name}(a : INTEGER) : {kind} EXPORTED FROM {JOB}")
        for routine in made.routines[1:]:
            if routine.file:
                emit(f"{self._head(routine)} EXPORTED FROM {PART} GLOBAL")
                self._routine(routine)
            else:
                emit(f"{self._head(routine)} EXPORTED FROM {JOB}")
        emit("BEGIN")
        self.depth += 1
        self._assign_points(1)
        self.depth -= 1
        emit(f"END {PART}")

    def _begin(self) -> None:
        """Set what has its value before the program of the drawing begins."""
        made, emit = self.made, self._emit
        poses = [*made.tools, *made.bases]
        for name, pose in zip(self._frames(), poses, strict=True):
            emit(f"{name} := {frame(pose)}")
        if any(routine.file for routine in made.routines):
            emit(f"CALL {PART}")
        if not made.fixed:
            self._assign_points(0)
            for name, numbers in made.arrays.items():
                for k, number in enumerate(numbers):
                    emit(f"{name}[{k + 1}] := {self._literal(number)}")
        for name, value in made.numbers.items():
            emit(f"{name} := {value}")
        for line in ("$FLY_TYPE := FLY_CART", "$FLY_TRAJ := FLY_FROM",
                     "$FLY_PER := 100", "$FLY_DIST := 5"):  # fmt: skip
            emit(line)
        self._condition(6, "AT END", "$DOUT[2] := ON")
        if made.interrupts:
            self._condition(5, "$DIN[9]+", "beep")
            emit("ENABLE CONDITION[5]")
        if not made.ends:
            emit("CYCLE")

    def _assign_points(self, own: int) -> None:
        for name, (number, file) in self.made.points.items():
            if file == own:
                self._emit(f"{name} := {self._literal(number)}")

    def _condition(self, number: int, event: str, action: str) -> None:
        self._emit(f"CONDITION[{number}] :")
        self._emit(f"  WHEN {event} DO")
        self._emit(f"    {action}")
        self._emit("ENDCONDITION")

    def _head(self, routine: Routine) -> str:
        given = "; ".join(
            f"{name} : {TYPES[kind]}" for name, kind in routine.parameters
        )
        return (
            f"ROUTINE {routine.name}({given})" if given else f"ROUTINE {routine.name}"
        )

    def _locals(self, routine: Routine) -> None:
        own = [*routine.own, *counters(routine.body), *loops(routine.body)]
        for name in dict.fromkeys(own):
            self._emit(f"  {name} : INTEGER")
        for name in own_points(routine.body):
            self._emit(f"  {name} : POSITION")

    def _routine(self, routine: Routine) -> None:
        self._emit(f"{self._head(routine)} EXPORTED FROM {(JOB, PART)[routine.file]}")
        self._emit("VAR")
        self._locals(routine)
        self._emit("BEGIN")
        self._inner(routine.body)
        self._emit(f"END {routine.name}")

    def _functions(self) -> None:
        for own in self.made.functions:
            kind = "POSITION" if own.kind == "point" else "INTEGER"
            head = f"ROUTINE {own.name}(a : INTEGER) : {kind}"
            self._emit(f"{head} EXPORTED FROM {JOB}")
            match own.kind:
                case "sum":
                    lines = ["BEGIN", f"  RETURN(a + {own.number})"]
                case "choice":
                    test = [f"  IF a < {own.number} THEN", "    RETURN(a)", "  ENDIF"]
                    lines = ["BEGIN", *test, f"  RETURN({own.number})"]
                case _:
                    add = f"  r.Z := r.Z + a + {own.number}"
                    start = ["VAR", "  r : POSITION", "BEGIN", f"  r := {own.point}"]
                    lines = [*start, add, "  RETURN(r)"]
            for line in [*lines, f"END {own.name}"]:
                self._emit(line)
        if self.made.interrupts:
            self._emit("ROUTINE beep")
            self._emit("BEGIN")
            self._emit("  $DOUT[3] := ON")
            self._inner(self.made.interrupt)
            self._emit("END beep")

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
            case SetTool(number, way):
                emit(f"$TOOL := {self._tool(number, way)}")
            case SetBase(number, shift, way):
                at = f" : {turnless(shift)}" if any(shift) else ""
                emit(f"$UFRAME := {self._base(number, way)}{at}")
            case SetSpeed(speed):
                emit(f"$LIN_SPD := {speed / 1000:g}")
            case SetZone(size):
                emit(f"$FLY_DIST := {size}")
            case Assign(name, value):
                emit(f"{name} := {number_text(value)}")
            case SetPoint(name, value):
                emit(f"{name} := {self._point(value)}")
            case SetElement(name, index, value):
                emit(f"{name}[{number_text(index)}] := {self._point(value)}")
            case SetPart(point, axis, Inline(number), _, mark):
                at = literal(
                    mark, bare_numbers(", ".join(self._numbers(number)[0]))[axis]
                )
                emit(f"{self._point(point)}.{'XYZ'[axis]} := {at}")
            case SetPart(point, axis, of, by):
                part = f".{'XYZ'[axis]}"
                value = f"{self._point(of)}{part} + ({number_text(by)})"
                emit(f"{self._point(point)}{part} := {value}")
            case Lift(name, by):
                emit(f"{name}.Z := {name}.Z + ({number_text(by)})")
            case Wait(way):
                emit(("DELAY 200", "WAIT FOR $DIN[8]")[way])
            case Output(number, _):
                emit(f"$DOUT[{number}] := ON")
            case Foreign():
                emit("elsewhere")
            case Note(way):
                emit(NOTES[way])
            case Call(name, arguments):
                given = ", ".join(self._given(name, arguments))
                emit(f"{name}({given})" if given else name)
            case Return(test):
                emit(f"IF {cond(test)} THEN")
                emit("  RETURN")
                emit("ENDIF")
            case _:
                self._block(one)

    def _tool(self, number: int, way: int) -> str:
        return frame(self.made.tools[number - 1]) if way else f"tool{number}"

    def _base(self, number: int, way: int) -> str:
        return frame(self.made.bases[number - 1]) if way else f"base{number}"

    def _given(self, name: str, arguments: Sequence[Expr | Point]) -> Iterator[str]:
        """Yield arguments; the value of a variable goes in behind parentheses."""
        parameters = self.made.routine(name).parameters
        for (_, kind), value in zip(parameters, arguments, strict=True):
            if isinstance(value, Named | Element):
                yield self._point(value)
            else:
                assert isinstance(value, int | Var | Read | Sum | Ask)
                copy = kind == "value" and isinstance(value, Var)
                yield f"({number_text(value)})" if copy else number_text(value)

    def _block(self, one: Statement) -> None:
        emit, inner = self._emit, self._inner
        match one:
            case If(branches, otherwise):
                self._if(list(branches), otherwise)
            case Switch(value, cases, otherwise):
                emit(f"SELECT {number_text(value)} OF")
                for values, body in cases:
                    emit(f"CASE ({', '.join(map(str, values))}):")
                    inner(body)
                emit("ELSE:")
                inner(otherwise)
                emit("ENDSELECT")
            case For(name, first, last, step, body):
                self._for(name, first, last, step)
                inner(body)
                emit("ENDFOR")
            case Count():
                self._count(one)
            case Poll(signal, body):
                emit(f"WHILE $DIN[{signal}] DO")
                inner(body)
                emit("ENDWHILE")
            case Loop(name, before, leave, after):
                emit(f"{name} := 0")
                emit("WHILE TRUE DO")
                inner(before)
                for test in (cond(leave), f"{name} >= 2"):
                    emit(f"IF {test} THEN")
                    emit(f"  GOTO out_{name}")
                    emit("ENDIF")
                inner(after)
                emit(f"{name} := {name} + 1")
                emit("ENDWHILE")
                emit(f"out_{name}::")
            case Skip(number, test, body):
                emit(f"IF {cond(test)} THEN")
                emit(f"  GOTO over_{number}")
                emit("ENDIF")
                self._body(body)
                emit(f"over_{number}::")

    def _if(self, branches: list[tuple[Cond, Body]], otherwise: Body) -> None:
        (test, body), *rest = branches
        self._emit(f"IF {cond(test)} THEN")
        self._inner(body)
        if rest or otherwise:
            self._emit("ELSE")
            self.depth += 1
            if rest:
                self._if(rest, otherwise)
            else:
                self._body(otherwise)
            self.depth -= 1
        self._emit("ENDIF")

    def _for(self, name: str, first: int, last: int, step: int) -> None:
        """Write the head of a loop; one that counts down is written in two ways."""
        down, by = step == -1 and len(name) % 2 == 0, ""
        if not down and step != 1:
            by = f" STEP {step}"
        word = "DOWNTO" if down else "TO"
        self._emit(f"FOR {name} := {first} {word} {last}{by} DO")

    def _count(self, one: Count) -> None:
        emit, name, limit = self._emit, one.name, one.limit
        emit(f"{name} := 0")
        start = {
            "while": f"WHILE {name} < {limit} DO", "repeat": "REPEAT",
            "label": f"again_{name}::",
        }  # fmt: skip
        emit(start[one.way])
        self._inner(one.body)
        emit(f"{name} := {name} + 1")
        match one.way:
            case "while":
                emit("ENDWHILE")
            case "repeat":
                emit(f"UNTIL {name} >= {limit}")
            case "label":
                emit(f"IF {name} < {limit} THEN")
                emit(f"  GOTO again_{name}")
                emit("ENDIF")

    def _move(self, one: Move) -> str:
        word = f"MOVE{'FLY' * bool(one.zone)} {WORDS[one.kind]}"
        if one.kind == "step":
            assert isinstance(one.to, Shifted)
            by = ", ".join(map(number_text, one.to.by))
            text = f"{word} RELATIVE VEC({by}) IN UFRAME"
        else:
            text = f"{word} TO {self._point(one.to)}"
        if one.via is not None:
            text += f" VIA {self._point(one.via)}"
        clauses = []
        if one.tool:
            clauses.append(f"$TOOL = {self._tool(one.tool, one.mark % 2)}")
            clauses.append(f"$UFRAME = {self._base(one.base, one.mark % 3)}")
        if one.speed and one.kind != "axes":
            clauses.append(f"$LIN_SPD = {one.speed / 1000:g}")
        if one.zone > 0:
            clauses.append(f"$FLY_DIST = {one.zone}")
        if one.trigger:
            clauses.append("CONDITION[6]")
        text += " ADVANCE" * bool(one.zone)
        return text + (f" WITH {', '.join(clauses)}" if clauses else "")

    def _point(self, point: Point) -> str:
        match point:
            case Named(name):
                return name
            case Element(name, index):
                return f"{name}[{number_text(index)}]"
            case Inline(number):
                return self._literal(number)
            case Shifted(inner, by, in_tool, mark):
                own, mm = self._point(inner), ", ".join(map(number_text, by))
                if mark and isinstance(by[2], int):
                    mm = literal(mark, mm)
                if in_tool:
                    return f"{own} : POS({mm}, 0, 0, 0, '')"
                return f"POS_SHIFT({own}, VEC({mm}))"
            case Made(name, argument):
                return f"{name}({number_text(argument)})"


def turnless(mm: Sequence[object]) -> str:
    """Write a frame that moves without turning."""
    return f"POS({', '.join(map(str, mm))}, 0, 0, 0, '')"


def number_text(expr: Expr) -> str:
    """Write a number."""
    match expr:
        case Var(name):
            return name
        case Read():
            return "$GIN[1]"
        case Sum(a, b):
            return f"{number_text(a)} + {number_text(b)}"
        case Ask(name, argument):
            return f"{name}({number_text(argument)})"
    return str(expr)


def cond(test: Cond) -> str:
    """Write a condition."""
    match test:
        case Less(a, b, equal):
            return f"{number_text(a)} {'=' if equal else '<'} {number_text(b)}"
        case Signal(number):
            return f"$DIN[{number}]"
        case Not(inner):
            return f"NOT ({cond(inner)})"
        case Both(a, b):
            return f"({cond(a)}) AND ({cond(b)})"
