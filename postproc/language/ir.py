"""What statements say in every language: values, control flow, calls, assignments.

Names are lower case (no language here tells cases apart). Languages add statements and
values of their own, as nodes too: what only asks for parts need not know them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Node:
    """A value, a statement, or a part of one."""

    def children(self) -> Iterator[Node]:
        """Yield the nodes in it, in the order of its fields."""
        name: str
        for name in self.__match_args__:
            part = getattr(self, name)
            if isinstance(part, Node):
                yield part
            elif isinstance(part, tuple):
                yield from (one for one in part if isinstance(one, Node))


def walk(*nodes: Node | None) -> list[Node]:
    """List nodes with all that is in them, inner ones first."""
    found: list[Node] = []
    for one in nodes:
        if one is not None:
            _add(one, found)
    return found


def _add(node: Node, found: list[Node]) -> None:
    for part in node.children():
        if type(part) is Num:  # there are more of them than of all others
            found.append(part)
        else:
            _add(part, found)
    found.append(node)


def calls_in(*nodes: Node | None) -> list[FunctionCall]:
    """List the calls of functions in nodes, inner ones first."""
    return [part for part in walk(*nodes) if isinstance(part, FunctionCall)]


def names_called(*nodes: Node | None) -> frozenset[str]:
    """Return the names of the functions and instructions in nodes."""
    calls = (
        part for part in walk(*nodes) if isinstance(part, Instruction | FunctionCall)
    )
    return frozenset(one.name for one in calls)


def data_in(*nodes: Node | None) -> list[DataObject]:
    """List the data that nodes name."""
    return [part for part in walk(*nodes) if isinstance(part, DataObject)]


# Expressions, with number slots.
#
# A `Num` knows only which number of its statement it is, so that one expression serves
# all of its form.


@dataclass(frozen=True, slots=True)
class Operand(Node):
    """A value; a language adds its own kinds."""


@dataclass(frozen=True, slots=True)
class Num(Operand):
    """The number in a slot of the statement."""

    slot: int


@dataclass(frozen=True, slots=True)
class StringLiteral(Operand):
    """A string as it is written; quotes stay where they tell it from words."""

    text: str


@dataclass(frozen=True, slots=True)
class Interval(Operand):
    """``low..high``: a range of indices, or of the values of a case."""

    low: Operand
    high: Operand


@dataclass(frozen=True, slots=True)
class ElementStep(Node):
    """``{i, j}`` behind the name of an array."""

    subscripts: tuple[Operand, ...]


@dataclass(frozen=True, slots=True)
class DataObject(Operand):
    """Data by name, then components and elements of it."""

    name: str
    steps: tuple[str | ElementStep, ...] = ()


@dataclass(frozen=True, slots=True)
class Argument(Node):
    r"""An argument of an instruction or function.

    Attributes:
        value: What is given; None for a switch, or where it is left out.
        name: Of an optional argument (``\WObj``), "" where it goes by its place.
        passed_on: It is there where a parameter of the routine is (``\a?b``).
    """

    value: Operand | None
    name: str = ""
    passed_on: bool = False


@dataclass(frozen=True, slots=True)
class FunctionCall(Operand):
    """A call that returns a value."""

    name: str
    arguments: tuple[Argument, ...]

    @property
    def values(self) -> tuple[Operand | None, ...]:
        """What is given, in the order in which it is written."""
        return tuple([one.value for one in self.arguments])


@dataclass(frozen=True, slots=True)
class Operation(Operand):
    """An operator and one operand or two.

    The operator ``()`` is data in parentheses: their value, not the data themselves.
    """

    operator: str
    operands: tuple[Operand, ...]


@dataclass(frozen=True, slots=True)
class Composite(Operand):
    """``[a, b, ..]``: a record or an array."""

    items: tuple[Operand, ...]


# Statements.


@dataclass(frozen=True, slots=True)
class SourceStatement(Node):
    """A statement; by itself: one that says nothing."""


@dataclass(frozen=True, slots=True)
class NotUnderstood(SourceStatement):
    """Text that the grammar has no rule for, where a language keeps it."""

    text: str = ""


@dataclass(frozen=True, slots=True)
class BlockWord(SourceStatement):
    """A word that is a statement: else, endif, .., and what follows it on its line."""

    word: str
    then: SourceStatement | None = None


@dataclass(frozen=True, slots=True)
class Branch(SourceStatement):
    """A statement that ways part at, or that a loop begins with.

    Attributes:
        word: if, elseif, while, test, case, default, loop, repeat or until.
        values: The condition, what is tested, or the values of a case.
        then: What follows a case on its line.
    """

    word: str
    values: tuple[Operand, ...] = ()
    then: SourceStatement | None = None


@dataclass(frozen=True, slots=True)
class CompactIf(SourceStatement):
    """``IF condition statement``: a statement that runs where a condition holds."""

    condition: Operand
    statement: SourceStatement


def inside(one: SourceStatement) -> SourceStatement:
    """Return the statement behind a condition, the statement itself without one."""
    while isinstance(one, CompactIf):
        one = one.statement
    return one


DIVISIONS = ("elseif", "case", "default")


def divides(one: Node | None) -> bool:
    """Tell whether a statement divides a block: else, elseif, case, default."""
    if isinstance(one, BlockWord):
        return one.word == "else"
    return isinstance(one, Branch) and one.word in DIVISIONS


@dataclass(frozen=True, slots=True)
class ForLoop(SourceStatement):
    """A loop that counts.

    Attributes:
        name: Of its variable, "" where only a part of the line is understood.
        first, last: Values that it begins and ends with.
        step: What it counts by, None where that is not said.
        down: ``DOWNTO``: it counts down.
    """

    name: str
    first: Operand | None
    last: Operand | None
    step: Operand | None = None
    down: bool = False


@dataclass(frozen=True, slots=True)
class LabelMark(SourceStatement):
    """``name:``, and what follows it on its line."""

    name: str
    then: SourceStatement | None = None


@dataclass(frozen=True, slots=True)
class JumpTo(SourceStatement):
    """``GOTO name``."""

    name: str


@dataclass(frozen=True, slots=True)
class Leave(SourceStatement):
    """``RETURN x``, and other words that lead elsewhere."""

    word: str
    value: Operand | None = None


@dataclass(frozen=True, slots=True)
class Assignment(SourceStatement):
    """A value is given to data."""

    target: DataObject
    value: Operand


@dataclass(frozen=True, slots=True)
class Instruction(SourceStatement):
    """An instruction, or a call of a procedure; they look the same."""

    name: str
    arguments: tuple[Argument, ...] = ()

    @property
    def values(self) -> tuple[Operand | None, ...]:
        """What is given, in the order in which it is written."""
        return tuple([one.value for one in self.arguments])


# Declarations and routines.


@dataclass(frozen=True, slots=True)
class ScopeHead(SourceStatement):
    """``MODULE name(..)``, ``RECORD name``, ``DEFDAT name``: what declares data.

    Attributes:
        kind: module, record, defdat, or import.
        name: Its name.
        attributes: Words behind it.
    """

    kind: str
    name: str
    attributes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DeclaredItem(Node):
    """One name of a declaration.

    Attributes:
        name: What is declared.
        dimensions: Of an array.
        value: What it is at first, None where nothing is said.
    """

    name: str
    dimensions: tuple[Operand, ...] = ()
    value: Operand | None = None


@dataclass(frozen=True, slots=True)
class Declaration(SourceStatement):
    """``LOCAL PERS tooldata t{2} := [..]``, ``DECL GLOBAL E6POS XP1={..}``.

    Attributes:
        type: Of the data.
        items: What is declared.
        kind: const, pers or var.
        scope: local, task or global, "" where nothing is said.
    """

    type: str
    items: tuple[DeclaredItem, ...]
    kind: str = "var"
    scope: str = ""


@dataclass(frozen=True, slots=True)
class RoutineParameter:
    r"""A parameter of a routine.

    Attributes:
        name: Its name.
        by_reference: The routine may change what it is called with; others are copies.
        optional: ``\name``.
        type: Of the data, "" where a declaration in the routine says it.
    """

    name: str
    by_reference: bool = False
    optional: bool = False
    type: str = ""


@dataclass(frozen=True, slots=True)
class RoutineHead(SourceStatement):
    """``PROC name(..)``, ``FUNC type name(..)``, ``DEF name(..)``.

    Attributes:
        kind: proc, func, trap, def or deffct.
        name: Its name.
        parameters: Its parameters.
        local: Only its own module or file knows it.
    """

    kind: str
    name: str
    parameters: tuple[RoutineParameter, ...] = ()
    local: bool = False
