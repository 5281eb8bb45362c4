"""Arrays by their type, work on long ones, and numbers in the place of texts."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import count
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Indices = NDArray[np.signedinteger[Any]]  # Ints, or smaller ones
Bools = NDArray[np.bool_]
Signs = NDArray[np.int8]  # -1, 0, +1
Bytes = NDArray[np.uint8]


def floats(rows: Floats) -> Floats:
    """Return numbers as the core takes them, row behind row."""
    return np.ascontiguousarray(rows, dtype=float)


def read_only(columns: object) -> None:
    """Refuse to have the arrays of a dataclass changed."""
    for column in vars(columns).values():
        if isinstance(column, np.ndarray):
            column.setflags(write=False)


# Rows of few columns: numpy goes along rows, we go down columns, several times as fast.


def any_in_rows(told: Bools) -> Bools:
    """Tell which rows (n, k) hold a True, (n,).

    >>> any_in_rows(np.array([[False, True], [False, False]])).tolist()
    [True, False]
    """
    return np.asarray(np.logical_or.reduce(list(told.T)))


def all_in_rows(told: Bools) -> Bools:
    """Tell which rows (n, k) hold nothing but True, (n,).

    >>> all_in_rows(np.array([[False, True], [True, True]])).tolist()
    [False, True]
    """
    return np.asarray(np.logical_and.reduce(list(told.T)))


def largest_in_rows(values: Floats) -> Floats:
    """Return the largest value of every row (n, k), (n,); NaN where there is one.

    >>> largest_in_rows(np.array([[1.0, 3.0], [2.0, np.nan]])).tolist()
    [3.0, nan]
    """
    return np.asarray(np.maximum.reduce(list(values.T)))


# Long arrays in chunks: what a chunk needs stays in the cache.

K = TypeVar("K")
T = TypeVar("T")
CHUNK = 2048  # rows at a time


class Map(Protocol):
    """How something is made of every task, in order: by `map`, or on two cores."""

    def __call__(self, make: Callable[[K], T], tasks: Sequence[K], /) -> Iterator[T]:
        """Make something of every task."""


def in_chunks(work: Callable[[slice], T], n: int, size: int = CHUNK) -> list[T]:
    """Do the work on slices of n rows, one after the other.

    >>> in_chunks(lambda rows: (rows.start, rows.stop), 5, 2)
    [(0, 2), (2, 4), (4, 5)]
    """
    return [work(rows) for rows in chunks(n, size)]


def chunks(n: int, size: int = CHUNK) -> Iterator[slice]:
    """Cut n rows into slices."""
    return (slice(a, min(a + size, n)) for a in range(0, n, size))


# Many short stretches of a long array, as one list of places.


def spans(begin: Ints, count: Ints) -> Ints:
    """List begin, begin + 1, .., begin + count - 1 of every span.

    >>> spans(np.array([3, 10]), np.array([2, 3])).tolist()
    [3, 4, 10, 11, 12]
    """
    offset = np.cumsum(count) - count
    return np.repeat(begin - offset, count) + np.arange(int(count.sum()))


# Texts that stand in many rows, once each; rows hold their numbers.


class Interned(defaultdict[K, int]):
    """Things by number, in the order in which they are asked for first.

    >>> names = Interned([""])
    >>> names["wp_1"], names[""], names.of(["wp_2", "wp_1"]).tolist(), tuple(names)
    (1, 0, [2, 1], ('', 'wp_1', 'wp_2'))
    """

    def __init__(self, first: Iterable[K] = ()) -> None:
        """Number some things from 0 on."""
        super().__init__(count().__next__)
        self.of([*first])

    def of(self, things: Sequence[K]) -> Ints:
        """Return the numbers of things, (n,)."""
        return np.fromiter(map(self.__getitem__, things), np.int64, len(things))
