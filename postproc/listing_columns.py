"""The listing of `postproc.listing` from columns of bytes: the same text, no loop.

`print_listing` lets a cell that sticks out widen its column from the next row on. The
width of a column at a row is thus the longest cell before it, which is one running
maximum.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import TextIO

import numpy as np

from postproc.arrays import Ints
from postproc.byte_columns import Column as Bytes
from postproc.byte_columns import joined
from postproc.console import Column
from postproc.exceptions import printable
from postproc.listing import GAP, MEASURED, Colours, is_coloured, paint


@dataclass(frozen=True)
class Block:
    """Some rows of a listing.

    Attributes:
        cells: The texts of every column as UTF-8, (k, w) each; coloured in the last
            column where colours are wanted.
        lengths: How many characters they have, (k, columns).
        single: Rows that are given as texts instead, which may be of any kind.
    """

    cells: Sequence[Bytes]
    lengths: Ints
    single: Mapping[int, Sequence[str]] = field(default_factory=dict)


def print_blocks(
    columns: Sequence[Column],
    blocks: Iterable[Block],
    colours: Colours | None = None,
    out: TextIO | None = None,
) -> None:
    """Print an aligned table of any length as `print_listing` does.

    Args:
        columns: Its columns; the last one is not padded.
        blocks: Its rows.
        colours: Which colour a cell of a column (by title) has. Used on a terminal
            only.
        out: Where to; default: stdout.
    """
    out = out or sys.stdout
    shown = (colours or {}) if is_coloured(out) else {}
    given = iter(blocks)
    first, rows = [], 0
    while rows < MEASURED and (block := next(given, None)):
        first.append(block)
        rows += len(block.lengths)
    titles = [c.title for c in columns]
    layout = _Layout(
        [c.justify == "left" for c in columns], [shown.get(t) for t in titles]
    )
    widths = _measured(titles, first)
    bold = [(lambda _: "bold") if shown else None for _ in titles]
    print(_Layout(layout.left, bold).line(titles, widths), file=out)
    for block in chain(first, given):
        text, widths = layout.text(block, widths)
        out.write(text)


def _measured(titles: Sequence[str], blocks: Sequence[Block]) -> Ints:
    """Return the widths that titles and the first rows ask for."""
    lengths = [np.array([[len(title) for title in titles]])]
    for block in blocks:
        lengths.append(block.lengths.copy())
        for k, row in block.single.items():
            lengths[-1][k] = [len(cell) for cell in row]
    widths: Ints = np.concatenate(lengths)[: MEASURED + 1].max(axis=0)
    widths[-1] = 0  # the last column is not padded
    return widths


@dataclass(frozen=True)
class _Layout:
    """On which side cells stand, and which colour they have."""

    left: Sequence[bool]
    colours: Sequence[Callable[[str], str] | None]

    def text(self, block: Block, widths: Ints) -> tuple[str, Ints]:
        """Write rows; return the widths from there on, too."""
        lengths = block.lengths.copy()
        for k, row in block.single.items():
            lengths[k] = [len(printable(cell)) for cell in row]
        lengths[:, -1] = 0
        wide = np.maximum.accumulate(np.concatenate([widths[None], lengths]))
        parts: list[Bytes | bytes] = []
        for number, cells in enumerate(block.cells):
            parts += [GAP.encode()] if number else []
            blanks = _blanks(wide[:-1, number] - lengths[:, number])
            if number == len(block.cells) - 1:
                parts += [cells]
            else:
                parts += [cells, blanks] if self.left[number] else [blanks, cells]
        text = joined([*parts, b"\n"]).decode()
        if block.single or " \n" in text:
            lines = [*map(str.rstrip, text.split("\n"))]
            for k, row in block.single.items():
                lines[k] = self.line(row, wide[k])
            text = "\n".join(lines)
        return text, wide[-1]

    def line(self, row: Sequence[str], widths: Ints) -> str:
        """Write a row of texts."""
        texts = [printable(cell) for cell in row]
        cells = []
        for text, width, left, colour in zip(
            texts, widths.tolist(), self.left, self.colours, strict=True
        ):
            cell = text.ljust(width) if left else text.rjust(width)
            cells.append(paint(cell, colour(text)) if colour else cell)
        return GAP.join(cells).rstrip()


def _blanks(count: Ints) -> Bytes:
    """Return so many blanks a row; none for less than one."""
    most = int(count.max(initial=0))
    return np.where(np.arange(most) < count[:, None], 32, 0).astype(np.uint8)
