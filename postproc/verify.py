"""Our own output, read again: nothing but the intended numbers may differ."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from postproc.exceptions import PostprocError
from postproc.language.rewrite import compare
from postproc.language.source import Source
from postproc.language.stamp import strip_stamp
from postproc.output import Output
from postproc.planning import Reading

Ints = NDArray[np.int64]


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
    kept = ~np.isin(v.literal, edited)
    if not np.array_equal(v.values[kept], w.values[kept], equal_nan=True):
        raise VerificationError(f"{v.files[0]}: a target changed that was to be kept")
