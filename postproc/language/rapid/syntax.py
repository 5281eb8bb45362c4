"""What a statement of RAPID says: expressions, declarations, instructions."""

from __future__ import annotations

from dataclasses import dataclass

from postproc.language.ir import Argument, DataObject, Operand, SourceStatement


@dataclass(frozen=True, slots=True)
class FileHeader(SourceStatement):
    """``%%% VERSION:1 LANGUAGE:ENGLISH %%%``."""


@dataclass(frozen=True, slots=True)
class ModuleHead(SourceStatement):
    """``MODULE name(SYSMODULE, ..)``."""

    name: str
    attributes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class RoutineParameter:
    r"""A parameter of a routine.

    Attributes:
        name: Its name.
        by_reference: ``VAR``, ``PERS`` or ``INOUT``: the routine may change what it is
            called with; others are copies.
        optional: ``\name``.
    """

    name: str
    by_reference: bool = False
    optional: bool = False


@dataclass(frozen=True, slots=True)
class RoutineHead(SourceStatement):
    """``PROC name(..)``, ``FUNC type name(..)``, ``TRAP name``.

    Attributes:
        kind: proc, func or trap.
        name: Its name.
        parameters: Its parameters.
        local: Only its module knows it.
        returns: The type of a function's value.
    """

    kind: str
    name: str
    parameters: tuple[RoutineParameter, ...] = ()
    local: bool = False
    returns: str = ""


@dataclass(frozen=True, slots=True)
class RecordHead(SourceStatement):
    """``RECORD name``."""

    name: str


@dataclass(frozen=True, slots=True)
class DataDeclaration(SourceStatement):
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
class TypeAlias(SourceStatement):
    """``ALIAS type name``."""

    type: str
    name: str


@dataclass(frozen=True, slots=True)
class CompactIf(SourceStatement):
    """``IF condition statement;``."""

    condition: Operand
    statement: SourceStatement


@dataclass(frozen=True, slots=True)
class ConnectTrap(SourceStatement):
    """``CONNECT interrupt WITH trap;``."""

    interrupt: DataObject
    trap: str


@dataclass(frozen=True, slots=True)
class ErrorHandler(SourceStatement):
    """``ERROR`` and what follows, up to the end of the routine."""

    numbers: tuple[Operand, ...] = ()


@dataclass(frozen=True, slots=True)
class LateCall(SourceStatement):
    """``%name% ..;``: which procedure is called shows when it runs."""

    procedure: Operand
    arguments: tuple[Argument, ...] = ()
