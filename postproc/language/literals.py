"""Which numbers of which file belong to which target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools
from postproc.language.source import Source
from postproc.language.visits import Literals, Target
from postproc.language.world import World

Ints = NDArray[np.signedinteger[Any]]


class SlotColumns(Protocol):
    """What is needed of the visits' columns."""

    slots: Ints
    target: Ints
    name: Ints
    taught: Bools
    shared: Bools


class _Texts(Protocol):
    def texts(self) -> tuple[str, ...]:
        """Return the names by index."""


@dataclass(frozen=True)
class Numbering:
    """All numbers of all files of a job.

    Attributes:
        sources: The files.
        first: Index of each file's first number, (f,).
        start, end: Byte offsets in its file, (m,).
    """

    sources: tuple[Source, ...]
    first: Ints
    start: Ints
    end: Ints

    @staticmethod
    def of(world: World) -> Numbering:
        """Number the files of a job as its slots are."""
        numbered = [
            (p.lines.source, p.lines.start, p.lines.end) for p in world.programs()
        ]
        if world.variables is not None:
            v = world.variables
            numbered.append((v.source, v.start, v.end))
        first = [world.slot_base[source.name] for source, _, _ in numbered]
        return Numbering(
            tuple(source for source, _, _ in numbered),
            np.array(first, dtype=np.int64),
            _together([start for _, start, _ in numbered]),
            _together([end for _, _, end in numbered]),
        )

    def apart(self, slots: Ints) -> Bools:
        """Tell which targets have their numbers in more than one file, (k,).

        Args:
            slots: Six numbers of each target, (k, 6).
        """
        if len(self.first) == 1:
            return np.zeros(len(slots), dtype=bool)
        file = np.searchsorted(self.first, slots, side="right")
        different: Bools = (file != file[:, :1]).any(axis=1)
        return different


def _together(columns: list[Ints]) -> Ints:
    """Put the columns of files one after the other; one by itself is not copied."""
    return columns[0] if len(columns) == 1 else np.concatenate(columns)


def find_literals(
    columns: SlotColumns, numbering: Numbering, names: _Texts
) -> tuple[Literals, Ints]:
    """Find the distinct literals; also return the literal of every visit.

    Visits whose numbers partly belong to another target, or to another file, get none
    (-1).
    """
    literal = np.full(len(columns.slots), -1, dtype=np.int64)
    rows = np.flatnonzero(columns.slots[:, 0] >= 0)
    slots = columns.slots[rows]
    _, example, inverse = np.unique(slots[:, 0], return_index=True, return_inverse=True)
    distinct = slots[example]
    mixed = np.zeros(len(distinct), dtype=bool)
    mixed[inverse[(slots != distinct[inverse]).any(axis=1)]] = True
    used = np.bincount(distinct.ravel(), minlength=len(numbering.start))
    mixed |= (used[distinct] > 1).any(axis=1) | numbering.apart(distinct)
    kept = np.flatnonzero(~mixed)
    index = np.full(len(distinct), -1, dtype=np.int64)
    index[kept] = np.arange(len(kept))
    literal[rows] = index[inverse]
    first = rows[example[kept]]
    return _literals(columns, numbering, names, distinct[kept], first, literal), literal


def _literals(
    columns: SlotColumns,
    numbering: Numbering,
    names: _Texts,
    slots: Ints,
    visit: Ints,
    literal: Ints,
) -> Literals:
    file = np.searchsorted(numbering.first, slots[:, 0], side="right") - 1
    start, end = numbering.start[slots], numbering.end[slots]
    line = np.zeros(len(slots), dtype=np.int64)
    for i, source in enumerate(numbering.sources):
        mine = file == i
        places = start[mine].min(axis=1) if mine.any() else start[mine][:, 0]
        line[mine] = np.searchsorted(source.line_starts, places, side="right")
    texts = names.texts()
    return Literals(
        file=file.astype(np.int64),
        line=line,
        start=start,
        end=end,
        joints=columns.target[visit] == Target.JOINTS,
        name=tuple(map(texts.__getitem__, columns.name[visit].tolist())),
        shared=_any(columns.shared, literal, len(slots)),
        taught=_any(columns.taught, literal, len(slots)),
        pinned=("",) * len(slots),
    )


def _any(flags: Bools, literal: Ints, m: int) -> Bools:
    """Tell for each literal whether any of its visits is flagged."""
    found = np.zeros(m, dtype=bool)
    found[literal[flags & (literal >= 0)]] = True
    return found
