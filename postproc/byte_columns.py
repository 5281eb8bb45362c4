"""Texts of thousands of rows as columns of bytes, put side by side without a loop.

A column is an array of bytes (k, w), filled up with NUL, which no text holds: rows are
what is left of all columns, in order, without the NULs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from postproc import _native
from postproc.arrays import Bools, Floats, Ints, floats

ByteColumn = NDArray[np.uint8]
T = TypeVar("T")


def joined(columns: Sequence[ByteColumn | bytes]) -> bytes:
    """Return the rows one after the other; bytes are the same text in every row."""
    return beside(columns).tobytes().translate(None, b"\0")


def beside(columns: Sequence[ByteColumn | bytes]) -> ByteColumn:
    """Put columns side by side; bytes are the same text in every row."""
    rows = max(len(c) for c in columns if isinstance(c, np.ndarray))
    parts = [repeated(c, rows) if isinstance(c, bytes) else c for c in columns]
    return np.concatenate(parts, axis=1)


def repeated(text: bytes, rows: int) -> ByteColumn:
    """Return a text as a column."""
    return np.broadcast_to(np.frombuffer(text, dtype=np.uint8), (rows, len(text)))


def named(
    texts: Sequence[T], index: NDArray[np.integer], text: Callable[[T], str]
) -> ByteColumn:
    """Write one of some texts for every row, as UTF-8.

    Args:
        texts: The texts.
        index: Which one a row has.
        text: How it is written.
    """
    least = int(index.min(initial=len(texts)))
    used = np.bincount(index - least) > 0
    wanted = (np.flatnonzero(used) + least).tolist()
    table = np.array([text(texts[k]).encode() for k in wanted], dtype="S")
    at = (np.cumsum(used) - 1)[index - least]
    rows: ByteColumn = table.view(np.uint8).reshape(len(wanted), -1)[at]
    return rows


def blanked(column: ByteColumn, rows: Bools, text: bytes) -> ByteColumn:
    """Put a text in the place of some rows."""
    if not rows.any():
        return column
    out = np.zeros((len(column), max(column.shape[1], len(text))), dtype=np.uint8)
    out[:, : column.shape[1]] = column
    out[rows] = 0
    out[rows, : len(text)] = np.frombuffer(text, dtype=np.uint8)
    return out


def listed(columns: Sequence[ByteColumn]) -> ByteColumn:
    """Return a column of lists in square brackets."""
    parts: list[ByteColumn | bytes] = [b"["]
    for number, column in enumerate(columns):
        parts += [b", ", column] if number else [column]
    return beside([*parts, b"]"])


def whole(values: Ints) -> ByteColumn:
    """Write whole numbers from 0 on."""
    return fixed(values.astype(float), 0)


def fixed(values: Floats, decimals: int) -> ByteColumn:
    """Write numbers as ``%.3f`` does for 3 decimals, (k,); NaN becomes ``null``.

    >>> joined([fixed(np.array([-0.0625, 12345.678, np.nan]), 3), b" "])
    b'-0.062 12345.678 null '
    """
    return _native.fixed(floats(values), decimals)


def shortest(values: Floats, decimals: int | None = None) -> ByteColumn:
    """Write numbers as Python does, (k,); NaN becomes ``null``.

    Args:
        values: (k,).
        decimals: What they are rounded to before, None: not at all.

    >>> joined([shortest(np.array([12.5, -3.0, 0.1 + 0.2, 1e-5]), 9), b" "])
    b'12.5 -3.0 0.3 1e-05 '
    """
    return _native.shortest(floats(values), decimals)
