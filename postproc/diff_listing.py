"""The listing of `diff`: a row a line, then what was left alone, then a summary."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Ints
from postproc.byte_columns import Column as Bytes
from postproc.byte_columns import blanked, fixed, named, repeated, whole
from postproc.compensation.parallel import in_turns
from postproc.console import Column
from postproc.diff import Difference
from postproc.files import VARIABLES
from postproc.listing import ARROWS, arrows, is_coloured, paint, status_colour
from postproc.listing_columns import Block, print_blocks
from postproc.row_columns import blocks_of, number_places, strung
from postproc.rows import STATUSES, Row, Rows

DECIMALS = 4
HERE = 4  # every fourth block is made where all of them are laid out
STATUS = "status"
PLACE = (Column("file", "left"), Column("line"), Column("target", "left"))
NUMBERS = (Column("original"), Column("", "left"), Column("compensated"))
TOLD = (Column("J1-6", "left"), Column(STATUS, "left"))
SIGNS = tuple(ARROWS[d] for d in range(-1, 3))


def print_difference(found: Difference, out: TextIO | None = None) -> None:
    """Print a row for every line that differs, the targets left alone, a summary."""
    out = out or sys.stdout
    names = {r.file for r in (*found.differing, *found.untouched) if len(r)}
    skip = 0 if len(names) > 1 or any(n.endswith(VARIABLES) for n in names) else 1
    told = bool(found.counts)
    size = Column("|c| mm" if told else "change mm")
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

    def blocks(self, parts: Sequence[Rows], shown: Sequence[int]) -> Iterator[Block]:
        """Write the rows of all files, some columns of them."""
        tasks = [(rows, *block) for rows in parts for block in blocks_of(rows)]
        return in_turns(lambda task: self._block(*task, shown), tasks, HERE)

    def _block(self, rows: Rows, k: Ints, single: Ints, shown: Sequence[int]) -> Block:
        """Write some rows."""
        plain = ~np.isin(k, single)
        cells = [*_place(rows, k), *_numbers(rows, k, plain), self._size(rows, k)]
        if self.told:
            cells += self._told(rows, k)
        texts = {row - int(k[0]): self._texts(rows.row(row)) for row in single.tolist()}
        return Block(
            [_masked(cells[c], plain) for c in shown],
            np.column_stack([_lengths(cells[c]) * plain for c in shown]),
            {at: [row[c] for c in shown] for at, row in texts.items()},
        )

    def _size(self, rows: Rows, k: Ints) -> Bytes:
        """Write how far the TCP is moved, or else by how much the numbers changed."""
        size, has = rows.change_mm[k], rows.has_change[k]
        if self.told and rows.told is not None and len(rows.told.line):
            entry = rows.entry[k]
            size = np.where(entry < 0, size, rows.told.correction_mm[entry])
            has = has | (entry >= 0)
        return blanked(fixed(np.where(has, size, 0.0), 3), ~has, b"")

    def _told(self, rows: Rows, k: Ints) -> list[Bytes]:
        """Say how the targets are reached, and what came of them."""
        told = rows.told
        if told is None or not len(told.line):
            return [repeated(b"", len(k))] * 2
        entry = rows.entry[k]
        signs = named(SIGNS, told.direction[entry].ravel() + 1, str)
        what = told.status[entry] * len(told.reasons) + told.why[entry]
        said = [_said(s, why) for s in STATUSES for why in told.reasons]
        both = signs.reshape(len(k), -1), named(said, what, self._painted)
        return [blanked(cells, entry < 0, b"") for cells in both]

    def _painted(self, status: str) -> str:
        return paint(status, status_colour(status)) if self.coloured else status

    def _texts(self, row: Row) -> list[str]:
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


def _place(rows: Rows, k: Ints) -> list[Bytes]:
    """Say where rows stand."""
    file = repeated(rows.file.encode(errors="replace"), len(k))
    line = rows.line[k]
    names = named(rows.targets, rows.target[k], str)
    return [file, blanked(whole(line), line == 0, b""), names]


def _numbers(rows: Rows, k: Ints, plain: NDArray[np.bool_]) -> list[Bytes]:
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


def _written(row: Row) -> tuple[str, str]:
    """Write the numbers that changed, or the text."""
    if row.text or not row.original:
        return row.text, ""
    pairs = zip(row.original, row.compensated, strict=True)
    moved = [pair for pair in pairs if pair[0] != pair[1]]
    written = ", ".join([f"%.{DECIMALS}f"] * len(moved))
    old, new = zip(*moved, strict=True)
    return written % old, written % new
