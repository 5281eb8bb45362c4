"""Arrays by their type, work on long ones, and numbers in the place of texts."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import count
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from postproc import _native

if TYPE_CHECKING:  # who makes none does not wait for pandas
    from pandas import DataFrame as DataFrame

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Indices = NDArray[np.signedinteger[Any]]  # Ints, or smaller ones
Bools = NDArray[np.bool_]
Signs = NDArray[np.int8]  # -1, 0, +1
Bytes = NDArray[np.uint8]
K = TypeVar("K")


def floats(rows: Floats) -> Floats:
    """Return numbers as the core takes them, row behind row."""
    return np.ascontiguousarray(rows, dtype=float)


def read_only(columns: object) -> None:
    """Refuse to have the arrays of a dataclass changed."""
    for column in vars(columns).values():
        if isinstance(column, np.ndarray):
            column.setflags(write=False)


# What long columns took is given back, not kept for later: other processes need it.

MANY = 40_000  # rows


def release_memory(rows: int = MANY) -> None:
    """Give memory that is free by now back to the system, after work on many rows."""
    if rows >= MANY:
        _native.give_back()


# Columns that hold one value throughout, kept as that value alone.


def slim(column: NDArray[Any]) -> NDArray[Any]:
    """Keep a column that holds one value throughout as that value alone.

    >>> slim(np.zeros(1000)).strides
    (0,)
    >>> slim(np.zeros((1000, 3))).base.nbytes  # of what is kept
    24
    """
    if not len(column) or is_one_value(column):
        return column
    first = column[0]
    same = column == first
    if column.dtype.kind == "f":
        same |= np.isnan(column) & np.isnan(first)
    return np.broadcast_to(np.array(first), column.shape) if same.all() else column


def narrow(values: Indices) -> NDArray[np.unsignedinteger[Any]]:
    """Keep whole numbers, none below 0, in as few bytes as the largest needs.

    >>> narrow(np.array([3, 255])).dtype, narrow(np.array([3, 256])).dtype
    (dtype('uint8'), dtype('uint16'))
    """
    return values.astype(np.min_scalar_type(int(values.max(initial=0))))


def is_one_value(column: NDArray[Any]) -> bool:
    """Tell whether a column is kept as one value."""
    return column.strides[0] == 0


def few_rows(column: NDArray[Any]) -> NDArray[Any]:
    """Return the one row of a column that is kept as one value, or all rows."""
    return column[:1] if is_one_value(column) else column


def take_rows(
    column: NDArray[Any], rows: NDArray[np.int64] | NDArray[np.bool_] | slice
) -> NDArray[Any]:
    """Take rows of a column; one value stays one value.

    >>> take_rows(slim(np.zeros(9)), np.array([2, 5])).strides
    (0,)
    """
    if isinstance(rows, slice) or not len(column) or not is_one_value(column):
        return column[rows]
    count = int(rows.sum()) if rows.dtype == bool else len(rows)
    return np.broadcast_to(column[0], (count, *column.shape[1:]))


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


# Rows of text, as the core writes them from columns.


@dataclass(frozen=True)
class Cells:
    """What stands in a column of n rows of text: values of one kind, and words.

    Attributes:
        before: What stands before it in every row.
        numbers: Numbers, (n, k); NaN is written as ``null``.
        fixed: Decimals that they are written with, as ``%.3f`` does; None: as few
            digits as Python writes.
        rounded: Decimals that they are rounded to before that, None: not at all.
        whole: Or whole numbers, (n, k).
        names, index: Or texts, and which of them it is, (n, k).
        quoted: Or texts of Latin-1 filled up with NUL, (n, w), as strings of JSON.
        between: What opens the values of a row, stands between two, and closes them.
        first: Where those of every row begin and at last end, (n + 1,), where there are
            not as many in all; k is 1 then.
        left: Rows without values, (n,).
        instead: What stands there.
    """

    before: bytes = b""
    numbers: Floats | None = None
    fixed: int | None = None
    rounded: int | None = None
    whole: Ints | None = None
    names: Sequence[bytes] = ()
    index: Ints | None = None
    quoted: Bytes | None = None
    between: tuple[bytes, bytes, bytes] = (b"", b"", b"")
    first: Ints | None = None
    left: Bools | None = None
    instead: bytes = b""

    def behind(self, text: bytes) -> Cells:
        """Put a text before it in every row."""
        return replace(self, before=text + self.before)

    def within(self, begin: bytes, between: bytes, end: bytes) -> Cells:
        """Open, part and close the values of every row."""
        return replace(self, between=(begin, between, end))

    def bracket_rows(self) -> Cells:
        """Write the values of every row as a list in square brackets."""
        return self.within(b"[", b", ", b"]")

    def group_rows(self, first: Ints) -> Cells:
        """Let every row have so many values: where they begin, and at last end."""
        return replace(self, first=np.ascontiguousarray(first, dtype=np.int64))

    def unless(self, left: Bools, instead: bytes) -> Cells:
        """Put a text in the place of some rows' values."""
        return replace(self, left=left, instead=instead)


def format_fixed(values: Floats, decimals: int) -> Cells:
    """Write numbers, (n,) or (n, k), as ``%.3f`` does for 3 decimals.

    >>> text_of(2, [format_fixed(np.array([-0.0625, np.nan]), 3), Cells(b" ")])
    b'-0.062 null '
    """
    return Cells(numbers=floats(_in_columns(values)), fixed=decimals)


def shortest(values: Floats, decimals: int | None = None) -> Cells:
    """Write numbers, (n,) or (n, k), as Python does.

    Args:
        values: The numbers.
        decimals: What they are rounded to before, None: not at all.

    >>> text_of(3, [shortest(np.array([12.5, 0.1 + 0.2, 1e-5]), 9), Cells(b" ")])
    b'12.5 0.3 1e-05 '
    """
    return Cells(numbers=floats(_in_columns(values)), rounded=decimals)


def whole(values: Indices) -> Cells:
    """Write whole numbers, (n,) or (n, k)."""
    return Cells(whole=np.ascontiguousarray(_in_columns(values), dtype=np.int64))


def format_texts(texts: Sequence[K], index: Indices, text: Callable[[K], str]) -> Cells:
    """Write one of some texts for every row, as UTF-8.

    Args:
        texts: The texts.
        index: Which one a row has, (n,) or (n, k).
        text: How it is written.
    """
    least = int(index.min(initial=len(texts)))
    used = np.bincount(index.ravel() - least) > 0
    wanted = (np.flatnonzero(used) + least).tolist()
    at = (np.cumsum(used) - 1)[index - least]
    names = tuple(text(texts[k]).encode() for k in wanted)
    return Cells(names=names, index=np.ascontiguousarray(_in_columns(at)))


def text_of(
    n: int, columns: Sequence[Cells], given: Mapping[int, bytes] | None = None
) -> bytes:
    """Write n rows, one behind the other.

    Args:
        n: How many there are.
        columns: What they are made of.
        given: Rows that are given as texts instead.
    """
    return _native.table(n, columns, given or {})


def _in_columns(values: NDArray[Any]) -> NDArray[Any]:
    return values.reshape(len(values), -1) if len(values) else values.reshape(0, 1)


# Long arrays in chunks: what a chunk needs stays in the cache.

T = TypeVar("T")
CHUNK = 2048  # rows at a time


def map_chunks(
    work: Callable[[slice], T], n: int, size: int = CHUNK, threads: int = 1
) -> list[T]:
    """Do the work on slices of n rows; return what comes of each, in order.

    Args:
        work: What to do.
        n: How many rows there are.
        size: Rows of a slice.
        threads: How many slices are worked on at a time. The interpreter's lock is free
            while numpy and the core work.

    >>> map_chunks(lambda rows: (rows.start, rows.stop), 5, 2)
    [(0, 2), (2, 4), (4, 5)]
    """
    if threads == 1 or n <= size:
        return [work(rows) for rows in chunks(n, size)]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, chunks(n, size)))


def chunks(n: int, size: int = CHUNK) -> Iterator[slice]:
    """Cut n rows into slices."""
    return (slice(a, min(a + size, n)) for a in range(0, n, size))


# Many short stretches of a long array, as one list of places.


def spans(begin: Indices, count: Indices) -> Ints:
    """List begin, begin + 1, .., begin + count - 1 of every span.

    >>> spans(np.array([3, 10]), np.array([2, 3])).tolist()
    [3, 4, 10, 11, 12]
    """
    if len(begin) == 1:
        return np.arange(begin[0], begin[0] + count[0], dtype=np.int64)
    offset = np.cumsum(count) - count
    return np.repeat(begin - offset, count) + np.arange(int(count.sum()))


def isin_sorted(values: Indices, some: Indices) -> Bools:
    """Tell which values, (n,), are among some in ascending order, (m,).

    >>> isin_sorted(np.array([7, 2, 9]), np.array([2, 5, 9])).tolist()
    [False, True, True]
    """
    if not len(some):
        return np.zeros(len(values), dtype=bool)
    at = np.minimum(np.searchsorted(some, values), len(some) - 1)
    return np.asarray(some[at] == values)


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


# Tables for people who work in Python.


def columns_of(names: Sequence[str], rows: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Name the columns of rows (n, k), which may be none."""
    return {name: rows[:, k] for k, name in enumerate(names)} if len(rows) else {}


def data_frame(columns: Mapping[str, Any]) -> DataFrame:
    """Make a data frame of columns of equal length, by their names.

    pandas takes a third of a second to load: nobody else loads it.
    """
    from pandas import DataFrame

    return DataFrame(dict(columns))
