"""The expected true error of every target, before and after its correction.

The error of an arrival is e = m + c + d: m is what the model predicts, c the
correction that was applied, and d is normal with the standard error of the model, what
is left of the model, and repeatability. Errors of the part and of the frames are not in
it. The square of the length of e is approximated by a scaled and shifted chi-square
variable of the same mean, variance and skewness (Pearson; Imhof 1961): its 95 % bound
is within 1.5 % of the exact one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import gammaincc, gammaincinv

from postproc.arrays import Bools, Floats
from postproc.compensation.arrivals import ArrivalStates

BOUND = 0.95  # of the length of an error
NODES, WEIGHTS = (  # of a probability from 0 to 1
    (np.polynomial.legendre.leggauss(6) + np.array([[1.0], [0.0]])) / 2.0
)
LEAST = 1e-9  # standard deviation [m]
FLAT = 1e-3  # .. and part of the mean: below it the error does not scatter


@dataclass(frozen=True, eq=False)
class LengthLaw:
    """The distribution of the lengths of n normal vectors: L^2 = shift + scale chi^2.

    Attributes:
        scale, shift: Of the chi-square variable, (n,) [m^2].
        half: Half of its degrees of freedom, (n,).
    """

    scale: Floats
    shift: Floats
    half: Floats

    @classmethod
    def of_normal(cls, mean: Floats, std: Floats) -> LengthLaw:
        """Match the first three cumulants: mean and std per axis, (n, 3) [m]."""
        size = np.sqrt(np.square(mean).sum(axis=1, keepdims=True))
        m, s = mean**2, np.maximum(std, np.maximum(FLAT * size, LEAST)) ** 2
        first, second = (m + s).sum(axis=1), 2.0 * (s * (s + 2.0 * m)).sum(axis=1)
        third = 8.0 * (s * s * (s + 3.0 * m)).sum(axis=1)
        scale = third / (4.0 * second)
        half = second / (4.0 * scale**2)
        return cls(scale, first - 2.0 * half * scale, half)

    def quantile(self, share: float) -> Floats:
        """Return the lengths that errors are within with a probability, (n,) [m]."""
        square = self.shift + 2.0 * self.scale * gammaincinv(self.half, share)
        return np.sqrt(np.maximum(square, 0.0))

    def beyond(self, length: Floats | float) -> Floats:
        """Return the probability that a length is larger, (n,)."""
        chi = (np.square(length) - self.shift) / (2.0 * self.scale)
        return np.asarray(gammaincc(self.half, np.maximum(chi, 0.0)))

    def at_nodes(self) -> Floats:
        """Return the lengths at `NODES`, (n, 6) [m]."""
        return np.stack([self.quantile(p) for p in NODES], axis=1)


@dataclass(frozen=True, eq=False)
class ExpectedErrors:
    """Expected true errors of n visits; lengths in metres, NaN where not known.

    Attributes:
        judged: Whether a visit has a target that it can miss, (n,).
        mean: Its error with the correction that was made, (n, 3).
        std: Standard deviation of the error of an arrival per axis, (n, 3).
        outside: Whether the state is outside of what was surveyed, (n,).
        before: Expected length of the error without any correction, (n,).
        after: .. with the correction, (n,).
        high: The 95 % bound of that length, (n,).
        below: The length that 95 % of all true errors are expected within.
        below_before: .. without any correction.
    """

    judged: Bools
    mean: Floats
    std: Floats
    outside: Bools
    before: Floats
    after: Floats
    high: Floats
    below: float
    below_before: float

    @cached_property
    def law(self) -> LengthLaw:
        """Return the distributions of the lengths with the correction."""
        return LengthLaw.of_normal(self.mean, self.std)

    @property
    def known(self) -> Bools:
        """Which judged visits have a known error, (n,)."""
        return self.judged & ~np.isnan(self.high)

    @property
    def unknown(self) -> Bools:
        """Which judged visits have none, (n,)."""
        return self.judged & np.isnan(self.high)


def expect_errors(
    arrivals: ArrivalStates, correction: Floats, judged: Bools
) -> ExpectedErrors:
    """Estimate what every visit keeps of its error.

    Args:
        arrivals: How the arm arrives at n visits.
        correction: Change of their commanded TCP, base frame, (n, 3) [m]; zero where
            nothing was corrected.
        judged: Whether visits have a target that they can miss, (n,).
    """
    n = len(arrivals.visits)
    error, std, outside = np.moveaxis(arrivals.predict(np.arange(n)), 1, 0)
    known = judged & ~np.isnan(error + std + correction).any(axis=1)
    mean = np.where(known[:, None], error + correction, np.nan)
    rows = np.flatnonzero(known)
    first = LengthLaw.of_normal(error[rows], std[rows]).at_nodes()
    law = LengthLaw.of_normal(mean[rows], std[rows])
    last = law.at_nodes()
    before, after, high = np.full((3, n), np.nan)
    before[rows], after[rows] = first @ WEIGHTS, last @ WEIGHTS
    high[rows] = law.quantile(BOUND)
    return ExpectedErrors(
        judged, mean, std, np.asarray(outside[:, 0] > 0.0), before, after, high,
        below=pool_quantile(last), below_before=pool_quantile(first),
    )  # fmt: skip


def pool_quantile(lengths: Floats, share: float = BOUND) -> float:
    """Return the length that a share of the errors of n visits is within; NaN for none.

    Args:
        lengths: Of every visit at `NODES`, (n, 6).
        share: Which share.
    """
    if not len(lengths):
        return np.nan
    order = np.argsort(lengths, axis=None)
    weight = np.broadcast_to(WEIGHTS, lengths.shape).ravel()[order]
    at = (np.cumsum(weight) - weight / 2.0) / weight.sum()
    return float(np.interp(share, at, lengths.ravel()[order]))
