"""What a logical line of PDL2 says, beyond what is neutral."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from postproc.language import ir
from postproc.language.text.symbol_column import read_kinds

NAMES = read_kinds(Path(__file__).with_name("names.txt"))
"""Words, and names of built-in routines and system variables, by what they do."""

POINTS = frozenset({"position", "xtndpos", "jointpos"})

# Statements that declare: programs, routines, variables, types.


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
class ProgramHead(ir.SourceStatement):
    """``PROGRAM name``; `arm` is the slot of ``PROG_ARM=n``, -1 where there is none."""

    name: str
    arm: int = -1


@dataclass(frozen=True, slots=True)
class Declare(ir.SourceStatement):
    """``a, b : TYPE (initial)``, the names as they are written; ``name = value``."""

    names: tuple[str, ...]
    type: Type | None
    initial: ir.Operand | None
    exported: str = ""
    attributes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Routine(ir.SourceStatement):
    """``ROUTINE name(..)``; `exported` names the program that holds it, or is ""."""

    name: str
    parameters: tuple[Declare, ...]
    exported: str


@dataclass(frozen=True, slots=True)
class NodeFields(ir.SourceStatement):
    """``$MAIN_POS, $LIN_SPD``: standard fields that nodes have, in lower case."""

    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class End(ir.SourceStatement):
    """``END name``."""

    name: str


# Statements that move, assign, call or wait.


@dataclass(frozen=True, slots=True)
class Move(ir.SourceStatement):
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
    arm: ir.Operand | None
    trajectory: str
    how: str
    where: tuple[ir.Operand, ...]
    via: ir.Operand | None = None
    frame: str = ""
    settings: tuple[ir.Assignment, ...] = ()
    conditions: tuple[ir.Operand | ir.ElementStep, ...] = ()
    til: tuple[ir.DataObject | ir.FunctionCall, ...] | None = None
    sync: tuple[Move, ...] = ()


@dataclass(frozen=True, slots=True)
class ProgramCall(ir.Instruction):
    """``CALL program``."""


@dataclass(frozen=True, slots=True)
class Transfer(ir.SourceStatement):
    """READ, DECODE, ENCODE, WRITE: `operands` may change unless it is WRITE."""

    word: str
    operands: tuple[ir.Operand, ...]


@dataclass(frozen=True, slots=True)
class Still(ir.SourceStatement):
    """A statement that neither moves the arm nor changes a value: WAIT, DELAY, ..

    Attributes:
        waits: It takes time that only the run tells.
        terms: Names in the rest, which is not understood; functions that it calls.
    """

    waits: bool
    terms: tuple[ir.DataObject | ir.FunctionCall, ...] = ()


@dataclass(frozen=True, slots=True)
class CancelMove(ir.SourceStatement):
    """``CANCEL CURRENT FOR ARM[n]``, ``CANCEL ALL``: moves end on their way.

    Attributes:
        arms: The arms whose moves end; none: those of the program's arm.
    """

    arms: tuple[ir.Operand, ...] = ()


# Statements that decide what runs next.


@dataclass(frozen=True, slots=True)
class When(ir.SourceStatement):
    """``WHEN event DO action``; `terms` are the names that the event tells."""

    then: ir.SourceStatement | None
    terms: tuple[ir.DataObject | ir.FunctionCall, ...] = ()


def action(statement: ir.SourceStatement | None) -> ir.SourceStatement | None:
    """Return what a line does behind its label, CASE, ELSE or WHEN, if anything."""
    while isinstance(statement, ir.LabelMark | When) or ir.divides(statement):
        statement = getattr(statement, "then", None)
    return statement
