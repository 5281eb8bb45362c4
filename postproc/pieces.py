"""Work on long arrays in pieces: what a piece needs stays in the cache."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol, TypeVar

K = TypeVar("K")
T = TypeVar("T")
PIECE = 2048  # rows at a time


class Each(Protocol):
    """How something is made of every task, in order: by `map`, or on two cores."""

    def __call__(self, make: Callable[[K], T], tasks: Sequence[K], /) -> Iterator[T]:
        """Make something of every task."""


def in_pieces(work: Callable[[slice], T], n: int, size: int = PIECE) -> list[T]:
    """Do the work on slices of n rows, one after the other.

    >>> in_pieces(lambda rows: (rows.start, rows.stop), 5, 2)
    [(0, 2), (2, 4), (4, 5)]
    """
    return [work(rows) for rows in pieces(n, size)]


def pieces(n: int, size: int = PIECE) -> Iterator[slice]:
    """Cut n rows into slices."""
    return (slice(a, min(a + size, n)) for a in range(0, n, size))
