"""What variables hold when a program starts, by key."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, repeat

import numpy as np

from postproc.arrays import Bools, Ints
from postproc.language.entry_columns import Entries
from postproc.language.values import Position, Value


@dataclass(frozen=True)
class Points:
    """Points whose six numbers a variable file tells.

    Attributes:
        prefix: What keys of the program's own variables begin with, before their names.
        own: Which rows of `entries` are points of such variables.
        other: Rows of points of variables of other programs, by key.
        entries: The entries of the file.
        base: Global index of the file's first number.
        shared: Another program may read it too, by row of `entries`.
        taught: Marked as taught where it is declared, likewise.
    """

    prefix: str
    own: Bools
    other: Mapping[str, int]
    entries: Entries
    base: int
    shared: Bools
    taught: Bools

    def row(self, key: str) -> int:
        """Return the row of a key, -1 where it is no point."""
        if key.startswith(self.prefix):
            row = self.entries.row.get(key[len(self.prefix) :], -1)
            if row >= 0 and self.own[row]:
                return row
        return self.other.get(key, -1)

    def rows(self, names: Sequence[str]) -> Ints:
        """Return the rows of the program's own variables, (m,), -1 for no points.

        Args:
            names: Their names, in lower case.
        """
        found = map(self.entries.row.get, names, repeat(-1))
        rows = np.fromiter(found, np.int64, len(names))
        rows[rows >= 0] = np.where(self.own[rows[rows >= 0]], rows[rows >= 0], -1)
        return rows

    def keys(self) -> Iterator[str]:
        """Go through the keys, in the order of the file."""
        elsewhere = {row: key for key, row in self.other.items()}
        for name, row in self.entries.row.items():
            if self.own[row]:
                yield self.prefix + name
            elif row in elsewhere:
                yield elsewhere[row]

    def parts(self) -> Iterator[str]:
        """Go through the keys that may be elements or fields."""
        if self.entries.parts or self.other or any(c in self.prefix for c in "[."):
            yield from self.keys()

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
        return -1 if self.points is None else self.points.row(key)

    def rows(self, prefix: str, names: Sequence[str]) -> Ints:
        """Return the rows of points of a program's own variables, (m,), -1 for others.

        Args:
            prefix: What the keys of its variables begin with.
            names: Names of its variables, in lower case.
        """
        if self.points is None or prefix != self.points.prefix:
            return np.full(len(names), -1)
        return self.points.rows(names)

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

    def parts(self) -> Iterator[str]:
        """Go through the keys, but for most of those that are no parts of others."""
        own = self.points.parts() if self.points is not None else ()
        return chain(own, (key for key in self.other if self.point(key) < 0))

    def __iter__(self) -> Iterator[str]:
        """Go through the keys."""
        own = self.points.keys() if self.points is not None else ()
        return chain(own, (key for key in self.other if self.point(key) < 0))
