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
from postproc.pieces import Each

Ints = NDArray[np.signedinteger[Any]]
"""Whole numbers, as short as the length of the file allows: there are millions."""
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_PIECE = 1 << 18  # bytes masked at once: array passes that fit the cache
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


def read_lines(source: Source, each: Each = map) -> Lines:
    """Split a source into logical lines with masked numbers.

    Args:
        source: The text.
        each: How the pieces of a long text are read.

    Raises:
        ProgramError: A string does not end on its line.
    """
    data = source.data
    if data.startswith(b"\xef\xbb\xbf"):
        data = b"   " + data[3:]  # a byte order mark is no code
    ids: dict[bytes, int] = {}
    shape: list[Ints] = []
    numbers: list[Masked] = []
    tasks = list(_tasks(source))
    read = each(lambda task: _read(data, source.line_starts, *task), tasks)
    for (rows, _), (piece, masks, mask) in zip(tasks, read, strict=True):
        if piece.unterminated:
            _refuse(source, rows.start + 1 + piece.unterminated[0])
        new = [ids.setdefault(text, len(ids)) for text in masks]
        shape.append(np.array(new, dtype=np.int32)[mask])
        numbers.append(piece)
    return _logical(source, tuple(ids), np.concatenate(shape), _merged(numbers))


def _refuse(source: Source, line: int) -> None:
    raise ProgramError(
        source.name,
        "a string is not terminated",
        "Close it with an apostrophe on the same line.",
        line=line,
    )


def _tasks(source: Source) -> Iterator[tuple[slice, slice]]:
    """Cut a text into pieces that start and end with lines: lines and bytes."""
    starts, size = source.line_starts, len(source.data)
    at = 0
    while at < size:
        row = int(np.searchsorted(starts, at))
        last = int(np.searchsorted(starts, at + _PIECE))
        end = int(starts[last]) if last < len(starts) else size
        yield slice(row, last), slice(at, end)
        at = end


def _read(
    data: bytes, starts: Ints, lines: slice, place: slice
) -> tuple[Masked, tuple[bytes, ...], Ints]:
    """Mask a piece of a text; return its distinct masks, and which a line has, too."""
    masked = mask_lines(data[place], starts[lines] - place.start)
    ids = {mask: k for k, mask in enumerate(dict.fromkeys(masked.masks))}
    mask = np.fromiter(map(ids.__getitem__, masked.masks), np.int32)
    short = np.int32 if len(data) < 2**31 else np.int64
    return _moved(masked, place.start, short), tuple(ids), mask


def _moved(piece: Masked, at: int, short: type[np.signedinteger[Any]]) -> Masked:
    """Count the offsets of a piece from the beginning of its file."""
    return Masked(
        [],
        np.where(piece.comment >= 0, piece.comment + at, -1).astype(short),
        piece.first,
        (piece.start + at).astype(short),
        (piece.end + at).astype(short),
        piece.value,
        piece.unterminated,
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
