"""Statements that decide what runs next."""

from __future__ import annotations

from dataclasses import dataclass

from postproc.language.declarations import Statement
from postproc.language.expressions import Expression


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
    """``WHEN event DO action``."""

    then: Statement | None


@dataclass(frozen=True, slots=True)
class EndCondition(Statement):
    """``ENDCONDITION``."""


def action(statement: Statement | None) -> Statement | None:
    """Return what a line does behind its label, CASE, ELSE or WHEN, if anything."""
    while isinstance(statement, Label | Case | Else | When):
        statement = statement.then
    return statement
