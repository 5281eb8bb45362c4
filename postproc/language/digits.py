"""Numbers as text, a million at a time: fixed-width rows of bytes instead of strings.

Only plain decimal numbers are treated here, and only values that round without doubt;
the functions tell which. The others are for `lexis` and Python's own formatting, one by
one, which define what all of it means.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Bytes, Floats, Ints

Texts = NDArray[np.bytes_]

WIDEST = 24  # bytes of a number that is read here
MOST_DIGITS = 15  # of a number that is written here: exact as a float
TIE = 1e-4  # nearer to halfway than this the last digit is not sure
_TENS = 10.0 ** np.arange(MOST_DIGITS + 1)
_DOT, _MINUS, _ZERO = 46, 45, 48


def cut(data: bytes, start: Ints, end: Ints) -> tuple[Texts, Bools]:
    """Cut numbers out of a text.

    Args:
        data: The text.
        start: Offsets at which numbers begin, (m,).
        end: Offsets at which they end, (m,).

    Returns:
        The texts, (m,), and which of them are plain: digits with or without a dot,
        after a minus or nothing.
    """
    a = np.frombuffer(data, dtype=np.uint8)
    length = end - start
    width = int(min(length.max(initial=1), WIDEST))
    rows = np.zeros((len(start), width), dtype=np.uint8)
    plain, dots = length <= width, np.zeros(len(start), dtype=np.int64)
    for k in range(width):
        inside = k < length
        byte = np.where(inside, a[np.minimum(start + k, len(a) - 1)], 0)
        digit = (byte >= _ZERO) & (byte < _ZERO + 10)
        dot = byte == _DOT
        dots += dot
        plain &= digit | dot | ~inside | ((byte == _MINUS) & (k == 0))
        rows[:, k] = byte
    digits = length - dots - (rows[:, 0] == _MINUS)
    plain &= (dots <= 1) & (digits > 0)
    return _texts(rows), plain


def decimals(texts: Texts) -> Ints:
    """Count the decimals of plain numbers, (m,)."""
    dot = np.char.find(texts, b".")
    return np.where(dot < 0, 0, np.char.str_len(texts) - dot - 1)


def fixed(values: Floats, decimals: Ints) -> tuple[Texts, Bools]:
    """Write numbers with so many decimals each; a zero carries no sign.

    Args:
        values: (m,).
        decimals: (m,).

    Returns:
        The texts, (m,), and which of them are sure.

    >>> fixed(np.array([12.34567, -0.00001]), np.array([3, 4]))[0].tolist()
    [b'12.346', b'0.0000']
    """
    scaled = np.abs(values) * _TENS[np.minimum(decimals, MOST_DIGITS)]
    sure = (scaled < _TENS[-1] / 10) & (decimals < MOST_DIGITS)
    scaled[~sure] = 0.0
    whole = np.rint(scaled).astype(np.int64)
    sure &= np.abs(scaled - np.floor(scaled) - 0.5) > TIE
    negative = (values < 0) & (whole > 0)
    count = np.searchsorted(_TENS, whole, side="right")
    before = np.maximum(count - decimals, 1)
    rows = np.zeros((len(values), 2 * MOST_DIGITS), dtype=np.uint8)
    layout = (decimals * 32 + before) * 2 + negative
    for key in np.unique(layout[sure]).tolist():
        mine = np.flatnonzero(sure & (layout == key))
        rest, sign = divmod(key, 2)
        after, ahead = divmod(rest, 32)
        rows[mine] = _written(whole[mine], ahead, after, bool(sign), rows.shape[1])
    return _texts(rows), sure


def _written(whole: Ints, ahead: int, after: int, sign: bool, width: int) -> Bytes:
    """Write scaled numbers that have one layout, (g, width)."""
    rows = np.zeros((len(whole), width), dtype=np.uint8)
    at = sign + ahead + after + (after > 0)
    for k in range(ahead + after):
        if k == after and after > 0:
            at -= 1
            rows[:, at] = _DOT
        at -= 1
        whole, digit = np.divmod(whole, 10)
        rows[:, at] = digit + _ZERO
    if sign:
        rows[:, 0] = _MINUS
    return rows


def _texts(rows: Bytes) -> Texts:
    """See rows of bytes as texts."""
    texts: Texts = np.ascontiguousarray(rows).view(f"S{rows.shape[1]}")[:, 0]
    return texts
