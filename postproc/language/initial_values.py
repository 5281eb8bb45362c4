"""What variables hold when a program starts, by key."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from postproc.language.entry_columns import Entries
from postproc.language.values import Position, Value

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Points:
    """Points whose six numbers a variable file tells.

    Attributes:
        row: Row of `entries`, by key.
        entries: The entries of the file.
        base: Global index of the file's first number.
        shared: Another program may read it too, by row of `entries`.
        taught: Marked as taught where it is declared, likewise.
    """

    row: dict[str, int]
    entries: Entries
    base: int
    shared: Bools
    taught: Bools

    def position(self, row: int) -> Position:
        """Return the value of a point."""
        entry = self.entries.entry(row)
        return Position(
            entry.kind == "JNTP",
            entry.numbers,
            tuple(self.base + slot if slot >= 0 else -1 for slot in entry.slots),
            entry.config,
            entry.aux,
            entry.name,
            taught=bool(self.taught[row]),
            shared=bool(self.shared[row]),
        )


@dataclass
class InitialValues:
    """Values by key; those of points are made when they are asked for."""

    other: dict[str, Value] = field(default_factory=dict)
    points: Points | None = None

    def point(self, key: str) -> int:
        """Return the row of a point that the variable file tells, -1 for all else."""
        return -1 if self.points is None else self.points.row.get(key, -1)

    def find(self, key: str) -> Value | None:
        """Return what a key holds, None where it holds nothing."""
        row = self.point(key)
        if row >= 0 and self.points is not None:
            return self.points.position(row)
        return self.other.get(key)

    def __contains__(self, key: str) -> bool:
        """Tell whether a key holds anything."""
        return self.point(key) >= 0 or key in self.other

    def __setitem__(self, key: str, value: Value) -> None:
        """Let a key hold a value, unless the variable file says another."""
        self.other[key] = value

    def __iter__(self) -> Iterator[str]:
        """Go through the keys."""
        own = self.points.row if self.points is not None else {}
        return chain(own, (key for key in self.other if key not in own))
