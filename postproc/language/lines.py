"""Logical lines of a file: shapes and numbers as arrays, no object per line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.exceptions import ProgramError
from postproc.language.masking import Masked, mask_lines
from postproc.language.source import Source

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

_PIECE = 1 << 20  # bytes masked at once: array passes that fit the cache
_OPENS = re.compile(rb" *(?:\w+ *:: *)?(?:MOVE|MOVEFLY|OPEN)\b[^\n]*, *\Z", re.I)
_CLAUSE = re.compile(
    rb" *(?:WITH|ADVANCE|TIL|VIA|SYNCMOVE|SYNCMOVEFLY|CONDITION|\$)", re.I
)
_WITH = re.compile(rb" *(?:WITH|SYNCMOVE|SYNCMOVEFLY)\b", re.I)
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
        starts = self.source.line_starts
        for found in pattern.finditer(self.source.data):
            row = int(np.searchsorted(starts, found.start(), side="right")) - 1
            if self.comment[row] == found.start():
                yield row + 1, found.group(1).decode("latin-1")


def read_lines(source: Source) -> Lines:
    """Split a source into logical lines with masked numbers.

    Raises:
        ProgramError: A string does not end on its line.
    """
    ids: dict[bytes, int] = {}
    pieces: list[Masked] = []
    shape: list[Ints] = []
    for data, starts, at in _pieces(source):
        masked = mask_lines(data, starts - at)
        if masked.unterminated:
            line = int(np.searchsorted(source.line_starts, at)) + 1
            _refuse(source, line + masked.unterminated[0])
        for mask in dict.fromkeys(masked.masks):
            ids.setdefault(mask, len(ids))
        shape.append(np.fromiter(map(ids.__getitem__, masked.masks), np.int64))
        pieces.append(_moved(masked, at))
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


def _moved(piece: Masked, at: int) -> Masked:
    comment = np.where(piece.comment >= 0, piece.comment + at, -1)
    return Masked(
        [], comment, piece.first, piece.start + at, piece.end + at, piece.value, ()
    )


def _merged(pieces: list[Masked]) -> Masked:
    offsets = np.cumsum([0, *(len(p.start) for p in pieces)])
    first = [p.first[:-1] + o for p, o in zip(pieces, offsets[:-1], strict=True)]
    return Masked(
        [],
        np.concatenate([p.comment for p in pieces]),
        np.concatenate([*first, offsets[-1:]]),
        np.concatenate([p.start for p in pieces]),
        np.concatenate([p.end for p in pieces]),
        np.concatenate([p.value for p in pieces]),
        (),
    )


def _logical(
    source: Source, masks: tuple[bytes, ...], shape: Ints, numbers: Masked
) -> Lines:
    """Join the continued lines and drop the empty ones."""
    blank = np.array([not mask.strip() for mask in masks], dtype=bool)
    opens = np.array([bool(_OPENS.match(mask)) for mask in masks], dtype=bool)
    shape, keep = shape.copy(), ~blank[shape]
    joined: dict[bytes, int] = {}
    for row in np.flatnonzero(opens[shape]).tolist():
        rows = _continued(masks, blank, shape, row)
        if len(rows) > 1:
            mask = b" ".join(masks[shape[r]].strip() for r in rows)
            shape[row] = len(masks) + joined.setdefault(mask, len(joined))
            keep[rows[1:]] = False
    texts = tuple(m.strip().decode("latin-1") for m in (*masks, *joined))
    kept = np.flatnonzero(keep)
    first = np.append(numbers.first[kept], len(numbers.start))
    return Lines(
        source,
        texts,
        shape[kept],
        kept + 1,
        first.astype(np.int64),
        numbers.start,
        numbers.end,
        numbers.value,
        numbers.comment,
    )


def _continued(
    masks: tuple[bytes, ...], blank: NDArray[np.bool_], shape: Ints, row: int
) -> list[int]:
    """Return the physical rows of the statement that starts at a row."""
    rows = [row]
    for at in range(row + 1, len(shape)):
        if blank[shape[at]]:
            continue
        mask = masks[shape[at]]
        if _CLOSES.match(mask):
            return [*rows, at]
        comma = masks[shape[rows[-1]]].rstrip().endswith(b",")
        if not (_CLAUSE.match(mask) if comma else _WITH.match(mask)):
            break
        rows.append(at)
    return rows
