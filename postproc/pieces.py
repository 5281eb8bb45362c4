"""Work on long arrays in pieces: what a piece needs stays in the cache."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TypeVar

T = TypeVar("T")
PIECE = 2048  # rows at a time


def in_pieces(work: Callable[[slice], T], n: int, size: int = PIECE) -> list[T]:
    """Do the work on slices of n rows, one after the other.

    >>> in_pieces(lambda rows: (rows.start, rows.stop), 5, 2)
    [(0, 2), (2, 4), (4, 5)]
    """
    return [work(rows) for rows in pieces(n, size)]


def pieces(n: int, size: int = PIECE) -> Iterator[slice]:
    """Cut n rows into slices."""
    return (slice(a, min(a + size, n)) for a in range(0, n, size))
