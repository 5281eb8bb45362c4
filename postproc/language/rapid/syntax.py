"""What a statement of RAPID says: expressions, declarations, instructions."""

from __future__ import annotations

from dataclasses import dataclass

# Expressions, with number slots.
#
# Names are lower case (RAPID does not tell cases apart). A `Num` knows only which
# number of its statement it is, so that one expression serves all of its form.


@dataclass(frozen=True, slots=True)
class Num:
    """The number in a slot of the statement."""

    slot: int


@dataclass(frozen=True, slots=True)
class StringLiteral:
    """A string, with its quotes and as it is written."""

    text: str


@dataclass(frozen=True, slots=True)
class ElementStep:
    """``{i, j}`` behind the name of an array."""

    subscripts: tuple[Operand, ...]


@dataclass(frozen=True, slots=True)
class DataObject:
    """Data by name, then components and elements of it."""

    name: str
    steps: tuple[str | ElementStep, ...] = ()


@dataclass(frozen=True, slots=True)
class FunctionCall:
    """A call that returns a value."""

    name: str
    arguments: tuple[Argument, ...]


@dataclass(frozen=True, slots=True)
class Operation:
    """An operator and one operand or two."""

    operator: str
    operands: tuple[Operand, ...]


@dataclass(frozen=True, slots=True)
class Composite:
    """``[a, b, ..]``: a record or an array."""

    items: tuple[Operand, ...]


Operand = Num | StringLiteral | DataObject | FunctionCall | Operation | Composite


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
class RapidStatement:
    """A statement; by itself: one that says nothing."""


@dataclass(frozen=True, slots=True)
class FileHeader(RapidStatement):
    """``%%% VERSION:1 LANGUAGE:ENGLISH %%%``."""


@dataclass(frozen=True, slots=True)
class NotUnderstood(RapidStatement):
    """Text that the grammar has no rule for."""


@dataclass(frozen=True, slots=True)
class ModuleHead(RapidStatement):
    """``MODULE name(SYSMODULE, ..)``."""

    name: str
    attributes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class RoutineHead(RapidStatement):
    """``PROC name(..)``, ``FUNC type name(..)``, ``TRAP name``.

    Attributes:
        kind: proc, func or trap.
        name: Its name.
        parameters: Names of its parameters.
        local: Only its module knows it.
        returns: The type of a function's value.
    """

    kind: str
    name: str
    parameters: tuple[str, ...] = ()
    local: bool = False
    returns: str = ""


@dataclass(frozen=True, slots=True)
class RecordHead(RapidStatement):
    """``RECORD name``."""

    name: str


@dataclass(frozen=True, slots=True)
class BlockWord(RapidStatement):
    """A word that is a statement: endmodule, else, endif, undo, .."""

    word: str


@dataclass(frozen=True, slots=True)
class DataDeclaration(RapidStatement):
    """``LOCAL PERS tooldata t{2} := [..]``.

    Attributes:
        kind: const, var or pers.
        type, name: Of the data.
        scope: local, task or "".
        dimensions: Of an array.
        value: What it is at first, None where nothing is said.
    """

    kind: str
    type: str
    name: str
    scope: str = ""
    dimensions: tuple[Operand, ...] = ()
    value: Operand | None = None


@dataclass(frozen=True, slots=True)
class TypeAlias(RapidStatement):
    """``ALIAS type name``."""

    type: str
    name: str


@dataclass(frozen=True, slots=True)
class Branch(RapidStatement):
    """``IF .. THEN``, ``ELSEIF``, ``WHILE .. DO``, ``TEST``, ``CASE ..:``, ``DEFAULT``.

    Attributes:
        word: if, elseif, while, test, case or default.
        values: The condition, what is tested, or the values of a case.
    """

    word: str
    values: tuple[Operand, ...] = ()


@dataclass(frozen=True, slots=True)
class CompactIf(RapidStatement):
    """``IF condition statement;``."""

    condition: Operand
    statement: RapidStatement


@dataclass(frozen=True, slots=True)
class ForLoop(RapidStatement):
    """``FOR name FROM first TO last STEP step DO``."""

    name: str
    first: Operand
    last: Operand
    step: Operand | None = None


@dataclass(frozen=True, slots=True)
class LabelMark(RapidStatement):
    """``name:``."""

    name: str


@dataclass(frozen=True, slots=True)
class JumpTo(RapidStatement):
    """``GOTO name;``."""

    name: str


@dataclass(frozen=True, slots=True)
class Leave(RapidStatement):
    """``RETURN x;``, ``RAISE x;``, ``EXIT;``, ``RETRY;``, ``TRYNEXT;``."""

    word: str
    value: Operand | None = None


@dataclass(frozen=True, slots=True)
class ConnectTrap(RapidStatement):
    """``CONNECT interrupt WITH trap;``."""

    interrupt: DataObject
    trap: str


@dataclass(frozen=True, slots=True)
class ErrorHandler(RapidStatement):
    """``ERROR`` and what follows, up to the end of the routine."""

    numbers: tuple[Operand, ...] = ()


@dataclass(frozen=True, slots=True)
class Assignment(RapidStatement):
    """``data := value;``."""

    target: DataObject
    value: Operand


@dataclass(frozen=True, slots=True)
class Instruction(RapidStatement):
    """An instruction, or a call of a procedure; they look the same."""

    name: str
    arguments: tuple[Argument, ...] = ()


@dataclass(frozen=True, slots=True)
class LateCall(RapidStatement):
    """``%name% ..;``: which procedure is called shows when it runs."""

    procedure: Operand
    arguments: tuple[Argument, ...] = ()
