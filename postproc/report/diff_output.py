"""The rows of `diff` as a listing and as JSON, some thousand at a time."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TextIO

import numpy as np

from postproc.arrays import (
    Cells,
    Floats,
    Ints,
    chunks,
    format_fixed,
    format_texts,
    shortest,
    text_of,
    whole,
)
from postproc.files import schema
from postproc.language.languages import file_named
from postproc.report.diff import STATUSES, Difference, DiffRow, DiffRows
from postproc.report.terminal import (
    ARROWS,
    Block,
    Column,
    arrows,
    is_coloured,
    paint,
    print_blocks,
    status_colour,
)

# The rows of `diff`, many at a time.
#
# Rows with text, with many numbers, with visits of several statuses or with names that
# cannot be printed are few: whoever writes rows writes them one by one, as `DiffRow`,
# and asks here which they are.

AT_ONCE = 50_000  # rows
MOST = 12  # numbers of a row that is written with others


def single_rows(rows: DiffRows) -> Ints:
    """Return the rows that are written one by one."""
    count = np.diff(rows.first)
    many = count > MOST
    many[list(rows.texts)] = True
    finite = np.isfinite(rows.original) & np.isfinite(rows.compensated)
    many[np.repeat(np.arange(len(rows)), count)[~finite]] = True
    many |= rows.has_change & ~np.isfinite(rows.change_mm)
    if rows.told is not None and len(rows.told.line):
        many |= ~np.isfinite(rows.told.correction_mm)[rows.entry]
        unclear = ~np.array([why.text.isprintable() for why in rows.told.reasons])
        many |= unclear[rows.told.why[rows.entry]]
        many |= np.isin(rows.entry, [*rows.told.mixed])
    return np.flatnonzero(many)


def blocks_of(parts: Sequence[DiffRows]) -> Iterator[tuple[DiffRows, slice, list[int]]]:
    """Cut rows: yield each block, and those that are written one by one."""
    for rows in parts:
        single = single_rows(rows)
        for some in chunks(len(rows), AT_ONCE):
            here = (single >= some.start) & (single < some.stop)
            yield rows, some, single[here].tolist()


# The rows of `diff` as JSON.

SIGN_NUMBERS = tuple(map(str, range(-1, 3)))


def difference_pieces(found: Difference) -> Iterator[str]:
    """Write what differs as ``json.dumps(.., indent=1)`` would, piece by piece."""
    head = {
        **schema("difference"),
        "stamped": found.stamped,
        "counts": dict(found.counts),
    }
    yield json.dumps(head, indent=1)[: -len("\n}")]
    for key, parts in (("rows", found.differing), ("uncorrected", found.untouched)):
        yield f',\n "{key}": ['
        comma = len(",")
        for block in blocks_of(parts):
            yield _objects(*block).decode("ascii")[comma:]
            comma = 0
        yield "]" if comma else "\n ]"
    yield "\n}\n"


def _objects(rows: DiffRows, some: slice, single: Sequence[int]) -> bytes:
    """Write some rows as JSON objects, a comma before each."""
    sizes = np.where(rows.has_change[some], rows.change_mm[some], np.nan)
    columns = {
        "file": Cells(json.dumps(rows.file).encode()),
        "line": whole(rows.line[some]),
        "target": format_texts(rows.targets, rows.target[some], json.dumps),
        "original": _number_list(rows, rows.original, some),
        "compensated": _number_list(rows, rows.compensated, some),
        "change_mm": shortest(sizes),
        "text": Cells(b'""'),
        **_write_record_columns(rows, some),
        "visits": Cells(b"{}"),
    }
    cells, lead = [], ",\n  {"
    for key, column in columns.items():
        cells.append(column.behind(f'{lead}\n   "{key}": '.encode()))
        lead = ","
    given = {}
    for row in single:
        told = json.dumps(rows.row(row)._asdict(), indent=1).replace("\n", "\n  ")
        given[row - some.start] = f",\n  {told}".encode("ascii")
    return text_of(some.stop - some.start, [*cells, Cells(b"\n  }")], given)


def _write_record_columns(rows: DiffRows, some: slice) -> dict[str, Cells]:
    told = rows.told
    none = {key: b'""' for key in ("status", "code", "reason")}
    none |= {"direction": b"[]", "correction_mm": b"null"}
    if told is None or not len(told.line):
        return {key: Cells(text) for key, text in none.items()}
    entry = rows.entry[some]
    signs = format_texts(SIGN_NUMBERS, told.direction[entry] + 1, str)
    columns = {
        "status": format_texts(STATUSES, told.status[entry], json.dumps),
        "code": format_texts(
            [r.name for r in told.reasons], told.why[entry], json.dumps
        ),
        "reason": format_texts(
            [r.text for r in told.reasons], told.why[entry], json.dumps
        ),
        "direction": signs.within(*LIST),
        "correction_mm": shortest(told.correction_mm[entry]),
    }
    return {key: columns[key].unless(entry < 0, none[key]) for key in columns}


LIST = (b"[\n    ", b",\n    ", b"\n   ]")  # an item a line


def _number_list(rows: DiffRows, values: Floats, some: slice) -> Cells:
    first = rows.first[some.start : some.stop + 1]
    cells = shortest(values[first[0] : first[-1]]).within(*LIST)
    return cells.group_rows(first - first[0]).unless(np.diff(first) == 0, b"[]")


# The listing of `diff`: a row a line, then what was left alone, then a summary.

DECIMALS = 4
STATUS = "status"
PLACE = (Column("file", "left"), Column("line"), Column("target", "left"))
NUMBERS = (Column("original"), Column("", "left"), Column("compensated"))
TOLD = (Column("J1-6", "left"), Column(STATUS, "left"))
SIGN_ARROWS = tuple(ARROWS[d] for d in range(-1, 3))


def print_difference(found: Difference, out: TextIO | None = None) -> None:
    """Print a row for every line that differs, uncorrected targets, a summary."""
    out = out or sys.stdout
    names = {r.file for r in (*found.differing, *found.untouched) if len(r)}
    skip = 0 if len(names) > 1 or any(file_named(n).is_variables for n in names) else 1
    told = bool(found.counts)
    size = Column("|c| mm") if told else Column("change mm", "left")
    columns = [*PLACE, *NUMBERS, size, *(TOLD if told else ())]
    writer = _Writer(told, is_coloured(out))
    if found:
        blocks = writer.blocks(found.differing, range(skip, len(columns)))
        print_blocks(columns[skip:], blocks, {STATUS: status_colour}, out)
    if any(len(rows) for rows in found.untouched):
        print("\nnot corrected:", file=out)
        shown = [*range(skip, len(PLACE)), *range(len(columns) - 2, len(columns))]
        blocks = writer.blocks(found.untouched, shown)
        print_blocks([columns[c] for c in shown], blocks, {STATUS: status_colour}, out)
    print(found.summary(), file=out)


@dataclass(frozen=True)
class _Writer:
    """Writes rows as cells.

    Attributes:
        told: A record tells of directions and statuses.
        coloured: Statuses have colours.
    """

    told: bool
    coloured: bool

    def blocks(
        self, parts: Sequence[DiffRows], shown: Sequence[int]
    ) -> Iterator[Block]:
        """Write the rows of all files, some columns of them."""
        return (self._block(*block, shown) for block in blocks_of(parts))

    def _block(
        self, rows: DiffRows, some: slice, single: Sequence[int], shown: Sequence[int]
    ) -> Block:
        cells = [*_place(rows, some), *_number_changes(rows, some)]
        cells += [self._size(rows, some), *self._write_outcome_columns(rows, some)]
        texts = {row - some.start: self._texts(rows.row(row)) for row in single}
        return Block(
            some.stop - some.start,
            [cells[c] for c in shown],
            {at: [row[c] for c in shown] for at, row in texts.items()},
        )

    def _size(self, rows: DiffRows, some: slice) -> Cells:
        """Write how far the TCP is moved, or else by how much the numbers changed."""
        size, has = rows.change_mm[some], rows.has_change[some]
        if self.told and rows.told is not None and len(rows.told.line):
            entry = rows.entry[some]
            size = np.where(entry < 0, size, rows.told.correction_mm[entry])
            has = has | (entry >= 0)
        return format_fixed(size, 3).unless(~has, b"")

    def _write_outcome_columns(self, rows: DiffRows, some: slice) -> list[Cells]:
        """Say how the targets are reached, and what came of them."""
        told = rows.told
        if told is None or not len(told.line):
            return [Cells()] * 2
        entry = rows.entry[some]
        signs = format_texts(SIGN_ARROWS, told.direction[entry] + 1, str)
        what = told.status[entry] * len(told.reasons) + told.why[entry]
        said = [
            _describe_outcome(s, why.text) for s in STATUSES for why in told.reasons
        ]
        both = signs, format_texts(said, what, self._paint)
        return [cells.unless(entry < 0, b"") for cells in both]

    def _paint(self, status: str) -> str:
        return paint(status, status_colour(status)) if self.coloured else status

    def _texts(self, row: DiffRow) -> list[str]:
        """Write a row by itself."""
        size = row.correction_mm if self.told and row.status else row.change_mm
        old, new = _write_change(row)
        length = "" if size is None else f"{size:.3f}"
        place = [row.file, str(row.line or ""), row.target]
        cells = [*place, old, "->" if new else "", new, length]
        told = [
            arrows(row.direction),
            _describe_outcome(row.status, row.reason, row.visits),
        ]
        return [*cells, *told] if self.told else cells


def _describe_outcome(
    status: str, why: str, visits: Mapping[str, int] | None = None
) -> str:
    """Say what came of a target, and of the others on its line."""
    others = ", ".join(f"{n} {name}" for name, n in (visits or {}).items())
    if others:
        why = f"{why} ({others})" if why else others
    return f"{status}: {why}" if why else status


def _place(rows: DiffRows, some: slice) -> list[Cells]:
    line = rows.line[some]
    names = format_texts(rows.targets, rows.target[some], str)
    file = Cells(rows.file.encode(errors="replace"))
    return [file, whole(line).unless(line == 0, b""), names]


def _number_changes(rows: DiffRows, some: slice) -> list[Cells]:
    first = rows.first[some.start : some.stop + 1]
    mine = slice(*first[[0, -1]].tolist())
    old, new = rows.original[mine], rows.compensated[mine]
    moved = old != new
    first = np.append(0, np.cumsum(moved))[first - first[0]]
    both = [
        format_fixed(values[moved], DECIMALS).within(b"", b", ", b"").group_rows(first)
        for values in (old, new)
    ]
    arrow = Cells().within(b"->", b"", b"").unless(np.diff(first) == 0, b"")
    return [both[0], arrow, both[1]]


def _write_change(row: DiffRow) -> tuple[str, str]:
    """Write the numbers that changed, or the text."""
    if row.text or not row.original:
        return row.text, ""
    pairs = zip(row.original, row.compensated, strict=True)
    moved = [pair for pair in pairs if pair[0] != pair[1]]
    written = ", ".join([f"%.{DECIMALS}f"] * len(moved))
    old, new = zip(*moved, strict=True)
    return written % old, written % new
