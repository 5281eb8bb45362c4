"""Before and after, on rows that took no part in choosing or fitting.

The whole search is repeated without each part of the rows; the errors on that part are
then errors on rows that no fit has seen and that chose nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.diagnosis.folds import deal
from postproc.accuracy.diagnosis.search import Progress, Search
from postproc.accuracy.diagnosis.withdrawal import investigate
from postproc.accuracy.fit import fit_effects
from postproc.accuracy.fitted import Fit
from postproc.arrays import Floats
from postproc.model.combination import Combination
from postproc.model.kinematics import Batch

PARTS = 5
RUN = 8  # consecutive rows that are held out together
MANY = 2000  # rows from which one part is enough


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Errors on held-out rows.

    Attributes:
        rows: The rows, (m,).
        fitted: Rows that each of them was predicted from, typically.
        before, after: Errors that the given and the extended model leave, (m, 3) [m].
    """

    rows: NDArray[np.int64]
    fitted: int
    before: Floats
    after: Floats


def hold_out(
    found: Search, seed: int, progress: Progress, given: Floats | None = None
) -> HeldOut:
    """Repeat the search without each part of the rows.

    Args:
        found: The search on all rows: its first fit, its library, its threshold.
        seed: Of the parts.
        progress: Told what is being done.
        given: Errors that the given model leaves as it is, (n, 3) [m], where it has
            not seen the rows; else its effects are refitted without each part.
    """
    base = found.base
    used = base.rows.weight > 0
    part = deal(base.batch.states.order, PARTS, seed, RUN)
    count = PARTS if len(base.batch) < MANY else 1
    rows, before, after, fitted = [], [], [], 0
    for k in range(count):
        progress(f"held-out rows, part {k + 1} of {count}", 0.6 + 0.4 * k / count)
        out = np.flatnonzero((part == k) & used)
        inside = np.flatnonzero(part != k)
        if len(out) == 0:
            continue
        less = _fit_of(base, inside)
        library = found.library.at_rows(inside)
        more = investigate(less, library, found.null, lambda *_: None).fit
        rows.append(out)
        before.append(
            left_by(less, base, out) if given is None else np.asarray(given[out])
        )
        after.append(left_by(more, base, out))
        fitted = len(inside)
    return HeldOut(
        np.concatenate(rows), fitted, np.concatenate(before), np.concatenate(after)
    )


def _fit_of(base: Fit, rows: NDArray[np.int64]) -> Fit:
    """Fit the effects of a fit to some of its rows only."""
    batch = Batch(base.batch.arm, base.batch.states[rows])
    position = base.error[rows] + batch.walk.tcp
    return fit_effects(batch, position, base.combination.effects, base.noise.origin)


def left_by(fit: Fit, every: Fit, rows: NDArray[np.int64]) -> Floats:
    """Return what a fit leaves of the errors of other rows, (m, 3) [m]."""
    batch = Batch(every.batch.arm, every.batch.states[rows])
    predicted = Combination(fit.combination.effects).error(batch, fit.values)
    left: Floats = every.error[rows] - predicted
    return left
