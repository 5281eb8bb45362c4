"""Mask the numbers of whole files with array passes; `lexis` is the definition.

CAM programs hold a million lines of a handful of shapes. A few passes over the bytes
find strings, comments and plain decimal numbers; the lines in which anything is out of
the ordinary (escapes, exponents, hexadecimal, ranges, open strings) are left to
`lexis.mask_line`, one by one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Bytes, Floats, Ints
from postproc.language.lexis import BLANKS, mask_line, number_value
from postproc.language.numbered import NAME_MARK, WHOLE, find_names, texts_of
from postproc.language.plain_numbers import (
    DOT,
    Plain,
    byte_table,
    numeric_bytes,
    plain_numbers,
    runs_of,
    values,
    with_signs,
)

_IS_IDLE = byte_table(BLANKS + ",({\n\r")


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


@dataclass(frozen=True)
class Marked:
    """The physical lines of a piece of a file, their numbered names marked too.

    Attributes:
        masked: The lines; in the mask of one whose names are taken out each is one
            `NAME_MARK`, the mask of any other begins with `WHOLE`.
        name: The names, in order.
        name_first: CSR offsets into them, (n + 1,).
    """

    masked: Masked
    name: list[str]
    name_first: Ints


@dataclass(frozen=True)
class _Code:
    """What array passes find in a text: `runs` of digits and dots are in code."""

    a: Bytes
    line_starts: Ints
    quotes: Ints
    comment: Ints
    odd: Bools
    runs: Plain
    numbers: Plain
    start: Ints


def mask_lines(data: bytes, line_starts: Ints) -> Masked:
    """Mask every physical line of a text that starts at a line start.

    Args:
        data: The text; no NUL.
        line_starts: Offset of every line in `data`, ascending from 0.
    """
    code = _code(data, line_starts)
    none = np.zeros(0, dtype=np.int64)
    return _with_odd_lines(data, line_starts, code.odd, _masked(code, none, none))


def mark_lines(data: bytes, line_starts: Ints) -> Marked:
    """Mask every line, and mark its numbered names where that is not out of the way.

    Args:
        data: The text; no NUL.
        line_starts: Offset of every line in `data`, ascending from 0.
    """
    code = _code(data, line_starts)
    a, runs = code.a, code.runs
    in_word = ~runs.number & ~runs.odd & (a[runs.first] != DOT)
    start, end, far = find_names(a, runs.first[in_word])
    whole = code.odd.copy()
    unusual = np.flatnonzero((a >= 128) | (a == ord(NAME_MARK)))
    for place in (np.sort(far), unusual):
        line = line_of(line_starts, place)
        behind = code.comment[line]
        whole[line[(behind < 0) | (place < behind)]] = True
    if whole.any():
        named = ~whole[line_of(line_starts, start)]
        start, end = start[named], end[named]
    masked = _with_odd_lines(data, line_starts, code.odd, _masked(code, start, end))
    for k in np.flatnonzero(whole).tolist():
        masked.masks[k] = WHOLE + masked.masks[k]
    first = np.append(np.searchsorted(start, line_starts), len(start))
    return Marked(masked, texts_of(a, start, end), first)


def _code(data: bytes, line_starts: Ints) -> _Code:
    """Find numbers, strings and comments."""
    a = np.frombuffer(data, dtype=np.uint8)
    quotes, comment, odd_line = quotes_and_comments(a, line_starts)
    start, end = runs_of(numeric_bytes(a))
    code = in_code(start, quotes, comment, line_starts)
    runs = plain_numbers(a, start[code], end[code])
    numbers = runs.take(runs.number)
    start, far = with_signs(a, numbers.first)
    odd_line[line_of(line_starts, runs.first[runs.odd])] = True
    odd_line[line_of(line_starts, far)] = True
    if odd_line.any():
        plain = ~odd_line[line_of(line_starts, start)]
        numbers, start = numbers.take(plain), start[plain]
    return _Code(a, line_starts, quotes, comment, odd_line, runs, numbers, start)


def _masked(code: _Code, names: Ints, name_ends: Ints) -> Masked:
    """Mask the lines that are not odd, with the names from some places to others."""
    a, start, line_starts = code.a, code.start, code.line_starts
    dropped = _cover(len(a), start, code.numbers.end)
    if len(names):
        dropped |= _cover(len(a), names, name_ends)
    if (code.comment >= 0).any():
        dropped |= _in_comments(a, code.comment, line_starts)
    masks = _squeeze(a, dropped, code.quotes, start, names)
    first = np.append(np.searchsorted(start, line_starts), len(start))
    value = values(a, code.numbers, start)
    return Masked(masks, code.comment, first, start, code.numbers.end, value, ())


def line_of(line_starts: Ints, place: Ints) -> Ints:
    """Return the line of every place, ascending."""
    first = np.append(np.searchsorted(place, line_starts), len(place))
    line: Ints = np.repeat(np.arange(len(line_starts)), np.diff(first))
    return line


def _inside(quotes: Ints, place: Ints) -> Bools:
    """Tell which places, ascending, are in a string."""
    count = np.diff(np.searchsorted(place, quotes), prepend=0, append=len(place))
    inside: Bools = np.repeat(np.arange(len(count)) % 2 == 1, count)
    return inside


def _cover(n: int, start: Ints, end: Ints) -> Bools:
    """Return what n bytes lie in the (disjoint) spans."""
    change = np.zeros(n + 1, dtype=bool)
    change[start] = True
    change[end] ^= True
    covered: Bools = np.logical_xor.accumulate(change[:-1])
    return covered


def quotes_and_comments(a: Bytes, line_starts: Ints) -> tuple[Ints, Ints, Bools]:
    """Find the quotes of plain strings, the comments, and the lines that are odd.

    The first ``--`` with an even number of quotes before it on its line starts the
    comment, for all quotes before it are code.
    """
    quotes = np.flatnonzero(a == 39)
    comment = np.full(len(line_starts), -1, dtype=np.int64)
    dashes = np.flatnonzero((a[:-1] == 45) & (a[1:] == 45))
    if len(dashes):
        before_line = np.searchsorted(quotes, line_starts)
        line = line_of(line_starts, dashes)
        even = (np.searchsorted(quotes, dashes) - before_line[line]) % 2 == 0
        first_line, first = np.unique(line[even], return_index=True)
        comment[first_line] = dashes[even][first]

    line = line_of(line_starts, quotes)
    real = (comment[line] < 0) | (quotes < comment[line])
    quotes, line = quotes[real], line[real]
    odd = np.bincount(line, minlength=len(line_starts)) % 2 == 1
    odd[line_of(line_starts, np.flatnonzero((a == 34) | (a == 92)))] = True
    return quotes[~odd[line]], comment, odd


def in_code(place: Ints, quotes: Ints, comment: Ints, line_starts: Ints) -> Bools:
    """Tell which places, ascending, are in no string and no comment."""
    code = ~_inside(quotes, place)
    if (comment >= 0).any():
        own = comment[line_of(line_starts, place)]
        code &= (own < 0) | (place < own)
    return code


def _in_comments(a: Bytes, comment: Ints, line_starts: Ints) -> Bools:
    """Return what bytes are in a comment; the end of its line is not."""
    line_ends = np.append(line_starts[1:], len(a))
    has = comment >= 0
    covered = _cover(len(a), comment[has], line_ends[has])
    covered &= (a != 10) & (a != 13)
    return covered


def _squeeze(
    a: Bytes, dropped: Bools, quotes: Ints, start: Ints, names: Ints
) -> list[bytes]:
    """Return the masks: numbers to NUL, comments and idle blanks dropped."""
    out, keep = a.copy(), ~dropped
    blank = np.flatnonzero((a <= 32) & (a != 10) & (a != 13) & (a > 0) | (a == 127))
    blank = blank[~_inside(quotes, blank)]
    idle = blank[(blank == 0) | _IS_IDLE[a[blank - 1]]]
    out[blank] = 32
    keep[idle] = False
    keep[start] = True
    out[start] = 0
    keep[names] = True
    out[names] = ord(NAME_MARK)
    returns = np.flatnonzero(a == 13)
    alone = a[np.minimum(returns + 1, len(a) - 1)] != 10
    alone |= returns == len(a) - 1
    keep[returns] = alone
    out[returns] = 10
    masks = out[keep].tobytes().split(b"\n")
    if len(a) and out[-1] == 10:
        masks.pop()
    return masks


def _with_odd_lines(
    data: bytes, line_starts: Ints, odd: Bools, plain: Masked
) -> Masked:
    """Mask the odd lines one by one and merge them with the plain ones."""
    if not odd.any():
        return plain
    starts, ends, numbers = [plain.start], [plain.end], [plain.value]
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
        numbers.append(np.array([number_value(text[s:e]) for s, e in spans], float))
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
        np.concatenate(numbers)[order],
        tuple(unterminated),
    )
