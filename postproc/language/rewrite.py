"""New numbers into old text: edits of the numbers of targets, and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bytes, Floats, Indices, Ints, chunks
from postproc.byte_columns import as_texts, fixed
from postproc.exceptions import ProgramError
from postproc.language.lines import Lines, read_lines
from postproc.language.scan import read_numbers
from postproc.language.shapes import Shapes
from postproc.language.source import Replacements, Source, apply
from postproc.language.visits import Literals

# What new numbers must leave alone: the shapes of lines and where numbers stand.

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
    shape: Indices
    line: Indices
    start: Indices
    end: Indices

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


def difference(
    before: Source | Skeleton,
    after: Source | Skeleton,
    allowed: Replacements,
    stamp: int = 0,
) -> str:
    """Say where a text differs from its origin otherwise than by the edits meant.

    Its bytes must be those of the edited original. Read by itself, every line must
    have the shape it had, every edit must replace one whole number, and every number
    must stand where the edits move it to.

    Args:
        before: The original; it is read where it has not been yet.
        after: The rewritten text, likewise.
        allowed: The edits of numbers that were meant.
        stamp: Bytes of the stamp line that the rewritten text begins with.

    Returns:
        What is wrong, "" where all is well.
    """
    old, new = (s.source if isinstance(s, Skeleton) else s for s in (before, after))
    if not _is_meant(old.data, allowed, new.data, stamp):
        return _first_difference(apply(old.data, allowed), new, stamp)
    try:
        a = before if isinstance(before, Skeleton) else Skeleton.read(before)
        b = after if isinstance(after, Skeleton) else Skeleton.read(after)
    except ProgramError as problem:
        return str(problem)
    if len(a.shape) != len(b.shape) or len(a.start) != len(b.start):
        return "the rewritten text has other lines or numbers than the original"
    if a.shapes != b.shapes or (a.shape != b.shape).any():
        row = int(np.flatnonzero(a.shape != b.shape)[:1].sum())
        return f"line {a.line[row]}: the rewritten line has another shape"
    return _part_of_a_number(a, allowed) or _number_elsewhere(a, b, allowed, stamp)


def _part_of_a_number(before: Skeleton, allowed: Replacements) -> str:
    """Say which edit does not replace one whole number."""
    for rows in chunks(len(allowed), AT_ONCE):
        some = allowed[rows]
        at = np.searchsorted(before.start, some.start)
        whole = at < len(before.start)
        at[~whole] = 0
        if len(before.start):
            whole &= before.start[at] == some.start
            whole &= before.end[at] == some.end
        if not whole.all():
            line = before.source.line_of(int(some.start[~whole][0]))
            return f"line {line}: an edit does not replace one whole number"
    return ""


def _number_elsewhere(
    before: Skeleton, after: Skeleton, allowed: Replacements, stamp: int
) -> str:
    """Say which number does not stand where the edits move it to."""
    growth = np.char.str_len(allowed.new) - (allowed.end - allowed.start)
    shift = stamp + np.cumsum(np.append(0, growth))
    for rows in chunks(len(before.start), AT_ONCE):
        start, end = before.start[rows], before.end[rows]
        edits = np.searchsorted(allowed.start, start)  # before the number
        wrong = after.start[rows] != start + shift[edits]
        edits = np.searchsorted(allowed.start, start, side="right")  # and its own
        wrong |= after.end[rows] != end + shift[edits]
        if wrong.any():
            line = before.source.line_of(int(start[wrong][0]))
            return f"line {line}: a number stands elsewhere than it should"
    return ""


def _is_meant(old: bytes, allowed: Replacements, new: bytes, stamp: int) -> bool:
    """Tell whether a text is another one with edits, without making it once more."""
    at = stamp
    for piece in allowed.applied(old):
        if not new.startswith(piece, at):
            return False
        at += len(piece)
    return at == len(new)


def _first_difference(meant: bytes, after: Source, stamp: int) -> str:
    length = min(len(meant), len(after.data) - stamp)
    pairs = zip(meant, after.data[stamp:], strict=False)
    at = next((i for i, (a, b) in enumerate(pairs) if a != b), length)
    line = after.line_of(min(at + stamp, max(len(after.data) - 1, 0)))
    return f"line {line}: the text is not what was meant"


# The edits, file by file.

Texts = NDArray[np.bytes_]

MM_DECIMALS, DEGREE_DECIMALS, JOINT_DECIMALS = 3, 4, 5
_PIECE = 100_000  # numbers rewritten at a time
_POSE_DECIMALS = (MM_DECIMALS,) * 3 + (DEGREE_DECIMALS,) * 3
_JOINT_DECIMALS = (JOINT_DECIMALS,) * 6


def number_texts(values: Floats, decimals: Ints) -> Texts:
    """Write numbers with so many decimals each; a zero carries no sign, (m,).

    >>> number_texts(np.array([12.34567, -0.00001]), np.array([3, 4])).tolist()
    [b'12.346', b'0.0000']
    """
    groups = [np.flatnonzero(decimals == d) for d in np.unique(decimals).tolist()]
    written = []
    for rows in groups:
        column = fixed(values[rows], int(decimals[rows[0]]))
        nought = ~((column > ord("0")) & (column <= ord("9"))).any(axis=1)
        column[nought & (column[:, 0] == ord("-")), 0] = 0
        written.append(as_texts(column))
    texts = np.zeros(len(values), np.result_type("S1", *written))
    for rows, own in zip(groups, written, strict=True):
        texts[rows] = own
    return texts


def edits(
    literals: Literals,
    sources: Sequence[Source],
    rows: Ints | Sequence[int],
    new_values: Floats | Sequence[Floats],
) -> tuple[Replacements, ...]:
    """Return the edits that give literals new values, file by file.

    A number is edited only where it changes by more than half of its last digit as it
    will be written.

    Args:
        literals: Where the numbers stand.
        sources: The files that `literals.file` means.
        rows: Literals to change, (r,).
        new_values: Their new numbers, (r, 6) [mm, deg].

    Raises:
        ValueError: A new value is not finite.
    """
    new_values = np.asarray(new_values, dtype=float).reshape(-1, 6)
    if not np.isfinite(new_values).all():
        raise ValueError("a new value of a target is not finite")
    rows = np.asarray(rows, dtype=np.int64)
    found = []
    for file, source in enumerate(sources):
        mine = np.flatnonzero(literals.file[rows] == file)
        start, end = literals.start[rows[mine]], literals.end[rows[mine]]
        joints = literals.joints[rows[mine], None]
        least = np.where(joints, _JOINT_DECIMALS, _POSE_DECIMALS)
        written = start >= 0
        order = np.argsort(start[written], kind="stable")
        start, end = start[written][order], end[written][order]
        values, least = new_values[mine][written][order], least[written][order]
        parts = [
            _edits_of(source, start[some], end[some], values[some], least[some])
            for some in chunks(len(start), _PIECE)
        ]
        found.append(Replacements.joined(parts))
    return tuple(found)


def _edits_of(
    source: Source, start: Ints, end: Ints, values: Floats, least: Ints
) -> Replacements:
    """Return the edits of one file's numbers, which are in ascending order."""
    before, had = read_numbers(source.data, start, end)
    digits = np.maximum(had, least)
    rows = np.flatnonzero(~(np.abs(values - before) <= 0.5 * 10.0**-digits))
    new = number_texts(values[rows], digits[rows])
    new = _with_plus(new, np.frombuffer(source.data, dtype=np.uint8)[start[rows]])
    other = new.astype(float) != before[rows]
    return Replacements(start[rows[other]], end[rows[other]], new[other])


def _with_plus(new: Texts, before: Bytes) -> Texts:
    """Keep the plus that numbers began with, where they are not below zero."""
    rows = (before == ord("+")) & ~np.char.startswith(new, b"-")
    if not rows.any():
        return new
    signed: Texts = np.where(rows, np.char.add(b"+", new), new)
    return signed
