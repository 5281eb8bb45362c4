"""The entries of a variable file as columns; one of each layout is read."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from postproc.arrays import Bools, Floats, Indices, Ints, slim
from postproc.language.pdl2.parser import EntryPart
from postproc.language.text.statement_table import Statements
from postproc.language.text.symbol_column import NameColumn
from postproc.language.text.templates import (
    ParsedShapes,
    alike,
    name_index,
    number_in_order,
)

EntryLines = Statements[EntryPart | None]
POSITIONS = ("POS", "XTND", "JNTP")
NESTED = ("REC", "NODE", "PATH")
_KINDS = {"POS": "POS", "JNT": "JNTP", "JNTP": "JNTP", "XTN": "XTND", "XTND": "XTND"}


def kind_of(code: str) -> tuple[str, bool]:
    """Read the type code of a head: the kind of its values, and whether it is an array.

    >>> kind_of("XTN"), kind_of("APOS"), kind_of("AINT")
    (('XTND', False), ('POS', True), ('INT', True))
    """
    code = code.upper()
    array = code.startswith("A") and code != "ARM"
    code = code[1:] if array else code
    return _KINDS.get(code, code), array


@dataclass(frozen=True)
class Layout:
    """What entries that are written alike have in common.

    Attributes:
        kind: POS, JNTP, XTND, or another type's code, of which only a scalar is kept.
        shared: Other programs see it (Xport).
        config: Configuration string or None.
        axes: Auxiliary axes, ascending.
        seen: How many values are written, ``****`` counted.
    """

    kind: str
    shared: bool
    config: str | None
    axes: tuple[int, ...]
    seen: int


@dataclass(frozen=True, eq=False)
class Rows(Mapping[str, int]):
    """Rows by name.

    Attributes:
        names: The names, each once.
        rows: The row of each, (m,).
    """

    names: NameColumn
    rows: Indices

    def __len__(self) -> int:
        """Return how many names there are."""
        return len(self.names)

    def __iter__(self) -> Iterator[str]:
        """Go through the names."""
        return iter(self.names)

    def __getitem__(self, name: str) -> int:
        """Return the row of a name."""
        number = self.names.number(name)
        if number < 0:
            raise KeyError(name)
        return int(self.rows[number])

    def find(self, names: NameColumn) -> Ints:
        """Return the rows of names, (m,), -1 where there is none."""
        number = self.names.find(names)
        return np.append(self.rows, -1)[number]


@dataclass(frozen=True, eq=False)
class Entries:
    """k variables or array elements, and those by name that have one of their own.

    Attributes:
        row: Row of each lower-case name; names with two entries are missing.
        name: Names as they are written, k of them.
        line: 1-based line of each head, (k,).
        layout: Index into `layouts`, (k,).
        layouts: How they are written.
        numbers: Six numbers each, (k, 6), NaN where uninitialised or missing.
        slots: Index of each number in the file, (k, 6), -1 for none.
        aux: Values of the auxiliary axes of their layout, (k, a), NaN likewise.
        arm: Arm number, (k,), 0 where it is not said.
    """

    row: Rows
    name: NameColumn
    line: Ints
    layout: Indices
    layouts: tuple[Layout, ...]
    numbers: Floats
    slots: Indices
    aux: Floats
    arm: Indices

    @cached_property
    def parts(self) -> list[str]:
        """List the lower-case names of elements and fields."""
        if not self.name.hold("[."):
            return []
        return [name for name in self.row if "[" in name or "." in name]

    def layout_of(self, row: int) -> Layout:
        """Return how an entry is written."""
        return self.layouts[int(self.layout[row])]

    def numbers_of(self, row: int) -> tuple[float, ...]:
        """Return the numbers of an entry, NaN where uninitialised or missing."""
        return _with_one_nan(self.numbers[row])

    def aux_of(self, row: int) -> tuple[tuple[int, float], ...]:
        """Return the auxiliary axes of an entry, each with its value."""
        axes = self.layout_of(row).axes
        return tuple(zip(axes, _with_one_nan(self.aux[row]), strict=False))


_NO = np.empty(0, np.int32)
NO_ENTRIES = Entries(
    Rows(NameColumn(), _NO), NameColumn(), np.empty(0, np.int64), _NO, (),
    np.empty((0, 6)), np.empty((0, 6), np.int32), np.empty((0, 0)), _NO,
)  # fmt: skip


def _with_one_nan(values: Floats) -> tuple[float, ...]:
    """Return numbers that equal themselves."""
    return tuple(math.nan if value != value else value for value in values.tolist())


# From the lines of a variable file to its entries: one of each layout is read.
#
# An entry is a head, or the index of an array's element, with the lines up to the next.
# Files hold many thousands that are written alike; what one says of its numbers holds
# for all of its layout.

MOST = 2.0**53  # beyond it a number does not tell which whole one it is
_LETTERS = "XYZAER"
_NONE = (0, -1)  # the place of a value that is not written

Place = tuple[int, int]
"""Where a value stands: which line of the entry, and which number of that line."""


@dataclass(frozen=True)
class Records:
    """The k entries of a file, in order, as far as their lines tell.

    Attributes:
        head: Row of the head that each belongs to, (k,).
        first, closed: Their rows, `closed` is that at which the next begins, (k,).
        element: Its own index stands in its first line, (k,).
    """

    head: Ints
    first: Ints
    closed: Ints
    element: Bools


def find_records(lines: EntryLines, head: Ints) -> Records:
    """Find where the entries of a file begin and end.

    The fields of records and of path nodes, and lines that are not understood, end an
    entry and begin none.

    Args:
        lines: The file.
        head: Row of the last variable's head up to every row, (n,).
    """
    n = len(lines)
    own = head == np.arange(n)
    other = (lines.which(_is_head) | lines.which(is_no_value)) & ~own
    elements = lines.which(lambda e: e is not None and bool(e.element))
    elements &= (head >= 0) & ~other
    arrays = lines.which(lambda e: e is not None and kind_of(e.type)[1])
    # a line may hold a head, then an element: two places on an axis of half lines
    half = [2 * np.flatnonzero(own | other), 2 * np.flatnonzero(elements) + 1]
    place = np.sort(np.concatenate(half))
    after = np.append(place[1:], 2 * n)
    begins = (place % 2 == 1) | (own & ~arrays)[place // 2]
    first, closed = place[begins] // 2, after[begins] // 2
    return Records(head[first], first, closed, place[begins] % 2 == 1)


def last_head(lines: EntryLines) -> Ints:
    """Return the row of the last variable's head up to every row, (n,), -1: none.

    A head below that of a record or path which does not say whose variable it is heads
    a field, not a variable.
    """
    rows = np.flatnonzero(lines.which(_is_head))
    nested = lines.which(is_nested)[rows]
    if nested.any():
        fields, heads, within = lines.which(_may_be_field)[rows], [], False
        columns = (rows.tolist(), fields.tolist(), nested.tolist())
        for row, is_field, has_fields in zip(*columns, strict=True):
            if not (within and is_field):
                heads.append(row)
                within = has_fields
        rows = np.array(heads, dtype=np.int64)
    last = np.full(len(lines), -1, dtype=np.int64)
    last[rows] = rows
    return np.asarray(np.maximum.accumulate(last))


def is_nested(entered: EntryPart | None) -> bool:
    """Tell whether a line heads a record or a path, whose fields have heads too."""
    return entered is not None and kind_of(entered.type)[0] in NESTED


def _is_head(entered: EntryPart | None) -> bool:
    return entered is not None and bool(entered.name)


def is_no_value(entered: EntryPart | None) -> bool:
    """Tell whether a line is not understood, or names a node: no variable has any."""
    return entered is None or entered.node >= 0


def _may_be_field(entered: EntryPart | None) -> bool:
    if entered is None:
        return False
    return entered.name.startswith("$") or not entered.variable


def _read_layout(
    head: EntryPart, parts: Sequence[EntryPart | None], axes: Iterable[int]
) -> tuple[Layout, Sequence[Place], Mapping[int, Place]]:
    """Read an entry whose axes have these numbers, for all that are laid out alike.

    Returns:
        Its layout, where its six numbers stand, and the value of each auxiliary axis.
    """
    kind, numbered = kind_of(head.type)[0], iter(axes)
    joint, places, aux = kind == "JNTP", [_NONE] * 6, dict[int, Place]()
    config, seen = None, 0
    for row, line in enumerate(parts):
        if line is None:
            continue
        found = [(_LETTERS.index(k.upper()), slot) for k, slot in line.components]
        for (_, slot), axis in zip(line.axes, numbered, strict=False):
            if joint and 1 <= axis <= 6:
                found.append((axis - 1, slot))
            elif axis >= 1:
                aux[axis - 6 if joint else axis] = row, slot
        found += enumerate(line.plain, seen + len(found))
        for at, slot in found:
            if at < 6:
                places[at] = row, slot
        seen += len(found)
        config = config if line.config is None else line.config
    return Layout(kind, head.shared, config, tuple(sorted(aux)), seen), places, aux


def read_records(lines: EntryLines, records: Records) -> Entries:
    """Read the entries of a file, layout by layout; no name is told yet to be twice."""
    said, k = lines.said, len(records.first)
    form, layouts = said.form[lines.shape], list[Layout]()
    numbers, slots = np.full((k, 6), np.nan), np.full((k, 6), -1, dtype=np.int32)
    layout, arm = np.zeros((2, k), dtype=np.int64)
    aux = list[tuple[Ints, Floats]]()
    for mine in _alike(form, records):
        a, b = int(records.first[mine[0]]), int(records.closed[mine[0]])
        parts = [said.said[f] for f in form[a:b].tolist()]
        head = said.said[int(form[records.head[mine[0]]])]
        assert head is not None
        if head.arm >= 0:
            arm[mine] = _whole(_values(lines, records.head[mine], head.arm))
        for some, axes in _by_axes(lines, records.first, mine, parts):
            own, places, named = _read_layout(head, parts, axes)
            first = records.first[some]
            for at, (row, slot) in enumerate(places):
                if slot >= 0:
                    numbers[some, at] = _values(lines, first + row, slot)
                    slots[some, at] = lines.first[first + row] + slot
            values = _columns(lines, first, [named[axis] for axis in own.axes])
            aux.append((some, values))
            layout[some] = len(layouts)
            layouts.append(own)
    stacked = np.full((k, max((v.shape[1] for _, v in aux), default=0)), np.nan)
    for rows, values in aux:
        stacked[rows, : values.shape[1]] = values
    return Entries(
        Rows(NameColumn(), np.empty(0, dtype=np.int32)), _names(lines, records),
        lines.begin_line[records.first], slim(layout), tuple(layouts),
        numbers, slots, stacked, slim(arm),
    )  # fmt: skip


def _alike(form: Ints, records: Records) -> Iterator[Ints]:
    """Group the entries whose lines have the same forms."""
    if len(records.first) == 0:
        return iter(())
    own = alike(form, records.first, records.closed)
    heads = form[records.head]
    kind, first = number_in_order(own * (int(heads.max()) + 1) + heads)
    ends = np.cumsum(np.bincount(kind, minlength=len(first)))
    return iter(np.split(np.argsort(kind, kind="stable"), ends[:-1]))


def _by_axes(
    lines: EntryLines, first: Ints, mine: Ints, parts: Sequence[EntryPart | None]
) -> Iterator[tuple[Ints, list[int]]]:
    """Split entries that are written alike by the axes that they give values of."""
    places = [
        (row, axis)
        for row, entered in enumerate(parts)
        if entered is not None
        for axis, _ in entered.axes
    ]
    if not places:
        yield mine, []
        return
    axes = _whole(_columns(lines, first[mine], places))
    distinct, which = np.unique(axes, axis=0, return_inverse=True)
    for number, one in enumerate(distinct.tolist()):
        yield mine[which.ravel() == number], one


def _columns(lines: EntryLines, first: Ints, places: Sequence[Place]) -> Floats:
    """Return the values at some places of entries that begin at some rows, (k, p)."""
    found = np.full((len(first), len(places)), np.nan)
    for column, (row, slot) in enumerate(places):
        if slot >= 0:
            found[:, column] = _values(lines, first + row, slot)
    return found


def _values(lines: EntryLines, rows: Ints, slot: int) -> Floats:
    """Return a number of every row, NaN where it cannot be read."""
    value = lines.value[lines.first[rows] + slot]
    return np.where(np.isfinite(value), value, np.nan)


def _whole(values: Floats) -> Ints:
    """Cut numbers down to whole ones, 0 where not known or beyond all bounds."""
    sound = np.abs(values) < MOST  # NaN is not
    return np.trunc(np.where(sound, values, 0.0)).astype(np.int64)


def _names(lines: EntryLines, records: Records) -> NameColumn:
    """Name every entry: as its head does, elements with their index."""
    heads, at = np.unique(records.head, return_inverse=True)
    names = _head_names(lines.said, lines.shape[heads]).take(at.astype(np.int64))
    index = _indices(lines, records)
    if not index:
        return names
    return NameColumn(name + index.get(row, "") for row, name in enumerate(names))


def _indices(lines: EntryLines, records: Records) -> dict[int, str]:
    """Write the indices of the entries that are elements of an array."""
    said, elements = lines.said, np.flatnonzero(records.element)
    form = said.form[lines.shape[records.first[elements]]]
    found = {}
    for one in np.unique(form).tolist():
        mine = elements[form == one]
        entered = said.said[one]
        assert entered is not None
        places = [(0, slot) for slot in entered.element]
        numbers = _whole(_columns(lines, records.first[mine], places)).tolist()
        for row, index in zip(mine.tolist(), numbers, strict=True):
            found[row] = f"[{','.join(map(str, index))}]"
    return found


def _head_names(said: ParsedShapes[EntryPart | None], shapes: Ints) -> NameColumn:
    """Return the names in some heads, (m,)."""
    names, written = said.shapes.names, list[str]()
    found, form = np.zeros(len(shapes), dtype=np.int64), said.form[shapes]
    for one in np.unique(form).tolist():
        mine, head = np.flatnonzero(form == one), said.said[one]
        assert head is not None
        at = name_index(head.name)
        if at >= 0:
            found[mine] = said.shapes.names_at(shapes[mine])[:, at]
        else:
            found[mine] = len(names) + len(written)
            written.append(head.name)
    if written:
        names = NameColumn(names)
        names.extend(written)
    return names.take(found)
