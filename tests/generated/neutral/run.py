"""A drawn program, run statement by statement, with inputs drawn on the way."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tests.generated.neutral.traits import Traits
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
)

MM = 1e-3
MOST = 80  # moves
ROUNDS = 2  # of a program that begins again
STEPS = 3_000  # statements
FAILS = 0.25  # of instructions that may fail
MOVES = 0.5  # of calls of what no file holds
COMES = 0.04  # interrupts between two statements
HEAVY = 0.01  # [kg] a lighter tool states nothing
Load = tuple[float, tuple[float, float, float]]
NOTHING: Load = (float("nan"), (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Target:
    """Where a point is: a pose (4, 4) [m] or joint angles (6,) [rad].

    Attributes:
        literals: Whose numbers are in it.
        computed: It is not what a literal says.
        parted: A number of it has been set by itself, otherwise than by adding to it:
            nothing else of it may change.
    """

    value: np.ndarray
    literals: frozenset[int]
    computed: bool = False
    parted: bool = False


@dataclass(frozen=True)
class Step:
    """One arrival of a run.

    Attributes:
        move: The statement; `via` at the point on an arc.
        tool, base: Frames then, (4, 4) [m]; `base` with what displaces it.
        load: What the program says that the arm carries; NaN where it says nothing.
        fly: It is passed without a stop, in a zone of `zone` [mm].
        speed: Along paths [mm/s].
        plain: It is no spline.
        beside: A call by a name in a text led to it, or of what no file holds: nobody
            follows it.
    """

    move: Move
    via: bool
    target: Target
    tool: np.ndarray
    base: np.ndarray
    load: Load
    fly: bool
    zone: float
    speed: float
    plain: bool
    beside: bool

    @property
    def by_joints(self) -> bool:
        """Whether its corner is blended in the joints' space."""
        return self.move.early and self.plain

    @property
    def in_joints(self) -> bool:
        """Whether it is a joint target."""
        return self.target.value.shape == (6,)

    @property
    def world(self) -> np.ndarray:
        """Where the tool is to be, (4, 4) [m]."""
        return np.asarray(self.base @ self.target.value)


@dataclass
class Box:
    """The place of a value, which several names may share."""

    value: int | Target


@dataclass
class Modes:
    """What holds from one statement to the next."""

    tool: int = 1
    base: np.ndarray = field(default_factory=lambda: np.eye(4))
    shown: np.ndarray | None = None  # displacement
    grip: int = 0  # load of the hand, 0: none
    load: Load = NOTHING  # KRL: what $LOAD says
    speed: int = 200
    zone: int = 5


class FailError(Exception):
    """An instruction raised an error; True: one of the program's own."""


class LeaveError(Exception):
    """The routine ends here."""


class EndError(Exception):
    """The run ends here."""


class Run:
    """Runs a program once.

    Args:
        made: The program.
        literals: What the numbers in its text say.
        shifts: The numbers of its shifts that stand in the text [mm], by mark.
        seed: Of the inputs.
        language: Whose rules hold.
    """

    def __init__(
        self,
        made: Program,
        literals: Mapping[int, np.ndarray],
        shifts: Mapping[int, Sequence[float]],
        seed: int,
        language: Traits,
    ) -> None:
        self.made, self.literals, self.language = made, literals, language
        self.shifts = shifts
        self.rng = random.Random(f"inputs:{seed}")
        self.steps: list[Step] = []
        self.left = STEPS
        self.handlers: list[Routine] = []
        self.inside = False  # an interrupt
        self.beside = 0  # calls by name
        self.modes = Modes()
        self.all = {name: Box(value) for name, value in made.numbers.items()}
        self.scopes: list[dict[str, Box]] = []

    def run(self) -> list[Step]:
        """Run it, to its end or as far as is wanted."""
        try:
            for _ in range(ROUNDS):
                left = self._routine(self.made.routines[0], {})
                if self.made.ends and not left:
                    break
        except (FailError, EndError):
            pass
        return self.steps

    def _routine(self, routine: Routine, given: dict[str, Box]) -> bool:
        """Run a routine; tell whether it was left before its end."""
        self.scopes.append(given | {name: Box(0) for name in routine.own})
        self.handlers.append(routine)
        try:
            self._body(routine.body)
        except LeaveError:
            return True
        finally:
            self.scopes.pop()
            self.handlers.pop()
        return False

    def _body(self, body: Body) -> None:
        for one in body:
            self._guarded(one)

    def _guarded(self, one: Statement) -> None:
        """Do a statement, with what a handler of its routine makes of an error."""
        if not isinstance(one, MayFail | Call):
            self._do(one)
            return
        for _ in range(4):
            try:
                self._do(one)
            except FailError as fail:
                word, way = self.handlers[-1].handler
                if fail.args[0] and way == 2 and word:
                    raise EndError from None  # its handler ends without an answer
                word = "" if fail.args[0] and way == 1 else word
                if word:
                    self._body(self.handlers[-1].repair)
                match word:
                    case "RETRY":
                        continue
                    case "TRYNEXT":
                        return
                    case "RETURN":
                        raise LeaveError from None
                raise
            return
        raise EndError  # too many times

    def _do(self, one: Statement) -> None:
        self.left -= 1
        if self.left < 0 or len(self.steps) >= MOST:
            raise EndError
        self._interrupt()
        match one:
            case Note():
                pass
            case Move():
                self._move(one)
            case (
                SetTool() | SetBase() | Displace() | SetLoad() | SetSpeed() | SetZone()
            ):
                self._set(one)
            case Assign(name, value):
                self._box(name).value = self._number(value)
            case SetPoint(name, value):
                self.all[name] = Box(self._place(value))
            case SetElement(name, index, value):
                self.all[f"{name}[{self._number(index)}]"] = Box(self._place(value))
            case SetPart():
                self._set_part(one)
            case Lift(name, by):
                old = self._target(name)
                value = shifted(old.value, (0, 0, self._number(by)), False)
                self.all[name] = Box(replace(old, value=value, computed=True))
            case Wait():
                self._stop("wait")
            case Output(_, ahead):
                if not ahead:
                    self._stop("output")
            case MayFail(own):
                if self.rng.random() < FAILS:
                    raise FailError(own)
            case Foreign():
                self._foreign(one)
            case Call(name, arguments, late):
                self.beside += late
                try:
                    self._call(name, arguments)
                finally:
                    self.beside -= late
            case Return(test):
                if self._holds(test):
                    raise LeaveError
            case _:
                self._block(one)

    def _foreign(self, one: Foreign) -> None:
        """Run a routine that no file holds: it may move the arm."""
        if self.rng.random() < MOVES:
            self.beside += 1
            self._move(Move(0, "axes", Inline(one.to)))
            self.beside -= 1

    def _set_part(self, one: SetPart) -> None:
        """Set one number of the place of a point."""
        old = self._place(one.point)
        if one.mark in self.shifts:
            number = self.shifts[one.mark][0] * MM
        else:
            by = self._number(one.by) * MM
            number = float(self._place(one.of).value[one.axis, 3]) + by
        value = old.value.copy()
        value[one.axis, 3] = number
        parted = old.parted or one.of != one.point
        new = replace(old, value=value, computed=True, parted=parted)
        match one.point:
            case Named(name):
                self.all[name] = Box(new)
            case Element(name, index):
                self.all[f"{name}[{self._number(index)}]"] = Box(new)

    def _interrupt(self) -> None:
        """Let an interrupt come, now and then: it knows the program's data alone."""
        if not self.made.interrupt or self.inside or self.rng.random() > COMES:
            return
        self.inside = True
        self.scopes.append({})
        for one in self.made.interrupt:
            self._do(one)
        self.scopes.pop()
        self.inside = False

    def _block(self, one: Statement) -> None:
        match one:
            case If(branches, otherwise):
                body = next((b for test, b in branches if self._holds(test)), otherwise)
                self._body(body)
            case Switch(value, cases, otherwise):
                number = self._number(value)
                self._body(next((b for v, b in cases if number in v), otherwise))
            case For(name, first, last, step, body):
                for k in range(first, last + (1 if step > 0 else -1), step):
                    self.scopes[-1][name] = Box(k)
                    self._body(body)
            case Count(name, limit, body, _):
                self.scopes[-1][name] = Box(0)
                for k in range(limit):
                    self.scopes[-1][name] = Box(k)
                    self._body(body)
            case Poll(_, body):
                while self._holds(Signal(1)):
                    self._body(body)
            case Loop(_, before, leave, after):
                for k in range(3):
                    self._body(before)
                    if self._holds(leave) or k == 2:
                        break
                    self._body(after)
            case Skip(_, test, body):
                if not self._holds(test):
                    self._body(body)

    def _call(self, name: str, arguments: Sequence[Expr | Point]) -> None:
        routine = self.made.routine(name)
        given: dict[str, Box] = {}
        for (own, kind), value in zip(routine.parameters, arguments, strict=True):
            if kind == "reference":
                assert isinstance(value, Var)
                given[own] = self._box(value.name)
            elif kind == "point":
                assert isinstance(value, Named | Element)
                given[own] = Box(self._place(value))
            else:
                assert isinstance(value, int | Var | Read | Sum | Ask)
                given[own] = Box(self._number(value))
        self._routine(routine, given)

    # Values.

    def _box(self, name: str) -> Box:
        return self.scopes[-1].get(name) or self.all[name]

    def _number(self, expr: Expr) -> int:
        match expr:
            case Var(name):
                value = self._box(name).value
                assert isinstance(value, int)
                return value
            case Read():
                self._stop("input")
                return self.rng.randint(0, 3)
            case Sum(a, b):
                return self._number(a) + self._number(b)
            case Ask(name, argument):
                own, number = self.made.function(name), self._number(argument)
                if own.kind == "sum":
                    return number + own.number
                return number if number < own.number else own.number
        return expr

    def _holds(self, test: Cond) -> bool:
        match test:
            case Less(a, b, equal):
                one, two = self._number(a), self._number(b)
                return one == two if equal else one < two
            case Signal():
                self._stop("input")
                return self.rng.random() < 0.5
            case Not(inner):
                return not self._holds(inner)
            case Both(a, b):
                one, two = self._holds(a), self._holds(b)
                return one and two

    def _stop(self, kind: str) -> None:
        """Stop at the last point, where the program waits for the arm."""
        part = self.language.stops_for(kind)
        stops = part == 1.0 or (part > 0.0 and self.rng.random() < part)
        if stops and self.steps:
            self.steps[-1] = replace(self.steps[-1], fly=False)

    # Places.

    def _target(self, name: str) -> Target:
        box = self.scopes[-1].get(name) or self.all.get(name)
        if box is None:
            return self._literal(self.made.points[name][0])
        assert isinstance(box.value, Target)
        return box.value

    def _literal(self, number: int) -> Target:
        value = self.literals.get(number)
        if value is None:  # it stands in no text
            value = self.made.places[number].q
        return Target(value, frozenset([number]))

    def _place(self, point: Point) -> Target:
        match point:
            case Named(name):
                return self._target(name)
            case Element(name, index) if name in self.made.rows:
                return self._target(f"{name}[{self._number(index)}]")
            case Element(name, index):
                return self._literal(self.made.arrays[name][self._number(index) - 1])
            case Inline(number):
                return self._literal(number)
            case Shifted(inner, by, in_tool, mark):
                old = self._place(inner)
                mm = self.shifts.get(mark) or [self._number(one) for one in by]
                value = shifted(old.value, mm, in_tool)
                return replace(old, value=value, computed=True)
            case Made(name, argument):
                own, z = self.made.function(name), self._number(argument)
                old = self._target(own.point)
                value = shifted(old.value, (0, 0, z + own.number), False)
                return replace(old, value=value, computed=True)

    def _step(self, by: Sequence[Expr]) -> Target:
        """Return where a step from the last target ends, in the base that holds."""
        last, modes = self.steps[-1], self.modes
        if last.in_joints:
            raise EndError  # it would need the arm's kinematics
        mm = [self._number(one) for one in by]
        # The flange is where it was; the tool may be another one by now.
        tool = self.made.tools[modes.tool - 1]
        world = last.world @ np.linalg.inv(last.tool) @ tool
        here = np.linalg.inv(modes.base) @ world
        return Target(shifted(here, mm, False), last.target.literals, True)

    # What moves are made with.

    def _set(self, one: Statement) -> None:
        modes, made = self.modes, self.made
        match one:
            case SetTool(number, way):
                modes.tool = number
                if way == 1:
                    modes.load = self._of_tool(number)
            case SetBase(number, shift, _):
                modes.base = moved(made.bases[number - 1], shift)
            case Displace(by):
                modes.shown = None if by is None else moved(np.eye(4), by)
            case SetLoad(number):
                modes.grip = number
                modes.load = made.loads[number - 1] if number else NOTHING
            case SetSpeed(speed):
                modes.speed = speed
            case SetZone(size):
                modes.zone = size

    def _move(self, one: Move) -> None:
        modes, made = self.modes, self.made
        if one.tool and made.plain:
            self._form(one)
        tool = one.tool or modes.tool
        base = made.bases[one.base - 1] if one.base else modes.base
        if modes.shown is not None:
            base = base @ modes.shown
        speed = one.speed or modes.speed
        load = self._load(tool, bool(one.tool))
        places = [] if one.via is None else [(True, self._place(one.via))]
        if one.kind == "step":
            assert isinstance(one.to, Shifted)
            places.append((False, self._step(one.to.by)))
        else:
            places.append((False, self._place(one.to)))
        for via, target in places:
            fly = bool(one.zone) and not via
            zone = modes.zone if one.zone < 0 else one.zone
            if self.language.zone_stays and one.zone and not one.tool:
                modes.zone = zone
            pose = made.tools[tool - 1]
            beside, plain = self.beside > 0, made.plain
            step = Step(
                one, via, target, pose, base, load, fly, zone, speed, plain, beside
            )
            self.steps.append(step)

    def _form(self, one: Move) -> None:
        """Take what an inline form of a plain move sets for all that follow."""
        modes = self.modes
        modes.tool, modes.base = one.tool, self.made.bases[one.base - 1]
        modes.load = self._of_tool(one.tool)
        if one.kind == "line":
            modes.speed, modes.zone = one.speed, one.zone

    def _of_tool(self, tool: int) -> Load:
        """Return the load that LOAD_DATA has for a tool."""
        mass = self.made.tool_loads[tool - 1]
        return (mass, (0.0, 0.0, 100.0)) if mass > HEAVY else NOTHING

    def _load(self, tool: int, named: bool) -> Load:
        """Return what the arm carries: maybe its tool and what it grips."""
        if not self.language.grips:
            return self._of_tool(tool) if named else self.modes.load
        mass, grip = self.made.tool_loads[tool - 1], self.modes.grip
        parts = [(mass, np.array([0.0, 0.0, 100.0]))] if mass > HEAVY else []
        if grip:
            own, centre = self.made.loads[grip - 1]
            pose = self.made.tools[tool - 1]
            at = pose[:3, :3] @ np.array(centre) + pose[:3, 3] / MM
            parts.append((own, at))
        whole = sum(m for m, _ in parts)
        if not parts:
            return NOTHING
        middle = sum(m * c for m, c in parts) / whole
        x, y, z = np.asarray(middle).tolist()
        return whole, (x, y, z)


def moved(pose: np.ndarray, mm: Sequence[float]) -> np.ndarray:
    """Return a frame that is moved along its own axes."""
    shift = np.eye(4)
    shift[:3, 3] = np.array(mm) * MM
    return np.asarray(pose @ shift)


def shifted(pose: np.ndarray, mm: Sequence[float], in_tool: bool) -> np.ndarray:
    """Return a place that is moved along the axes of its frame, or along its own."""
    if in_tool:
        return moved(pose, mm)
    new = pose.copy()
    new[:3, 3] += np.array(mm) * MM
    return new
