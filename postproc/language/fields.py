"""The fields of all records and paths of a variable file, read like its variables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Ints
from postproc.language.diagnostic import Diagnostic
from postproc.language.entered import Entered
from postproc.language.entry_columns import POSITIONS, Entries
from postproc.language.field import Field, OddLine
from postproc.language.forms import Formed
from postproc.language.lines import Lines
from postproc.language.nested import Nested
from postproc.language.records import Records, is_nested

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


def find_fields(lines: Lines, said: Formed[Entered | None], head: Ints) -> Fields:
    """Find the fields of the records and paths of a file.

    Args:
        lines: The file.
        said: What its shapes of lines say.
        head: Row of the last variable's head up to every row, (n,).
    """
    own = np.flatnonzero(head == np.arange(len(head)))
    nested = np.flatnonzero(said.which(is_nested)[lines.shape[own]])
    if not len(nested):
        return Fields()
    names = [_name(lines, said, row) for row in own.tolist()]
    count, ends = Counter(names), np.append(own[1:], len(head))
    each: list[Field] = []
    findings: list[Finding] = []
    unread: set[str] = set()
    for at in nested.tolist():
        row, end = int(own[at]), int(ends[at])
        if count[names[at]] > 1:
            text = "has two entries: it is not compensated; delete one"
            findings.append((end, _finding(lines, said, row, row, "lsv-twice", text)))
            unread.add(names[at])
            continue
        entry = Nested(lines, said, row)
        try:
            each += entry.fields(end)
        except OddLine as odd:
            unread.add(names[at])
            text = f"is not read: {odd}"
            findings.append(
                (end, _finding(lines, said, row, odd.row, "lsv-parts", text))
            )
        else:
            findings += _unread(lines, said, entry, end)
            unread |= {names[at] + part.lower() for part in entry.dropped}
    twice = frozenset(names[at] for at in nested.tolist() if count[names[at]] > 1)
    return Fields(tuple(each), tuple(findings), twice, frozenset(unread))


def _unread(
    lines: Lines, said: Formed[Entered | None], entry: Nested, end: int
) -> Iterator[Finding]:
    """Say which fields of an entry are not read, once."""
    if entry.unread:
        at, why = entry.unread[0]
        more = len(entry.unread) - 1
        text = f"is not read as a whole: {why}" + (f", and {more} more" if more else "")
        yield end, _finding(lines, said, entry.row, at, "lsv-parts", text)


def _finding(
    lines: Lines, said: Formed[Entered | None], row: int, at: int, code: str, text: str
) -> Diagnostic:
    entered = said[int(lines.shape[row])]
    assert entered is not None
    line = int(lines.line[at])
    return Diagnostic(lines.source.name, line, code, f"{entered.name} {text}")


def _name(lines: Lines, said: Formed[Entered | None], row: int) -> str:
    entered = said[int(lines.shape[row])]
    return entered.name.lower() if entered is not None else ""


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


def completed(entries: Entries, fields: Fields) -> Entries:
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
        name=[*entries.name[:-k], *(one.name for one in fields.each)],
        layout=layout,
        layouts=(*entries.layouts, *(replace(e, shared=True) for e in entries.layouts)),
        numbers=numbers,
        arm=np.append(arm[:-k], np.where(arm[-k:] == 0, given, arm[-k:])),
    )
