"""Numbers of the rows of `diff` as columns of bytes, some thousand at a time.

Rows with text, with many numbers, with visits of several statuses or with names that
cannot be printed are few: whoever writes rows writes them one by one, as `Row`, and
asks here which they are.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import Ints, pieces
from postproc.byte_columns import Column
from postproc.rows import Rows

AT_ONCE = 5_000  # rows
MOST = 12  # numbers of a row that is written with others


def single_rows(rows: Rows) -> Ints:
    """Return the rows that are written one by one."""
    count = np.diff(rows.first)
    many = count > MOST
    many[list(rows.texts)] = True
    finite = np.isfinite(rows.original) & np.isfinite(rows.compensated)
    many[np.repeat(np.arange(len(rows)), count)[~finite]] = True
    many |= rows.has_change & ~np.isfinite(rows.change_mm)
    if rows.told is not None and len(rows.told.line):
        many |= ~np.isfinite(rows.told.correction_mm)[rows.entry]
        unclear = ~np.array([why.isprintable() for why in rows.told.reasons])
        many |= unclear[rows.told.why[rows.entry]]
        many |= np.isin(rows.entry, [*rows.told.mixed])
    return np.flatnonzero(many)


def blocks_of(rows: Rows) -> Iterator[tuple[Ints, Ints]]:
    """Cut rows: yield the rows of each block, and those that are written one by one."""
    single = single_rows(rows)
    for some in pieces(len(rows), AT_ONCE):
        here = (single >= some.start) & (single < some.stop)
        yield np.arange(some.start, some.stop), single[here]


def number_places(first: Ints, k: Ints) -> tuple[Ints, Ints]:
    """Return where the numbers of some rows stand, and the row (from 0) of each.

    Args:
        first: CSR offsets of all rows.
        k: Rows.
    """
    count = first[k + 1] - first[k]
    owner = np.repeat(np.arange(len(k)), count)
    before = np.cumsum(count) - count
    return np.arange(len(owner)) + (first[k] - before)[owner], owner


def strung(cells: Column, owner: Ints, rows: int, between: bytes) -> Column:
    """Put the texts of every row beside each other.

    Args:
        cells: Texts, row by row.
        owner: The row of each, ascending.
        rows: How many rows there are.
        between: What stands between two texts.
    """
    count = np.bincount(owner, minlength=rows)
    at = np.arange(len(owner)) - (np.cumsum(count) - count)[owner]
    width = cells.shape[1] + len(between)
    out = np.zeros((rows, int(count.max(initial=0)), width), dtype=np.uint8)
    out[owner, at, len(between) :] = cells
    later = at > 0
    out[owner[later], at[later], : len(between)] = np.frombuffer(between, np.uint8)
    return out.reshape(rows, -1)
