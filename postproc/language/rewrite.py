"""New numbers into old text: edits of the numbers of targets, and nothing else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats, Ints, pieces
from postproc.exceptions import ProgramError
from postproc.language import digits
from postproc.language.edits import Replacements, as_bytes
from postproc.language.lexis import number_value
from postproc.language.skeleton import Skeleton, differences
from postproc.language.source import Source, apply
from postproc.language.visits import Literals

Texts = NDArray[np.bytes_]

MM_DECIMALS, DEGREE_DECIMALS, JOINT_DECIMALS = 3, 4, 5
_PIECE = 100_000  # numbers rewritten at a time
_POSE_DECIMALS = (MM_DECIMALS,) * 3 + (DEGREE_DECIMALS,) * 3
_JOINT_DECIMALS = (JOINT_DECIMALS,) * 6


def decimals_of(text: str) -> int:
    """Return how many decimals a number is written with.

    >>> decimals_of("-12.50"), decimals_of("7"), decimals_of("1.25e1")
    (2, 0, 1)
    """
    if text.replace(".", "", 1).lstrip("-").isdecimal():
        return len(text.partition(".")[2])
    mantissa, _, exponent = text.lower().partition("e")
    if "x" in mantissa:
        return 0
    written = len(mantissa.partition(".")[2])
    return max(written - int(exponent or 0), 0)


def number_text(value: float, decimals: int, least: int) -> str:
    """Write a number with the decimals it had and at least `least`.

    The sign stands directly before the digits; a zero carries none.

    >>> number_text(12.34567, 1, 3), number_text(-0.00001, 4, 3)
    ('12.346', '0.0000')
    """
    text = f"{value:.{max(decimals, least)}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


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
            for some in pieces(len(start), _PIECE)
        ]
        found.append(Replacements.joined(parts))
    return tuple(found)


def _edits_of(
    source: Source, start: Ints, end: Ints, values: Floats, least: Ints
) -> Replacements:
    """Return the edits of one file's numbers, which are in ascending order."""
    old, plain = digits.cut(source.data, start, end)
    had, before = np.zeros(len(old), dtype=np.int64), np.empty(len(old))
    had[plain], before[plain] = digits.decimals(old[plain]), old[plain].astype(float)
    for row in np.flatnonzero(~plain).tolist():
        text = source.text[start[row] : end[row]]
        had[row], before[row] = decimals_of(text), number_value(text)
    moved = ~(np.abs(values - before) <= 0.5 * 10.0 ** -np.maximum(had, least))
    rows = np.flatnonzero(moved)
    new = _texts(values[rows], had[rows], least[rows])
    new = _with_plus(new, old[rows])
    other = new.astype(float) != before[rows]
    return Replacements(start[rows[other]], end[rows[other]], new[other])


def _with_plus(new: Texts, old: Texts) -> Texts:
    """Keep the plus of numbers that had one and are not below zero."""
    rows = np.char.startswith(old, b"+") & ~np.char.startswith(new, b"-")
    if not rows.any():
        return new
    signed: Texts = np.where(rows, np.char.add(b"+", new), new)
    return signed


def _texts(values: Floats, decimals: Ints, least: Ints) -> NDArray[np.bytes_]:
    """Write numbers with the decimals they had and at least `least`, (m,)."""
    new, sure = digits.fixed(values, np.maximum(decimals, least))
    rest = np.flatnonzero(~sure)
    triples = zip(values[rest], decimals[rest], least[rest], strict=True)
    texts = [number_text(v, d, few).encode("ascii") for v, d, few in triples]
    widest = max([_width(new), *map(len, texts)])
    new = new.astype(f"S{widest}")
    new[rest] = texts
    return new


def _width(texts: Texts) -> int:
    """Return the length of the longest text, at least 1."""
    used = np.flatnonzero(as_bytes(texts).any(axis=0))
    return 1 + int(used.max(initial=0))


def compare(
    before: Source | Skeleton,
    after: Source | Skeleton,
    allowed: Replacements,
    stamp: int = 0,
) -> tuple[str, ...]:
    """Check that a text differs from its origin only by the edits meant.

    Texts that have not been read yet are; `differences` says what is looked at.

    Args:
        before: The original.
        after: The rewritten text.
        allowed: The edits of numbers that were meant.
        stamp: Bytes of the stamp line that it begins with.

    Returns:
        What is wrong, empty where all is well.
    """
    old, new = (s.source if isinstance(s, Skeleton) else s for s in (before, after))
    if not _is_meant(old.data, allowed, new.data, stamp):
        return (_first_difference(apply(old.data, allowed), new, stamp),)
    try:
        a = before if isinstance(before, Skeleton) else Skeleton.read(before)
        b = after if isinstance(after, Skeleton) else Skeleton.read(after)
    except ProgramError as problem:
        return (str(problem),)
    return differences(a, b, allowed, stamp)


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
