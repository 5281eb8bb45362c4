"""A program in no language: data, routines, statements and expressions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

# Whole numbers, and what is true.


@dataclass(frozen=True)
class Var:
    """A variable."""

    name: str


@dataclass(frozen=True)
class Read:
    """A number that comes from outside when the program runs."""


@dataclass(frozen=True)
class Sum:
    """The sum of two numbers."""

    a: Expr
    b: Expr


@dataclass(frozen=True)
class Ask:
    """What a function of the program returns for a number."""

    name: str
    argument: Expr


@dataclass(frozen=True)
class Less:
    """Whether a number is less than another, or equal to it."""

    a: Expr
    b: Expr
    equal: bool = False


@dataclass(frozen=True)
class Signal:
    """An input that is on or off when the program runs."""

    number: int


@dataclass(frozen=True)
class Not:
    """The opposite."""

    test: Cond


@dataclass(frozen=True)
class Both:
    """Whether both hold."""

    a: Cond
    b: Cond


Expr = int | Var | Read | Sum | Ask
Cond = Less | Signal | Not | Both

# Places.


@dataclass(frozen=True)
class Named:
    """A point with a name: of the data, a variable or an argument."""

    name: str


@dataclass(frozen=True)
class Element:
    """A point of an array; the first has index 1."""

    name: str
    index: Expr


@dataclass(frozen=True)
class Inline:
    """Numbers in the statement."""

    literal: int


@dataclass(frozen=True)
class Shifted:
    """A point that is shifted along the axes of the base, or of the tool [mm].

    Its mark tells its numbers apart where they may be written anew; 0: they may not.
    """

    point: Point
    by: tuple[Expr, Expr, Expr]
    in_tool: bool = False
    mark: int = 0


@dataclass(frozen=True)
class Made:
    """What a function of the program returns."""

    name: str
    argument: Expr


Point = Named | Element | Inline | Shifted | Made

# Statements.


@dataclass(frozen=True)
class Move:
    """One move.

    Attributes:
        mark: A number of its own.
        kind: joint, line, arc, axes (to joint angles) or step (line by `to`'s shift).
        zone: Size of the zone [mm]; 0: it stops, -1: the variable, or what holds.
        tool, base: Their numbers; 0: the variable, or what holds. In KRL the move is
            an inline form where they are named.
        trigger: It switches an output on its way.
        early: KRL blends it by joints (C_PTP).
    """

    mark: int
    kind: str
    to: Point
    via: Point | None = None
    zone: int = 0
    tool: int = 0
    base: int = 0
    speed: int = 200
    trigger: bool = False
    early: bool = False


@dataclass(frozen=True)
class SetTool:
    """Tool of a number from here on, in one of several ways to write it."""

    number: int
    way: int = 0


@dataclass(frozen=True)
class SetBase:
    """Base of a number from here on, with a shift of it [mm]."""

    number: int
    shift: tuple[int, int, int] = (0, 0, 0)
    way: int = 0


@dataclass(frozen=True)
class Displace:
    """All points displaced [mm] from here on, or no more."""

    by: tuple[int, int, int] | None


@dataclass(frozen=True)
class SetLoad:
    """Load of a number from here on, 0: none."""

    number: int


@dataclass(frozen=True)
class SetSpeed:
    """Speed along paths from here on [mm/s]."""

    speed: int


@dataclass(frozen=True)
class SetZone:
    """Zone from here on [mm], for moves that name none."""

    size: int


@dataclass(frozen=True)
class Assign:
    """A number gets a value."""

    name: str
    value: Expr


@dataclass(frozen=True)
class SetPoint:
    """A variable point gets a value."""

    name: str
    value: Point


@dataclass(frozen=True)
class SetElement:
    """A point of a variable array gets a value; the first has index 1."""

    name: str
    index: Expr
    value: Point


@dataclass(frozen=True)
class SetPart:
    """One number of the place of a variable point is set.

    Attributes:
        point: The point, or an element of a variable array.
        axis: 0 to 2: x, y or z.
        of: The point whose number it gets, with `by` [mm] added; or the literal whose
            number stands there, `mark` tells it apart.
    """

    point: Named | Element
    axis: int
    of: Named | Element | Inline
    by: Expr = 0
    mark: int = 0


@dataclass(frozen=True)
class Lift:
    """A variable point goes up [mm]."""

    name: str
    by: Expr


@dataclass(frozen=True)
class Wait:
    """Waits for a time or an input."""

    way: int


@dataclass(frozen=True)
class Output:
    """Switches an output; `ahead`: without waiting for the arm."""

    number: int
    ahead: bool = False


@dataclass(frozen=True)
class Note:
    """A statement without consequence, one of several."""

    way: int


@dataclass(frozen=True)
class MayFail:
    """An instruction that may raise an error: its own, or one of the program."""

    own: bool = False


@dataclass(frozen=True)
class Foreign:
    """Calls a routine that no file holds; `to`: the literal where it may move to."""

    to: int


@dataclass(frozen=True)
class If:
    """Branches with a condition each, and what else is done."""

    branches: tuple[tuple[Cond, Body], ...]
    otherwise: Body = ()


@dataclass(frozen=True)
class Switch:
    """One of several ways, by a number."""

    value: Expr
    cases: tuple[tuple[tuple[int, ...], Body], ...]
    otherwise: Body = ()


@dataclass(frozen=True)
class For:
    """Counts a variable of its own."""

    name: str
    first: int
    last: int
    step: int
    body: Body


@dataclass(frozen=True)
class Count:
    """Does it while a variable that it counts is below a limit.

    Attributes:
        way: while, repeat (test at the end) or label (goes back to one).
    """

    name: str
    limit: int
    body: Body
    way: str


@dataclass(frozen=True)
class Poll:
    """Does it again and again while an input is on."""

    signal: int
    body: Body


@dataclass(frozen=True)
class Loop:
    """An endless loop that is left in its middle, at most in the third round."""

    name: str
    before: Body
    leave: Cond
    after: Body


@dataclass(frozen=True)
class Skip:
    """Jumps over something."""

    number: int
    test: Cond
    body: Body


@dataclass(frozen=True)
class Call:
    """Calls a routine, maybe by its name in a text; arguments by kind."""

    name: str
    arguments: tuple[Expr | Point, ...] = ()
    late: bool = False


@dataclass(frozen=True)
class Return:
    """Leaves the routine where a condition holds."""

    test: Cond


Statement = (
    Move | SetTool | SetBase | Displace | SetLoad | SetSpeed | SetZone | Assign
    | SetPoint | SetElement | SetPart | Lift | Wait | Output | Note | MayFail | Foreign
    | If | Switch | For | Count | Poll | Loop | Skip | Call | Return
)  # fmt: skip
Body = tuple[Statement, ...]

# The whole.


@dataclass(frozen=True)
class Routine:
    """A procedure.

    Attributes:
        parameters: Name and kind: value, reference or point.
        own: Numbers of its own; one may hide a number of the program.
        handler: RETRY, TRYNEXT, RETURN, RAISE or "", and how it is written.
        repair: What the handler does before.
        file: 0: that of the program.
    """

    name: str
    parameters: tuple[tuple[str, str], ...] = ()
    body: Body = ()
    own: tuple[str, ...] = ()
    handler: tuple[str, int] = ("", 0)
    repair: Body = ()
    file: int = 0


@dataclass(frozen=True)
class Function:
    """A function of a number: sum, choice (by a test), or a point that it shifts."""

    name: str
    kind: str
    number: int
    point: str = ""


@dataclass(frozen=True)
class Place:
    """Where a literal is: joint angles [rad], and the frames in which it is written."""

    q: np.ndarray
    in_joints: bool
    tool: int
    base: int


@dataclass
class Program:
    """A drawn program.

    Attributes:
        places: Of the literals.
        points: Literal of each point with a name, and its file.
        arrays: Literals of arrays.
        variables: Points that the program sets.
        rows: Arrays of points that the program sets, and how many each has.
        numbers: Of the program, with their first values.
        tools, bases: Poses by number from 1, (4, 4) [m].
        loads: Mass [kg] and centre in the flange frame [mm], by number from 1.
        tool_loads: Mass of every tool [kg].
        routines: The first is the program itself.
        ends: Whether it ends, or begins again.
        plain: KRL without splines.
        interrupts: An interrupt switches an output.
        interrupt: What it does besides, at any time.
        shared: Other programs may read the points of the program.
        fixed: Its array never changes.
    """

    places: list[Place] = field(default_factory=list)
    points: dict[str, tuple[int, int]] = field(default_factory=dict)
    arrays: dict[str, list[int]] = field(default_factory=dict)
    variables: list[str] = field(default_factory=list)
    rows: dict[str, int] = field(default_factory=dict)
    numbers: dict[str, int] = field(default_factory=dict)
    tools: list[np.ndarray] = field(default_factory=list)
    bases: list[np.ndarray] = field(default_factory=list)
    loads: list[tuple[float, tuple[float, float, float]]] = field(default_factory=list)
    tool_loads: list[float] = field(default_factory=list)
    routines: list[Routine] = field(default_factory=list)
    functions: list[Function] = field(default_factory=list)
    ends: bool = True
    plain: bool = False
    interrupts: bool = False
    interrupt: Body = ()
    shared: bool = False
    fixed: bool = False

    def routine(self, name: str) -> Routine:
        """Return a routine by its name."""
        return next(one for one in self.routines if one.name == name)

    def function(self, name: str) -> Function:
        """Return a function by its name."""
        return next(one for one in self.functions if one.name == name)


def bodies_of(one: Statement) -> list[Body]:
    """Return the blocks in a statement."""
    match one:
        case Count(_, _, inner, _) | Skip(_, _, inner) | Poll(_, inner):
            return [inner]
        case For(_, _, _, _, inner):
            return [inner]
        case Loop(_, before, _, after):
            return [before, after]
        case If(branches, otherwise):
            return [*(inner for _, inner in branches), otherwise]
        case Switch(_, cases, otherwise):
            return [*(inner for _, inner in cases), otherwise]
    return []


def statements(body: Body) -> Iterator[Statement]:
    """Yield all statements of a block, those in blocks of it too."""
    for one in body:
        yield one
        for inner in bodies_of(one):
            yield from statements(inner)


def own_points(body: Body) -> list[str]:
    """Return the variable points that a routine sets and uses alone."""
    found: list[str] = []
    for one in body:
        if isinstance(one, SetPoint) and one.name.startswith("w"):
            found.append(one.name)
        for inner in bodies_of(one):
            found += own_points(inner)
    return [*dict.fromkeys(found)]


def counters(body: Body) -> list[str]:
    """Return the counters of loops, in all blocks."""
    found: list[str] = []
    for one in body:
        found += [one.name] if isinstance(one, Count | Loop) else []
        for inner in bodies_of(one):
            found += counters(inner)
    return found


def loops(body: Body) -> list[str]:
    """Return the variables of FOR loops, in all blocks."""
    found: list[str] = []
    for one in body:
        found += [one.name] if isinstance(one, For) else []
        for inner in bodies_of(one):
            found += loops(inner)
    return found
