"""Logical lines of a file: shapes and numbers as arrays, no object per line."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from postproc.arrays import Bools, Floats, Indices, Interned, Map
from postproc.exceptions import ProgramError
from postproc.language.scan import NAME_MARK, NUMBER_MARK, WHOLE, mark_lines, mask_of
from postproc.language.shapes import (
    Shapes,
    alike,
    find_shapes,
    numbered_in_order,
)
from postproc.language.source import Source

# Statements over several lines: one that ends with a comma goes on with clauses.

_OPENS = re.compile(rb" *(?:\w+ *:: *)?(?:MOVE|MOVEFLY|OPEN)\b[^\n]*, *\Z", re.I)
_CLAUSE = re.compile(
    rb" *(?:WITH|ADVANCE|TIL|VIA|SYNCMOVE|SYNCMOVEFLY|CONDITION|\$)", re.I
)
_WITH = re.compile(rb" *(?:WITH|SYNCMOVE|SYNCMOVEFLY)\b", re.I)
_COMMA = re.compile(rb"[^\n]*,\s*\Z")
_CLOSES = re.compile(rb" *(?:ENDMOVE|ENDOPEN)\b", re.I)


@dataclass(frozen=True)
class Names:
    """The names that are taken out of lines.

    Attributes:
        at: Index into `name` of the first name of every line, (n,).
        name: Index into `names`.
        names: The distinct ones.
    """

    at: Indices
    name: Indices
    names: Sequence[str]


@dataclass(frozen=True)
class JoinedLines:
    """Lines of code, those of a statement in one.

    Attributes:
        masks: Their distinct masks, stripped.
        shape: Index into `masks`, (k,).
        rows: The first line of each, (k,).
    """

    masks: tuple[bytes, ...]
    shape: Indices
    rows: Indices


def stripped(mask: bytes) -> bytes:
    """Drop the blanks around the mask of a line, see `MarkedLines`."""
    if mask[:1] == WHOLE:
        own = mask.strip()
        return WHOLE + own if own else own
    return mask.strip()


def join(masks: Sequence[bytes], shape: Indices, names: Names) -> JoinedLines:
    """Join the lines of every statement.

    Args:
        masks: The distinct masks of lines.
        shape: Index into `masks` of every line that holds code, (n,).
        names: What is taken out of the masks.
    """
    own = [stripped(mask) for mask in masks]
    bare = [mask.removeprefix(WHOLE) for mask in own]
    opens = np.array(
        [mask.endswith(b",") and bool(_OPENS.match(mask)) for mask in bare], dtype=bool
    )
    starts = np.flatnonzero(opens[shape])
    length = _lengths(tuple(bare), shape, starts)
    starts, length = starts[length > 1], length[length > 1]
    kind = alike(shape, starts, starts + length)
    shape, keep = shape.copy(), np.ones(len(shape), dtype=bool)
    inner = np.repeat(starts - np.cumsum(length - 1) + length, length - 1)
    keep[inner + np.arange(len(inner))] = False
    joined = Interned[bytes]()
    parts, of_kind = shape.tolist() if len(starts) else [], []
    for k in numbered_in_order(kind)[1].tolist():
        some = [own[part] for part in parts[starts[k] : starts[k] + length[k]]]
        if any(mask[:1] == WHOLE for mask in some):
            of_kind.append(-1)  # a row at a time: their names are filled in again
        else:
            of_kind.append(joined[b" ".join(some)])
    found = np.array(of_kind, dtype=np.int64)[kind]
    for k in np.flatnonzero(found < 0).tolist():
        a, b = int(starts[k]), int(starts[k] + length[k])
        found[k] = joined[_whole([own[part] for part in parts[a:b]], a, names)]
    shape[starts] = len(masks) + found
    rows = np.flatnonzero(keep)
    return JoinedLines((*own, *joined), shape[rows], rows)


def _whole(parts: Sequence[bytes], row: int, names: Names) -> bytes:
    """Join lines some of which hold their names, from a row on: now all do."""
    texts = []
    for at, part in zip(names.at[row : row + len(parts)].tolist(), parts, strict=True):
        count = 0 if part[:1] == WHOLE else part.count(NAME_MARK.encode())
        words = [names.names[k] for k in names.name[at : at + count].tolist()]
        mask = part.removeprefix(WHOLE).decode("latin-1")
        texts.append(mask_of(mask, tuple(words)) if words else mask)
    return WHOLE + " ".join(texts).encode("latin-1")


def _lengths(masks: tuple[bytes, ...], shape: Indices, starts: Indices) -> Indices:
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


def _which(
    masks: tuple[bytes, ...], shape: Indices, pattern: re.Pattern[bytes]
) -> Bools:
    """Tell which of some lines match a pattern."""
    used, at = np.unique(shape, return_inverse=True)
    found = [bool(pattern.match(masks[k])) for k in used.tolist()]
    return np.array(found, dtype=bool)[at]


# Lines that divide a block and open another one: each of both gets a row.
#
# ``CASE (1): IF a THEN`` belongs to two blocks, which end in different lines.

_NUMBER, _NAME = NUMBER_MARK.encode(), NAME_MARK.encode()
_IN_PARENTHESES = rb"\((?:'[^']*'|[^'()]|\([^()]*\))*\)"
_DIVIDED = re.compile(
    rb"(CASE *" + _IN_PARENTHESES + rb" *:|ELSE *:) *"
    rb"((?:IF|SELECT|FOR|WHILE|CONDITION)\b.*|REPEAT *;?)",
    re.I | re.S,
)
_CLOSED = re.compile(rb"\bEND(?:IF|SELECT|FOR|WHILE|CONDITION)\b", re.I)


@dataclass(frozen=True)
class LogicalRows:
    """Logical lines.

    Attributes:
        masks: The distinct masks, stripped, see `MarkedLines`.
        shape: Index into `masks`, (n,).
        line: Physical line, (n,).
        first: CSR offsets into the numbers, (n + 1,).
        name: Index of the first name that is taken out of the line, (n,).
    """

    masks: tuple[bytes, ...]
    shape: Indices
    line: Indices
    first: Indices
    name: Indices


def with_block_rows(rows: LogicalRows) -> LogicalRows:
    """Give the block that opens behind CASE or ELSE a row of its own."""
    found = {
        k: parts.groups()
        for k, mask in enumerate(rows.masks)
        if (parts := _DIVIDED.fullmatch(mask.removeprefix(WHOLE)))
        and not _CLOSED.search(parts[2])
    }
    if not found:
        return rows
    m = len(rows.masks)
    head, tail = np.arange(m), np.arange(m)
    numbers, names = np.zeros(m, dtype=np.int64), np.zeros(m, dtype=np.int64)
    masks = list(rows.masks)
    for k, (before, behind) in found.items():
        head[k], tail[k] = len(masks), len(masks) + 1
        numbers[k], names[k] = before.count(_NUMBER), before.count(_NAME)
        kind = WHOLE if rows.masks[k][:1] == WHOLE else b""
        masks += [kind + before, kind + behind]
    times = np.where(head[rows.shape] != rows.shape, 2, 1)
    row = np.repeat(np.arange(len(times)), times)
    second = np.append(False, row[1:] == row[:-1])
    shape = rows.shape[row]
    first = rows.first[row] + np.where(second, numbers[shape], 0)
    return LogicalRows(
        tuple(masks),
        np.where(second, tail[shape], head[shape]).astype(rows.shape.dtype),
        rows.line[row],
        np.append(first, rows.first[-1]).astype(rows.first.dtype),
        rows.name[row] + np.where(second, names[shape], 0),
    )


# All lines of a file, read piece by piece.

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
    shape: Indices
    line: Indices
    first: Indices
    start: Indices
    end: Indices
    value: Floats
    comment: Indices

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


def read_lines(source: Source, each: Map = map) -> Lines:
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
    ids, names = Interned[bytes](), Interned[str]()
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
        masks: Their distinct masks, see `MarkedLines`.
        shape: Index into `masks`, (n,).
        comment: As in `Lines`.
        first: CSR offsets into the numbers, (n + 1,).
        start: Byte offsets of the numbers in the file, (m,).
        end: Where they end, (m,).
        value: What they are worth, (m,).
        names: The names that are taken out of the masks, in order.
        name: Their numbers, the same for the same name, (p,).
        name_first: CSR offsets into them, (n + 1,).
        unterminated: As in `MaskedLines`.
    """

    masks: tuple[bytes, ...]
    shape: Indices
    comment: Indices
    first: Indices
    start: Indices
    end: Indices
    value: Floats
    names: Sequence[str]
    name: Indices
    name_first: Indices
    unterminated: tuple[int, ...]


def _read(data: bytes, starts: Indices, lines: slice, place: slice) -> _Piece:
    """Read a piece of a text; offsets are counted from the beginning of the text."""
    marked = mark_lines(data[place], starts[lines] - place.start)
    piece, at = marked.masked, place.start
    short = np.int32 if len(data) < 2**31 else np.int64
    ids = Interned[bytes]()
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


def _offsets(parts: list[Indices]) -> Indices:
    """Put CSR offsets one behind the other."""
    begin = np.cumsum([0, *(int(part[-1]) for part in parts)])
    moved = [part[:-1] + own for part, own in zip(parts, begin, strict=False)]
    return np.concatenate([*moved, begin[-1:]])


def _logical(
    source: Source, masks: tuple[bytes, ...], names: Interned[str], found: _Piece
) -> Lines:
    """Join the continued lines and drop the empty ones."""
    code = np.array([*map(bool, map(stripped, masks))], dtype=bool)
    rows = np.flatnonzero(code[found.shape])
    at = found.name_first[rows]
    joined = join(masks, found.shape[rows], Names(at, found.name, tuple(names)))
    kept, short = rows[joined.rows], found.start.dtype
    first = np.append(found.first[kept], len(found.start)).astype(short)
    lines = with_block_rows(
        LogicalRows(joined.masks, joined.shape, kept + 1, first, at[joined.rows])
    )
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
