"""Logical lines of a file: shapes and numbers as arrays, no object per line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from postproc import _native
from postproc.arrays import Bools
from postproc.exceptions import ProgramError
from postproc.language.text.source import NumberSpans, Source
from postproc.language.text.statement_table import Statements
from postproc.language.text.templates import find_shapes, parse_shapes

T = TypeVar("T")


def read_lines(source: Source, parse: Callable[[str], Any] = str) -> Statements[Any]:
    """Split a source into logical lines with masked numbers.

    A statement may go on over lines; a block that opens behind CASE or ELSE has a row
    of its own.

    Args:
        source: The file.
        parse: Says what the form of a line says.

    Raises:
        ProgramError: A string does not end on its line.
    """
    found = _native.scan_logical_lines(source.data, source.line_starts)
    forms, (form, line, at, first), (places, value), (names, name), unterminated = found
    if unterminated:
        raise ProgramError(
            source.name,
            "a string is not terminated",
            "Close it with an apostrophe on the same line.",
            line=1 + unterminated[0],
        )
    shapes, shape = find_shapes(forms, form, at, name, names)
    said, numbers = parse_shapes(shapes, parse), NumberSpans(*places)
    return Statements(source, said, shape.astype(np.int32), line, first, numbers, value)


def reread_lines(
    source: Source, before: Statements[T]
) -> tuple[Statements[T], Bools, int] | None:
    """Read a text that should differ from one read before in numbers alone.

    Every line of both is read, but what lines have in common with those before is not
    worked out again. One line of comment may have come in, as a stamp does.

    Returns:
        Its lines, which of their numbers are written otherwise, (m,), and the physical
        line (from 0) that was not there, -1 where there is none. None where lines say
        anything else, or a string does not end.
    """
    old, count = before.source, len(before.numbers)
    found = _native.rescan_lines(
        old.data, old.line_starts, source.data, source.line_starts, count
    )
    if found is None:
        return None
    added, places, value, changed = found
    line = before.begin_line
    if added >= 0:
        line = (line + (line > added)).astype(np.int32, copy=False)
    numbers = NumberSpans(*places)
    lines = replace(
        before, source=source, begin_line=line, numbers=numbers, value=value
    )
    return lines, changed, added
