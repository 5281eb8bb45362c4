"""The rows of `diff` as a listing and as JSON, some thousand at a time."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats, Ints, chunks
from postproc.byte_columns import (
    ByteColumn,
    beside,
    blanked,
    fixed,
    joined,
    named,
    repeated,
    shortest,
    whole,
)
from postproc.byte_columns import ByteColumn as Bytes
from postproc.compensation.parallel import parallel_map
from postproc.files import is_variables
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

# Numbers of the rows of `diff` as columns of bytes, some thousand at a time.
#
# Rows with text, with many numbers, with visits of several statuses or with names that
# cannot be printed are few: whoever writes rows writes them one by one, as `DiffRow`,
# and asks here which they are.

AT_ONCE = 5_000  # rows
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
        unclear = ~np.array([why.isprintable() for why in rows.told.reasons])
        many |= unclear[rows.told.why[rows.entry]]
        many |= np.isin(rows.entry, [*rows.told.mixed])
    return np.flatnonzero(many)


def blocks_of(rows: DiffRows) -> Iterator[tuple[Ints, Ints]]:
    """Cut rows: yield the rows of each block, and those that are written one by one."""
    single = single_rows(rows)
    for some in chunks(len(rows), AT_ONCE):
        here = (single >= some.start) & (single < some.stop)
        yield np.arange(some.start, some.stop), single[here]


def number_places(first: Ints, k: Ints) -> tuple[Ints, Ints]:
    """Return where the numbers of some rows stand, and the row (from 0) of each.

    Args:
        first: CSR offsets of all rows.
        k: Rows.
    """
    count = first[k + 1] - first[k]
    owner = np.repeat(np.arange(len(k)), count)
    before = np.cumsum(count) - count
    return np.arange(len(owner)) + (first[k] - before)[owner], owner


def strung(cells: ByteColumn, owner: Ints, rows: int, between: bytes) -> ByteColumn:
    """Put the texts of every row beside each other.

    Args:
        cells: Texts, row by row.
        owner: The row of each, ascending.
        rows: How many rows there are.
        between: What stands between two texts.
    """
    count = np.bincount(owner, minlength=rows)
    at = np.arange(len(owner)) - (np.cumsum(count) - count)[owner]
    width = cells.shape[1] + len(between)
    out = np.zeros((rows, int(count.max(initial=0)), width), dtype=np.uint8)
    out[owner, at, len(between) :] = cells
    later = at > 0
    out[owner[later], at[later], : len(between)] = np.frombuffer(between, np.uint8)
    return out.reshape(rows, -1)


# The rows of `diff` as JSON, some thousand at a time.

END = b"\x01"  # behind a row; no JSON text holds it
SIGN_NUMBERS = tuple(map(str, range(-1, 3)))


def difference_pieces(found: Difference) -> Iterator[str]:
    """Write what differs as ``json.dumps(.., indent=1)`` would, piece by piece."""
    head = {"stamped": found.stamped, "counts": dict(found.counts)}
    yield json.dumps(head, indent=1)[: -len("\n}")]
    for key, parts in (("rows", found.differing), ("left", found.untouched)):
        yield f',\n "{key}": ['
        comma = ""
        tasks = [(rows, *block) for rows in parts for block in blocks_of(rows)]
        for piece in parallel_map(lambda task: _piece(*task), tasks):
            yield comma + piece
            comma = ","
        yield "\n ]" if comma else "]"
    yield "\n}\n"


def _piece(rows: DiffRows, k: Ints, single: Ints) -> str:
    """Write some rows with commas between them."""
    begin = int(k[0])
    texts = np.empty(len(k), dtype=object)
    plain = np.setdiff1d(k, single, assume_unique=True)
    if len(plain):
        texts[plain - begin] = _objects(rows, plain)
    for row in single.tolist():
        told = json.dumps(rows.row(row)._asdict(), indent=1)
        texts[row - begin] = "\n  " + told.replace("\n", "\n  ")
    return ",".join(texts.tolist())


def _objects(rows: DiffRows, k: Ints) -> list[str]:
    """Write some rows as JSON objects."""
    columns = {
        "file": json.dumps(rows.file).encode(),
        "line": whole(rows.line[k]),
        "target": named(rows.targets, rows.target[k], json.dumps),
        "original": _number_lists(rows, rows.original, k),
        "compensated": _number_lists(rows, rows.compensated, k),
        "change_mm": _sizes(np.where(rows.has_change[k], rows.change_mm[k], np.nan)),
        "text": b'""',
        **_told(rows, k),
        "visits": b"{}",
    }
    parts: list[ByteColumn | bytes] = []
    for number, (key, column) in enumerate(columns.items()):
        lead = "," if number else "\n  {"
        parts += [f'{lead}\n   "{key}": '.encode(), column]
    return joined([*parts, b"\n  }" + END]).decode("ascii").split(END.decode())[:-1]


def _told(rows: DiffRows, k: Ints) -> dict[str, ByteColumn | bytes]:
    """Write what a record says of some rows."""
    told = rows.told
    none = {"status": b'""', "why": b'""', "direction": b"[]", "correction_mm": b"null"}
    if told is None or not len(told.line):
        return dict(none)
    entry = rows.entry[k]
    columns = {
        "status": named(STATUSES, told.status[entry], json.dumps),
        "why": named(told.reasons, told.why[entry], json.dumps),
        "direction": _lists(
            named(SIGN_NUMBERS, told.direction[entry].ravel() + 1, str),
            np.repeat(np.arange(len(k)), 6),
            len(k),
        ),
        "correction_mm": _sizes(told.correction_mm[entry]),
    }
    return {key: blanked(columns[key], entry < 0, none[key]) for key in columns}


def _number_lists(rows: DiffRows, values: Floats, k: Ints) -> ByteColumn:
    """Write the numbers of some rows as lists."""
    at, owner = number_places(rows.first, k)
    return _lists(shortest(values[at]), owner, len(k))


def _lists(cells: ByteColumn, owner: Ints, rows: int) -> ByteColumn:
    """Write lists, an item a line."""
    column = beside([b"[\n    ", strung(cells, owner, rows, b",\n    "), b"\n   ]"])
    return blanked(column, np.bincount(owner, minlength=rows) == 0, b"[]")


def _sizes(values: Floats) -> ByteColumn:
    """Write sizes with all their digits; NaN becomes null."""
    return shortest(values)


# The listing of `diff`: a row a line, then what was left alone, then a summary.

DECIMALS = 4
HERE = 4  # every fourth block is made where all of them are laid out
STATUS = "status"
PLACE = (Column("file", "left"), Column("line"), Column("target", "left"))
NUMBERS = (Column("original"), Column("", "left"), Column("compensated"))
TOLD = (Column("J1-6", "left"), Column(STATUS, "left"))
SIGN_ARROWS = tuple(ARROWS[d] for d in range(-1, 3))


def print_difference(found: Difference, out: TextIO | None = None) -> None:
    """Print a row for every line that differs, the targets left alone, a summary."""
    out = out or sys.stdout
    names = {r.file for r in (*found.differing, *found.untouched) if len(r)}
    skip = 0 if len(names) > 1 or any(map(is_variables, names)) else 1
    told = bool(found.counts)
    size = Column("|c| mm") if told else Column("change mm", "left")
    columns = [*PLACE, *NUMBERS, size, *(TOLD if told else ())]
    writer = _Writer(told, is_coloured(out))
    if found:
        blocks = writer.blocks(found.differing, range(skip, len(columns)))
        print_blocks(columns[skip:], blocks, {STATUS: status_colour}, out)
    if any(len(rows) for rows in found.untouched):
        print("\nleft as they were:", file=out)
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
        tasks = [(rows, *block) for rows in parts for block in blocks_of(rows)]
        return parallel_map(lambda task: self._block(*task, shown), tasks, HERE)

    def _block(
        self, rows: DiffRows, k: Ints, single: Ints, shown: Sequence[int]
    ) -> Block:
        """Write some rows."""
        plain = ~np.isin(k, single)
        cells = [
            *_place(rows, k),
            *_number_changes(rows, k, plain),
            self._size(rows, k),
        ]
        if self.told:
            cells += self._told(rows, k)
        texts = {row - int(k[0]): self._texts(rows.row(row)) for row in single.tolist()}
        return Block(
            [_masked(cells[c], plain) for c in shown],
            np.column_stack([_lengths(cells[c]) * plain for c in shown]),
            {at: [row[c] for c in shown] for at, row in texts.items()},
        )

    def _size(self, rows: DiffRows, k: Ints) -> Bytes:
        """Write how far the TCP is moved, or else by how much the numbers changed."""
        size, has = rows.change_mm[k], rows.has_change[k]
        if self.told and rows.told is not None and len(rows.told.line):
            entry = rows.entry[k]
            size = np.where(entry < 0, size, rows.told.correction_mm[entry])
            has = has | (entry >= 0)
        return blanked(fixed(np.where(has, size, 0.0), 3), ~has, b"")

    def _told(self, rows: DiffRows, k: Ints) -> list[Bytes]:
        """Say how the targets are reached, and what came of them."""
        told = rows.told
        if told is None or not len(told.line):
            return [repeated(b"", len(k))] * 2
        entry = rows.entry[k]
        signs = named(SIGN_ARROWS, told.direction[entry].ravel() + 1, str)
        what = told.status[entry] * len(told.reasons) + told.why[entry]
        said = [_said(s, why) for s in STATUSES for why in told.reasons]
        both = signs.reshape(len(k), -1), named(said, what, self._painted)
        return [blanked(cells, entry < 0, b"") for cells in both]

    def _painted(self, status: str) -> str:
        return paint(status, status_colour(status)) if self.coloured else status

    def _texts(self, row: DiffRow) -> list[str]:
        """Write a row by itself."""
        size = row.correction_mm if self.told and row.status else row.change_mm
        old, new = _written(row)
        length = "" if size is None else f"{size:.3f}"
        place = [row.file, str(row.line or ""), row.target]
        cells = [*place, old, "->" if new else "", new, length]
        told = [arrows(row.direction), _said(row.status, row.why, row.visits)]
        return [*cells, *told] if self.told else cells


def _said(status: str, why: str, visits: Mapping[str, int] | None = None) -> str:
    """Say what came of a target, and of the others on its line."""
    others = ", ".join(f"{n} {name}" for name, n in (visits or {}).items())
    if others:
        why = f"{why} ({others})" if why else others
    return f"{status}: {why}" if why else status


def _place(rows: DiffRows, k: Ints) -> list[Bytes]:
    """Say where rows stand."""
    file = repeated(rows.file.encode(errors="replace"), len(k))
    line = rows.line[k]
    names = named(rows.targets, rows.target[k], str)
    return [file, blanked(whole(line), line == 0, b""), names]


def _number_changes(rows: DiffRows, k: Ints, plain: NDArray[np.bool_]) -> list[Bytes]:
    """Write the numbers that changed."""
    at, owner = number_places(rows.first, k)
    old, new = rows.original[at], rows.compensated[at]
    moved = (old != new) & plain[owner]
    owner = owner[moved]
    if not len(owner):
        return [repeated(b"", len(k))] * 3
    both = [
        strung(fixed(values[moved], DECIMALS), owner, len(k), b", ")
        for values in (old, new)
    ]
    arrow = blanked(
        repeated(b"->", len(k)), np.bincount(owner, minlength=len(k)) == 0, b""
    )
    return [both[0], arrow, both[1]]


def _masked(cells: Bytes, plain: NDArray[np.bool_]) -> Bytes:
    """Leave out the rows that are written by themselves."""
    return cells if plain.all() else np.where(plain[:, None], cells, 0).astype(np.uint8)


def _lengths(cells: Bytes) -> Ints:
    """Count the characters of UTF-8 texts."""
    shown = cells != 0
    if (cells >= 0x80).any():
        shown &= cells & 0xC0 != 0x80
    lengths: Ints = np.count_nonzero(shown, axis=1)
    return lengths


def _written(row: DiffRow) -> tuple[str, str]:
    """Write the numbers that changed, or the text."""
    if row.text or not row.original:
        return row.text, ""
    pairs = zip(row.original, row.compensated, strict=True)
    moved = [pair for pair in pairs if pair[0] != pair[1]]
    written = ", ".join([f"%.{DECIMALS}f"] * len(moved))
    old, new = zip(*moved, strict=True)
    return written % old, written % new
