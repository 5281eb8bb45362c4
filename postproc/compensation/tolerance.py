"""The expected true error of every target, against a tolerance.

The error of an arrival is e = m + c + d: m is what the model predicts, c the
correction that was applied, and d is normal with the standard error of the model, what
is left of the model, and repeatability. The length of e is judged by its quantiles.
Errors of the part and of the frames are not in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cache

import numpy as np

from postproc.arrays import Bools, Floats, Signs, chunks
from postproc.compensation.arrivals import ArrivalStates
from postproc.exceptions import PostprocError
from postproc.robot.pose import MM, lengths

LOW, HIGH = 5.0, 95.0  # bounds of the length of the error [%]
DRAWS = 1024  # of a normal error, the same for every target
AT_ONCE = 1_000  # visits


class Verdict(IntEnum):
    """What the bounds of a target's error say of a tolerance."""

    PASS = 0  # the upper bound is within it
    FAIL = 1  # the lower bound is beyond it
    UNKNOWN = 2  # it lies between them, or the error is not known
    NONE = 3  # the move holds no target of its own, such as $HOME


@dataclass(frozen=True, eq=False)
class ToleranceCheck:
    """Expected true errors of n visits; lengths in metres, NaN where not known.

    Attributes:
        tolerance: What they are held against.
        verdict: `Verdict` of every visit, (n,).
        before: Expected length of the error without any correction, (n,).
        expected: .. with the corrections that were made, (n,).
        low, high: Its 5 % and 95 % bounds, (n,).
        risk: Probability that it is beyond the tolerance, (n,).
    """

    tolerance: float
    verdict: Signs
    before: Floats
    expected: Floats
    low: Floats
    high: Floats
    risk: Floats

    @property
    def passes(self) -> bool:
        """Whether every visit to a target passes."""
        return not (self.count(Verdict.FAIL) or self.count(Verdict.UNKNOWN))

    def count(self, verdict: Verdict) -> int:
        """Count the visits of one verdict."""
        return int((self.verdict == verdict).sum())

    @property
    def outside(self) -> float:
        """How many visits of known error are expected beyond the tolerance.

        The sum of their probabilities: it holds however their errors depend on each
        other.
        """
        return float(np.nansum(self.risk))


def check_tolerance(
    arrivals: ArrivalStates, correction: Floats, judged: Bools, tolerance_mm: float
) -> ToleranceCheck:
    """Judge every visit by what it keeps of its error.

    Args:
        arrivals: How the arm arrives at n visits.
        correction: Change of their commanded TCP, base frame, (n, 3) [m]; zero where
            nothing was corrected.
        judged: Whether visits have a target that they can miss, (n,).
        tolerance_mm: Largest length of the true error.

    Raises:
        PostprocError: The tolerance is no positive number.
    """
    if not 0.0 < tolerance_mm < np.inf:
        raise PostprocError(
            f"--tolerance {tolerance_mm:g}: give a length in mm above 0"
        )
    n, tolerance = len(arrivals.visits), tolerance_mm * MM
    found = arrivals.predict(np.arange(n))
    error, std, outside = np.moveaxis(found, 1, 0)
    known = judged & ~np.isnan(error + std + correction).any(axis=1)
    kept = error + correction
    columns = np.full((5, n), np.nan)
    for rows in chunks(n, AT_ONCE):
        size = _sizes(kept[rows], std[rows])
        columns[0, rows] = _sizes(error[rows], std[rows]).mean(axis=1)
        columns[1, rows] = size.mean(axis=1)
        columns[2:4, rows] = np.percentile(size, [LOW, HIGH], axis=1)
        columns[4, rows] = (size > tolerance).mean(axis=1)
    columns[:, ~known] = np.nan
    beyond = np.asarray(outside[:, 0] > 0.0)
    verdict = _verdicts(columns[2], columns[3], tolerance, beyond)
    verdict[~judged] = Verdict.NONE
    return ToleranceCheck(tolerance, verdict, *columns)


def _verdicts(low: Floats, high: Floats, tolerance: float, outside: Bools) -> Signs:
    """Compare bounds with the tolerance.

    Outside of what was surveyed nothing says how wide the bounds are: no visit passes
    there.
    """
    verdict = np.full(len(low), Verdict.UNKNOWN, dtype=np.int8)
    verdict[(high <= tolerance) & ~outside] = Verdict.PASS
    verdict[low > tolerance] = Verdict.FAIL
    return verdict


def _sizes(mean: Floats, std: Floats) -> Floats:
    """Draw lengths of normal errors: (k, 3), (k, 3) -> (k, DRAWS)."""
    return lengths(mean[:, None] + std[:, None] * _normal())


@cache
def _normal() -> Floats:
    """Return points that fill the normal distribution evenly, (DRAWS, 3)."""
    from scipy.stats import norm, qmc  # slow to load

    cube = qmc.Sobol(3, rng=np.random.default_rng(0)).random(DRAWS)
    return np.asarray(norm.ppf(np.clip(cube, 1e-9, 1.0 - 1e-9)))
