"""Logical lines of a file: shapes and numbers as arrays, no object per line."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np

from postproc.arrays import Bools, Indices, Interned, Ints, spans
from postproc.exceptions import ProgramError
from postproc.language.text.lexer import (
    NAME_MARK,
    NUMBER_MARK,
    rescan_lines,
    scan_lines,
)
from postproc.language.text.source import Source
from postproc.language.text.statement_table import Statements
from postproc.language.text.templates import (
    alike,
    find_shapes,
    number_in_order,
    parse_shapes,
)
from postproc.language.visits import Diagnostic

T = TypeVar("T")

# Statements over several lines: one that ends with a comma goes on with clauses.

_OPENS = re.compile(rb" *(?:\w+ *:: *)?(?:MOVE|MOVEFLY|OPEN)\b[^\n]*, *\Z", re.I)
_CLAUSE = re.compile(
    rb" *(?:WITH|ADVANCE|TIL|VIA|SYNCMOVE|SYNCMOVEFLY|CONDITION|\$)", re.I
)
_WITH = re.compile(rb" *(?:WITH|SYNCMOVE|SYNCMOVEFLY)\b", re.I)
_COMMA = re.compile(rb"[^\n]*,\s*\Z")
_CLOSES = re.compile(rb" *(?:ENDMOVE|ENDOPEN)\b", re.I)


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


def join(masks: Sequence[bytes], shape: Indices) -> JoinedLines:
    """Join the lines of every statement.

    Args:
        masks: The distinct masks of lines.
        shape: Index into `masks` of every line that holds code, (n,).
    """
    own = tuple(mask.strip() for mask in masks)
    opens = np.array(
        [mask.endswith(b",") and bool(_OPENS.match(mask)) for mask in own], dtype=bool
    )
    starts = np.flatnonzero(opens[shape])
    length = _lengths(own, shape, starts)
    starts, length = starts[length > 1], length[length > 1]
    kind = alike(shape, starts, starts + length)
    shape, keep = shape.copy(), np.ones(len(shape), dtype=bool)
    inner = np.repeat(starts - np.cumsum(length - 1) + length, length - 1)
    keep[inner + np.arange(len(inner))] = False
    joined = Interned[bytes]()
    parts, of_kind = shape.tolist() if len(starts) else [], []
    for k in number_in_order(kind)[1].tolist():
        some = [own[part] for part in parts[starts[k] : starts[k] + length[k]]]
        of_kind.append(joined[b" ".join(some)])
    shape[starts] = len(masks) + np.array(of_kind, dtype=np.int64)[kind]
    rows = np.flatnonzero(keep)
    return JoinedLines((*own, *joined), shape[rows], rows)


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
        masks: The distinct masks, stripped.
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
        if (parts := _DIVIDED.fullmatch(mask)) and not _CLOSED.search(parts[2])
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
        masks += [before, behind]
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


# All lines of a file.


def read_lines(source: Source, parse: Callable[[str], Any] = str) -> Statements[Any]:
    """Split a source into logical lines with masked numbers.

    Args:
        source: The file.
        parse: Says what the form of a line says.

    Raises:
        ProgramError: A string does not end on its line.
    """
    found = scan_lines(source.data, source.line_starts)
    if found.unterminated:
        raise ProgramError(
            source.name,
            "a string is not terminated",
            "Close it with an apostrophe on the same line.",
            line=1 + found.unterminated[0],
        )
    # Continued lines are joined and empty ones dropped.
    code = np.array([bool(mask.strip()) for mask in found.masks], dtype=bool)
    rows = np.flatnonzero(code[found.shape])
    at = found.name_first[rows]
    joined = join(found.masks, found.shape[rows])
    kept = rows[joined.rows]
    first = np.append(found.first[kept], np.int32(len(found.numbers)))
    lines = with_block_rows(
        LogicalRows(joined.masks, joined.shape, kept + 1, first, at[joined.rows])
    )
    shapes, shape = find_shapes(
        lines.masks, lines.shape, lines.name, found.name, found.names
    )
    return Statements(
        source,
        parse_shapes(shapes, parse),
        shape.astype(np.int32),
        lines.line.astype(np.int32),
        lines.first,
        found.numbers,
        found.value,
    )


# The lines of a text that was read before, with other numbers.


@dataclass(frozen=True)
class RereadLines(Generic[T]):
    """Lines that say what they said before, but for what their numbers are worth.

    Attributes:
        lines: The lines as they are now.
        changed: Which numbers are written otherwise, (m,).
        added: Physical line (from 0) that was not there, -1 where there is none.
    """

    lines: Statements[T]
    changed: Bools
    added: int

    def change(self, rows: Ints) -> bool:
        """Tell whether any number in some logical lines is written otherwise."""
        first = self.lines.first.astype(np.int64)
        own = spans(first[rows], first[rows + 1] - first[rows])
        return bool(self.changed[own].any())

    def move(self, found: Sequence[Diagnostic]) -> tuple[Diagnostic, ...]:
        """Move what was found in the lines before to where these stand now."""
        if self.added < 0:
            return tuple(found)
        return tuple(replace(d, line=d.line + (d.line > self.added)) for d in found)


def reread_lines(source: Source, before: Statements[T]) -> RereadLines[T] | None:
    """Read a text that should differ from one read before in numbers alone.

    Every line of both is read, but what lines have in common with those before is not
    worked out again. One line of comment may have come in, as a stamp does.

    Returns:
        Its lines; None where they say anything else, or a string does not end.
    """
    old = before.source
    found = rescan_lines(
        (old.data, old.line_starts), (source.data, source.line_starts),
        len(before.numbers),
    )  # fmt: skip
    if found is None:
        return None
    line = before.begin_line
    if found.added >= 0:
        line = line + (line > found.added)
    lines = replace(
        before, source=source, begin_line=line.astype(np.int32, copy=False),
        numbers=found.numbers, value=found.value,
    )  # fmt: skip
    return RereadLines(lines, found.changed, found.added)
