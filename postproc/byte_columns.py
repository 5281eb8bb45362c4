"""Texts of thousands of rows as columns of bytes, put side by side without a loop.

A column is an array of bytes (k, w), filled up with NUL, which no text holds: rows are
what is left of all columns, in order, without the NULs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Floats, Ints

ByteColumn = NDArray[np.uint8]
T = TypeVar("T")

TIE = 1e-4  # nearer to halfway than this the last digit is left to Python
MOST = 1e10  # scaled numbers from here on, too: they are not exact enough
EXACT = 8  # decimals that are written here
_FOUR = 10_000


_NUMBERS = np.arange(_FOUR)
_BARE = _NUMBERS.astype("S4").view(np.uint32)  # four digits in one piece
_FULL = np.strings.zfill(_NUMBERS.astype("S4"), 4).view(np.uint32)
_MORE = np.where(_NUMBERS > 0, _BARE, np.uint32(0))  # 0: nothing


def joined(columns: Sequence[ByteColumn | bytes]) -> bytes:
    """Return the rows one after the other; bytes are the same text in every row."""
    return beside(columns).tobytes().translate(None, b"\0")


def as_texts(column: ByteColumn) -> NDArray[np.bytes_]:
    """Return the rows by themselves, (k,)."""
    held = column != 0
    length = np.count_nonzero(held, axis=1)
    width = max(int(length.max(initial=0)), 1)
    rows = np.zeros((len(column), width), dtype=np.uint8)
    rows[np.arange(width) < length[:, None]] = column[held]
    texts: NDArray[np.bytes_] = rows.view(f"S{width}")[:, 0]
    return texts


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
    """Write numbers as ``%.3f`` does for 3 decimals; NaN becomes ``null``.

    Args:
        values: (k,).
        decimals: More than 8 are left to Python.

    >>> joined([fixed(np.array([-0.0625, 12345.678, np.nan]), 3), b" "])
    b'-0.062 12345.678 null '
    """
    few = min(decimals, EXACT)
    with np.errstate(invalid="ignore", over="ignore"):
        scaled = np.abs(values) * 10.0**few
        sure = (scaled < MOST) & (np.abs(scaled - np.floor(scaled) - 0.5) > TIE)
    sure &= decimals == few
    rounded = np.rint(np.where(sure, scaled, 0.0)).astype(np.int64)
    rows = _written(rounded, few, np.signbit(values))
    rows = blanked(rows, np.isnan(values), b"null")
    return _by_python(
        rows, values, ~(sure | np.isnan(values)), f"%.{decimals}f".__mod__
    )


def short(value: float) -> str:
    """Write a number as Python does, rounded to 9 decimals."""
    return repr(round(value, 9))


def shortest(
    values: Floats, decimals: int = 5, text: Callable[[float], str] = short
) -> ByteColumn:
    """Write numbers as Python does, rounded to 9 decimals; NaN becomes ``null``.

    Numbers of few decimals are exact in that many, and what is shorter is the same
    without zeros at the end.

    Args:
        values: (k,).
        decimals: What most numbers are written with at most, 2 to 8.
        text: How a number with more decimals is written.

    >>> joined([shortest(np.array([12.5, -3.0, 0.1 + 0.2, 1e-5])), b" "])
    b'12.5 -3.0 0.3 1e-05 '
    """
    size = np.abs(values)
    with np.errstate(invalid="ignore"):
        scaled = np.rint(size * 10.0**decimals)
        sure = (scaled < MOST) & (scaled / 10.0**decimals == size)
        sure &= (size >= 1e-4) | (size == 0.0)  # smaller ones have an exponent
    rows = _written(
        np.where(sure, scaled, 0.0).astype(np.int64), decimals, np.signbit(values)
    )
    ends = np.ones(len(rows), dtype=bool)
    for column in range(rows.shape[1] - 1, rows.shape[1] - decimals, -1):
        ends &= rows[:, column] == ord("0")
        rows[:, column] *= ~ends
    rows = blanked(rows, np.isnan(values), b"null")
    return _by_python(rows, values, ~(sure | np.isnan(values)), text)


def _written(scaled: Ints, decimals: int, negative: Bools) -> ByteColumn:
    """Write numbers that are whole when scaled, with their sign."""
    before = scaled // 10**decimals
    after = scaled - before * 10**decimals
    high = before // _FOUR
    low = before - high * _FOUR
    higher = high // _FOUR
    sign = np.where(negative, ord("-"), 0).astype(np.uint8)[:, None]
    parts = [sign]
    if higher.any():
        parts += [_bytes(_MORE.take(higher))]
    if high.any():
        high -= higher * _FOUR
        parts += [_bytes(np.where(higher > 0, _FULL.take(high), _MORE.take(high)))]
        long = before >= _FOUR
        parts += [_bytes(np.where(long, _FULL.take(low), _BARE.take(low)))]
    else:
        parts += [_bytes(_BARE.take(low))]
    if decimals:
        parts.append(repeated(b".", len(scaled)))
    for left in range(decimals, 0, -4):  # digits that are still to be written
        rest = 10 ** max(left - 4, 0)
        four = after // rest
        after = after - four * rest
        parts.append(_bytes(_FULL.take(four))[:, max(4 - left, 0) :])
    return np.concatenate(parts, axis=1)


def _bytes(four: NDArray[np.uint32]) -> ByteColumn:
    """Return texts of four digits as a column."""
    return four.view(np.uint8).reshape(-1, 4)


def _by_python(
    rows: ByteColumn, values: Floats, some: Bools, text: Callable[[float], str]
) -> ByteColumn:
    """Write some numbers one by one."""
    if not some.any():
        return rows
    texts = np.array([text(value).encode() for value in values[some].tolist()])
    own = texts.view(np.uint8).reshape(len(texts), -1)
    rows = blanked(rows, some, b" " * own.shape[1])
    rows[some, : own.shape[1]] = own
    return rows
