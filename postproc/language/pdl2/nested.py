"""Records and paths of a variable file: which lines hold the value of a field."""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from postproc.arrays import Ints
from postproc.diagnostics import Code
from postproc.exceptions import ProgramError
from postproc.language.pdl2.entries import (
    NESTED,
    POSITIONS,
    Entries,
    EntryLines,
    Records,
    is_nested,
    kind_of,
    last_head,
)
from postproc.language.pdl2.parser import EntryPart, parse_value_form
from postproc.language.pdl2.values import COMPONENTS
from postproc.language.text.source import Source
from postproc.language.text.statement_table import read_lines
from postproc.language.text.symbol_column import NameColumn
from postproc.language.visits import Diagnostic

HIDDEN = frozenset({*COMPONENTS, "pos", "aux"})
"""Names of fields that may mean a component too, as in ``rec[1].x``: not read."""


@dataclass(frozen=True)
class Field:
    """A value in a record, or in a node of a path.

    Attributes:
        first: Row of its head.
        closed: Row at which what follows it begins.
        name: How a program writes it: ``pth.NODE[2].$MAIN_POS``.
        shared: Other programs see the record or path (Xport).
        arm: Arm number of the record or path, 0 where it is not said.
    """

    first: int
    closed: int
    name: str
    shared: bool
    arm: int


class OddLine(Exception):  # noqa: N818 - no error of the file, but the end of a reading
    """A line that leaves open to which part a value belongs.

    Attributes:
        row: Its row.
    """

    def __init__(self, row: int, why: str) -> None:
        """Say which line it is, and what is odd about it."""
        super().__init__(why)
        self.row = row


def fits(kind: str, line: EntryPart) -> bool:
    """Tell whether a line may be a part of a value of a type."""
    place = bool(line.components) or line.config is not None
    match kind:
        case "POS":
            return place and not (line.axes or line.plain)
        case "XTND":
            return (place or bool(line.axes)) and not line.plain
        case "JNTP":
            return bool(line.axes) and not (place or line.plain)
        case "INT" | "REA":
            return bool(line.plain) and not (place or line.axes)
    return not line.axes and line.config is None


# One record or path of a variable file: which of its lines hold a field's value.
#
# No public listing of a path is known. What is read is what the listings of the other
# types would be with fields in them; where a line leaves open to which part a value
# belongs, nothing of the entry is read.


@dataclass
class Nested:
    """A record, an array of records or a path, line by line.

    Attributes:
        lines: The file.
        row: Row of its head.
        found: Its fields by part (``.NODE[1]``, ``[1]``, "") and lower-case name.
        unread: Rows of what is not read, and why not.
        dropped: Parts of which nothing is read.
    """

    lines: EntryLines
    row: int
    found: dict[str, dict[str, Field]] = field(default_factory=dict)
    unread: list[tuple[int, str]] = field(default_factory=list)
    dropped: set[str] = field(default_factory=set)
    _part: str | None = None
    _words: bool | None = None  # parts begin with NODE[1], not with [1]
    _listed: bool = False  # a field of this part has elements
    _deeper: bool = False  # a field of this part has fields
    _open: tuple[int, EntryPart] | None = None
    _configs: int = 0

    def fields(self, end: int) -> list[Field]:
        """Return the fields up to a row, that of the next variable.

        Raises:
            OddLine: A line leaves open to which part a value belongs.
        """
        self.head = self._enter(self.row)
        self._begin_entry()
        for row in range(self.row + 1, end):
            self._take(row, self._enter(row))
        self._close(end)
        return [
            one
            for part, own in self.found.items()
            for one in own.values()
            if part not in self.dropped
        ]

    def _enter(self, row: int) -> EntryPart:
        entered = self.lines.statement(row)
        if entered is None:
            text = self.lines.source.line_text(self.lines.line(row))
            raise OddLine(row, f"{text.strip()[:60]!r} is not understood")
        return entered

    def _begin_entry(self) -> None:
        self.kind, self.array = kind_of(self.head.type)
        if not self.head.variable:
            why = "its head does not say whose it is (Priv, Xport, Local)"
            raise OddLine(self.row, why)
        if self.kind == "NODE" or (self.kind == "PATH" and self.array):
            raise OddLine(self.row, "values of this type are not read")
        if self.head.element or self.head.says_value:
            raise OddLine(self.row, "a value stands beside its head")
        if self.kind == "REC" and not self.array:
            self._part = ""
        slot = self.head.arm
        self._arm = self._index(self.row, slot) if slot >= 0 else 0

    def _take(self, row: int, line: EntryPart) -> None:
        if line.name:
            self._close(row)
            self._field(row, line)
        elif line.node >= 0 or line.element:
            parts = self._words or (self.kind == "REC" and not self.array)
            element = line.element and self._listed and parts  # no part can begin here
            if self._open is not None or not element:
                self._close(row)
                self._begin_part(row, line)
        elif self._open is not None:
            self._value(row, line)
        elif not (self._listed or self._deeper):
            raise OddLine(row, "it is not clear whose value this is")

    def _begin_part(self, row: int, line: EntryPart) -> None:
        words = line.node >= 0
        if self.kind == "REC" and (words or not self.array):
            raise OddLine(row, "a record has no such parts")
        if self._words not in (None, words) or (self._listed and not words):
            raise OddLine(row, "this may be a part of it, or an element of a field")
        if line.says_value:
            raise OddLine(row, "it is not clear whose value this is")
        slots = (line.node,) if words else line.element
        index = ",".join(str(self._index(row, slot)) for slot in slots)
        self._part = f".NODE[{index}]" if self.kind == "PATH" else f"[{index}]"
        if self._part in self.found:
            self._drop(row, f"{self._part.lstrip('.')} is there twice")
        self.found.setdefault(self._part, {})
        self._words, self._listed, self._deeper = words, False, False

    def _index(self, row: int, slot: int) -> int:
        value = float(self.lines.value[self.lines.first[row] + slot])
        if not (value.is_integer() and value >= 1):
            raise OddLine(row, "an index, or an arm, is no whole number")
        return int(value)

    def _field(self, row: int, line: EntryPart) -> None:
        if self._part is None:
            raise OddLine(row, "a field stands before the first part")
        kind, array = kind_of(line.type)
        nested = kind in NESTED
        self._listed |= array or bool(line.element) or kind == "PATH"
        if self._deeper:
            return
        if nested or array or line.element:
            self._deeper = nested
            if nested or line.name.startswith("$"):
                self._drop(row, f"{line.name} has parts of its own")
            else:
                self.unread.append((row, f"{line.name} has elements"))
        elif line.name.lower() in HIDDEN:
            self.unread.append((row, f"{line.name} may mean a component"))
            self._open = (row, line)
        else:
            self._open = (row, line)
        self._configs = 0
        if self._open is not None and line.says_value:
            self._value(row, line)

    def _value(self, row: int, line: EntryPart) -> None:
        assert self._open is not None
        self._configs += line.config is not None
        if self._configs > 1 or not fits(kind_of(self._open[1].type)[0], line):
            raise OddLine(row, f"this is no value of {self._open[1].name}")

    def _drop(self, row: int, why: str) -> None:
        """Read nothing of this part: which of its values is meant is not sure."""
        assert self._part is not None
        self.dropped.add(self._part)
        self.unread.append((row, why))

    def _close(self, row: int) -> None:
        """End the field that is open."""
        if self._open is None or self._part is None:
            return
        first, line = self._open
        self._open, name = None, line.name.lower()
        if name in HIDDEN or self._part in self.dropped:
            return
        own = self.found.setdefault(self._part, {})
        if name in own:
            self._drop(first, f"{line.name} is there twice")
        written = f"{self.head.name}{self._part}.{line.name}"
        own[name] = Field(first, row, written, self.head.shared, self._arm)


# The fields of all records and paths of a variable file, read like its variables.

Finding = tuple[int, Diagnostic]

_NUMBERS = {**dict.fromkeys(POSITIONS, 6), "VEC": 3}  # of a value; one of all others


@dataclass(frozen=True)
class Fields:
    """What the records and paths of a file hold.

    Attributes:
        each: Their fields.
        findings: What is not read of them, and the rows at which that shows.
        twice: Names, in lower case, that a record or path and something else have.
        unread: Records, paths and parts of them, in lower case, that are not read as
            a whole.
    """

    each: tuple[Field, ...] = ()
    findings: tuple[Finding, ...] = ()
    twice: frozenset[str] = frozenset()
    unread: frozenset[str] = frozenset()


def find_fields(lines: EntryLines, head: Ints) -> Fields:
    """Find the fields of the records and paths of a file.

    Args:
        lines: The file.
        head: Row of the last variable's head up to every row, (n,).
    """
    own = np.flatnonzero(head == np.arange(len(head)))
    nested = np.flatnonzero(lines.which(is_nested)[own])
    if not len(nested):
        return Fields()
    heads = map(lines.statement, own.tolist())
    names = ["" if head is None else head.name.lower() for head in heads]
    count, ends = Counter(names), np.append(own[1:], len(head))
    each: list[Field] = []
    findings: list[Finding] = []
    unread: set[str] = set()
    for at in nested.tolist():
        row, end = int(own[at]), int(ends[at])
        if count[names[at]] > 1:
            text = "has two entries: it is not compensated; delete one"
            findings.append((end, _finding(lines, row, row, Code.LSV_DUPLICATE, text)))
            unread.add(names[at])
            continue
        entry = Nested(lines, row)
        try:
            each += entry.fields(end)
        except OddLine as odd:
            unread.add(names[at])
            text = f"is not read: {odd}"
            findings.append((end, _finding(lines, row, odd.row, Code.LSV_PARTS, text)))
        else:
            findings += _report_unread(lines, entry, end)
            unread |= {names[at] + part.lower() for part in entry.dropped}
    twice = frozenset(names[at] for at in nested.tolist() if count[names[at]] > 1)
    return Fields(tuple(each), tuple(findings), twice, frozenset(unread))


def _report_unread(lines: EntryLines, entry: Nested, end: int) -> Iterator[Finding]:
    """Say which fields of an entry are not read, once."""
    if entry.unread:
        at, why = entry.unread[0]
        more = len(entry.unread) - 1
        text = f"is not read as a whole: {why}" + (f", and {more} more" if more else "")
        yield end, _finding(lines, entry.row, at, Code.LSV_PARTS, text)


def _finding(lines: EntryLines, row: int, at: int, code: Code, text: str) -> Diagnostic:
    entered = lines.statement(row)
    assert entered is not None
    return lines.diagnostic(at, code, f"{entered.name} {text}")


def with_fields(records: Records, fields: Fields) -> Records:
    """Take the fields for entries behind those of the variables."""
    if not fields.each:
        return records
    first = np.array([one.first for one in fields.each], dtype=np.int64)
    closed = np.array([one.closed for one in fields.each], dtype=np.int64)
    return Records(
        np.append(records.head, first),
        np.append(records.first, first),
        np.append(records.closed, closed),
        np.append(records.element, np.zeros(len(first), dtype=bool)),
    )


def complete_entries(entries: Entries, fields: Fields) -> Entries:
    """Tell of the fields, the last entries, what the heads of their variables say."""
    k, of = len(fields.each), len(entries.layouts)
    if not k:
        return entries
    layout, arm, numbers = entries.layout.copy(), entries.arm, entries.numbers.copy()
    own = layout[-k:]
    too_many = [one.seen > _NUMBERS.get(one.kind, 1) for one in entries.layouts]
    numbers[-k:][np.array(too_many, dtype=bool)[own]] = np.nan
    own[[one.shared for one in fields.each]] += of
    given = np.array([one.arm for one in fields.each], dtype=np.int64)
    return replace(
        entries,
        name=NameColumn((*[*entries.name][:-k], *(one.name for one in fields.each))),
        layout=layout,
        layouts=(*entries.layouts, *(replace(e, shared=True) for e in entries.layouts)),
        numbers=numbers,
        arm=np.append(arm[:-k], np.where(arm[-k:] == 0, given, arm[-k:])),
    )


def name_parts(source: Source, wanted: Sequence[int]) -> Iterator[str]:
    """Name the variables, fields and nodes that lines of a variable file belong to.

    Args:
        source: The file.
        wanted: 1-based lines, 0 for those that it does not have.
    """
    try:
        lines: EntryLines = read_lines(source, parse_value_form)
    except ProgramError:  # a string does not end
        yield from ("" for _ in wanted)
        return
    head = last_head(lines)
    fields = {f.first: f for f in find_fields(lines, head).each}
    firsts = sorted(fields)
    for line in wanted:
        row = int(np.searchsorted(lines.begin_line, line, side="right")) - 1
        at = bisect_right(firsts, row) - 1
        inside = at >= 0 and row < fields[firsts[at]].closed
        entered = lines.statement(int(head[row])) if row >= 0 <= head[row] else None
        name = "" if entered is None else entered.name
        yield fields[firsts[at]].name if inside else name
