"""Statements of a RAPID file: forms and numbers as arrays, no object per statement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc import _native
from postproc.arrays import Floats, Indices, Interned
from postproc.exceptions import ProgramError
from postproc.language.rapid.parser import parse_statement
from postproc.language.rapid.syntax import RapidStatement
from postproc.language.shapes import ParsedShapes, find_shapes, parse_shapes
from postproc.language.source import Source, Span


@dataclass(frozen=True)
class RapidText:
    """The n statements of a file (structure of arrays).

    A statement ends with ``;``, or where its words are complete (``ENDPROC``,
    ``IF a THEN``), whatever lines it stands on.

    Attributes:
        source: The text.
        said: What the distinct statements say.
        shape: Index into `said`, (n,).
        begin, end: Byte offsets of every statement, (n,).
        first: CSR offsets into the numbers, (n + 1,).
        start, stop: Byte offsets of each number, its sign included, (m,).
        value: What it is worth, NaN where it cannot be read, (m,).
    """

    source: Source
    said: ParsedShapes[RapidStatement]
    shape: Indices
    begin: Indices
    end: Indices
    first: Indices
    start: Indices
    stop: Indices
    value: Floats

    def __len__(self) -> int:
        """Return the number of statements."""
        return len(self.shape)

    def statement(self, row: int) -> RapidStatement:
        """Return what a statement says."""
        return self.said[int(self.shape[row])]

    def line(self, row: int) -> int:
        """Return the 1-based line that a statement begins on."""
        return self.source.line_of(int(self.begin[row]))

    def span(self, row: int) -> Span:
        """Return the bytes of a statement."""
        return Span(int(self.begin[row]), int(self.end[row]))

    def text(self, row: int) -> str:
        """Return a statement as it is written."""
        start, end = self.span(row)
        return self.source.text[start:end]


def read_statements(source: Source) -> RapidText:
    """Read the statements of a RAPID file.

    Raises:
        ProgramError: A string or the header does not end.
    """
    forms, by_statement, numbers, names, unterminated = _native.scan_statements(
        source.data
    )
    form, begin, end, first, name_first = by_statement
    if unterminated:
        at = unterminated[0]
        header = source.data[at : at + 1] == b"%"
        raise ProgramError(
            source.name,
            "the header does not end" if header else "a string is not terminated",
            "Close it with %%%." if header else "Close it with a quote on its line.",
            line=source.line_of(at),
        )
    known = Interned[str](names[0])
    at_names = np.asarray(name_first[:-1])
    shapes, shape = find_shapes(forms, form, at_names, names[1], known)
    said = parse_shapes(shapes, parse_statement)
    return RapidText(source, said, shape.astype(np.int32), begin, end, first, *numbers)
