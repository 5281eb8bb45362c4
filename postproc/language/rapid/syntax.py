"""What a statement of RAPID says: expressions, declarations, instructions."""

from __future__ import annotations

from dataclasses import dataclass

from postproc.language.ir import Argument, DataObject, Operand, SourceStatement


@dataclass(frozen=True, slots=True)
class TypeAlias(SourceStatement):
    """``ALIAS type name``."""

    type: str
    name: str


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
