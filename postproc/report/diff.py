"""What differs between two programs: the numbers of targets, or more."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import SequenceMatcher
from functools import cached_property, partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from postproc import _native
from postproc.arrays import Bools, Floats, Indices, Interned, Ints, data_frame
from postproc.compensation.outcome import LEFT_ALONE, Status
from postproc.compensation.output.line_outcomes import (
    LineOutcomes,
    read_arrivals,
)
from postproc.compensation.scale.workers import in_background
from postproc.files import (
    NamedText,
    open_text,
    read_input,
)
from postproc.language.languages import UNNAMED, file_named, language_of
from postproc.language.text.lexer import BLANKS, mask_of, scan_lines
from postproc.language.text.stamp import read_stamp, stamp_span, strip_stamp

if TYPE_CHECKING:
    from postproc.arrays import DataFrame

# Rows of `diff` as columns: no object a line, whatever the length of a program.

STATUSES = tuple(Status(k).name.lower() for k in range(len(Status)))


class DiffRow(NamedTuple):
    """One line that differs, or whose target was left alone.

    Attributes:
        file: Name of the original file.
        line: 1-based line in the original; 0 for a line that it does not have.
        target: What the numbers belong to: a variable, or the statement's first word.
        original, compensated: The numbers on the line; empty where the text differs.
        change_mm: Length of the change of the first three of six numbers or more, for
            a position; None for joint angles and text.
        text: The line's two texts where more than numbers differ, else "".
        status, code, reason: What came of the line's target, "" where no record tells.
        direction: In which every joint arrives, see `compensation.outcome`; or ().
        correction_mm: How far the TCP is moved there, or None.
        visits: Visits of the line by status where they have several, the most urgent
            first; else empty.
    """

    file: str
    line: int
    target: str
    original: tuple[float, ...]
    compensated: tuple[float, ...]
    change_mm: float | None
    text: str = ""
    status: str = ""
    code: str = ""
    reason: str = ""
    direction: tuple[int, ...] = ()
    correction_mm: float | None = None
    visits: dict[str, int] = {}  # noqa: RUF012


@dataclass(frozen=True, eq=False)
class DiffRows(Sequence[DiffRow]):
    """The rows of one file (structure of arrays); as a sequence it makes them.

    Attributes:
        file: Name of the original file.
        line: See `DiffRow`, (k,).
        targets: Names of what numbers belong to.
        target: Index into them, (k,).
        first: CSR offsets into the numbers, (k + 1,).
        original, compensated: The numbers, (m,).
        change_mm: See `DiffRow`, NaN where there is none, (k,).
        has_change: Where there is one, (k,).
        texts: The texts of those rows that have one, by row.
        told: What the record says of the file's targets, where there is one.
        entry: Index into it, -1 where it says nothing, (k,).
    """

    file: str
    line: Ints
    targets: Sequence[str]
    target: Ints
    first: Ints
    original: Floats
    compensated: Floats
    change_mm: Floats
    has_change: Bools
    texts: Mapping[int, str] = field(default_factory=dict)
    told: LineOutcomes | None = None
    entry: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    @classmethod
    def bare(cls, file: str, line: Ints, targets: Sequence[str]) -> DiffRows:
        """Make rows without numbers, each with a target of its own."""
        k = len(line)
        ints, none = np.zeros(k + 1, dtype=np.int64), np.empty(0)
        nan, no = np.full(k, np.nan), np.zeros(k, dtype=bool)
        return cls(file, line, targets, np.arange(k), ints, none, none, nan, no)

    def with_record(self, told: LineOutcomes | None) -> DiffRows:
        """Add what a record says."""
        if told is None:
            return self
        return replace(self, told=told, entry=told.find(self.line))

    def __len__(self) -> int:
        """Count the rows."""
        return len(self.line)

    def __iter__(self) -> Iterator[DiffRow]:
        """Make all rows, in order."""
        return map(self.row, range(len(self)))

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        """Make the k-th row, or those of a slice."""
        rows = range(len(self))[k]
        return self.row(rows) if isinstance(rows, int) else [*map(self.row, rows)]

    def row(self, k: int) -> DiffRow:
        """Make the k-th row."""
        own = slice(*self.first[k : k + 2].tolist())
        row = DiffRow(
            self.file,
            int(self.line[k]),
            self.targets[self.target[k]],
            tuple(self.original[own].tolist()),
            tuple(self.compensated[own].tolist()),
            float(self.change_mm[k]) if self.has_change[k] else None,
            self.texts.get(k, ""),
        )
        told, at = self.told, int(self.entry[k]) if self.told else -1
        if told is None or at < 0:
            return row
        return row._replace(
            status=STATUSES[told.status[at]],
            code=told.reasons[told.why[at]].name,
            reason=told.reasons[told.why[at]].text,
            direction=tuple(told.direction[at].tolist()),
            correction_mm=float(told.correction_mm[at]),
            visits=dict(told.mixed.get(at, {})),
        )


def join_rows(file: str, parts: Sequence[DiffRows]) -> DiffRows:
    """Put rows of one file one after the other, before a record tells of them."""
    if not parts:
        return DiffRows.bare(file, np.empty(0, dtype=np.int64), ())
    named = np.cumsum([0, *(len(p.targets) for p in parts)]).tolist()
    rows = np.cumsum([0, *(len(p) for p in parts)]).tolist()
    counts = [np.diff(p.first) for p in parts]
    return DiffRows(
        file,
        np.concatenate([p.line for p in parts]),
        [name for p in parts for name in p.targets],
        np.concatenate([p.target + n for p, n in zip(parts, named, strict=False)]),
        np.cumsum(np.concatenate([[0], *counts])),
        np.concatenate([p.original for p in parts]),
        np.concatenate([p.compensated for p in parts]),
        np.concatenate([p.change_mm for p in parts]),
        np.concatenate([p.has_change for p in parts]),
        {
            n + k: text
            for p, n in zip(parts, rows, strict=False)
            for k, text in p.texts.items()
        },
    )


# Lines of the same two places in two files: which numbers differ, or what more.

_ASSIGNED = re.compile(r"\s*([A-Za-z_$][\w$.\[\]]*)\s*(?::=|:)")
_TWO_WORDS = re.compile(r"\s*([A-Za-z_]+)\s+([A-Za-z_]+)")
_WORD = re.compile(r"[A-Za-z_]+")
_LEAD = re.compile(
    r"\s*(?:ELSE\s*:|CASE\s*\(.*?\)\s*:|WHEN\b.*?\bDO\b|[A-Za-z_]\w*\s*::)"
    r"(?=\s*[A-Za-z_$])",
    re.I,
)  # what may stand before a statement on its line
_LED = re.compile(r"\s*(?:ELSE\s*:|CASE\s*\(|WHEN\b|[A-Za-z_]\w*\s*::)", re.I)
_AS_BLANKS = bytes(32 if chr(c) in BLANKS else c for c in range(256))


def describe_changes(
    file: str, before: TextLines, after: TextLines, lead: int = 0
) -> DiffRows:
    """Describe those of equally many lines that differ.

    Args:
        file: Name of the original.
        before: Its lines.
        after: Those of the other file.
        lead: How many lines of the original stand before them.
    """
    rows, (old, new) = _native.compare_lines(
        before.data, before.first, after.data, after.first,
        named=language_of(file).names_numbers,
    )  # fmt: skip
    row, first, begin, alike, braced = rows
    has = (np.diff(first) >= 3) & ~braced
    at = first[:-1][has, None] + np.arange(3)
    change = np.full(len(row), np.nan)
    with np.errstate(invalid="ignore"):  # numbers too long for a float are infinite
        change[has] = np.linalg.norm(new[at] - old[at], axis=1)
    texts = {
        k: f"{before[line].decode('latin-1')} -> {after[line].decode('latin-1')}"
        for k, line in _pairs(np.flatnonzero(begin < 0), row)
    }
    names, target = _targets(before, row, begin, alike)
    told = row + lead + 1
    return DiffRows(file, told, names, target, first, old, new, change, has, texts)


def _pairs(rows: Ints, lines: Ints) -> Iterator[tuple[int, int]]:
    return zip(rows.tolist(), lines[rows].tolist(), strict=True)


def _targets(
    before: TextLines, lines: Ints, begins: Ints, alike: Bools
) -> tuple[list[str], Ints]:
    """Name what the numbers of lines belong to, once for lines that begin alike.

    Args:
        before: All lines.
        lines: The ones in question, (n,).
        begins: Where their first number starts, -1 for a line without a name, (n,).
        alike: What stands before it is the same as in the one above, (n,).

    Returns:
        Names, and the index of each line's, (n,).
    """
    lead = np.flatnonzero(~alike)
    known: dict[bytes, str | None] = {}
    told: list[str | None] = []
    for k, line in _pairs(lead, lines):
        begin = before[line][: max(int(begins[k]), 0)]
        if begin not in known:
            known[begin] = _name_owner(begin.translate(_AS_BLANKS).decode("latin-1"))
        told.append(known[begin] if begins[k] >= 0 else "")
    names = Interned[str]()
    code = [-1 if t is None else names[t] for t in told]
    codes = np.array(code, dtype=np.int64)
    index = np.repeat(codes, np.diff(lead, append=len(lines)))
    for k, line in _pairs(np.flatnonzero(index < 0), lines):
        index[k] = names[target_name(before[line].decode("latin-1"))]
    return list(names), index


def _name_owner(begin: str) -> str | None:
    """Name what numbers belong to by what is before the first, None if not told."""
    if _LED.match(begin):
        return None
    words, assigned = _TWO_WORDS.match(begin), _ASSIGNED.match(begin)
    if words:
        return f"{words[1]} {words[2]}"
    return assigned[1] if assigned else None


def target_name(line: str) -> str:
    """Name what a line's numbers belong to.

    >>> target_name("CASE (2): MOVE LINEAR TO POS(1, 2, 3, 4, 5, 6, '')")
    'MOVE LINEAR'
    """
    while lead := _LEAD.match(line):
        line = line[lead.end() :]
    assigned = _ASSIGNED.match(line)
    if assigned:
        return assigned.group(1)
    return " ".join(found.group() for found in islice(_WORD.finditer(line), 2))


# The lines of a long file, cut out of its bytes where they are asked for.


@dataclass(frozen=True, eq=False)
class TextLines(Sequence[bytes]):
    r"""Lines without their endings, as ``data.split(b"\n")`` gives them.

    A million lines as objects of their own take as long to make as to compare, and
    half as much memory again; where a process is forked, they are not shared.

    Attributes:
        data: The file.
        first: Where its lines begin, and one more behind the last one, (n + 1,).
    """

    data: bytes
    first: Indices

    @classmethod
    def of(cls, data: bytes, skipped: int = 0) -> Self:
        r"""Find the lines of a file, but for some in front.

        >>> list(TextLines.of(b"a\n\nb\n", 1))
        [b'', b'b', b'']
        """
        starts = _native.line_starts(data)
        last = [len(data), len(data) + 1] if data[-1:] == b"\n" else [len(data) + 1]
        return cls(data, np.append(starts, np.array(last, np.int32))[skipped:])

    def part(self, begin: int, end: int) -> TextLines:
        """Return lines begin .. end - 1."""
        return TextLines(self.data, self.first[begin : end + 1])

    def shapes(self) -> list[str]:
        """Return the masks of all lines, with their names."""
        found = scan_lines(b"\n".join([*self, b""]), self.first[:-1] - self.first[0])
        masks = [mask.decode("latin-1") for mask in found.masks]
        ends = found.name_first.tolist()
        names = [found.names[k] for k in found.name.tolist()]
        return [
            mask_of(masks[shape], tuple(names[a:b]))
            for shape, a, b in zip(found.shape.tolist(), ends, ends[1:], strict=False)
        ]

    def __len__(self) -> int:
        """Count the lines."""
        return len(self.first) - 1

    def __iter__(self) -> Iterator[bytes]:
        """Cut out all lines."""
        return iter(self[:])

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        """Cut out the k-th line, or a list of those of a slice."""
        rows = range(len(self))[k]
        if isinstance(rows, int):
            return self.data[self.first[rows] : self.first[rows + 1] - 1]
        if rows.step != 1:
            return [self[row] for row in rows]
        begin, end = self.first[[rows.start, rows.stop]] if rows else (0, 0)
        return self.data[begin : end - 1].split(b"\n") if rows else []


# Two files line by line: which numbers differ, or what more.


@dataclass(frozen=True)
class Compared:
    """Two files, and how they differ.

    Attributes:
        original, compensated: The files.
        lines: Those of the original, without their endings.
        rows: Lines that differ.
        stamped: The second file carries a stamp.
    """

    original: Path
    compensated: Path
    lines: Sequence[bytes]
    rows: DiffRows
    stamped: bool

    def targets(self, lines: Ints) -> list[str]:
        """Name what the numbers on lines of the original, ascending, belong to."""
        if is_named_by_file(self.original.name):
            language = language_of(self.original.name)
            names = language.target_names(
                self.original.name, self.lines, lines.tolist()
            )
            return list(names)
        texts = (self.lines[line - 1].decode("latin-1") for line in lines.tolist())
        return [target_name(text) for text in texts]


def is_named_by_file(place: str) -> bool:
    """Tell whether a line alone does not tell which target it belongs to."""
    file = file_named(place)
    return file.is_variables or not file.variables


def _read_lines(file: Path | NamedText) -> tuple[TextLines, bool]:
    """Read a file's lines without their endings; the stamp line is dropped."""
    data = file.data if isinstance(file, NamedText) else read_input(file)
    stamped = read_stamp(data) is not None
    span = stamp_span(data)
    if span.start:  # it stands behind a header
        data = strip_stamp(data)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return TextLines.of(data, stamped and not span.start), stamped


def compare_files(first: Path | NamedText, second: Path | NamedText) -> Compared:
    """Compare two files line by line.

    Raises:
        ProgramError: A file cannot be read.
    """
    before, _ = _read_lines(first)
    after, stamped = _read_lines(second)
    original, compensated = Path(first.name), Path(second.name)
    if isinstance(first, Path) and isinstance(second, Path):
        original, compensated = first, second
    rows = join_rows(original.name, list(_rows(original.name, before, after)))
    if is_named_by_file(original.name):
        rows = _name_rows(original.name, rows, before)
    return Compared(original, compensated, before, rows, stamped)


def _rows(file: str, before: TextLines, after: TextLines) -> Iterator[DiffRows]:
    """Describe the lines that differ, in order."""
    if len(before) == len(after):
        yield describe_changes(file, before, after)
        return
    inserted = _find_inserted(file, after)
    if len(inserted):
        yield from _beside_points(file, before, after, inserted)
        return
    matcher = SequenceMatcher(None, before.shapes(), after.shapes(), autojunk=False)
    for kind, a0, a1, b0, b1 in matcher.get_opcodes():
        if kind == "equal":
            yield describe_changes(file, before.part(a0, a1), after.part(b0, b1), a0)
            continue
        gone = np.arange(a0 + 1, a1 + 1)
        yield _text_rows(file, gone, "- ", before[a0:a1])
        yield _text_rows(file, np.zeros(b1 - b0, dtype=int), "+ ", after[b0:b1])


def _find_inserted(file: str, lines: TextLines) -> Ints:
    """Find the lines that are points on the ways of moves, from 0, (k,)."""
    language = language_of(file)
    return np.flatnonzero([language.is_inserted(line) for line in lines])


def _beside_points(
    file: str, before: TextLines, after: TextLines, inserted: Ints
) -> Iterator[DiffRows]:
    """Describe the lines that differ, and points on ways where they stand."""
    kept = np.delete(np.arange(len(after)), inserted)
    others = TextLines.of(b"".join(after[k] + b"\n" for k in kept.tolist()))
    others = others.part(0, len(kept))
    place = np.searchsorted(kept, inserted)  # lines of the original before each
    language, cut = language_of(file), set[int]()
    if language.via_first:
        cut = {
            at + 1
            for at, row in zip(place.tolist(), inserted.tolist(), strict=True)
            if language.ends_at_via(after[row])
        }
    if len(others) != len(before):  # more differs: the points come last
        yield from _rows(file, before, others)
        place[:] = len(before)
    done = 0
    for at in np.unique(place).tolist():
        if len(others) == len(before):
            part = before.part(done, at), others.part(done, at)
            yield _without_change(describe_changes(file, *part, done), cut)
        done = at
        texts = [after[k] for k in inserted[place == at].tolist()]
        yield _text_rows(file, np.zeros(len(texts), dtype=int), "+ ", texts)
    if len(others) == len(before):
        rest = before.part(done, len(before)), others.part(done, len(before))
        yield _without_change(describe_changes(file, *rest, done), cut)


def _without_change(rows: DiffRows, lines: Collection[int]) -> DiffRows:
    """Take the change of some lines back: their first point is another one now."""
    gone = np.isin(rows.line, np.array(sorted(lines), dtype=np.int64))
    change = np.where(gone, np.nan, rows.change_mm)
    return replace(rows, change_mm=change, has_change=rows.has_change & ~gone)


def _text_rows(file: str, lines: Ints, sign: str, texts: Sequence[bytes]) -> DiffRows:
    """Describe lines that only one of the files has."""
    told = {k: f"{sign}{text.decode('latin-1')}" for k, text in enumerate(texts)}
    return replace(DiffRows.bare(file, lines, [""] * len(lines)), texts=told)


def _name_rows(file: str, rows: DiffRows, lines: Sequence[bytes]) -> DiffRows:
    """Name rows as the language of their file does; joint angles are no distance."""
    own = (rows.targets[k] for k in rows.target.tolist())
    language, numbers = language_of(file), rows.line.tolist()
    entries = language.target_names(file, lines, numbers)
    names = [name or target for name, target in zip(entries, own, strict=True)]
    texts = (lines[k - 1].decode("latin-1") if k else "" for k in numbers)
    joints = np.fromiter(map(language.holds_joints, texts), bool, len(numbers))
    return replace(
        rows,
        targets=names,
        target=np.arange(len(names)),
        change_mm=np.where(joints, np.nan, rows.change_mm),
        has_change=rows.has_change & ~joints,
    )


# Two programs, with the variable files beside them.


@dataclass(frozen=True)
class Difference:
    """All rows in which two programs (and their variable files) differ.

    Attributes:
        differing: Lines that differ, file by file.
        stamped: The second program carries a stamp.
        untouched: Lines of targets that were left alone on purpose, where a record
            tells, file by file.
        counts: Visits by status, likewise; else empty.
    """

    differing: tuple[DiffRows, ...]
    stamped: bool
    untouched: tuple[DiffRows, ...] = ()
    counts: Mapping[str, int] = field(default_factory=dict)

    @cached_property
    def rows(self) -> tuple[DiffRow, ...]:
        """All lines that differ, one object each: for programs of some lines."""
        return tuple(row for part in self.differing for row in part)

    @cached_property
    def left(self) -> tuple[DiffRow, ...]:
        """All lines that were left alone, likewise."""
        return tuple(row for part in self.untouched for row in part)

    def __bool__(self) -> bool:
        """Tell whether a line differs."""
        return any(len(part) > 0 for part in self.differing)

    def __str__(self) -> str:
        """Say what differs; see `summary`."""
        return self.summary()

    def to_frame(self) -> DataFrame:
        """Return a data frame, one row a line that differs or was left alone.

        Columns: file, line, target, the numbers on the line in the first and the
        second program (original, compensated), change_mm, text, status, code, reason
        and correction_mm, as `DiffRow` has them.
        """
        names = (
            "file", "line", "target", "original", "compensated", "change_mm", "text",
            "status", "code", "reason", "correction_mm",
        )  # fmt: skip
        rows = (*self.rows, *self.left)
        return data_frame({name: [getattr(r, name) for r in rows] for name in names})

    def summary(self) -> str:
        """Say in one line what differs, and what came of the targets."""
        said = self._summarise() if self else "the targets are the same"
        counts = ", ".join(f"{n} {status}" for status, n in self.counts.items() if n)
        return f"{said}; visits: {counts}" if counts else said

    def _summarise(self) -> str:
        """Count the rows and their sizes."""
        sizes = np.concatenate([r.change_mm[r.has_change] for r in self.differing])
        texts = sum(len(r.texts) for r in self.differing)
        numbers = sum(len(r) for r in self.differing) - texts
        said = f"{numbers} lines with other numbers"
        if len(sizes):
            said += f", change mean {np.mean(sizes):.3f} mm, max {max(sizes):.3f} mm"
        return said + (f"; {texts} lines with other text" if texts else "")


def diff(
    original: str | Path | bytes,
    compensated: str | Path | bytes,
    *,
    name: str = UNNAMED,
) -> Difference:
    """Compare two programs, and the variable files beside them.

    Args:
        original: The first program: its path, or its bytes.
        compensated: The second one; the record beside its path tells of every target.
        name: File name of bytes.

    Raises:
        ProgramError: A file cannot be read.
    """
    first, second = open_text(original, name), open_text(compensated, name)
    if isinstance(first, NamedText) or isinstance(second, NamedText):
        only = compare_files(first, second)
        return Difference((only.rows,), only.stamped)
    pairs = [(first, second)]
    old, new = (file_named(p).find_values() for p in pairs[0])
    if not file_named(first).is_variables and old is not None and new is not None:
        pairs.append((old, new))
    ask = in_background(partial(read_arrivals, second, pairs))
    files = [compare_files(*pair) for pair in pairs]
    told = ask()
    found = [(f, told.get(f.original.name)) for f in files]
    rows = tuple(f.rows.with_record(own) for f, own in found)
    left = tuple(_list_uncorrected(f, own) for f, own in found if own is not None)
    statuses = [s.name.lower() for s in Status] if told else []
    counts = {s: sum(a.counts[s] for a in told.values()) for s in statuses}
    return Difference(rows, files[0].stamped, left, counts)


def _list_uncorrected(file: Compared, told: LineOutcomes) -> DiffRows:
    """List the targets that were left alone."""
    alone = told.line[np.isin(told.status, LEFT_ALONE)]
    lines = alone[~np.isin(alone, file.rows.line)]
    return DiffRows.bare(file.original.name, lines, file.targets(lines)).with_record(
        told
    )
