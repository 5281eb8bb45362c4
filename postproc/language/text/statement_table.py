"""Statements of a file: forms and numbers as arrays, no object per statement."""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Generic, Self, TypeVar

import numpy as np

from postproc import _native
from postproc.arrays import Bools, Floats, Indices, Ints, release_memory
from postproc.diagnostics import Code
from postproc.exceptions import ProgramError
from postproc.language import ir
from postproc.language.text import templates
from postproc.language.text.source import NumberSpans, Source, Span
from postproc.language.text.symbol_column import NameColumn
from postproc.language.visits import Diagnostic

_WORD = re.compile(r"[A-Za-z_$]\w*")
SHOWN = 60  # characters of a statement in a message
_OPEN_STRING = "a string is not terminated"
T = TypeVar("T")


@dataclass(frozen=True)
class Statements(Generic[T]):
    """The n statements of a file (structure of arrays).

    Attributes:
        source: The text.
        said: What the distinct statements say.
        shape: Index into `said`, (n,).
        begin_line: 1-based line on which each begins, (n,).
        first: CSR offsets into the numbers, (n + 1,).
        numbers: Where each number stands, its sign included, (m,).
        value: What it is worth, NaN where it cannot be read or is infinite, (m,).
    """

    source: Source
    said: templates.ParsedShapes[T]
    shape: Indices
    begin_line: Indices
    first: Indices
    numbers: NumberSpans
    value: Floats

    def __len__(self) -> int:
        """Return the number of statements."""
        return len(self.shape)

    @property
    def shapes(self) -> templates.Shapes:
        """Return the distinct masks of statements, in the order of appearance."""
        return self.said.shapes

    def statement(self, row: int) -> T:
        """Return what a statement says."""
        return self.said[int(self.shape[row])]

    def which(self, test: Callable[[T], bool]) -> Bools:
        """Tell which statements pass a test that no name in them decides, (n,)."""
        found: Bools = self.said.which(test)[self.shape]
        return found

    def of_kind(self, test: Callable[[T], bool]) -> list[int]:
        """List statements that pass a test that no name in them decides."""
        rows: list[int] = np.flatnonzero(self.which(test)).tolist()
        return rows

    def where(
        self, test: Callable[[T], bool], first: int = 0, behind: int | None = None
    ) -> list[int]:
        """List statements that pass a test that no name but what they call decides.

        Args:
            test: The test; it is asked once for each form that calls nothing by a name
                with a digit.
            first: The first row to look at.
            behind: The row behind the last one.
        """
        shape = self.shape[first:behind]
        number, example = templates.number_in_order(shape)
        passed, known = np.zeros(len(example), dtype=bool), dict[int, bool | None]()
        for k, own in enumerate(shape[example].tolist()):
            form = int(self.said.form[own])
            if form not in known:
                one = self.said.said[form]
                known[form] = None if _calls_open(one) else test(one)
            found = known[form]
            passed[k] = test(self.said[own]) if found is None else found
        rows = first + np.flatnonzero(passed[number])
        return [*rows.tolist()]

    @property
    def end_line(self) -> Indices:
        """1-based line up to which what stands before a statement counts, (n,)."""
        return self.begin_line

    def line(self, row: int) -> int:
        """Return the 1-based line that a statement begins on."""
        return int(self.begin_line[row])

    def diagnostic(self, row: int, code: Code, message: str) -> Diagnostic:
        """Say something of a statement."""
        return Diagnostic(self.source.name, self.line(row), code, message)

    def without_values(self) -> Self:
        """Let go of what the numbers are worth: it can be read again."""
        return replace(self, value=np.empty(0))


def _calls_open(one: object) -> bool:
    """Tell whether the name of what a statement calls is open in its form."""
    inner = ir.inside(one) if isinstance(one, ir.SourceStatement) else one
    return templates.name_index(getattr(inner, "name", "")) >= 0


@dataclass(frozen=True)
class StatementText(Statements[T]):
    """The n statements of a file, and where each of them stands.

    Attributes:
        begin, end: Byte offsets of every statement, (n,).
    """

    begin: Indices
    end: Indices

    def lines(self, row: int) -> range:
        """Return the 1-based lines that a statement stands on."""
        begin, end = self.span(row)
        return range(self.line(row), self.source.line_of(max(end - 1, begin)) + 1)

    @cached_property
    def end_line(self) -> Indices:
        """1-based line on which each statement ends, (n,)."""
        return self.source.lines_of(np.maximum(self.end - 1, self.begin))

    def rows_on(self, line: int) -> range:
        """Return the statements that stand on a line, or begin or end there."""
        begin, end = self.begin_line, self.end_line
        behind = int(np.searchsorted(begin, line, side="right"))
        return range(int(np.searchsorted(end, line)), behind)

    def row_of(self, slot: int) -> int:
        """Return the statement that a number stands in."""
        return int(np.searchsorted(self.first, slot, side="right")) - 1

    def span(self, row: int) -> Span:
        """Return the bytes of a statement."""
        return Span(int(self.begin[row]), int(self.end[row]))

    def text(self, row: int) -> str:
        """Return a statement as it is written."""
        start, end = self.span(row)
        return self.source.text[start:end]

    def words(self, rows: Iterable[int], but: Container[str] = ()) -> frozenset[str]:
        """Return the words of some statements, in lower case.

        Args:
            rows: The statements.
            but: What they do not begin with.
        """
        texts = (_WORD.findall(self.text(row).lower()) for row in rows)
        found = (words for words in texts if words and words[0] not in but)
        return frozenset().union(*found)

    def quote(self, row: int) -> str:
        """Quote the beginning of a statement, on one line."""
        words = " ".join(self.text(row).split())
        return repr(words if len(words) <= SHOWN else f"{words[:SHOWN]} ..")


def read_lines(source: Source, parse: Callable[[str], Any] = str) -> Statements[Any]:
    """Read the logical lines of a file.

    A statement may go on over lines; a block that opens behind CASE or ELSE has a row
    of its own.

    Args:
        source: The file.
        parse: Says what the form of a line says.

    Raises:
        ProgramError: A string does not end on its line.
    """
    found = _native.scan_logical_lines(source.data, source.line_starts)
    forms, (form, line, at, first), (places, value), names, unterminated = found
    if unterminated:
        cure = "Close it with an apostrophe on the same line."
        raise ProgramError(source.name, _OPEN_STRING, cure, line=1 + unterminated[0])
    said, shape = _parse(forms, form, at, names, parse)
    return Statements(source, said, shape, line, first, NumberSpans(*places), value)


def _parse(
    forms: Sequence[bytes],
    form: Indices,
    at: Indices,
    names: tuple[NameColumn, Ints],
    parse: Callable[[str], T],
) -> tuple[templates.ParsedShapes[T], Indices]:
    """Parse each form once; return what every statement says, and its shape, (n,)."""
    shapes, shape = templates.find_shapes(forms, form, at, names[1], names[0])
    return templates.parse_shapes(shapes, parse), shape.astype(np.int32)


def read_text(
    source: Source, scan: Callable[[bytes], tuple[Any, ...]], parse: Callable[[str], T]
) -> StatementText[T]:
    """Read the statements of a file.

    Args:
        source: The file.
        scan: Cuts its bytes into statements, in the core.
        parse: Says what the form of a statement says.

    Raises:
        ProgramError: A string or a header does not end.
    """
    forms, by_statement, numbers, names, unterminated = scan(source.data)
    form, begin, end, first, name_first = by_statement
    if unterminated:
        at = unterminated[0]
        header = source.data[at : at + 1] == b"%"
        raise ProgramError(
            source.name,
            "the header does not end" if header else _OPEN_STRING,
            "Close it with %%%." if header else "Close it with a quote on its line.",
            line=source.line_of(at),
        )
    said, shape = _parse(forms, form, np.asarray(name_first[:-1]), names, parse)
    places, value = numbers
    value[~np.isfinite(value)] = np.nan
    line = source.lines_of(begin).astype(np.int32)
    release_memory(len(value))
    return StatementText(
        source, said, shape, line, first, NumberSpans(*places), value, begin, end,
    )  # fmt: skip
