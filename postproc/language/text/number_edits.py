"""New numbers into old text: edits of the numbers of targets, and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc import _native
from postproc.arrays import Floats, Indices, Ints, chunks, floats
from postproc.exceptions import ProgramError
from postproc.language.pose_encoding import Dialect
from postproc.language.text.source import (
    NumberSpans,
    Replacements,
    Source,
    Span,
    apply,
    as_texts,
)
from postproc.language.text.statement_table import Statements, read_lines
from postproc.language.text.templates import Shapes
from postproc.language.visits import Literals

AT_ONCE = 200_000  # numbers compared: what that takes is small beside two texts
NO_STAMP = Span(0, 0)


@dataclass(frozen=True)
class Skeleton:
    """A text as it was read: n lines of code with m numbers.

    It is kept while a program is worked on.

    Attributes:
        source: The text.
        shapes: The distinct masks of its lines.
        shape: Index into `shapes`, (n,).
        line: 1-based physical lines, (n,).
        numbers: Where the numbers stand, (m,).
    """

    source: Source
    shapes: Shapes
    shape: Indices
    line: Indices
    numbers: NumberSpans

    @classmethod
    def of(cls, text: Statements[Any]) -> Skeleton:
        """Take over what the statements of a text tell."""
        where = text.shape, text.begin_line, text.numbers
        return cls(text.source, text.shapes, *where)

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
    stamp: Span = NO_STAMP,
) -> str:
    """Say where a text differs from its origin otherwise than by the edits meant.

    Its bytes must be those of the edited original. Read by itself, every line must
    have the shape it had, every edit must replace one whole number, and every number
    must stand where the edits move it to.

    Args:
        before: The original; it is read where it has not been yet.
        after: The rewritten text, likewise.
        allowed: The edits of numbers that were meant.
        stamp: Where the stamp line stands in the rewritten text.

    Returns:
        What is wrong, "" where all is well.
    """
    old, new = (s.source if isinstance(s, Skeleton) else s for s in (before, after))
    if not allowed.reproduces(old.data, new.data, stamp):
        meant = apply(old.data, allowed)
        text = new.data[: stamp.start] + new.data[stamp.end :]
        pairs, length = zip(meant, text, strict=False), min(len(meant), len(text))
        at = next((i for i, (a, b) in enumerate(pairs) if a != b), length)
        at += (stamp.end - stamp.start) * (at >= stamp.start)
        line = new.line_of(min(at, max(len(new.data) - 1, 0)))
        return f"line {line}: the text is not what was meant"
    try:
        a, b = (s if isinstance(s, Skeleton) else Skeleton.read(s)
                for s in (before, after))  # fmt: skip
    except ProgramError as problem:
        return str(problem)
    if len(a.shape) != len(b.shape) or len(a.numbers) != len(b.numbers):
        return "the rewritten text has other lines or numbers than the original"
    if a.shapes != b.shapes or (a.shape != b.shape).any():
        row = int(np.flatnonzero(a.shape != b.shape)[:1].sum())
        return f"line {a.line[row]}: the rewritten line has another shape"
    return _number_elsewhere(a, b, allowed, stamp)


def _number_elsewhere(
    before: Skeleton, after: Skeleton, allowed: Replacements, stamp: Span
) -> str:
    """Say which edit does not replace one whole number, or which number moves wrongly.

    Numbers must stand where the edits of those before them, and the stamp, move them.
    """
    done, shift, length = 0, np.int32(0), np.int32(stamp.end - stamp.start)
    for rows in chunks(len(before.numbers), AT_ONCE):
        start, end = before.numbers.starts(rows), before.numbers.ends(rows)
        some = allowed[done : np.searchsorted(allowed.start, start[-1], side="right")]
        at = np.searchsorted(start, some.start)
        part = (start[at] != some.start) | (end[at] != some.end)
        if part.any():
            return _part_of_a_number(before, int(some.start[part][0]))
        growth = np.zeros(len(start), dtype=np.int32)
        growth[at] = some.growth
        moved = shift + np.cumsum(growth, dtype=np.int32)
        behind = length * (start + moved - growth >= stamp.start)
        wrong = after.numbers.starts(rows) != start + moved - growth + behind
        wrong |= after.numbers.ends(rows) != end + moved + behind
        if wrong.any():
            line = before.source.line_of(int(start[wrong][0]))
            return f"line {line}: a number stands elsewhere than it should"
        done, shift = done + len(some), moved[-1]
    if done < len(allowed):
        return _part_of_a_number(before, int(allowed.start[done]))
    return ""


def _part_of_a_number(before: Skeleton, place: int) -> str:
    line = before.source.line_of(place)
    return f"line {line}: an edit does not replace one whole number"


Texts = NDArray[np.bytes_]
MOST_DIGITS = 1_000  # of a number that is written again


def count_decimals(
    literals: Literals, sources: Sequence[Source], rows: Ints, dialect: Dialect
) -> Ints:
    """Return how many decimals new numbers of some literals have, (r, w).

    Args:
        literals: Where the numbers stand.
        sources: The files that `literals.file` means.
        rows: The literals, (r,).
        dialect: How many decimals they have at least.
    """
    joints = literals.joints[rows, None]
    least = np.where(joints, dialect.joint_decimals, dialect.pose_decimals)
    places, file = literals.places[rows], literals.file[rows, None]
    for number, source in enumerate(sources):
        mine = np.nonzero((places.start >= 0) & (file == number))
        spans = (of[mine].astype(np.int64) for of in (places.start, places.end))
        least[mine] = np.maximum(
            least[mine], _native.count_decimals(source.data, *spans)
        )
    return least


def edits(
    literals: Literals,
    sources: Sequence[Source],
    rows: Ints | Sequence[int],
    new_values: Floats | Sequence[Floats],
    dialect: Dialect,
) -> tuple[Replacements, ...]:
    """Return the edits that give literals new values, file by file.

    A number is edited only where it changes by more than half of its last digit as it
    will be written; a plus that it began with stays.

    Args:
        literals: Where the numbers stand.
        sources: The files that `literals.file` means.
        rows: Literals to change, (r,).
        new_values: Their new numbers, (r, w).
        dialect: How many decimals they have.

    Raises:
        ValueError: A new value is not finite.
        ProgramError: A number has more digits than can be written.
    """
    new_values = np.asarray(new_values, dtype=float).reshape(-1, dialect.width)
    if not np.isfinite(new_values).all():
        raise ValueError("a new value of a target is not finite")
    rows = np.asarray(rows, dtype=np.int64)
    found = []
    for file, source in enumerate(sources):
        mine = np.flatnonzero(literals.file[rows] == file)
        places = literals.places[rows[mine]]
        start, end = places.start, places.end
        joints = literals.joints[rows[mine], None]
        least = np.where(joints, dialect.joint_decimals, dialect.pose_decimals)
        written = start >= 0
        order = np.argsort(start[written], kind="stable")
        start, end = start[written][order], end[written][order]
        long = np.flatnonzero(end - start > MOST_DIGITS)
        if len(long):
            line = source.line_of(int(start[long[0]]))
            problem = f"a number of the target has more than {MOST_DIGITS:,} digits"
            cure = "Write it with 15 digits at most: a controller reads no more"
            raise ProgramError(source.name, problem, cure, line=line)
        values, least = new_values[mine][written][order], least[written][order]
        changed, new = _native.rewrite_numbers(
            source.data, start.astype(np.int64), end.astype(np.int64),
            floats(values), least.astype(np.int64),
        )  # fmt: skip
        found.append(Replacements(start[changed], end[changed], as_texts(new)))
    return tuple(found)
