"""What the analysis records of each arrival, before it becomes arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from postproc.arrays import Ints
from postproc.language.actions import Move
from postproc.language.store import Settings
from postproc.language.values import Position, Value
from postproc.language.visits import Motion, Target
from postproc.language.world import Place

Numbers = tuple[float | None, ...]
_NO_NUMBERS: Numbers = (None,) * 6

WRITTEN, HELD = -1, -2  # instead of a row of the variable file


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

    def __len__(self) -> int:
        """Return the number of visits."""
        return 1


@dataclass(frozen=True, slots=True)
class Run:
    """Moves that follow each other, each from the one before.

    Attributes:
        place: Where they stand.
        rows: Their rows, (k,).
        variant: Which lines differ in numbers and points only, (k,).
        moves: What each variant says.
        ways: Trajectory of each variant, and why that is not known.
        predecessors: Visits the first of them may come from.
        settings: Frames and motion variables that hold, but for those of WITH.
        point: Row of the variable file that each goes to, (k,); WRITTEN where the
            numbers stand in the move, HELD where a variable holds something else.
        held: What that is, by the index of the move.
        reason: Why none of them can be compensated, "" where they can.
    """

    place: Place
    rows: Ints
    variant: Ints
    moves: Mapping[int, Move]
    ways: Mapping[int, tuple[Motion, str]]
    predecessors: frozenset[int]
    settings: Settings
    point: Ints
    held: Mapping[int, Value]
    reason: str = ""

    def __len__(self) -> int:
        """Return the number of visits."""
        return len(self.rows)
