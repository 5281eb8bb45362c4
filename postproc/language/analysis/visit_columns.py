"""Columns of visits as a language fills them, and what follows from them alone."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, chain, pairwise
from typing import Any

import numpy as np

from postproc.arrays import (
    Bools,
    Indices,
    Interned,
    Ints,
    any_in_rows,
    chunks,
    map_chunks,
    slim,
    spans,
)
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language import visits
from postproc.language.analysis.conditions import ConditionColumns, Conditions
from postproc.language.pose_encoding import Dialect
from postproc.language.shifts import Shift
from postproc.language.text.statement_table import Statements
from postproc.language.text.symbol_column import NameColumn

TOO_COMPLEX = Reason(Code.TOO_COMPLEX, "the program is too complex to be followed")
TORN = Reason(
    Code.NUMBERS_NOT_OWN, "a number of the target belongs to another target too"
)
APART = Reason(
    Code.NUMBERS_NOT_OWN,
    "some of its numbers stand in the program, others in another file: write them in "
    "one",
)


class VisitColumns:
    """Columns of n visits that a language fills; see the parts of `Visits`.

    Attributes:
        condition: Index into `conditions`, (n,).
        slots: Which numbers of all files are those of a target that may be edited,
            (n, w), -1 for what is not written; none where the first is -1.
        taught, shared: See `Literals`, (n,).
        measured: Ids of measured visits.
    """

    def __init__(self, n: int, width: int, axes: int, numbers: int) -> None:
        """Make room.

        Args:
            n: Visits.
            width: Numbers of a target.
            axes: The last auxiliary axis.
            numbers: Those in all files: where they stand are the longest columns.
        """
        short = np.int32 if numbers < 2**31 else np.int64
        self.file = np.zeros(n, dtype=np.int32)
        self.line = np.zeros(n, dtype=np.int32)
        self.kind = np.zeros(n, dtype=np.int8)
        self.meaning = np.zeros(n, dtype=np.int8)
        self.via = np.zeros(n, dtype=bool)
        self.fly = np.zeros(n, dtype=bool)
        self.arc_angle = np.broadcast_to(np.nan, n)
        self.block = np.broadcast_to(-1, n)
        self.curved = np.broadcast_to(False, n)
        self.values = np.full((n, width), np.nan)
        self.distance_mm = np.broadcast_to(np.nan, n)
        self.aux = np.full((n, axes), np.nan)
        self.config = np.zeros(n, dtype=np.int32)
        self.config_given = np.zeros(n, dtype=bool)
        self.name = np.zeros(n, dtype=np.int32)
        self.shift = np.broadcast_to(-1, n)
        self.reason = np.zeros(n, dtype=np.int32)
        self.condition = np.zeros(n, dtype=np.int32)
        self.slots = np.full((n, width), -1, dtype=short)
        self.taught = np.zeros(n, dtype=bool)
        self.shared = np.zeros(n, dtype=bool)
        self.measured: dict[int, str] = {}
        self.configs = Interned([""])
        self.names = NameColumn([""])
        self.shifts = Interned[Shift]()
        self.reasons = Interned[Reason]([NO_REASON])
        self.conditions = Interned[Conditions]()

    def __len__(self) -> int:
        """Return the number of visits."""
        return len(self.line)


def to_visits(
    columns: VisitColumns,
    files: Sequence[str],
    graph: visits.Graph,
    literals: visits.Literals,
    literal: Indices,
    follows: Indices,
    dialect: Dialect,
) -> visits.Visits:
    """Make visits of columns.

    Args:
        columns: n visits.
        files: Names of the files.
        graph: Where arms come from.
        literals: The places of targets in the texts.
        literal: Literal of every visit, (n,), -1 where it has none.
        follows: Literal that it moves along with, (n,), likewise.
        dialect: What the numbers mean.
    """
    c = columns
    conditions = ConditionColumns(c.conditions, c.condition)

    def own(*names: str) -> dict[str, Any]:
        return {name: slim(getattr(c, name)) for name in names}

    return visits.Visits(
        files=tuple(files),
        place=visits.PlaceColumns(
            **own("file", "line"), measure_id=visits.texts_of(len(c), c.measured)
        ),
        target=visits.TargetColumns(
            **own("meaning", "distance_mm", "config", "config_given", "name", "shift"),
            values=c.values,
            aux=c.aux,
            configs=tuple(c.configs),
            literal=literal,
            follows=slim(follows),
            names=c.names,
            shifts=tuple(c.shifts),
        ),
        frame=conditions.frame(),
        motion=conditions.motion(
            **own("kind", "via", "fly", "arc_angle", "block", "curved")
        ),
        zone=conditions.part(visits.ZoneColumns, "zone."),
        speed=conditions.part(visits.SpeedColumns),
        graph=graph,
        reason=slim(c.reason),
        reasons=tuple(c.reasons),
        literals=literals,
        dialect=dialect,
    )


def chain_visits(counts: Ints, origins: Sequence[Sequence[int]]) -> visits.Graph:
    """Say where the arm comes from: in a run of visits each follows the one before.

    Args:
        counts: Visits of every run, (r,), none of them 0.
        origins: What the first visit of each run may come from, ascending.

    >>> chain_visits(np.array([2, 1]), [[-1], [0, 1]]).pred.tolist()
    [-1, 0, 0, 1]
    """
    n, first = int(counts.sum()), np.cumsum(counts) - counts
    own = np.ones(n, dtype=np.int32)
    own[first] = [len(some) for some in origins]
    start = np.append(np.int32(0), np.cumsum(own, dtype=np.int32))
    pred = np.repeat(np.arange(-1, n - 1, dtype=np.int32), own)
    if n:
        pred[spans(start[first], own[first])] = [*chain.from_iterable(origins)]
    return visits.Graph(start, pred)


# Which numbers of which file belong to which target.


@dataclass(frozen=True)
class Numbering:
    """All statements and numbers of all files of a job.

    Attributes:
        texts: The files.
    """

    texts: Sequence[Statements[Any]]

    @cached_property
    def first(self) -> Sequence[int]:
        """Index of each file's first number, and how many there are, f + 1."""
        return [0, *accumulate(len(text.numbers) for text in self.texts)]

    @cached_property
    def rows(self) -> Sequence[int]:
        """Index of each file's first row: one more than it has belongs to each."""
        return [0, *accumulate(len(text) + 1 for text in self.texts)]

    @cached_property
    def names(self) -> Sequence[str]:
        """The names of the files."""
        return [text.source.name for text in self.texts]

    def __len__(self) -> int:
        """Return how many numbers there are."""
        return self.first[-1]

    def file_of(self, slot: int) -> int:
        """Return the file that a number stands in, -1 for none."""
        return bisect_right(self.first, slot) - 1

    def file(self, slots: Indices) -> Indices:
        """Return the file of every number."""
        found: Ints = np.searchsorted(self.first[1:], slots, side="right")
        return found.astype(np.int32)

    def places(self, slots: Indices, file: Indices) -> visits.NumberPlaces:
        """Tell where the numbers of targets stand.

        Args:
            slots: Numbers of each target, (m, w), -1 for what is not written.
            file: The file of each, (m,).
        """
        rows = max(len(slots), 1)
        return visits.NumberPlaces.join(
            map_chunks(lambda k: self._of(slots[k], file[k]), rows)
        )

    def _of(self, slots: Indices, file: Indices) -> visits.NumberPlaces:
        start, end = np.full((2, *slots.shape), -1, dtype=np.int32)
        for number in np.unique(file).tolist():
            mine = slots >= 0
            mine[file != number] = False
            own = slots[mine] - self.first[number]
            numbers = self.texts[number].numbers
            start[mine], end[mine] = numbers.starts(own), numbers.ends(own)
        return visits.NumberPlaces.of(start, end)

    def apart(self, slots: Indices) -> Bools:
        """Tell which targets have their numbers in more than one file, (k,).

        Args:
            slots: Numbers of each target, (k, w), -1 for what is not written.
        """
        found = np.zeros(len(slots), dtype=bool)
        for k in chunks(len(slots) if len(self.texts) > 1 else 0):
            file = self.file(slots[k])
            found[k] = any_in_rows((file != file[:, :1]) & (slots[k] >= 0))
        return found


def find_literals(
    columns: VisitColumns, numbering: Numbering
) -> tuple[visits.Literals, Indices]:
    """Find the distinct literals; also return the literal of every visit.

    Visits whose numbers partly belong to another target, or to another file, get none
    (-1), and a reason where they have none yet.
    """
    literal = np.full(len(columns), -1, dtype=np.int32)
    rows = np.flatnonzero(columns.slots[:, 0] >= 0)
    span = len(rows) > 0 and rows[-1] - rows[0] == len(rows) - 1  # a view, no copy
    slots = columns.slots[rows[0] : rows[-1] + 1] if span else columns.slots[rows]
    if _ascend(slots) and not numbering.apart(slots).any():
        literal[rows] = np.arange(len(rows), dtype=np.int32)
        return _literals(columns, numbering, slots, rows, literal), literal
    _, example, inverse = np.unique(slots[:, 0], return_index=True, return_inverse=True)
    distinct = slots[example]
    mixed = np.zeros(len(distinct), dtype=bool)
    odd = (slots != distinct[inverse]).any(axis=1)
    mixed[inverse[odd]] = True
    used = np.bincount(distinct[distinct >= 0], minlength=int(slots.max()) + 1)
    own = slots[odd]
    used[np.unique(own[own >= 0])] += 1
    mixed |= any_in_rows((used[distinct] > 1) & (distinct >= 0))
    mixed |= numbering.apart(distinct)
    kept = np.flatnonzero(~mixed)
    index = np.full(len(distinct), -1, dtype=np.int32)
    index[kept] = np.arange(len(kept))
    literal[rows] = index[inverse]
    first = rows[example[kept]]
    _mark_torn(columns, numbering, literal)
    return _literals(columns, numbering, distinct[kept], first, literal), literal


def _ascend(slots: Indices) -> bool:
    """Tell whether each number stands behind the one before, in a target and of all.

    Those that are not written are the last of a target.
    """
    pairs = pairwise(slots.T)
    if not all(((b < 0) | ((a >= 0) & (a < b))).all() for a, b in pairs):
        return False
    last = np.maximum.reduce([*slots.T])
    return bool((last[:-1] < slots[1:, 0]).all())


def _mark_torn(columns: VisitColumns, numbering: Numbering, literal: Indices) -> None:
    """Give a reason to targets whose numbers are no literal of their own."""
    c = columns
    torn = (literal < 0) & (c.slots[:, 0] >= 0) & (c.reason == 0)
    if not torn.any():
        return
    apart = torn & numbering.apart(c.slots)
    c.reason[torn] = c.reasons[TORN]
    if apart.any():
        c.reason[apart] = c.reasons[APART]


def _literals(
    columns: VisitColumns,
    numbering: Numbering,
    slots: Indices,
    visit: Indices,
    literal: Indices,
) -> visits.Literals:
    file = numbering.file(slots[:, 0])
    places = numbering.places(slots, file)
    line = np.zeros(len(slots), dtype=np.int32)
    for i, text in enumerate(numbering.texts):
        mine = file == i
        line[mine] = text.source.lines_of(places.first[mine])
    own, unnamed = columns.name[visit].astype(np.int64), visits.texts_of(len(slots), {})
    return visits.Literals(
        file=slim(file),
        line=line,
        places=places,
        joints=columns.meaning[visit] == visits.Meaning.JOINTS,
        name=columns.names.take(own) if own.any() else unnamed,
        shared=slim(_any(columns.shared, literal, len(slots))),
        taught=slim(_any(columns.taught, literal, len(slots))),
        pinned=unnamed,
    )


def _any(flags: Bools, literal: Indices, m: int) -> Bools:
    """Tell for each literal whether any of its visits is flagged."""
    found = np.zeros(m, dtype=bool)
    found[literal[flags & (literal >= 0)]] = True
    return found
