"""Rows of `diff` as columns: no object a line, whatever the length of a program."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.outcome import Arrivals, Status

STATUSES = tuple(Status(k).name.lower() for k in range(len(Status)))


class Row(NamedTuple):
    """One line that differs, or whose target was left alone.

    Attributes:
        file: Name of the original file.
        line: 1-based line in the original; 0 for a line that it does not have.
        target: What the numbers belong to: a variable, or the statement's first word.
        original, compensated: The numbers on the line; empty where the text differs.
        change_mm: Length of the change of the first three of six numbers or more, for
            a position; None for joint angles and text.
        text: The line's two texts where more than numbers differ, else "".
        status, why: What came of the line's target, "" where no record tells.
        direction: In which every joint arrives, see `compensation.outcome`; or ().
        correction_mm: How far the TCP is moved there, or None.
        visits: Visits of the line by status where they have several, the most urgent
            first; else empty.
    """

    file: str
    line: int
    target: str
    original: tuple[float, ...]
    compensated: tuple[float, ...]
    change_mm: float | None
    text: str = ""
    status: str = ""
    why: str = ""
    direction: tuple[int, ...] = ()
    correction_mm: float | None = None
    visits: dict[str, int] = {}  # noqa: RUF012


@dataclass(frozen=True, eq=False)
class Rows(Sequence[Row]):
    """The rows of one file (structure of arrays); as a sequence it makes them.

    Attributes:
        file: Name of the original file.
        line: See `Row`, (k,).
        targets: Names of what numbers belong to.
        target: Index into them, (k,).
        first: CSR offsets into the numbers, (k + 1,).
        original, compensated: The numbers, (m,).
        change_mm: See `Row`, NaN where there is none, (k,).
        has_change: Where there is one, (k,).
        texts: The texts of those rows that have one, by row.
        told: What the record says of the file's targets, where there is one.
        entry: Index into it, -1 where it says nothing, (k,).
    """

    file: str
    line: Ints
    targets: Sequence[str]
    target: Ints
    first: Ints
    original: Floats
    compensated: Floats
    change_mm: Floats
    has_change: Bools
    texts: Mapping[int, str] = field(default_factory=dict)
    told: Arrivals | None = None
    entry: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    @classmethod
    def bare(cls, file: str, line: Ints, targets: Sequence[str]) -> Rows:
        """Make rows without numbers, each with a target of its own."""
        k = len(line)
        ints, none = np.zeros(k + 1, dtype=np.int64), np.empty(0)
        nan, no = np.full(k, np.nan), np.zeros(k, dtype=bool)
        return cls(file, line, targets, np.arange(k), ints, none, none, nan, no)

    def with_told(self, told: Arrivals | None) -> Rows:
        """Add what a record says."""
        if told is None:
            return self
        return replace(self, told=told, entry=told.find(self.line))

    def __len__(self) -> int:
        """Count the rows."""
        return len(self.line)

    def __iter__(self) -> Iterator[Row]:
        """Make all rows, in order."""
        return map(self.row, range(len(self)))

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        """Make the k-th row, or those of a slice."""
        rows = range(len(self))[k]
        return self.row(rows) if isinstance(rows, int) else [*map(self.row, rows)]

    def row(self, k: int) -> Row:
        """Make the k-th row."""
        own = slice(*self.first[k : k + 2].tolist())
        row = Row(
            self.file,
            int(self.line[k]),
            self.targets[self.target[k]],
            tuple(self.original[own].tolist()),
            tuple(self.compensated[own].tolist()),
            float(self.change_mm[k]) if self.has_change[k] else None,
            self.texts.get(k, ""),
        )
        told, at = self.told, int(self.entry[k]) if self.told else -1
        if told is None or at < 0:
            return row
        return row._replace(
            status=STATUSES[told.status[at]],
            why=told.reasons[told.why[at]],
            direction=tuple(told.direction[at].tolist()),
            correction_mm=float(told.correction_mm[at]),
            visits=dict(told.mixed.get(at, {})),
        )


def joined_rows(file: str, parts: Sequence[Rows]) -> Rows:
    """Put rows of one file one after the other, before a record tells of them."""
    if not parts:
        return Rows.bare(file, np.empty(0, dtype=np.int64), ())
    named = np.cumsum([0, *(len(p.targets) for p in parts)]).tolist()
    rows = np.cumsum([0, *(len(p) for p in parts)]).tolist()
    counts = [np.diff(p.first) for p in parts]
    return Rows(
        file,
        np.concatenate([p.line for p in parts]),
        [name for p in parts for name in p.targets],
        np.concatenate([p.target + n for p, n in zip(parts, named, strict=False)]),
        np.cumsum(np.concatenate([[0], *counts])),
        np.concatenate([p.original for p in parts]),
        np.concatenate([p.compensated for p in parts]),
        np.concatenate([p.change_mm for p in parts]),
        np.concatenate([p.has_change for p in parts]),
        {
            n + k: text
            for p, n in zip(parts, rows, strict=False)
            for k, text in p.texts.items()
        },
    )
