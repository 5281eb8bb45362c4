"""Our own output, read again: nothing but the intended numbers may differ."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from postproc.as_read import edited_numbers
from postproc.exceptions import PostprocError
from postproc.language.edits import Replacements
from postproc.language.rewrite import compare
from postproc.language.skeleton import Skeleton
from postproc.language.source import UTF8_MARK, Source
from postproc.language.stamp import strip_stamp
from postproc.language.visits import Visits
from postproc.output import Output
from postproc.planning import Reading

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

SAME = 1e-6  # [mm] and [deg]: what adding constants to numbers may round off
CONSTANT = (
    "frames", "tool", "base", "uframe", "pred_start", "pred", "target", "motion", "via",
    "distance_mm", "aux", "config", "configs", "config_given", "literal", "follows",
    "tool_remote", "nearest_turn", "care", "fly", "fly_dist_mm", "fly_per", "fly_type",
    "fly_traj", "lin_spd", "rot_spd", "override", "wrist_joint", "ornt_type",
)  # fmt: skip


class VerificationError(PostprocError):
    """The output is not the program that was meant; nothing may be written."""


def check_output(before: Reading, after: Reading, output: Output, edited: Ints) -> None:
    """Check that a rewritten program differs in the numbers of edited targets only.

    Args:
        before: The source.
        after: The output, parsed again.
        output: What was written.
        edited: Literals that were given new numbers, (m,).

    Raises:
        VerificationError: Another byte differs, or the program reads differently.
    """
    for old, new, edits in zip(before.texts, after.texts, output.edits, strict=True):
        for problem in _differences(old, new, edits, old.source.name in output.records):
            name = old.source.name
            raise VerificationError(f"{name}: {problem}; nothing is written")
    v, w = before.visits, after.visits
    if len(v) != len(w) or not np.array_equal(v.literal, w.literal):
        raise VerificationError(f"{v.files[0]}: the output makes other moves")
    kept = ~(np.isin(v.literal, edited) | np.isin(v.follows, edited))
    if not np.array_equal(v.values[kept], w.values[kept], equal_nan=True):
        raise VerificationError(f"{v.files[0]}: a target changed that was to be kept")
    if not np.allclose(_shares(v, w), w.values - v.values, atol=SAME, equal_nan=True):
        raise VerificationError(f"{v.files[0]}: a computed target changed otherwise")
    numbers, direct = _meant(v, output.edits), w.literal >= 0
    if not np.array_equal(w.values[direct], numbers[w.literal[direct]]):
        raise VerificationError(f"{v.files[0]}: a number does not read as it was meant")
    for name in CONSTANT:
        if not _equal(getattr(v, name), getattr(w, name)):
            raise VerificationError(f"{v.files[0]}: the output has another {name}")


def _differences(
    old: Skeleton, new: Skeleton, edits: Replacements, stamped: bool
) -> tuple[str, ...]:
    """Compare two texts as they were read; the second may begin with a stamp line."""
    text = strip_stamp(new.source.data) if stamped else new.source.data
    if old.source.data.startswith(UTF8_MARK):  # it is no code on line 1 alone
        return compare(old, Source(new.source.name, text), edits)
    return compare(old, new, edits, len(new.source.data) - len(text))


def _meant(visits: Visits, edits: Sequence[Replacements]) -> Array:
    """Return what the numbers of all literals should be after the edits, (m, 6)."""
    literals, direct = visits.literals, np.flatnonzero(visits.literal >= 0)
    numbers = np.full((len(literals), 6), np.nan)
    numbers[visits.literal[direct]] = visits.values[direct]
    new, edited = edited_numbers(literals, np.arange(len(literals)), edits)
    return np.where(edited, new, numbers)


def check_numbers(before: Visits, looked: Array, after: Visits) -> None:
    """Check that the output has the numbers that the last look was at.

    Args:
        before: The source.
        looked: The numbers, (n, 6).
        after: The output, parsed again.

    Raises:
        VerificationError: A written number is not that one bit by bit, or a computed
            one differs by more than what adding constants rounds off.
    """
    computed = before.follows >= 0
    same = (looked == after.values) | (np.isnan(looked) & np.isnan(after.values))
    if not same[~computed].all():
        raise VerificationError(f"{before.files[0]}: a number is not read as written")
    far = ~np.isclose(looked, after.values, rtol=0, atol=SAME, equal_nan=True)
    if far[computed].any():
        raise VerificationError(f"{before.files[0]}: a computed target is elsewhere")


def _equal(a: Array | tuple[str, ...], b: Array | tuple[str, ...]) -> bool:
    """Compare two columns."""
    if isinstance(a, tuple) or isinstance(b, tuple):
        return a == b
    return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


def _shares(before: Visits, after: Visits) -> Array:
    """Give the changes of all visits, those of computed targets by their literals."""
    moved = after.values - before.values
    direct = np.flatnonzero(before.literal >= 0)
    change = np.zeros((len(before.literals), 6))
    change[before.literal[direct]] = moved[direct]
    rows = before.follows >= 0
    moved[rows] = change[before.follows[rows]]
    return moved
