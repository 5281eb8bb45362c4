"""What a logical line of PDL2 says: expressions and statements."""

from __future__ import annotations

from dataclasses import dataclass

# Expressions of PDL2, with number slots.
#
# Names are lower case (PDL2 does not tell cases apart). A `Number` knows only which
# number of its line it is, so that one expression serves every line of its shape.


@dataclass(frozen=True, slots=True)
class Number:
    """The number in a slot of the line."""

    slot: int


@dataclass(frozen=True, slots=True)
class Text:
    """A string, without its quotes and otherwise verbatim."""

    value: str


@dataclass(frozen=True, slots=True)
class Index:
    """``[i, j]`` after a name; a pair is a range."""

    subscripts: tuple[Expression | tuple[Expression, Expression], ...]


@dataclass(frozen=True, slots=True)
class Reference:
    """A variable: its name, then fields and indices."""

    name: str
    steps: tuple[str | Index, ...] = ()


@dataclass(frozen=True, slots=True)
class Invoke:
    """A call that returns a value; an argument may be missing."""

    name: str
    arguments: tuple[Expression | None, ...]


@dataclass(frozen=True, slots=True)
class Unary:
    """An operator before its operand; ``()`` is a variable in parentheses.

    As an argument that is the variable's value, not the variable itself.
    """

    operator: str
    operand: Expression


@dataclass(frozen=True, slots=True)
class Binary:
    """An operator between two operands."""

    operator: str
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True)
class Aggregate:
    """``{j1, .., jn}``."""

    items: tuple[Expression, ...]


Expression = Number | Text | Reference | Invoke | Unary | Binary | Aggregate

# Statements that declare: programs, routines, variables, types.


@dataclass(frozen=True, slots=True)
class Statement:
    """Base of all statements; itself a line that does nothing that matters here."""


@dataclass(frozen=True, slots=True)
class Unknown(Statement):
    """A line that the grammar does not know."""

    text: str


@dataclass(frozen=True, slots=True)
class Type:
    """A type.

    Attributes:
        name: In lower case; for arrays and paths that of the elements.
        array, path: Whether it is one of these.
        arm: Slot of the number in ``FOR ARM[n]``, -1 where there is none.
    """

    name: str
    array: bool = False
    path: bool = False
    arm: int = -1


@dataclass(frozen=True, slots=True)
class ProgramHead(Statement):
    """``PROGRAM name``; `arm` is the slot of ``PROG_ARM=n``, -1 where there is none."""

    name: str
    arm: int = -1


@dataclass(frozen=True, slots=True)
class Import(Statement):
    """``IMPORT 'file'``."""

    file: str


@dataclass(frozen=True, slots=True)
class DeclarationSection(Statement):
    """``VAR``, ``CONST``, ``TYPE``, alone or with a declaration."""

    then: Statement | None


@dataclass(frozen=True, slots=True)
class FormalParameter:
    """One formal parameter."""

    name: str
    type: Type


@dataclass(frozen=True, slots=True)
class Routine(Statement):
    """``ROUTINE name(..)``; `exported` names the program that holds it, or is ""."""

    name: str
    parameters: tuple[FormalParameter, ...]
    exported: str


@dataclass(frozen=True, slots=True)
class Declare(Statement):
    """``a, b : TYPE (initial)``; the names as they are written."""

    names: tuple[str, ...]
    type: Type
    initial: Expression | None
    exported: str
    attributes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Constant(Statement):
    """``name = value`` in a CONST section."""

    name: str
    value: Expression


@dataclass(frozen=True, slots=True)
class Structure(Statement):
    """``name = RECORD | NODEDEF``; its fields follow up to `EndStructure`."""

    name: str


@dataclass(frozen=True, slots=True)
class NodeFields(Statement):
    """``$MAIN_POS, $LIN_SPD``: standard fields that nodes have, in lower case."""

    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class EndStructure(Statement):
    """``ENDRECORD``, ``ENDNODEDEF``."""


@dataclass(frozen=True, slots=True)
class Begin(Statement):
    """``BEGIN``."""


@dataclass(frozen=True, slots=True)
class End(Statement):
    """``END name``."""

    name: str


# Statements that move, assign, call or wait.


@dataclass(frozen=True, slots=True)
class Move(Statement):
    """A motion.

    Attributes:
        fly: MOVEFLY.
        arm: ``ARM[n]``, None where it is not said.
        trajectory: JOINT, LINEAR, CIRCULAR, SEG_VIA or "".
        how: TO, RELATIVE, AWAY, NEAR, ABOUT, ALONG, BY or FOR.
        where: Operands in the order in which they are written.
        via: VIA point of an arc.
        frame: TOOL, BASE, UFRAME after IN, else "".
        settings: ``WITH $X = value`` of this move alone.
        conditions: ``WITH CONDITION[..]``: what runs beside the move.
        til: What the condition names on which the move ends before its target.
        sync: Moves of other arms that run along (SYNCMOVE).
    """

    fly: bool
    arm: Expression | None
    trajectory: str
    how: str
    where: tuple[Expression, ...]
    via: Expression | None = None
    frame: str = ""
    settings: tuple[tuple[Reference, Expression], ...] = ()
    conditions: tuple[Expression | Index, ...] = ()
    til: tuple[Reference | Invoke, ...] | None = None
    sync: tuple[Move, ...] = ()


@dataclass(frozen=True, slots=True)
class Assign(Statement):
    """``target := value``, ``+=``, ``-=``."""

    target: Reference
    operator: str
    value: Expression


@dataclass(frozen=True, slots=True)
class Call(Statement):
    """A routine called as a statement, or ``CALL program``."""

    name: str
    arguments: tuple[Expression | None, ...]
    program: bool = False


@dataclass(frozen=True, slots=True)
class Transfer(Statement):
    """READ, DECODE, ENCODE, WRITE: `operands` may change unless it is WRITE."""

    word: str
    operands: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Still(Statement):
    """A statement that neither moves the arm nor changes a value: WAIT, DELAY, ..

    Attributes:
        waits: It takes time that only the run tells.
        terms: Names in the rest, which is not understood; functions that it calls.
    """

    waits: bool
    terms: tuple[Reference | Invoke, ...] = ()


@dataclass(frozen=True, slots=True)
class CancelMove(Statement):
    """``CANCEL CURRENT FOR ARM[n]``, ``CANCEL ALL``: moves end on their way.

    Attributes:
        arms: The arms whose moves end; none: those of the program's arm.
    """

    arms: tuple[Expression, ...] = ()


# Statements that decide what runs next.


@dataclass(frozen=True, slots=True)
class Label(Statement):
    """``name::`` and what follows it on the line."""

    name: str
    then: Statement | None


@dataclass(frozen=True, slots=True)
class If(Statement):
    """``IF condition THEN``."""

    condition: Expression | None


@dataclass(frozen=True, slots=True)
class Else(Statement):
    """``ELSE`` of an IF, ``ELSE:`` of a SELECT."""

    then: Statement | None = None


@dataclass(frozen=True, slots=True)
class EndIf(Statement):
    """``ENDIF``."""


@dataclass(frozen=True, slots=True)
class Select(Statement):
    """``SELECT value OF``."""

    value: Expression | None


@dataclass(frozen=True, slots=True)
class Case(Statement):
    """``CASE (a, b):``; a pair is a range."""

    choices: tuple[Expression | tuple[Expression, Expression], ...]
    then: Statement | None = None


@dataclass(frozen=True, slots=True)
class EndSelect(Statement):
    """``ENDSELECT``."""


@dataclass(frozen=True, slots=True)
class For(Statement):
    """``FOR i := a TO|DOWNTO b STEP s DO``."""

    name: str
    start: Expression | None
    stop: Expression | None
    step: Expression | None = None
    down: bool = False


@dataclass(frozen=True, slots=True)
class EndFor(Statement):
    """``ENDFOR``."""


@dataclass(frozen=True, slots=True)
class While(Statement):
    """``WHILE condition DO``."""

    condition: Expression | None


@dataclass(frozen=True, slots=True)
class EndWhile(Statement):
    """``ENDWHILE``."""


@dataclass(frozen=True, slots=True)
class Repeat(Statement):
    """``REPEAT``."""


@dataclass(frozen=True, slots=True)
class Until(Statement):
    """``UNTIL condition``."""

    condition: Expression | None


@dataclass(frozen=True, slots=True)
class Cycle(Statement):
    """``CYCLE``: from here to the program's END over and over."""


@dataclass(frozen=True, slots=True)
class ExitCycle(Statement):
    """``EXIT CYCLE``: the next cycle starts."""


@dataclass(frozen=True, slots=True)
class Goto(Statement):
    """``GOTO label``."""

    label: str


@dataclass(frozen=True, slots=True)
class Return(Statement):
    """``RETURN``, ``RETURN(value)``."""

    value: Expression | None


@dataclass(frozen=True, slots=True)
class Condition(Statement):
    """``CONDITION[n] :``; a handler up to `EndCondition`."""


@dataclass(frozen=True, slots=True)
class When(Statement):
    """``WHEN event DO action``; `terms` are the names that the event tells."""

    then: Statement | None
    terms: tuple[Reference | Invoke, ...] = ()


@dataclass(frozen=True, slots=True)
class EndCondition(Statement):
    """``ENDCONDITION``."""


def action(statement: Statement | None) -> Statement | None:
    """Return what a line does behind its label, CASE, ELSE or WHEN, if anything."""
    while isinstance(statement, Label | Case | Else | When):
        statement = statement.then
    return statement
