"""Programs in KRL."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from postproc.robot.cell import Cell
from tests.generated.neutral.run import HEAVY, moved
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
    loops,
    own_points,
)
from tests.language.neutral_job import NeutralJob, status

END = "E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0"
NOTES = (
    "; at work", "$ACC.CP=2", "$VEL_AXIS[1]=50", "$TIMER[1]=0", "$ADVANCE=3",
)  # fmt: skip
NEW_LINE = (
    " WITH $VEL=SVEL_CP({speed}, , LC{zone}), $TOOL=STOOL2({frames}), "
    "$BASE=SBASE({frames}.BASE_NO), $IPO_MODE=SIPO_MODE({frames}.IPO_FRAME), "
    "$LOAD=SLOAD({frames}.TOOL_NO), $ACC=SACC_CP(LC{zone}), "
    "$ORI_TYPE=SORI_TYP(LC{zone}), $APO=SAPO(LC{zone}), $JERK=SJERK(LC{zone})"
)
NEW_JOINT = (
    " WITH $VEL_AXIS[1]=SVEL_JOINT(50.0), $TOOL=STOOL2({frames}), "
    "$BASE=SBASE({frames}.BASE_NO), $IPO_MODE=SIPO_MODE({frames}.IPO_FRAME), "
    "$LOAD=SLOAD({frames}.TOOL_NO), $ACC_AXIS[1]=SACC_JOINT(PP{zone}), "
    "$APO=SAPO_PTP(PP{zone}), $GEAR_JERK[1]=SGEAR_JERK(PP{zone})"
)
DEFAULT_LOAD = "{M -1.0,CM {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0},J {X 0.0,Y 0.0,Z 0.0}}"


def krl(made: Program, cell: Cell) -> Printed:
    """Write a program as sources, data lists and the list of the system."""
    return Writer(made, cell).written()


def poses(numbers: dict[int, list[float]], made: Program) -> dict[int, np.ndarray]:
    """Return what the numbers of literals say: poses [m], or joint angles [rad]."""
    found = {}
    for k, values in numbers.items():
        if made.places[k].in_joints:
            found[k] = np.deg2rad(values[:6])
            continue
        found[k] = np.eye(4)
        found[k][:3, :3] = Rotation.from_euler("ZYX", values[3:6], True).as_matrix()
        found[k][:3, 3] = np.array(values[:3]) / 1000.0
    return found


def frame(pose: np.ndarray) -> str:
    """Write a frame."""
    return f"{{{components(pose, 10)}}}"


def components(pose: np.ndarray, digits: int = 4) -> str:
    """Write X to C."""
    x, y, z = (pose[:3, 3] * 1000.0).tolist()
    a, b, c = Rotation.from_matrix(pose[:3, :3]).as_euler("ZYX", True).tolist()
    angles = ",".join(
        f"{n} {v:.{digits}f}" for n, v in zip("ABC", (a, b, c), strict=True)
    )
    return f"X {x:.3f},Y {y:.3f},Z {z:.3f},{angles}"


def offset(mm: Sequence[object]) -> str:
    """Write a frame that moves without turning."""
    x, y, z = mm
    return f"{{X {x},Y {y},Z {z},A 0,B 0,C 0}}"


class Writer:
    """Writes the statements of a program."""

    def __init__(self, made: Program, cell: Cell) -> None:
        self.made, self.cell = made, cell
        self.depth = 0
        self.page = Page("job.src", "\r\n")
        self.file = 0

    def written(self) -> Printed:
        """Write all files; those of the second source only where it is used."""
        made = self.made
        pages = [self.page]
        self._source("job", 0)
        pages.append(self._data("job", 0))
        if any(routine.file for routine in made.routines):
            self.page = Page("part.src", "\r\n")
            pages.append(self.page)
            self._source("part", 1)
            pages.append(self._data("part", 1))
        return printed([*pages, self._config()])

    # Data.

    def _config(self) -> Page:
        made = self.made
        page = Page("$config.dat", "\r\n")
        page.emit("DEFDAT  $CONFIG")
        for name, poses in (("TOOL_DATA", made.tools), ("BASE_DATA", made.bases)):
            page.emit(f"DECL FRAME {name}[16]")
            for k, pose in enumerate(poses):
                page.emit(f"{name}[{k + 1}]={frame(pose)}")
        page.emit("DECL LOAD LOAD_DATA[16]")
        for k, mass in enumerate(made.tool_loads):
            heavy = self._load(mass, (0.0, 0.0, 100.0))
            text = heavy if mass > HEAVY else DEFAULT_LOAD
            page.emit(f"LOAD_DATA[{k + 1}]={text}")
        page.emit(f"LOAD_DATA[9]={DEFAULT_LOAD}")
        page.emit("ENDDAT")
        return page

    def _load(self, mass: float, centre: Sequence[float]) -> str:
        x, y, z = centre
        at = f"{{X {x:g},Y {y:g},Z {z:g},A 0.0,B 0.0,C 0.0}}"
        return f"{{M {mass:.1f},CM {at},J {{X 0.0,Y 0.0,Z 0.0}}}}"

    def _data(self, name: str, file: int) -> Page:
        made = self.made
        page = Page(f"{name}.dat", "\r\n")
        page.emit("&ACCESS RVP")
        page.emit(f"DEFDAT {name} PUBLIC")
        scope = "DECL GLOBAL" if made.shared and not file else "DECL"
        for point, (number, own) in made.points.items():
            if own == file:
                kind = "E6AXIS" if made.places[number].in_joints else "E6POS"
                page.emit(f"{scope} {kind} {point}={self._literal(number)}")
        if not file:
            for point in made.variables:
                if not point.startswith("w"):  # others are declared in their routine
                    page.emit(f"{scope} E6POS {point}")
            for row, count in made.rows.items():
                page.emit(f"{scope} E6POS {row}[{count}]")
            self._forms(page, scope)
            for number_name, value in made.numbers.items():
                page.emit(f"{scope} INT {number_name}={value}")
            for row, numbers in made.arrays.items():
                page.emit(f"{scope} E6POS {row}[{len(numbers)}]")
                for k, number in enumerate(numbers):
                    page.emit(f"{row}[{k + 1}]={self._literal(number)}")
        page.emit("ENDDAT")
        return page

    def _forms(self, page: Page, scope: str) -> None:
        """Write the data of inline forms."""
        for tool in range(1, len(self.made.tools) + 1):
            for base in range(1, len(self.made.bases) + 1):
                numbers = f"TOOL_NO {tool},BASE_NO {base}"
                text = f'{{{numbers},IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}}'
                page.emit(f"{scope} FDAT F{tool}{base}={text}")
        for zone in (0, 5, 10):
            size = f"ACC 100.0,APO_DIST {zone or 100}.0"
            path = f"{{VEL 2.0,{size},APO_FAC 50.0,ORI_TYP #VAR,CIRC_TYP #BASE}}"
            page.emit(f"{scope} LDAT LC{zone}={path}")
            joint = f"{{VEL 100.0,{size},APO_MODE #CDIS,GEAR_JERK 50.0}}"
            page.emit(f"{scope} PDAT PP{zone}={joint}")

    def _literal(self, number: int) -> str:
        where: Place = self.made.places[number]
        if where.in_joints:
            angles = zip("123456", np.rad2deg(where.q), strict=True)
            text = ",".join(f"A{k} {v:.5f}" for k, v in angles)
            return literal(number, f"{{{text}}}")
        tool, base = self.made.tools[where.tool - 1], self.made.bases[where.base - 1]
        job = NeutralJob(self.cell, tool, base)
        pose = components(job.pose(where.q))
        return literal(number, f"{{{pose},{status(job, where.q)},{END}}}")

    # Routines.

    def _source(self, name: str, file: int) -> None:
        emit = self.page.emit
        emit("&ACCESS RVP")
        emit("&REL 1")
        if file:
            emit(f"DEF {name} ( )")
            emit("END")
        for routine in self.made.routines:
            if routine.file == file:
                self._routine(routine)
        if not file:
            self._functions()

    def _routine(self, routine: Routine) -> None:
        main = routine is self.made.routines[0]
        given = ",".join(
            f"{name}:{'OUT' if kind == 'reference' else 'IN'}"
            for name, kind in routine.parameters
        )
        self._emit(f"{'' if main else 'GLOBAL '}DEF {routine.name} ({given})")
        for name, kind in routine.parameters:
            self._emit(f"DECL {'E6POS' if kind == 'point' else 'INT'} {name}")
        own = [*routine.own, *counters(routine.body), *loops(routine.body)]
        for name in dict.fromkeys(own):
            self._emit(f"DECL INT {name}")
        for name in own_points(routine.body):
            self._emit(f"DECL E6POS {name}")
        self._emit("DECL FRAME SH")
        self._emit("SIGNAL GI_PART $IN[10] TO $IN[11]")
        if main and self.made.interrupts:
            self._emit("GLOBAL INTERRUPT DECL 5 WHEN $IN[9]==TRUE DO BEEP ( )")
            self._emit("INTERRUPT ON 5")
        if main:
            ori = "{ORI #INTERPOLATE}"
            self._emit("BAS(#INITMOV,0)")
            self._emit("$APO.CDIS=5")
            self._emit("$APO.CPTP=40")
            self._emit(f"$CIRC_MODE={{AUX_PT {ori},TARGET_PT {ori}}}")
        self.depth += 1
        self._body(routine.body)
        self.depth -= 1
        self._emit("END")

    def _functions(self) -> None:
        for own in self.made.functions:
            kind = "E6POS" if own.kind == "point" else "INT"
            self._emit(f"GLOBAL DEFFCT {kind} {own.name} (A:IN)")
            self._emit("DECL INT A")
            match own.kind:
                case "sum":
                    lines = [f"RETURN (A+{own.number})"]
                case "choice":
                    test = [f"IF A<{own.number} THEN", "RETURN (A)", "ENDIF"]
                    lines = [*test, f"RETURN ({own.number})"]
                case _:
                    self._emit("DECL E6POS R")
                    lines = [f"R={own.point}", f"R.Z=R.Z+A+{own.number}", "RETURN (R)"]
            for line in lines:
                self._emit(f"  {line}")
            self._emit("ENDFCT")
        if self.made.interrupts:
            for line in ("GLOBAL DEF BEEP ( )", "CONTINUE", "$OUT[3]=TRUE"):
                self._emit(line)
            self._inner(self.made.interrupt)
            self._emit("END")

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
                self._move(one)
            case SetTool(number, way):
                text = (f"$TOOL=TOOL_DATA[{number}]", f"BAS(#TOOL,{number})")
                pose = frame(self.made.tools[number - 1])
                emit((*text, f"$TOOL={pose}")[way])
            case SetBase():
                emit(self._base(one))
            case SetLoad(0):
                emit("$LOAD=LOAD_DATA[9]")
            case SetLoad(number):
                emit(f"$LOAD={self._load(*self.made.loads[number - 1])}")
            case SetSpeed(speed):
                emit(f"$VEL.CP={speed / 1000:g}")
            case SetZone(size):
                emit(f"$APO.CDIS={size}")
            case Assign(name, value):
                emit(f"{name}={number_text(value)}")
            case SetPoint(name, value):
                emit(f"{name}={self._point(value)}")
            case SetElement(name, index, value):
                emit(f"{name}[{number_text(index)}]={self._point(value)}")
            case SetPart(point, axis, Inline(number), _, mark):
                at = literal(mark, bare_numbers(self._literal(number))[axis])
                emit(f"{self._point(point)}.{'XYZ'[axis]}={at}")
            case SetPart(point, axis, of, by):
                part = f".{'XYZ'[axis]}"
                value = f"{self._point(of)}{part}+({number_text(by)})"
                emit(f"{self._point(point)}{part}={value}")
            case Lift(name, by):
                emit(f"{name}.Z={name}.Z+({number_text(by)})")
            case Wait(way):
                emit(("WAIT SEC 0.2", "WAIT FOR $IN[8]")[way])
            case Output(number, ahead):
                if ahead:
                    emit("CONTINUE")
                emit(f"$OUT[{number}]=TRUE")
            case Foreign():
                emit("ELSEWHERE ( )")
            case Note(way):
                emit(NOTES[way])
            case Call(name, arguments):
                emit(f"{name}({','.join(self._argument(a) for a in arguments)})")
            case Return(test):
                emit(f"IF {cond(test)} THEN")
                emit("  RETURN")
                emit("ENDIF")
            case _:
                self._block(one)

    def _base(self, one: SetBase) -> str:
        entry = f"BASE_DATA[{one.number}]"
        if any(one.shift):
            return f"$BASE={entry}:{offset(one.shift)}"
        pose = frame(moved(self.made.bases[one.number - 1], (0, 0, 0)))
        return (f"$BASE={entry}", f"BAS(#BASE,{one.number})", f"$BASE={pose}")[one.way]

    def _block(self, one: Statement) -> None:
        emit, inner = self._emit, self._inner
        match one:
            case If(branches, otherwise):
                self._if(list(branches), otherwise)
            case Switch(value, cases, otherwise):
                emit(f"SWITCH {number_text(value)}")
                for values, body in cases:
                    emit(f"CASE {','.join(map(str, values))}")
                    inner(body)
                emit("DEFAULT")
                inner(otherwise)
                emit("ENDSWITCH")
            case For(name, first, last, step, body):
                by = f" STEP {step}" if step != 1 else ""
                emit(f"FOR {name}={first} TO {last}{by}")
                inner(body)
                emit("ENDFOR")
            case Count():
                self._count(one)
            case Poll(signal, body):
                emit(f"WHILE $IN[{signal}]")
                inner(body)
                emit("ENDWHILE")
            case Loop(name, before, leave, after):
                emit(f"{name}=0")
                emit("LOOP")
                inner(before)
                emit(f"IF {cond(leave)} THEN")
                emit("  EXIT")
                emit("ENDIF")
                emit(f"IF {name}>=2 THEN")
                emit("  EXIT")
                emit("ENDIF")
                inner(after)
                emit(f"{name}={name}+1")
                emit("ENDLOOP")
            case Skip(number, test, body):
                emit(f"IF {cond(test)} THEN")
                emit(f"  GOTO OVER_{number}")
                emit("ENDIF")
                self._body(body)
                emit(f"OVER_{number}:")

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

    def _count(self, one: Count) -> None:
        emit, name, limit = self._emit, one.name, one.limit
        emit(f"{name}=0")
        start = {
            "while": f"WHILE {name}<{limit}", "repeat": "REPEAT",
            "label": f"AGAIN_{name}:",
        }  # fmt: skip
        emit(start[one.way])
        self._inner(one.body)
        emit(f"{name}={name}+1")
        match one.way:
            case "while":
                emit("ENDWHILE")
            case "repeat":
                emit(f"UNTIL {name}>={limit}")
            case "label":
                emit(f"IF {name}<{limit} THEN")
                emit(f"  GOTO AGAIN_{name}")
                emit("ENDIF")

    def _move(self, one: Move) -> None:
        plain = self.made.plain
        words = {"joint": "PTP", "line": "LIN", "arc": "CIRC", "axes": "PTP",
                 "step": "LIN_REL"}  # fmt: skip
        word = words[one.kind] if plain else f"S{words[one.kind]}"
        if one.kind == "step":
            assert isinstance(one.to, Shifted)
            x, y, z = one.to.by
            self._emit(f"{word} {{X {x},Y {y},Z {z}}}", one.mark)
            return
        places = [self._point(p) for p in (one.via, one.to) if p is not None]
        if one.tool:
            self._form(one, word, *places)
            return
        if one.trigger and plain:
            self._emit("TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[2]=TRUE")
        blend = "C_DIS" if plain else "C_SPL"
        text = f"{word} {','.join(places)}"
        if one.zone > 0:
            self._emit(f"$APO.CDIS={one.zone}")
        if one.zone:
            text += " C_PTP" if plain and one.early else f" {blend}"
        self._emit(text, one.mark)

    def _form(self, one: Move, word: str, to: str) -> None:
        """Write a move as an inline form does."""
        line, frames = one.kind == "line", f"F{one.tool}{one.base}"
        speed = f"{one.speed / 1000:g}"
        if self.made.plain:
            self._emit(f"FDAT_ACT={frames}")
            kind, data = ("CP", f"LDAT_ACT=LC{one.zone}") if line else (
                "PTP", f"PDAT_ACT=PP{one.zone}")  # fmt: skip
            self._emit(data)
            self._emit(f"BAS(#{kind}_PARAMS,{speed if line else 50})")
            end = " C_DIS" if one.zone else ""
        else:
            form = NEW_LINE if line else NEW_JOINT
            end = form.format(speed=speed, frames=frames, zone=one.zone)
            end += " C_SPL" if one.zone else ""
        self._emit(f"{word} {to}{end}", one.mark)

    def _point(self, point: Point) -> str:
        match point:
            case Named(name):
                return name
            case Element(name, index):
                return f"{name}[{number_text(index)}]"
            case Inline(number):
                return self._literal(number)
            case Shifted(inner, by, in_tool, mark):
                shift = self._shift(by)
                if mark and isinstance(by[2], int):
                    shift = literal(mark, shift)
                own = self._point(inner)
                return f"{own}:{shift}" if in_tool else f"{shift}:{own}"
            case Made(name, argument):
                return f"{name}({number_text(argument)})"

    def _shift(self, by: Sequence[Expr]) -> str:
        """Write an offset; one that is computed is put into a variable before."""
        x, y, z = by
        if isinstance(z, int):
            return offset(by)
        self._emit(f"SH={offset((x, y, 0))}")
        self._emit(f"SH.Z={number_text(z)}")
        return "SH"

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
            return "GI_PART"
        case Sum(a, b):
            return f"{number_text(a)}+{number_text(b)}"
        case Ask(name, argument):
            return f"{name}({number_text(argument)})"
    return str(expr)


def cond(test: Cond) -> str:
    """Write a condition."""
    match test:
        case Less(a, b, equal):
            return f"{number_text(a)}{'==' if equal else '<'}{number_text(b)}"
        case Signal(number):
            return f"$IN[{number}]==TRUE"
        case Not(inner):
            return f"NOT ({cond(inner)})"
        case Both(a, b):
            return f"({cond(a)}) AND ({cond(b)})"
