"""Rows that are alike, numbered in the order in which they appear."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from itertools import count
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Ints

AnyInts = NDArray[np.signedinteger[Any]]

T = TypeVar("T", bytes, str)

_SHORT = 12  # longer sequences are told apart in Python


class Numbers(defaultdict[T, int]):
    """Numbers of texts, in the order in which they are asked for first."""

    def __init__(self) -> None:
        """Begin at 0."""
        super().__init__(count().__next__)

    def of(self, texts: Sequence[T]) -> Ints:
        """Return the numbers of texts, (n,)."""
        return np.fromiter(map(self.__getitem__, texts), np.int64, len(texts))


def alike(values: AnyInts, first: AnyInts, last: AnyInts) -> Ints:
    """Number sequences of whole numbers so that equal ones have the same number, (k,).

    Args:
        values: The numbers, (m,).
        first: Every sequence is values[first:last], (k,).
        last: See there.

    >>> alike(np.array([7, 8, 7, 8, 9]), np.array([0, 2, 2]), np.array([2, 4, 5]))
    array([0, 0, 1])
    """
    length = last - first
    if int(length.max(initial=0)) <= _SHORT:
        return _by_columns(values, first, length)
    data = np.ascontiguousarray(values, dtype=np.int32).tobytes()
    ends = zip((4 * first).tolist(), (4 * last).tolist(), strict=True)
    return Numbers[bytes]().of([data[a:b] for a, b in ends])


def _by_columns(values: AnyInts, first: AnyInts, length: AnyInts) -> Ints:
    """Number sequences: first by their lengths, then by one value after the other."""
    kind, rows = in_order(length)[0], np.arange(len(first))
    size = int(values.max(initial=0)) + 1
    for at in range(int(length.max(initial=0))):
        rows = rows[length[rows] > at]
        others = int(kind.max()) + 1
        pairs = kind[rows] * size + values[first[rows] + at]
        kind[rows] = others + in_order(pairs)[0]
    return in_order(kind)[0]


def in_order(keys: AnyInts) -> tuple[Ints, Ints]:
    """Number keys in the order in which they appear.

    Args:
        keys: Whole numbers from 0 on, (n,).

    Returns:
        The number of every row, (n,), and the first row of every number.

    >>> in_order(np.array([5, 2, 5]))
    (array([0, 1, 0]), array([0, 1]))
    """
    if len(keys) == 0:
        none = np.zeros(0, dtype=np.int64)
        return none, none
    if int(keys.max()) <= 2 * len(keys) + 1000:
        rows = np.arange(len(keys))[::-1]
        at = np.full(int(keys.max()) + 1, -1)
        at[keys[::-1]] = rows  # the last one that is written stays: the first row
        first = np.sort(at[at >= 0])
        rank = np.empty_like(at)
        rank[keys[first]] = np.arange(len(first))
        return rank[keys], first
    _, example, which = np.unique(keys, return_index=True, return_inverse=True)
    order = np.argsort(example)
    ranks = np.empty(len(order), dtype=np.int64)
    ranks[order] = np.arange(len(order))
    return ranks[which.ravel()], example[order]
