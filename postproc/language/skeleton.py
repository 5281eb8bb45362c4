"""What new numbers must leave alone: the shapes of lines and where numbers stand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import pieces
from postproc.language.edits import Replacements
from postproc.language.lines import Lines, read_lines
from postproc.language.shapes import Shapes
from postproc.language.source import Source

Ints = NDArray[np.signedinteger[Any]]

AT_ONCE = 200_000  # numbers compared: what that takes is small beside two texts


@dataclass(frozen=True)
class Skeleton:
    """A text as it was read: n lines of code with m numbers.

    It is kept while a program is worked on.

    Attributes:
        source: The text.
        shapes: The distinct masks of its lines.
        shape: Index into `shapes`, (n,).
        line: 1-based physical lines, (n,).
        start, end: Byte offsets of the numbers, (m,).
    """

    source: Source
    shapes: Shapes
    shape: Ints
    line: Ints
    start: Ints
    end: Ints

    @classmethod
    def of(cls, lines: Lines) -> Skeleton:
        """Take over what the lines of a text tell."""
        return cls(
            lines.source, lines.shapes, lines.shape, lines.line, lines.start, lines.end
        )

    @classmethod
    def read(cls, source: Source) -> Skeleton:
        """Read a text.

        Raises:
            ProgramError: A string does not end on its line.
        """
        return cls.of(read_lines(source))


def differences(
    before: Skeleton, after: Skeleton, allowed: Replacements, stamp: int
) -> tuple[str, ...]:
    """Check what was read of a rewritten text against the edits that were meant.

    Every line must have the shape it had, every edit must replace one whole number,
    and every number must stand where the edits move it to.

    Args:
        before: The original.
        after: The rewritten text, read by itself.
        allowed: The edits of numbers that were meant.
        stamp: Bytes of the rewritten text before the first line of the original.

    Returns:
        What is wrong, empty where all is well.
    """
    if len(before.shape) != len(after.shape) or len(before.start) != len(after.start):
        return ("the rewritten text has other lines or numbers than the original",)
    if before.shapes != after.shapes or (before.shape != after.shape).any():
        row = int(np.flatnonzero(before.shape != after.shape)[:1].sum())
        return (f"line {before.line[row]}: the rewritten line has another shape",)
    for rows in pieces(len(allowed), AT_ONCE):
        some = allowed[rows]
        at = np.searchsorted(before.start, some.start)
        whole = at < len(before.start)
        at[~whole] = 0
        if len(before.start):
            whole &= before.start[at] == some.start
            whole &= before.end[at] == some.end
        if not whole.all():
            line = before.source.line_of(int(some.start[~whole][0]))
            return (f"line {line}: an edit does not replace one whole number",)
    growth = np.char.str_len(allowed.new) - (allowed.end - allowed.start)
    shift = stamp + np.cumsum(np.append(0, growth))
    for rows in pieces(len(before.start), AT_ONCE):
        start, end = before.start[rows], before.end[rows]
        edits = np.searchsorted(allowed.start, start)  # before the number
        wrong = after.start[rows] != start + shift[edits]
        edits = np.searchsorted(allowed.start, start, side="right")  # and its own
        wrong |= after.end[rows] != end + shift[edits]
        if wrong.any():
            line = before.source.line_of(int(start[wrong][0]))
            return (f"line {line}: a number stands elsewhere than it should",)
    return ()
