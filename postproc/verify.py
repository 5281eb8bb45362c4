"""Our own output, read again: nothing but the intended numbers may differ."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import Floats, Ints, pieces
from postproc.as_read import edited_numbers
from postproc.exceptions import PostprocError
from postproc.language.rewrite import Skeleton, compare
from postproc.language.source import UTF8_MARK, Replacements, Source
from postproc.language.stamp import stamp_length
from postproc.language.visits import Visits
from postproc.output import Output
from postproc.planning import Reading
from postproc.side_by_side import meanwhile

SAME = 1e-6  # [mm] and [deg]: what adding constants to numbers may round off
WORTH = 40_000  # visits from which on a second process compares the texts
ROWS = 50_000  # compared at a time: what that takes is small beside two readings
CONSTANT = (
    "frames", "tool", "base", "uframe", "pred_start", "pred", "target", "motion", "via",
    "distance_mm", "aux", "config", "configs", "config_given", "literal", "follows",
    "tool_remote", "nearest_turn", "care", "fly", "fly_dist_mm", "fly_per", "fly_type",
    "fly_traj", "lin_spd", "rot_spd", "override", "wrist_joint", "ornt_type",
)  # fmt: skip


class VerificationError(PostprocError):
    """The output is not the program that was meant; nothing may be written."""


def check_output(
    before: Reading, after: Reading, output: Output, edited: Ints, processes: int = 1
) -> None:
    """Check that a rewritten program differs in the numbers of edited targets only.

    Args:
        before: The source.
        after: The output, parsed again.
        output: What was written.
        edited: Literals that were given new numbers, (m,).
        processes: How many may work at once on a long program.

    Raises:
        VerificationError: Another byte differs, or the program reads differently.
    """
    worth = processes > 1 and len(before.visits) > WORTH
    with meanwhile(lambda: _in_texts(before, after, output), worth=worth) as ask:
        in_visits = _in_visits(before.visits, after.visits, output, edited)
        problem = ask() or in_visits
    if problem:
        raise VerificationError(problem)


def _in_texts(before: Reading, after: Reading, output: Output) -> str:
    """Say where the texts differ otherwise than by the edits, nothing if nowhere."""
    for old, new, edits in zip(before.texts, after.texts, output.edits, strict=True):
        name = old.source.name
        for problem in _differences(old, new, edits, name in output.records):
            return f"{name}: {problem}; nothing is written"
    return ""


def _in_visits(v: Visits, w: Visits, output: Output, edited: Ints) -> str:
    """Say what the program does otherwise than it should, nothing if nothing."""
    name = v.files[0]
    if len(v) != len(w) or not np.array_equal(v.literal, w.literal):
        return f"{name}: the output makes other moves"
    changes = np.append(np.zeros(len(v.literals), dtype=bool), False)  # none: -1
    changes[edited] = True
    for rows in pieces(len(v), ROWS):
        kept = ~(changes[v.literal[rows]] | changes[v.follows[rows]])
        if not _same(v.values[rows][kept], w.values[rows][kept]):
            return f"{name}: a target changed that was to be kept"
    if not _move_along(v, w):
        return f"{name}: a computed target changed otherwise"
    if not all(_as_meant(v, w, rows, output.edits) for rows in pieces(len(v), ROWS)):
        return f"{name}: a number does not read as it was meant"
    for column in CONSTANT:
        if not _equal(getattr(v, column), getattr(w, column)):
            return f"{name}: the output has another {column}"
    return ""


def _differences(
    old: Skeleton, new: Skeleton, edits: Replacements, stamped: bool
) -> tuple[str, ...]:
    """Compare two texts as they were read; the second may begin with a stamp line."""
    length = stamp_length(new.source.data) if stamped else 0
    if old.source.data.startswith(UTF8_MARK):  # it is no code on line 1 alone
        text = new.source.data[length:]
        return compare(old, Source(new.source.name, text), edits)
    return compare(old, new, edits, length)


def _as_meant(
    before: Visits, after: Visits, rows: slice, edits: Sequence[Replacements]
) -> bool:
    """Tell whether the numbers in the text are those of the edits, else as before."""
    literal = after.literal[rows]
    direct = literal >= 0
    new, edited = edited_numbers(before.literals, literal[direct], edits)
    meant = np.where(edited, new, before.values[rows][direct])
    return np.array_equal(after.values[rows][direct], meant)


def check_numbers(before: Visits, looked: Floats, after: Visits) -> None:
    """Check that the output has the numbers that the last look was at.

    Args:
        before: The source.
        looked: The numbers, (n, 6).
        after: The output, parsed again.

    Raises:
        VerificationError: A written number is not that one bit by bit, or a computed
            one differs by more than what adding constants rounds off.
    """
    for rows in pieces(len(before), ROWS):
        wanted, read = looked[rows], after.values[rows]
        computed = before.follows[rows] >= 0
        if not _same(wanted[~computed], read[~computed]):
            problem = "a number is not read as written"
            raise VerificationError(f"{before.files[0]}: {problem}")
        own = wanted[computed], read[computed]
        if not np.allclose(*own, rtol=0, atol=SAME, equal_nan=True):
            problem = "a computed target is elsewhere"
            raise VerificationError(f"{before.files[0]}: {problem}")


def _equal(a: Floats | tuple[str, ...], b: Floats | tuple[str, ...]) -> bool:
    """Compare two columns."""
    if isinstance(a, tuple) or isinstance(b, tuple):
        return a == b
    return a.shape == b.shape and all(
        _same(a[rows], b[rows]) for rows in pieces(len(a), ROWS)
    )


def _same(a: Floats, b: Floats) -> bool:
    """Compare some rows of two columns; NaN equals NaN."""
    return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


def _move_along(before: Visits, after: Visits) -> bool:
    """Tell whether computed targets change as those do that they are computed from."""
    rows = np.flatnonzero(before.follows >= 0)
    if not len(rows):
        return True
    direct = np.flatnonzero(before.literal >= 0)
    change = np.zeros((len(before.literals), 6))
    moved = after.values[direct] - before.values[direct]
    change[before.literal[direct]] = moved
    moved = after.values[rows] - before.values[rows]
    meant = change[before.follows[rows]]
    return np.allclose(meant, moved, atol=SAME, equal_nan=True)
