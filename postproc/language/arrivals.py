"""What the analysis records of each arrival, before it becomes arrays."""

from __future__ import annotations

from dataclasses import dataclass

from postproc.language.store import Settings
from postproc.language.values import Position
from postproc.language.visits import Motion, Target
from postproc.language.world import Place

Numbers = tuple[float | None, ...]
_NO_NUMBERS: Numbers = (None,) * 6


@dataclass(frozen=True, slots=True)
class Arrival:
    """One visit.

    Attributes:
        place, row: Where the move stands.
        predecessors: Visits it may come from.
        settings: Frames and motion variables that hold.
        motion: Trajectory.
        target: What the numbers mean.
        numbers: Six numbers, None where not known.
        position: The position value where there is one.
        fly: MOVEFLY.
        via: The VIA point of an arc.
        distance: For NEAR [mm].
        reason: Why it cannot be compensated, "" where it can.
    """

    place: Place
    row: int
    predecessors: frozenset[int]
    settings: Settings
    motion: Motion
    target: Target
    numbers: Numbers = _NO_NUMBERS
    position: Position | None = None
    fly: bool = False
    via: bool = False
    distance: float | None = None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Run:
    """Consecutive moves to inline literals, from row first to last - 1.

    Attributes:
        predecessors: Visits the first of them may come from.
    """

    place: Place
    first: int
    last: int
    predecessors: frozenset[int]
    settings: Settings
    reason: str = ""
