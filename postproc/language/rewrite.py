"""New numbers into old text: edits of the numbers of targets, and nothing else."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from postproc.exceptions import ProgramError
from postproc.language.lexis import number_value
from postproc.language.lines import read_lines
from postproc.language.source import Edit, Source, Span
from postproc.language.visits import Literals

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

MM_DECIMALS, DEGREE_DECIMALS, JOINT_DECIMALS = 3, 4, 5
_POSE_DECIMALS = (MM_DECIMALS,) * 3 + (DEGREE_DECIMALS,) * 3
_JOINT_DECIMALS = (JOINT_DECIMALS,) * 6


def decimals_of(text: str) -> int:
    """Return how many decimals a number is written with.

    >>> decimals_of("-12.50"), decimals_of("7"), decimals_of("1.25e1")
    (2, 0, 1)
    """
    mantissa, _, exponent = text.lower().partition("e")
    if "x" in mantissa:
        return 0
    written = len(mantissa.partition(".")[2])
    return max(written - int(exponent or 0), 0)


def number_text(value: float, old: str, least: int) -> str:
    """Write a number with at least the decimals it had and at least `least`.

    The sign stands directly before the digits; a zero carries none.

    >>> number_text(12.34567, "12.3", 3), number_text(-0.00001, "- 0.5", 3)
    ('12.346', '0.000')
    """
    decimals = max(decimals_of(old), least)
    text = f"{value:.{decimals}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


def edits(
    literals: Literals,
    sources: Sequence[Source],
    rows: Ints | Sequence[int],
    new_values: Floats | Sequence[Floats],
) -> tuple[tuple[Edit, ...], ...]:
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
    found: list[list[Edit]] = [[] for _ in sources]
    rows = np.asarray(rows, dtype=np.int64)
    files = literals.file[rows].tolist()
    starts, ends = literals.start[rows].tolist(), literals.end[rows].tolist()
    joints = literals.joints[rows].tolist()
    for row, file in enumerate(files):
        text = sources[file].text
        least = _JOINT_DECIMALS if joints[row] else _POSE_DECIMALS
        places = zip(starts[row], ends[row], new_values[row].tolist(), least)  # noqa: B905
        for start, end, value, few in places:
            if start >= 0:
                edit = _edit(text, start, end, value, few)
                found[file] += [edit] if edit else []
    return tuple(tuple(sorted(file, key=_place)) for file in found)


def _place(edit: Edit) -> Span:
    return edit.span


def _edit(text: str, start: int, end: int, value: float, least: int) -> Edit | None:
    """Return the edit of one number, None where it keeps its digits."""
    old = text[start:end]
    decimals = max(decimals_of(old), least)
    if abs(value - number_value(old)) <= 0.5 * 10.0**-decimals:
        return None
    new = number_text(value, old, least)
    if math.isclose(number_value(old), float(new), rel_tol=0.0, abs_tol=1e-12):
        return None
    return Edit(Span(start, end), new.encode("ascii"))


def compare(before: Source, after: Source, allowed: Sequence[Edit]) -> tuple[str, ...]:
    """Check that a text differs from its origin only by the edits meant.

    Both texts are read anew: every line must have the shape it had, and every number
    its text, but for the numbers that were to change, which must have the new ones.

    Args:
        before: The original.
        after: The rewritten text, without its stamp line.
        allowed: The edits of numbers that were meant.

    Returns:
        What is wrong, empty where all is well.
    """
    try:
        old, new = read_lines(before), read_lines(after)
    except ProgramError as problem:
        return (str(problem),)
    if len(old) != len(new) or old.shapes != new.shapes:
        return ("the rewritten text has other lines or shapes than the original",)
    if (old.shape != new.shape).any() or len(old.start) != len(new.start):
        return ("a line of the rewritten text has another shape",)
    wanted = {edit.span.start: edit.new.decode("latin-1") for edit in allowed}
    is_wanted = np.isin(old.start, np.array(sorted(wanted), dtype=np.int64))
    problems = _compare_kept(before, after, allowed)
    for at in np.flatnonzero(is_wanted).tolist():
        got = after.text[new.start[at] : new.end[at]]
        if got != wanted[int(old.start[at])]:
            line = before.line_of(int(old.start[at]))
            problems.append(f"line {line}: a number is {got}, not what was meant")
    if int(is_wanted.sum()) != len(wanted):
        problems.append("an edit does not stand on a number")
    return tuple(problems)


def _compare_kept(before: Source, after: Source, allowed: Sequence[Edit]) -> list[str]:
    """Check the bytes between the edits."""
    at = done = 0
    for (start, end), new in sorted(allowed, key=_place):
        length = start - done
        if before.data[done:start] != after.data[at : at + length]:
            line = before.line_of(done)
            return [f"text after line {line} differs outside of the targets"]
        at += length + len(new)
        done = end
    if before.data[done:] != after.data[at:]:
        return [
            f"text after line {before.line_of(done)} differs outside of the targets"
        ]
    return []
