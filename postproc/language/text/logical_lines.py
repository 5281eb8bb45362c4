"""Logical lines of a file: shapes and numbers as arrays, no object per line."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from postproc import _native
from postproc.exceptions import ProgramError
from postproc.language.text.source import NumberSpans, Source
from postproc.language.text.statement_table import Statements
from postproc.language.text.templates import find_shapes, parse_shapes


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
