"""Two readings of one program: do both make the same moves to the same values?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace

import numpy as np

from postproc.arrays import Ints
from postproc.language.source import Edit, Source
from postproc.language.visits import Visits
from postproc.planning import Reading

_APART = frozenset(
    "line config configs literal literals follows name names reason reasons".split()
)
"""Columns that are numbered anew, or speak of lines: they are compared by meaning."""


def same_moves(
    before: Reading,
    after: Reading,
    edits: Sequence[Sequence[Edit]],
    names: Mapping[int, str],
) -> Visits | None:
    """Compare a program with itself after clones.

    Every visit must be there, in the same order, with the same predecessors, numbers,
    frames and settings, from the same line; its numbers must stand in a literal of its
    own exactly where it goes to a clone.

    Args:
        before: The program.
        after: The program with clones, read anew.
        edits: The edits between them, file by file.
        names: The clone that each separated visit goes to.

    Returns:
        The visits after it, with the lines of the program before; None where they
        differ.
    """
    v, w = before.visits, after.visits
    columns = [f.name for f in fields(Visits) if f.name not in _APART]
    if len(v) != len(w) or any(_differ(getattr(v, n), getattr(w, n)) for n in columns):
        return None
    if _configs(v) != _configs(w) or ((v.reason > 0) != (w.reason > 0)).any():
        return None
    if _origin(before.sources, after.sources, edits, w) != v.line.tolist():
        return None
    wanted = [names.get(i, v.names[k]) for i, k in enumerate(v.name.tolist())]
    if wanted != [w.names[k] for k in w.name.tolist()]:
        return None
    pairs = _pairs(v, w, names)
    if pairs is None:
        return None
    line = np.zeros(len(w.literals), dtype=np.int64)
    line[pairs[1]] = v.literals.line[pairs[0]]
    return replace(w, line=v.line, literals=replace(w.literals, line=line))


def _configs(visits: Visits) -> list[str]:
    return [visits.configs[k] for k in visits.config.tolist()]


def _differ(a: object, b: object) -> bool:
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return not np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    return a != b


def _origin(
    before: Sequence[Source],
    after: Sequence[Source],
    edits: Sequence[Sequence[Edit]],
    visits: Visits,
) -> list[int]:
    """Give the lines of visits as they were before the edits."""
    lines = np.array(visits.line)
    for file, (old, new, own) in enumerate(zip(before, after, edits, strict=True)):
        mine = visits.file == file
        start = new.line_starts[visits.line[mine] - 1]
        shift = np.zeros(len(start), dtype=np.int64)
        moved = 0
        for (begin, end), text in sorted(own, key=lambda edit: edit.span):
            behind = start >= begin + moved + len(text)
            moved += len(text) - (end - begin)
            shift[behind] = moved
        lines[mine] = np.searchsorted(old.line_starts, start - shift, side="right")
    return [int(line) for line in lines]


def _pairs(v: Visits, w: Visits, names: Mapping[int, str]) -> tuple[Ints, Ints] | None:
    """Match literals: one before and after for every visit that has one.

    Returns:
        Literals before and after, visit by visit; None where visits share a literal
        after the clones that they did not share before, or no longer do.
    """
    has = np.flatnonzero(v.literal >= 0)
    if not np.array_equal(has, np.flatnonzero(w.literal >= 0)):
        return None
    old = [(int(v.literal[i]), names.get(i, "")) for i in has.tolist()]
    new = w.literal[has].tolist()
    both = set(zip(old, new, strict=True))
    if not len(both) == len(set(old)) == len(set(new)):
        return None
    return v.literal[has], w.literal[has]
