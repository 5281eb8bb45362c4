"""Plain decimal numbers in a text: where they stand, what they are worth, in arrays.

A pass over all bytes costs far more than one over the numbers, so that only digits and
dots are looked for byte by byte; what is before and after is asked of each number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Bytes, Floats, Ints
from postproc.language.lexis import BLANKS, UNARY_CONTEXT, number_value

Words = NDArray[np.uint64]

EXACT = 15  # digits of a number that is read here: exact as a float
_TENS = 10 ** np.arange(EXACT + 1, dtype=np.int64)
_SCALES = _TENS.astype(float)
_MAX_BLANKS = 60  # blanks between a sign and what is before it; more: line by line
DOT, _MINUS, _PLUS = 46, 45, 43
_PAIRED = tuple(
    (np.uint64(ten), np.uint64(shift), np.uint64(mask))
    for ten, shift, mask in (
        (10, 8, 0x00FF00FF00FF00FF),
        (100, 16, 0x0000FFFF0000FFFF),
        (10_000, 32, 0x00000000FFFFFFFF),
    )
)


def byte_table(characters: str) -> Bools:
    """Return which bytes are one of some characters, (256,)."""
    table = np.zeros(256, dtype=bool)
    table[[ord(c) for c in characters]] = True
    return table


_LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_$"
_IS_LETTER, _IS_WORD = byte_table(_LETTERS), byte_table(_LETTERS + "0123456789")
_IS_BLANK, _IS_UNARY = byte_table(BLANKS), byte_table(UNARY_CONTEXT + "\n\r")


@dataclass(frozen=True)
class Plain:
    """Runs of digits and dots, most of which are plain numbers.

    Attributes:
        first: Where they begin, (m,).
        point: Where the dot stands, or the end where there is none, (m,).
        end: Where they end, (m,).
        number: Which are digits with at most one dot, and no part of a word, (m,).
        odd: Which may be something else and need a closer look, (m,).
    """

    first: Ints
    point: Ints
    end: Ints
    number: Bools
    odd: Bools

    def take(self, some: Bools | Ints) -> Plain:
        """Return some of them."""
        return Plain(*(column[some] for column in vars(self).values()))


def numeric_bytes(a: Bytes) -> Bools:
    """Tell which bytes are digits or dots."""
    numeric: Bools = (a - np.uint8(DOT)) < 12  # from the dot to 9, the slash too
    numeric &= a != 47
    return numeric


def runs_of(numeric: Bools) -> tuple[Ints, Ints]:
    """Find where runs of bytes begin and end."""
    edge = np.zeros(len(numeric) + 1, dtype=bool)
    edge[:-1] = numeric
    edge[1:] ^= numeric
    at = np.flatnonzero(edge)
    return at[0::2], at[1::2]


def plain_numbers(a: Bytes, start: Ints, end: Ints) -> Plain:
    """Tell which runs of digits and dots are plain numbers.

    Args:
        a: The text.
        start: Where the runs outside of strings and comments begin, (m,).
        end: Where they end, (m,).
    """
    before = np.where(start > 0, a[start - 1], 10)
    after = np.where(end < len(a), a[np.minimum(end, len(a) - 1)], 10)
    dot = np.append(np.flatnonzero(a == DOT), [len(a)] * 2)
    at = np.searchsorted(dot, start)
    dotted, more = dot[at] < end, np.flatnonzero(dot[at + 1] < end)
    dots = dotted.astype(np.int64)
    dots[more] = np.searchsorted(dot, end[more]) - at[more]
    digits = dots < end - start
    in_word = _IS_WORD[before]
    # `1..n`, `1e5`, `0x3F`, `].5`, `x1.5`: rare, and not worth an array pass
    odd = digits & ((dots > 1) | ~in_word & _IS_LETTER[after])
    leading = np.flatnonzero(digits & (a[start] == DOT))
    odd[leading] |= in_word[leading] | np.isin(before[leading], (41, 93))
    odd |= digits & in_word & dotted & (a[end - 1] != DOT)
    point = np.where(dotted, dot[at], end)
    return Plain(start, point, end, digits & ~odd & ~in_word, odd)


def with_signs(a: Bytes, first: Ints) -> tuple[Ints, Ints]:
    """Move the starts of numbers to their signs.

    Returns:
        The starts, and places too far from what is before them to tell.
    """
    sign, lost = _previous(a, first)
    signed = (sign >= 0) & ((a[sign] == _MINUS) | (a[sign] == _PLUS))
    start, tied = first.copy(), np.flatnonzero(signed)
    context, far = _previous(a, sign[tied])
    unary = (context < 0) | _IS_UNARY[a[context]]
    lost[tied] |= far
    start[tied[unary]] = sign[tied[unary]]
    return start, first[lost]


def _previous(a: Bytes, at: Ints) -> tuple[Ints, Bools]:
    """Return where the last byte before `at` stands that is no blank, -1 if none."""
    at = at - 1
    for _ in range(_MAX_BLANKS):
        blank = np.flatnonzero(_IS_BLANK[a[at]] & (at >= 0))
        if not len(blank):
            break
        at[blank] -= 1
    return at, _IS_BLANK[a[at]] & (at >= 0)


def values(a: Bytes, numbers: Plain, start: Ints) -> Floats:
    """Return what numbers are worth, (m,).

    Up to 15 digits the digits are an exact integer and the power of ten an exact float,
    so that one rounded division gives what reading the text would.

    Args:
        a: The text.
        numbers: The numbers.
        start: Where they start, the sign included, (m,).
    """
    if not len(start):
        return np.zeros(0)
    before = numbers.point - numbers.first
    after = np.maximum(numbers.end - numbers.point - 1, 0)
    whole = _short(a, numbers.end, before, after, numbers.point < numbers.end)
    long = np.flatnonzero(numbers.end - numbers.first > 8)
    if len(long):
        whole[long] = _digits(a, numbers.point[long], before[long])
        whole[long] *= _TENS[np.minimum(after[long], EXACT)]
        whole[long] += _digits(a, numbers.end[long], after[long])
    value: Floats = whole / _SCALES[np.minimum(after, EXACT)]
    value[a[start] == _MINUS] *= -1.0
    for i in np.flatnonzero(before + after > EXACT).tolist():
        text = a[start[i] : numbers.end[i]].tobytes()
        value[i] = number_value(text.decode("latin-1"))
    return value


def _short(a: Bytes, end: Ints, before: Ints, after: Ints, dotted: Bools) -> Ints:
    """Read numbers of at most 8 bytes: what is before the dot moves over it."""
    word = _words(a, end)
    cut = _shift(8 - after)
    decimals = (word >> cut) << cut
    front = (word << _shift(after + 1)) >> _shift(after)
    return _read(np.where(dotted, decimals | front, word), before + after)


def _digits(a: Bytes, end: Ints, count: Ints) -> Ints:
    """Read up to 15 digits that end at places of a text."""
    value = _read(_words(a, end), np.minimum(count, 8))
    long = np.flatnonzero(count > 8)
    if len(long):
        more = np.minimum(count[long] - 8, 8)
        value[long] += 10**8 * _read(_words(a, end[long] - 8), more)
    return value


def _words(a: Bytes, end: Ints) -> Words:
    """Return the eight bytes before places of a text as words, the last one on top."""
    padded = np.concatenate([np.zeros(8, dtype=np.uint8), a])
    words: Words = np.ndarray(len(a) + 1, "<u8", padded, strides=(1,))
    return words[end]


def _shift(count: Ints) -> Words:
    """Return the bits of some bytes; eight bytes and more shift everything out."""
    return (8 * np.maximum(count, 0)).astype(np.uint64)


def _read(word: Words, count: Ints) -> Ints:
    """Read words of up to 8 digits: pairs, fours, then all of them."""
    drop = _shift(8 - count)
    word = (word >> drop) << drop & np.uint64(0x0F0F0F0F0F0F0F0F)
    for ten, shift, mask in _PAIRED:
        word = (word * ten + (word >> shift)) & mask
    return word.astype(np.int64)
