"""Logical lines of a file: shapes and numbers as arrays, no object per line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.exceptions import ProgramError
from postproc.language.divided import Rows, divided
from postproc.language.masking import Masked, mask_lines
from postproc.language.source import Source

Ints = NDArray[np.signedinteger[Any]]
"""Whole numbers, as short as the length of the file allows: there are millions."""
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_PIECE = 1 << 20  # bytes masked at once: array passes that fit the cache
_OPENS = re.compile(rb" *(?:\w+ *:: *)?(?:MOVE|MOVEFLY|OPEN)\b[^\n]*, *\Z", re.I)
_CLAUSE = re.compile(
    rb" *(?:WITH|ADVANCE|TIL|VIA|SYNCMOVE|SYNCMOVEFLY|CONDITION|\$)", re.I
)
_WITH = re.compile(rb" *(?:WITH|SYNCMOVE|SYNCMOVEFLY)\b", re.I)
_COMMA = re.compile(rb"[^\n]*,\s*\Z")
_CLOSES = re.compile(rb" *(?:ENDMOVE|ENDOPEN)\b", re.I)


@dataclass(frozen=True)
class Lines:
    """The logical lines of a file that hold code (structure of arrays).

    Attributes:
        source: The text.
        shapes: The distinct masks, stripped.
        shape: Index into `shapes`, (n,).
        line: 1-based physical line on which each logical line starts, (n,).
        first: CSR offsets into the numbers, (n + 1,).
        start, end: Byte offsets of each number, its sign included, (m,).
        value: Its value, NaN where it cannot be read, (m,).
        comment: Byte offset of the comment of every *physical* line, -1: none.
    """

    source: Source
    shapes: tuple[str, ...]
    shape: Ints
    line: Ints
    first: Ints
    start: Ints
    end: Ints
    value: Floats
    comment: Ints

    def __len__(self) -> int:
        """Return the number of logical lines."""
        return len(self.shape)

    def text(self, row: int) -> str:
        """Return the mask of a logical line."""
        return self.shapes[int(self.shape[row])]

    def marks(self, word: str) -> Iterator[tuple[int, str]]:
        """Yield (physical line, next word) of comments like ``-- MEASURE P12``."""
        pattern = re.compile(rb"--+[ \t]*" + word.encode() + rb"\b[ \t]*([^\s]*)", re.I)
        rows = np.flatnonzero(self.comment >= 0)
        for row, start in zip(rows.tolist(), self.comment[rows].tolist(), strict=True):
            found = pattern.match(self.source.data, start)
            if found:
                yield row + 1, found.group(1).decode("latin-1")


def read_lines(source: Source) -> Lines:
    """Split a source into logical lines with masked numbers.

    Raises:
        ProgramError: A string does not end on its line.
    """
    ids: dict[bytes, int] = {}
    pieces: list[Masked] = []
    shape: list[Ints] = []
    short = np.int32 if len(source.data) < 2**31 else np.int64
    for data, starts, at in _pieces(source):
        masked = mask_lines(data, starts - at)
        if masked.unterminated:
            line = int(np.searchsorted(source.line_starts, at)) + 1
            _refuse(source, line + masked.unterminated[0])
        for mask in dict.fromkeys(masked.masks):
            ids.setdefault(mask, len(ids))
        shape.append(np.fromiter(map(ids.__getitem__, masked.masks), np.int32))
        pieces.append(_moved(masked, at, short))
    return _logical(source, tuple(ids), np.concatenate(shape), _merged(pieces))


def _refuse(source: Source, line: int) -> None:
    raise ProgramError(
        source.name,
        "a string is not terminated",
        "Close it with an apostrophe on the same line.",
        line=line,
    )


def _pieces(source: Source) -> Iterator[tuple[bytes, Ints, int]]:
    """Yield pieces that start and end with lines: bytes, line starts, offset."""
    data, starts = source.data, source.line_starts
    if data.startswith(b"\xef\xbb\xbf"):
        data = b"   " + data[3:]  # a byte order mark is no code
    at = 0
    while at < len(data):
        row = int(np.searchsorted(starts, at))
        last = int(np.searchsorted(starts, at + _PIECE))
        end = int(starts[last]) if last < len(starts) else len(data)
        yield data[at:end], starts[row:last], at
        at = end


def _moved(piece: Masked, at: int, short: type[np.signedinteger[Any]]) -> Masked:
    """Count the offsets of a piece from the beginning of its file."""
    return Masked(
        [],
        np.where(piece.comment >= 0, piece.comment + at, -1).astype(short),
        piece.first,
        (piece.start + at).astype(short),
        (piece.end + at).astype(short),
        piece.value,
        (),
    )


def _merged(pieces: list[Masked]) -> Masked:
    offsets = np.cumsum([0, *(len(p.start) for p in pieces)])
    first = [p.first[:-1] + o for p, o in zip(pieces, offsets[:-1], strict=True)]
    whole = [column.astype(pieces[0].start.dtype) for column in (*first, offsets[-1:])]
    return Masked(
        [],
        np.concatenate([p.comment for p in pieces]),
        np.concatenate(whole),
        np.concatenate([p.start for p in pieces]),
        np.concatenate([p.end for p in pieces]),
        np.concatenate([p.value for p in pieces]),
        (),
    )


def _logical(
    source: Source, masks: tuple[bytes, ...], shape: Ints, numbers: Masked
) -> Lines:
    """Join the continued lines and drop the empty ones."""
    stripped = [mask.strip() for mask in masks]
    code = np.flatnonzero(np.array([*map(bool, stripped)], dtype=bool)[shape])
    shape = shape[code]
    opens = np.array(
        [mask.endswith(b",") and bool(_OPENS.match(mask)) for mask in stripped],
        dtype=bool,
    )
    starts = np.flatnonzero(opens[shape])
    length = _lengths(masks, shape, starts)
    starts, length = starts[length > 1], length[length > 1]
    joined: dict[bytes, int] = {}
    parts, keep = shape.tolist() if len(starts) else [], np.ones(len(shape), dtype=bool)
    for row, count in zip(starts.tolist(), length.tolist(), strict=True):
        mask = b" ".join([stripped[k] for k in parts[row : row + count]])
        shape[row] = len(masks) + joined.setdefault(mask, len(joined))
        keep[row + 1 : row + count] = False
    kept, short = code[keep], numbers.start.dtype
    first = np.append(numbers.first[kept], len(numbers.start)).astype(short)
    rows = divided(Rows((*stripped, *joined), shape[keep], kept + 1, first))
    used, shape = np.unique(rows.shape, return_inverse=True)
    return Lines(
        source,
        tuple(rows.masks[k].decode("latin-1") for k in used.tolist()),
        shape.astype(short),
        rows.line.astype(short),
        rows.first,
        numbers.start,
        numbers.end,
        numbers.value,
        numbers.comment,
    )


def _lengths(masks: tuple[bytes, ...], shape: Ints, starts: Ints) -> Ints:
    """Count the lines of the statements that start at some lines of code, (k,).

    All statements grow by one line at a time, for as long as the next one belongs.
    """
    length = np.ones(len(starts), dtype=np.int64)
    growing = np.arange(len(starts))
    while len(growing := growing[(starts + length)[growing] < len(shape)]):
        following = shape[(starts + length)[growing]]
        closes = _which(masks, following, _CLOSES)
        comma = _which(masks, shape[(starts + length - 1)[growing]], _COMMA)
        clause = _which(masks, following, _CLAUSE)
        more = ~closes & np.where(comma, clause, _which(masks, following, _WITH))
        length[growing[closes | more]] += 1
        growing = growing[more]
    return length


def _which(masks: tuple[bytes, ...], shape: Ints, pattern: re.Pattern[bytes]) -> Bools:
    """Tell which of some lines match a pattern."""
    used, at = np.unique(shape, return_inverse=True)
    found = [bool(pattern.match(masks[k])) for k in used.tolist()]
    return np.array(found, dtype=bool)[at]
