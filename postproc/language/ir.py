"""What statements say in languages of one statement a time: values and control flow."""

from __future__ import annotations

from dataclasses import dataclass

# Expressions, with number slots.
#
# Names are lower case (no language here tells cases apart). A `Num` knows only which
# number of its statement it is, so that one expression serves all of its form.


@dataclass(frozen=True, slots=True)
class Operand:
    """A value; a language adds its own kinds."""


@dataclass(frozen=True, slots=True)
class Num(Operand):
    """The number in a slot of the statement."""

    slot: int


@dataclass(frozen=True, slots=True)
class StringLiteral(Operand):
    """A string, with its quotes and as it is written."""

    text: str


@dataclass(frozen=True, slots=True)
class ElementStep:
    """``{i, j}`` behind the name of an array."""

    subscripts: tuple[Operand, ...]


@dataclass(frozen=True, slots=True)
class DataObject(Operand):
    """Data by name, then components and elements of it."""

    name: str
    steps: tuple[str | ElementStep, ...] = ()


@dataclass(frozen=True, slots=True)
class FunctionCall(Operand):
    """A call that returns a value."""

    name: str
    arguments: tuple[Argument, ...]


@dataclass(frozen=True, slots=True)
class Operation(Operand):
    """An operator and one operand or two."""

    operator: str
    operands: tuple[Operand, ...]


@dataclass(frozen=True, slots=True)
class Composite(Operand):
    """``[a, b, ..]``: a record or an array."""

    items: tuple[Operand, ...]


@dataclass(frozen=True, slots=True)
class Argument:
    r"""An argument of an instruction or function.

    Attributes:
        value: What is given; None for a switch.
        name: Of an optional argument (``\WObj``), "" where it goes by its place.
        passed_on: It is there where a parameter of the routine is (``\a?b``).
    """

    value: Operand | None
    name: str = ""
    passed_on: bool = False


# Statements.


@dataclass(frozen=True, slots=True)
class SourceStatement:
    """A statement; by itself: one that says nothing."""


@dataclass(frozen=True, slots=True)
class NotUnderstood(SourceStatement):
    """Text that the grammar has no rule for."""


def is_odd(one: SourceStatement) -> bool:
    """Return True if a statement is not understood."""
    return isinstance(one, NotUnderstood)


@dataclass(frozen=True, slots=True)
class BlockWord(SourceStatement):
    """A word that is a statement: else, endif, .."""

    word: str


@dataclass(frozen=True, slots=True)
class Branch(SourceStatement):
    """A statement that ways part at, or that a loop begins with.

    Attributes:
        word: if, elseif, while, test, case, default, loop, repeat or until.
        values: The condition, what is tested, or the values of a case.
    """

    word: str
    values: tuple[Operand, ...] = ()


@dataclass(frozen=True, slots=True)
class ForLoop(SourceStatement):
    """A loop that counts."""

    name: str
    first: Operand
    last: Operand
    step: Operand | None = None


@dataclass(frozen=True, slots=True)
class LabelMark(SourceStatement):
    """``name:``."""

    name: str


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
