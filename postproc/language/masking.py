"""Mask the numbers of whole files with array passes; `lexis` is the definition.

CAM programs hold a million lines of a handful of shapes. A few passes over the bytes
find strings, comments and plain decimal numbers; the lines in which anything is out of
the ordinary (escapes, exponents, hexadecimal, ranges, open strings) are left to
`lexis.mask_line`, one by one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.language.lexis import BLANKS, UNARY_CONTEXT, mask_line, number_value

Bytes = NDArray[np.uint8]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

_TENS = 10 ** np.arange(16, dtype=np.int64)
_MAX_BLANKS = 6  # blanks between a sign and what is before it; more: line by line


def _table(characters: str) -> Bools:
    table = np.zeros(256, dtype=bool)
    table[[ord(c) for c in characters]] = True
    return table


_DIGITS = "0123456789"
_LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_$"
_IS_DIGIT, _IS_LETTER = _table(_DIGITS), _table(_LETTERS)
_IS_WORD, _IS_NUMERIC = _table(_LETTERS + _DIGITS), _table(_DIGITS + ".")
_IS_BLANK, _IS_IDLE = _table(BLANKS), _table(BLANKS + ",({\n\r")
_IS_ODD = _table('"\\')
_IS_UNARY = _table(UNARY_CONTEXT + "\n\r")


@dataclass(frozen=True)
class Masked:
    """The physical lines of a piece of a file.

    Attributes:
        masks: The mask of every line, n strings of bytes.
        comment: Offset of each line's comment, (n,), -1 where there is none.
        first: CSR offsets into the numbers, (n + 1,).
        start, end: Offsets of each number, its sign included, (m,).
        value: Its value, (m,).
        unterminated: Lines (from 0) with a string that does not end.
    """

    masks: list[bytes]
    comment: Ints
    first: Ints
    start: Ints
    end: Ints
    value: Floats
    unterminated: tuple[int, ...]


def mask_lines(data: bytes, line_starts: Ints) -> Masked:
    """Mask every physical line of a text that starts at a line start.

    Args:
        data: The text; no NUL.
        line_starts: Offset of every line in `data`, ascending from 0.
    """
    a = np.frombuffer(data, dtype=np.uint8)
    quotes, comment, odd_line = _quotes_and_comments(a, line_starts)
    line_ends = np.append(line_starts[1:], len(a))
    in_comment = _cover(len(a), comment[comment >= 0], line_ends[comment >= 0])
    ending = (a == 10) | (a == 13)
    in_comment &= ~ending
    in_string = _cover(len(a), quotes[0::2], quotes[1::2] + 1)
    code = ~(in_comment | in_string)
    start, end, odd_place = _numbers(a, code)
    odd_line[_line_of(line_starts, odd_place)] = True
    plain = ~odd_line[_line_of(line_starts, start)]
    start, end = start[plain], end[plain]
    in_number = _cover(len(a), start, end)
    masks = _squeeze(a, code, in_comment | in_number, start)
    value = _values(a, in_number, start, end)
    return _with_odd_lines(
        data,
        line_starts,
        odd_line,
        Masked(masks, comment, start, start, end, value, ()),
    )


def _line_of(line_starts: Ints, place: Ints) -> Ints:
    line: Ints = np.searchsorted(line_starts, place, side="right") - 1
    return line


def _cover(n: int, start: Ints, end: Ints) -> Bools:
    """Return what n bytes lie in the (disjoint) spans."""
    change = np.zeros(n + 1, dtype=np.int8)
    change[start] += 1
    change[end] -= 1
    covered: Bools = np.cumsum(change[:-1], dtype=np.int8).view(np.bool_)
    return covered


def _quotes_and_comments(a: Bytes, line_starts: Ints) -> tuple[Ints, Ints, Bools]:
    """Find the quotes of plain strings, the comments, and the lines that are odd.

    The first ``--`` with an even number of quotes before it on its line starts the
    comment, for all quotes before it are code.
    """
    quotes = np.flatnonzero(a == 39)
    dashes = np.flatnonzero((a[:-1] == 45) & (a[1:] == 45))
    before_line = np.searchsorted(quotes, line_starts)
    line = _line_of(line_starts, dashes)
    even = (np.searchsorted(quotes, dashes) - before_line[line]) % 2 == 0
    comment = np.full(len(line_starts), -1, dtype=np.int64)
    first_line, first = np.unique(line[even], return_index=True)
    comment[first_line] = dashes[even][first]

    line = _line_of(line_starts, quotes)
    real = (comment[line] < 0) | (quotes < comment[line])
    quotes, line = quotes[real], line[real]
    odd = np.bincount(line, minlength=len(line_starts)) % 2 == 1
    odd[_line_of(line_starts, np.flatnonzero(_IS_ODD[a]))] = True
    return quotes[~odd[line]], comment, odd


def _numbers(a: Bytes, code: Bools) -> tuple[Ints, Ints, Ints]:
    """Find plain decimal numbers, and the places that need a closer look."""
    numeric = _IS_NUMERIC[a] & code
    change = np.flatnonzero(np.diff(numeric.view(np.int8), prepend=0, append=0))
    start, end = change[0::2], change[1::2]
    padded = np.concatenate([[10], a, [10]]).astype(np.uint8)  # shifted by one
    before, after = padded[start], padded[end + 1]
    dots = np.add.reduceat(padded == 46, np.stack([start + 1, end + 1], 1).ravel())
    dots = dots[0::2] if len(start) else np.zeros(0, dtype=np.int64)
    digits = dots < end - start
    in_word = _IS_WORD[before]
    leading_dot = a[start] == 46
    # `1..n`, `1e5`, `0x3F`, `].5`, `x1.5`: rare, and not worth an array pass
    odd = digits & ((dots > 1) | ~in_word & _IS_LETTER[after])
    odd |= digits & leading_dot & (in_word | (before == 41) | (before == 93))
    odd |= digits & in_word & (dots > 0) & (a[end - 1] != 46)
    number = digits & ~odd & ~in_word
    odd_place = start[odd]
    start, end = start[number], end[number]
    start, far = _signs(padded, start)
    return start, end, np.concatenate([odd_place, far])


def _signs(padded: Bytes, start: Ints) -> tuple[Ints, Ints]:
    """Move starts to the number's sign; also return places too far to look back."""
    minus, lost = _previous(padded, start)
    signed = padded[minus] == 45
    context, lost_context = _previous(padded, minus - signed)
    context = np.where(signed, context, 0)
    signed &= _IS_UNARY[padded[context]]
    return np.where(signed, minus - 1, start), start[lost | lost_context & signed]


def _previous(padded: Bytes, at: Ints) -> tuple[Ints, Bools]:
    """Return where the last byte before `at` stands that is no blank (padded)."""
    at = at.copy()
    for _ in range(_MAX_BLANKS):
        blank = _IS_BLANK[padded[at]]
        if not blank.any():
            break
        at[blank] -= 1
    return at, _IS_BLANK[padded[at]]


def _squeeze(a: Bytes, code: Bools, dropped: Bools, start: Ints) -> list[bytes]:
    """Return the masks: numbers to NUL, comments and idle blanks dropped."""
    blank = _IS_BLANK[a] & code
    idle = blank.copy()
    idle[1:] &= _IS_IDLE[a[:-1]] & code[:-1]
    out = np.where(blank, np.uint8(32), a)
    keep = ~(dropped | idle)
    keep[start] = True
    out[start] = 0
    returns = np.flatnonzero(a == 13)
    alone = a[np.minimum(returns + 1, len(a) - 1)] != 10
    alone |= returns == len(a) - 1
    keep[returns] = alone
    out[returns] = 10
    masks = out[keep].tobytes().split(b"\n")
    if len(a) and out[-1] == 10:
        masks.pop()
    return masks


def _values(a: Bytes, in_number: Bools, start: Ints, end: Ints) -> Floats:
    """Return the values of plain decimal numbers, all at once.

    Up to 15 digits and 22 decimals the digits are an exact integer and the power of
    ten an exact float, so that one rounded division gives what reading the text would.
    """
    if not len(start):
        return np.zeros(0)
    at = np.flatnonzero(in_number & _IS_DIGIT[a])
    first = np.searchsorted(at, start)
    count = np.diff(np.append(first, len(at)))
    dot = np.flatnonzero(in_number & (a == 46))
    owner = np.searchsorted(start, dot, side="right") - 1
    decimals = np.zeros(len(start), dtype=np.int64)
    decimals[owner] = end[owner] - dot - 1
    power = np.repeat(first + count - 1, count) - np.arange(len(at))
    digits = (a[at] - np.uint8(48)).astype(np.int64)
    whole = np.add.reduceat(digits * _TENS[np.minimum(power, 15)], first)
    value: Floats = whole / _TENS[np.minimum(decimals, 15)].astype(float)
    value[a[start] == 45] *= -1.0
    for i in np.flatnonzero(count > 15).tolist():
        value[i] = number_value(a[start[i] : end[i]].tobytes().decode("latin-1"))
    return value


def _with_odd_lines(
    data: bytes, line_starts: Ints, odd: Bools, plain: Masked
) -> Masked:
    """Mask the odd lines one by one and merge them with the plain ones."""
    starts, ends, values = [plain.start], [plain.end], [plain.value]
    unterminated: list[int] = []
    line_ends = np.append(line_starts[1:], len(data))
    for line in np.flatnonzero(odd).tolist():
        at = int(line_starts[line])
        text = data[at : int(line_ends[line])].rstrip(b"\r\n").decode("latin-1")
        masked = mask_line(text)
        plain.masks[line] = masked.mask.encode("latin-1")
        plain.comment[line] = masked.comment + at if masked.comment >= 0 else -1
        starts.append(np.array(masked.start, dtype=np.int64) + at)
        ends.append(np.array(masked.end, dtype=np.int64) + at)
        spans = zip(masked.start, masked.end, strict=True)
        values.append(np.array([number_value(text[s:e]) for s, e in spans], float))
        if masked.unterminated:
            unterminated.append(line)
    start = np.concatenate(starts)
    order = np.argsort(start, kind="stable")
    start = start[order]
    return Masked(
        plain.masks,
        plain.comment,
        np.append(np.searchsorted(start, line_starts), len(start)).astype(np.int64),
        start,
        np.concatenate(ends)[order],
        np.concatenate(values)[order],
        tuple(unterminated),
    )
