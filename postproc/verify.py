"""Our own output, read again: nothing but the intended numbers may differ."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from postproc.exceptions import PostprocError
from postproc.language.rewrite import compare
from postproc.language.source import Source
from postproc.language.stamp import strip_stamp
from postproc.language.visits import Visits
from postproc.output import Output
from postproc.planning import Reading

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

SAME = 1e-6  # [mm] and [deg]: what adding constants to numbers may round off
CONSTANT = ("frames", "tool", "base", "uframe", "pred_start", "pred", "target")


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
    for old, new, edits in zip(
        before.sources, after.sources, output.edits, strict=True
    ):
        text = strip_stamp(new.data) if old.name in output.records else new.data
        for problem in compare(old, Source(new.name, text), edits):
            raise VerificationError(f"{old.name}: {problem}; nothing is written")
    v, w = before.visits, after.visits
    if len(v) != len(w) or not np.array_equal(v.literal, w.literal):
        raise VerificationError(f"{v.files[0]}: the output makes other moves")
    kept = ~(np.isin(v.literal, edited) | np.isin(v.follows, edited))
    if not np.array_equal(v.values[kept], w.values[kept], equal_nan=True):
        raise VerificationError(f"{v.files[0]}: a target changed that was to be kept")
    if not np.allclose(_shares(v, w), w.values - v.values, atol=SAME, equal_nan=True):
        raise VerificationError(f"{v.files[0]}: a computed target changed otherwise")
    for name in CONSTANT:
        if not np.array_equal(getattr(v, name), getattr(w, name), equal_nan=True):
            raise VerificationError(f"{v.files[0]}: the output has another {name}")


def _shares(before: Visits, after: Visits) -> Array:
    """Give the changes of all visits, those of computed targets by their literals."""
    moved = after.values - before.values
    direct = np.flatnonzero(before.literal >= 0)
    change = np.zeros((len(before.literals), 6))
    change[before.literal[direct]] = moved[direct]
    rows = before.follows >= 0
    moved[rows] = change[before.follows[rows]]
    return moved
