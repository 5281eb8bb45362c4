"""Statements that move, assign, call or wait."""

from __future__ import annotations

from dataclasses import dataclass

from postproc.language.declarations import Statement
from postproc.language.expressions import Expression, Index, Reference


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
        til: The move may end before its target.
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
    til: bool = False
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
    """A statement that neither moves the arm nor changes a value: WAIT, DELAY, .."""

    word: str
