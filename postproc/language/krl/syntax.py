"""What a statement of KRL says, beyond what is neutral."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from postproc.language.ir import Assignment, Node, Operand, SourceStatement
from postproc.language.text.symbol_column import read_kinds

NAMES = read_kinds(Path(__file__).with_name("names.txt"))
"""Words, and names of routines, functions and system variables, by what they do."""


@dataclass(frozen=True, slots=True)
class EnumValue(Operand):
    """``#BASE``, with its mark."""

    name: str


@dataclass(frozen=True, slots=True)
class NamedField(Node):
    """A component in an aggregate: ``X 100.0``."""

    name: str
    value: Operand


@dataclass(frozen=True, slots=True)
class KrlAggregate(Operand):
    """``{E6POS: X 100.0, Y 0.0}``; the type is "" where it is not said."""

    type: str
    fields: tuple[NamedField, ...]


@dataclass(frozen=True, slots=True)
class Waiting(SourceStatement):
    """``WAIT SEC t``, ``WAIT FOR x``, ``HALT``: the arm stands still until then."""

    value: Operand | None = None


@dataclass(frozen=True, slots=True)
class ContinueWord(SourceStatement):
    """``CONTINUE``: the next statement does not stop what is planned ahead."""


@dataclass(frozen=True, slots=True)
class InterruptDeclared(SourceStatement):
    """``INTERRUPT DECL n WHEN condition DO statement``."""

    number: Operand
    condition: Operand
    action: SourceStatement


@dataclass(frozen=True, slots=True)
class InterruptSwitched(SourceStatement):
    """``INTERRUPT ON n``, ``OFF``, ``ENABLE``, ``DISABLE``; ``BRAKE``; ``RESUME``.

    Attributes:
        word: Which of them.
        number: Of the interrupt, None where all are meant.
    """

    word: str
    number: Operand | None = None


@dataclass(frozen=True, slots=True)
class PathTrigger(SourceStatement):
    """``TRIGGER WHEN .. DO statement``: it belongs to the move behind it.

    Attributes:
        action: What it does.
        values: Where on the move, how much later, and with which priority.
    """

    action: SourceStatement
    values: tuple[Operand, ...] = ()


@dataclass(frozen=True, slots=True)
class KrlMove(SourceStatement):
    """A move.

    Attributes:
        word: ptp, lin, circ, sptp, slin, scirc, spl, ptp_rel, ..
        to: Its end.
        via: The point of an arc.
        angle: ``CA``: how far an arc goes, whatever its end point.
        words: Of blending, and the frame of a relative move.
        settings: What holds for this move only.
    """

    word: str
    to: Operand
    via: Operand | None = None
    angle: Operand | None = None
    words: tuple[str, ...] = ()
    settings: tuple[Assignment, ...] = ()


@dataclass(frozen=True, slots=True)
class SplineBlock(SourceStatement):
    """``SPLINE``, ``PTP_SPLINE``, ``ENDSPLINE``.

    Attributes:
        word: Which of them.
        words: Of blending.
        settings: What holds for the block.
    """

    word: str
    words: tuple[str, ...] = ()
    settings: tuple[Assignment, ...] = ()

    @property
    def block(self) -> str:
        """What it is to blocks."""
        return "endspline" if self.word == "endspline" else "spline"
