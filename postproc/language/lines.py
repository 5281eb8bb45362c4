"""Logical lines of a file: shapes and numbers as arrays, no object per line."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Each, Floats
from postproc.exceptions import ProgramError
from postproc.language.continued import Names, join, stripped
from postproc.language.divided import Rows, divided
from postproc.language.masking import mark_lines
from postproc.language.sequences import Numbers
from postproc.language.shapes import Shapes, find_shapes
from postproc.language.source import Source

Ints = NDArray[np.signedinteger[Any]]
"""Whole numbers, as short as the length of the file allows: there are millions."""

_PIECE = 1 << 18  # bytes masked at once: array passes that fit the cache


@dataclass(frozen=True)
class Lines:
    """The logical lines of a file that hold code (structure of arrays).

    Attributes:
        source: The text.
        shapes: The distinct masks, stripped, in the order of appearance.
        shape: Index into `shapes`, (n,).
        line: 1-based physical line on which each logical line starts, (n,).
        first: CSR offsets into the numbers, (n + 1,).
        start, end: Byte offsets of each number, its sign included, (m,).
        value: Its value, NaN where it cannot be read, (m,).
        comment: Byte offset of the comment of every *physical* line, -1: none.
    """

    source: Source
    shapes: Shapes
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
    ids, names = Numbers[bytes](), Numbers[str]()
    pieces: list[_Piece] = []
    tasks = list(_tasks(source))
    read = each(lambda task: _read(data, source.line_starts, *task), tasks)
    for (rows, _), piece in zip(tasks, read, strict=True):
        if piece.unterminated:
            _refuse(source, rows.start + 1 + piece.unterminated[0])
        pieces.append(
            replace(
                piece,
                shape=ids.of(piece.masks)[piece.shape],
                name=names.of(piece.names),
                names=(),
            )
        )
    return _logical(source, tuple(ids), names, _merged(pieces))


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


@dataclass(frozen=True)
class _Piece:
    """The n physical lines of a piece of a file, or of all of it.

    Attributes:
        masks: Their distinct masks, see `Marked`.
        shape: Index into `masks`, (n,).
        comment: As in `Lines`.
        first: CSR offsets into the numbers, (n + 1,).
        start: Byte offsets of the numbers in the file, (m,).
        end: Where they end, (m,).
        value: What they are worth, (m,).
        names: The names that are taken out of the masks, in order.
        name: Their numbers, the same for the same name, (p,).
        name_first: CSR offsets into them, (n + 1,).
        unterminated: As in `Masked`.
    """

    masks: tuple[bytes, ...]
    shape: Ints
    comment: Ints
    first: Ints
    start: Ints
    end: Ints
    value: Floats
    names: Sequence[str]
    name: Ints
    name_first: Ints
    unterminated: tuple[int, ...]


def _read(data: bytes, starts: Ints, lines: slice, place: slice) -> _Piece:
    """Read a piece of a text; offsets are counted from the beginning of the text."""
    marked = mark_lines(data[place], starts[lines] - place.start)
    piece, at = marked.masked, place.start
    short = np.int32 if len(data) < 2**31 else np.int64
    ids = Numbers[bytes]()
    shape = ids.of(piece.masks)
    return _Piece(
        tuple(ids),
        shape,
        np.where(piece.comment >= 0, piece.comment + at, -1).astype(short),
        piece.first,
        (piece.start + at).astype(short),
        (piece.end + at).astype(short),
        piece.value,
        marked.name,
        np.zeros(0, dtype=np.int32),
        marked.name_first,
        piece.unterminated,
    )


def _merged(pieces: list[_Piece]) -> _Piece:
    def together(name: str) -> Any:
        return np.concatenate([getattr(piece, name) for piece in pieces])

    return _Piece(
        (),
        together("shape"),
        together("comment"),
        _offsets([piece.first for piece in pieces]),
        together("start"),
        together("end"),
        together("value"),
        (),
        together("name"),
        _offsets([piece.name_first for piece in pieces]),
        (),
    )


def _offsets(parts: list[Ints]) -> Ints:
    """Put CSR offsets one behind the other."""
    begin = np.cumsum([0, *(int(part[-1]) for part in parts)])
    moved = [part[:-1] + own for part, own in zip(parts, begin, strict=False)]
    return np.concatenate([*moved, begin[-1:]])


def _logical(
    source: Source, masks: tuple[bytes, ...], names: Numbers[str], found: _Piece
) -> Lines:
    """Join the continued lines and drop the empty ones."""
    code = np.array([*map(bool, map(stripped, masks))], dtype=bool)
    rows = np.flatnonzero(code[found.shape])
    at = found.name_first[rows]
    joined = join(masks, found.shape[rows], Names(at, found.name, tuple(names)))
    kept, short = rows[joined.rows], found.start.dtype
    first = np.append(found.first[kept], len(found.start)).astype(short)
    lines = divided(Rows(joined.masks, joined.shape, kept + 1, first, at[joined.rows]))
    shapes, shape = find_shapes(lines.masks, lines.shape, lines.name, found.name, names)
    return Lines(
        source,
        shapes,
        shape.astype(short),
        lines.line.astype(short),
        lines.first,
        found.start,
        found.end,
        found.value,
        found.comment,
    )
