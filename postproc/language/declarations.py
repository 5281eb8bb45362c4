"""Statements that declare: programs, routines, variables, types."""

from __future__ import annotations

from dataclasses import dataclass

from postproc.language.expressions import Expression


@dataclass(frozen=True, slots=True)
class Statement:
    """Base of all statements; itself a line that does nothing that matters here."""


@dataclass(frozen=True, slots=True)
class Unknown(Statement):
    """A line that the grammar does not know."""

    text: str


@dataclass(frozen=True, slots=True)
class Type:
    """A type: its name in lower case; for arrays and paths that of the elements."""

    name: str
    array: bool = False
    path: bool = False


@dataclass(frozen=True, slots=True)
class Program(Statement):
    """``PROGRAM name``; `arm` is the slot of ``PROG_ARM=n``, -1 where there is none."""

    name: str
    arm: int = -1


@dataclass(frozen=True, slots=True)
class Import(Statement):
    """``IMPORT 'file'``."""

    file: str


@dataclass(frozen=True, slots=True)
class Section(Statement):
    """``VAR``, ``CONST``, ``TYPE``, alone or with a declaration."""

    then: Statement | None


@dataclass(frozen=True, slots=True)
class Parameter:
    """One formal parameter."""

    name: str
    type: Type


@dataclass(frozen=True, slots=True)
class Routine(Statement):
    """``ROUTINE name(..)``; `exported` names the program that holds it, or is ""."""

    name: str
    parameters: tuple[Parameter, ...]
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
