"""Variable files: the values that a program's points have on the controller."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Ints
from postproc.diagnostics import Code
from postproc.language.pdl2.abstract_state import root_of
from postproc.language.pdl2.entries import (
    NESTED,
    POSITIONS,
    Entries,
    EntryLines,
    Records,
    Rows,
    find_records,
    is_nested,
    is_no_value,
    last_head,
    read_records,
)
from postproc.language.pdl2.nested import complete_entries, find_fields, with_fields
from postproc.language.pdl2.parser import parse_value_form
from postproc.language.text.source import Source
from postproc.language.text.statement_table import read_lines
from postproc.language.text.symbol_column import NameColumn
from postproc.language.visits import Diagnostic

Finding = tuple[int, Diagnostic]
"""What was found, and the row at which that shows."""


@dataclass(frozen=True)
class VariableFile:
    """A variable file.

    Attributes:
        lines: The text, without what its numbers are worth.
        entries: Entries by lower-case name; a name with two entries has none.
        diagnostics: What was found while reading.
        unread: As in `Fields`.
    """

    lines: EntryLines
    entries: Entries
    diagnostics: tuple[Diagnostic, ...]
    unread: frozenset[str] = frozenset()

    @property
    def source(self) -> Source:
        """Return the text."""
        return self.lines.source


def read_variables(source: Source) -> VariableFile:
    """Read a variable file; what is wrong in it is reported, not fatal.

    Args:
        source: The file.

    Raises:
        ProgramError: A string does not end on its line.
    """
    lines: EntryLines = read_lines(source, parse_value_form)
    head = last_head(lines)
    fields = find_fields(lines, head)
    records = with_fields(find_records(lines, head), fields)
    read = complete_entries(read_records(lines, records), fields)
    entries, twice = _distinguish_entries(read, fields.twice)
    found = [
        *_report_duplicates(source, entries, records, twice),
        *_incomplete(source, entries, records, {*twice}),
        *_not_understood(lines, head),
        *fields.findings,
    ]
    found.sort(key=lambda finding: finding[0])
    told = tuple(diagnostic for _, diagnostic in found)
    return VariableFile(lines.without_values(), entries, told, fields.unread)


def _distinguish_entries(
    entries: Entries, ambiguous: frozenset[str]
) -> tuple[Entries, list[int]]:
    """Name the entries; also return those whose name an earlier one has.

    Args:
        entries: All of a file.
        ambiguous: Names that records or paths have too.
    """
    nested = [layout.kind in NESTED for layout in entries.layouts]
    written, own = entries.name.lower(), NameColumn()
    if not any(nested) and not ambiguous:
        rows = own.of(written)
        if len(own) == len(written):
            return replace(entries, row=Rows(own, rows)), []
    names = [
        (row, name)
        for row, name in enumerate(written)
        if not nested[entries.layout[row]]
    ]
    if ambiguous:
        names = [(k, name) for k, name in names if root_of(name) not in ambiguous]
    count = Counter(name for _, name in names)
    single = {name: row for row, name in names if count[name] == 1}
    first = {name: row for row, name in reversed(names)}
    twice = [row for row, name in names if first[name] != row]
    rows = np.array([*single.values()], dtype=np.int32)
    return replace(entries, row=Rows(NameColumn(single), rows)), twice


def _not_understood(lines: EntryLines, head: Ints) -> Iterator[Finding]:
    """Report lines that the grammar does not know, but for those of nested values."""
    nested = lines.which(is_nested)
    for row in np.flatnonzero(lines.which(is_no_value)).tolist():
        if head[row] < 0 or not nested[head[row]]:
            text = lines.source.line_text(lines.line(row)).strip()[:60]
            message = f"not understood, kept: {text!r}"
            yield row, lines.diagnostic(row, Code.LSV_LINE, message)


def _report_duplicates(
    source: Source, entries: Entries, records: Records, twice: list[int]
) -> Iterator[Finding]:
    for row in twice:
        text = f"{entries.name[row]} has two entries: it is not compensated; delete one"
        found = Diagnostic(
            source.name, int(entries.line[row]), Code.LSV_DUPLICATE, text
        )
        yield int(records.closed[row]), found


def _incomplete(
    source: Source, entries: Entries, records: Records, twice: set[int]
) -> Iterator[Finding]:
    """Report positions without six known values."""
    places = np.array([one.kind in POSITIONS for one in entries.layouts], dtype=bool)
    unknown = np.isnan(entries.numbers).any(axis=1) & places[entries.layout]
    for row in np.flatnonzero(unknown).tolist():
        if row in twice:
            continue
        name, seen = entries.name[row], entries.layouts[entries.layout[row]].seen
        code, text = Code.LSV_UNINITIALISED, f"{name} is not initialised (*)"
        if seen < 6:
            code = Code.LSV_INCOMPLETE
            text = f"{name} has {seen} of 6 values: is the file cut?"
        elif seen > 6:
            code, text = Code.LSV_TOO_MANY, f"{name} has {seen} values in place of 6"
        found = Diagnostic(source.name, int(entries.line[row]), code, text)
        yield int(records.closed[row]), found
