"""Two readings of one program: the same moves, to the numbers that were meant?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats, Interned, Ints, chunks
from postproc.language.text.templates import number_in_order
from postproc.language.visits import Visits

SAME = 1e-6  # [mm] and [deg]: what adding constants to numbers may round off
ROUNDED = 1e-14  # share of a number within which what is computed is the same
ROWS = 50_000  # compared at a time: what that takes is small beside two readings
NO_CLONES: Mapping[int, str] = MappingProxyType({})

_OTHERWISE = frozenset(
    "line values literal literals follows config configs name names reason reasons"
    " shift shifts".split()
)  # fmt: skip
"""Columns that edits change, that renumber, or that name lines."""


def equivalent(
    before: Visits,
    after: Visits,
    edited: Ints,
    values: Floats,
    clones: Mapping[int, str] = NO_CLONES,
) -> str:
    """Say in what a program that was edited differs otherwise than it should.

    Every visit must be there, in the same order, with the same predecessors, frames
    and settings. Its numbers are those that are meant, and stand in a literal of their
    own exactly where it goes to a clone.

    Args:
        before: The program.
        after: The edited program, read anew.
        edited: Literals of the program that were given new numbers, (m,).
        values: Numbers that are meant, (n, 6). Those of targets that are computed
            from edited ones may be rounded off.
        clones: The clone that each separated visit goes to.

    Returns:
        What differs, "" where nothing does.
    """
    if len(before) != len(after) or not _same_literals(before, after, clones):
        return "the output makes other moves"
    return (
        _other_number(before, after, edited, values)
        or _other_text(before, after, clones)
        or _other_column(before, after)
    )


def _same_literals(v: Visits, w: Visits, clones: Mapping[int, str]) -> bool:
    """Tell whether visits share literals as they did, but for those of clones."""
    if not _same(v.target.shift >= 0, w.target.shift >= 0):
        return False
    if not clones:
        return _same(v.target.literal, w.target.literal) and _same(
            v.target.follows, w.target.follows
        )
    if not np.array_equal(v.target.literal < 0, w.target.literal < 0):
        return False
    names, own = Interned([""]), np.zeros(len(v), dtype=np.int64)
    own[[*clones]] = names.of([*clones.values()])
    has = np.flatnonzero(v.target.literal >= 0)
    old, _ = number_in_order(v.target.literal[has] * len(names) + own[has])
    return np.array_equal(old, number_in_order(w.target.literal[has])[0])


def _other_number(v: Visits, w: Visits, edited: Ints, values: Floats) -> str:
    """Say which kind of number is not what is meant."""
    changes = np.append(np.zeros(len(v.literals), dtype=bool), False)  # none: -1
    changes[edited] = True
    for rows in chunks(len(v), ROWS):
        kept = ~(changes[v.target.literal[rows]] | changes[v.target.follows[rows]])
        wanted, read = values[rows], w.target.values[rows]
        if not _same(v.target.values[rows][kept], read[kept]):
            return "a target changed that was to be kept"
        computed = (v.target.follows[rows] >= 0) | (v.target.shift[rows] >= 0)
        if not _same(wanted[~computed], read[~computed]):
            return "a number does not read as it was meant"
        own = wanted[computed], read[computed]
        if not np.allclose(*own, rtol=ROUNDED, atol=SAME, equal_nan=True):
            return "a computed target changed otherwise"
    return ""


def _other_text(v: Visits, w: Visits, clones: Mapping[int, str]) -> str:
    """Say which column of texts differs; reasons may speak of lines."""
    if not _same_texts(
        v.target.configs, v.target.config, w.target.configs, w.target.config
    ):
        return "the output has another config"
    texts, name = v.target.names, v.target.name
    if clones:
        own, name = Interned(texts), np.array(name)
        name[[*clones]] = own.of([*clones.values()])
        texts = tuple(own)
    if not _same_texts(texts, name, w.target.names, w.target.name):
        return "the output has another name"
    if not np.array_equal(v.reason > 0, w.reason > 0):
        return "the output has another reason"
    return ""


def _same_texts(a: Sequence[str], i: Ints, b: Sequence[str], j: Ints) -> bool:
    """Tell whether rows have the same texts, by their indices."""
    if a == b:
        return np.array_equal(i, j)
    return [a[k] for k in i.tolist()] == [b[k] for k in j.tolist()]


def _other_column(v: Visits, w: Visits) -> str:
    """Say which of the other columns differs."""
    if v.files != w.files or v.dialect != w.dialect:
        return "the output has other files"
    for part in (*v.parts, "graph"):
        before, after = getattr(v, part), getattr(w, part)
        names = (f.name for f in fields(before))
        for name in (n for n in names if n not in _OTHERWISE):
            a, b = getattr(before, name), getattr(after, name)
            if not (_same(a, b) if isinstance(a, np.ndarray) else a == b):
                return f"the output has another {part}: {name}"
    return ""


def _same(a: NDArray[Any], b: NDArray[Any]) -> bool:
    """Compare two columns; NaN equals NaN."""
    return a.shape == b.shape and all(
        np.array_equal(a[rows], b[rows], equal_nan=a.dtype.kind == "f")
        for rows in chunks(len(a), ROWS)
    )
