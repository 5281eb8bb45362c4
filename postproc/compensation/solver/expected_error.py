"""The expected true error of every target, before and after its correction.

The error of an arrival is e = m + c + d: m is what the model predicts, c the
correction that was applied, and d is normal with the covariance of what the model does
not know, and of repeatability. Errors of the part and of the frames are not in it. The
square of the length of e is approximated by a scaled and shifted chi-square variable
of the same mean, variance and skewness (Pearson; Imhof 1961): its 95 % bound is within
1.5 % of the exact one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cache, cached_property

import numpy as np
from scipy.optimize import brentq
from scipy.special import gammaincinv, ndtr, ndtri

from postproc.arrays import Bools, Floats, Indices, any_in_rows, chunks, map_chunks
from postproc.model.model import CHUNK, Prediction
from postproc.model.variance import covariance_times
from postproc.operating_system import count_cores

BOUND = 0.95  # of the length of an error
SIDED = float(ndtri(BOUND))  # standard deviations that hold it on one side
NODES, WEIGHTS = (  # of a probability from 0 to 1
    (np.polynomial.legendre.leggauss(6) + np.array([[1.0], [0.0]])) / 2.0
)
WIDE = 3.0  # times its mean is beyond the bound of any length
LEAST = 1e-9  # standard deviation [m]
FLAT = 1e-3  # .. and part of the mean: below it the error does not scatter
MANY, FEW = 40_000, 4_000  # laws, and those that tell nearly what all of them do
NEAR = 0.03  # of the length that these tell
FINE = 1e-9  # [m] to which that length is found


@dataclass(frozen=True, eq=False)
class LengthLaw:
    """The distribution of the lengths of n normal vectors: L^2 = shift + scale chi^2.

    Attributes:
        scale, shift: Of the chi-square variable, (n,) [m^2].
        half: Half of its degrees of freedom, (n,).
        least: What at least 95 % of the lengths are beyond, (n,) [m].
    """

    scale: Floats
    shift: Floats
    half: Floats
    least: Floats

    @classmethod
    def of_normal(cls, mean: Floats, covariance: Floats) -> LengthLaw:
        """Match the first three cumulants.

        Args:
            mean: (n, 3) [m].
            covariance: (n, 6) [m^2]: xx, yy, zz, then xy, xz, yz.
        """
        square = np.square(mean).sum(axis=1)
        covariance = _floor(covariance, square)
        a, b, c, d, e, f = covariance.T
        (x, y, z), turned = mean.T, covariance_times(covariance, mean).T
        along = np.maximum(x * turned[0] + y * turned[1] + z * turned[2], 0.0)
        first = a + b + c + square
        second = a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f + along)
        third = a**3 + b**3 + c**3 + 6.0 * d * e * f
        third += 3.0 * (a * (d * d + e * e) + b * (d * d + f * f) + c * (e * e + f * f))
        third += 3.0 * sum(part * part for part in turned)
        scale = third / second
        half = second / (2.0 * scale**2)
        # A length is no less than its component along the mean.
        size = np.sqrt(np.maximum(square, LEAST**2))
        least = np.maximum(size - SIDED * np.sqrt(along) / size, 0.0)
        return cls(scale, first - 2.0 * half * scale, half, least)

    @classmethod
    def unknown(cls, n: int) -> LengthLaw:
        """Make room for n distributions, NaN as yet."""
        return cls(*np.full((4, n), np.nan))

    def put(self, rows: Indices, law: LengthLaw) -> None:
        """Enter some distributions, in place."""
        for f in fields(self):
            getattr(self, f.name)[rows] = getattr(law, f.name)

    def __getitem__(self, rows: Bools | slice) -> LengthLaw:
        """Return some of the distributions."""
        return LengthLaw(*(getattr(self, f.name)[rows] for f in fields(self)))

    @property
    def bound(self) -> Floats:
        """The lengths that 95 % of the errors are within, (n,) [m]."""
        return self._root(np.asarray(2.0 * gammaincinv(self.half, BOUND)))

    def beyond(self, length: Floats | float) -> Floats:
        """Return the probability that a length is larger, (n,), within 0.01."""
        middle, cube = self._cube_root
        root = np.cbrt(np.maximum(np.square(length) - self.shift, 0.0) * cube)
        return np.asarray(ndtr(middle - root))

    @cached_property
    def _cube_root(self) -> tuple[Floats, Floats]:
        """Mean of the cube root of chi^2 over its deviation, its cube a unit, (n,)."""
        wide = np.sqrt(self._part)
        return (1.0 - self._part) / wide, 1.0 / (2.0 * self.half * self.scale * wide**3)

    @property
    def mean(self) -> Floats:
        """The expected lengths, (n,) [m], within 2 %."""
        normal, part = ndtri(NODES), self._part[:, None]
        root = np.maximum(1.0 - part + normal * np.sqrt(part), 0.0)
        chi = 2.0 * self.half[:, None] * root * root * root
        return np.asarray(self._root(chi.T).T @ WEIGHTS)

    @cached_property
    def _part(self) -> Floats:
        """Variance of the cube root of chi^2 over its mean, taken as normal, (n,).

        After Wilson and Hilferty (1931).
        """
        return np.asarray(1.0 / (9.0 * self.half))

    def _root(self, chi: Floats) -> Floats:
        """Return lengths of values of the chi-square variable, (n,) or (k, n)."""
        return np.asarray(np.sqrt(np.maximum(self.shift + self.scale * chi, 0.0)))


def _floor(covariance: Floats, square: Floats) -> Floats:
    """Keep every standard deviation above what counts as none, (n, 6)."""
    least = np.maximum(FLAT**2 * square, LEAST**2)[:, None]
    return np.concatenate(
        [np.maximum(covariance[:, :3], least), covariance[:, 3:]], axis=1
    )


@dataclass(frozen=True, eq=False)
class ErrorLaws:
    """Distributions of the lengths of errors of n visits, NaN where not known.

    Attributes:
        before: Without any correction.
        after: With the correction that was made.
        outside: Whether the state is outside of what was surveyed, (n,).
    """

    before: LengthLaw
    after: LengthLaw
    outside: Bools

    @classmethod
    def of(
        cls, found: Prediction, spread: float, correction: Floats, judged: Bools
    ) -> ErrorLaws:
        """Tell how the errors of n visits are distributed.

        Args:
            found: The predicted errors.
            spread: How held-out readings scatter against their noise, see
                `Model.reading_spread`; below 1 it counts as 1.
            correction: Change of their commanded TCP, base frame, (n, 3) [m]: of a
                target that was left, what it moves by along with its point; else zero.
            judged: Whether visits have a target that they can miss, (n,).
        """
        unsure = np.isnan(found.error + found.covariance[:, :3] + correction)
        rows = np.flatnonzero(judged & ~any_in_rows(unsure))
        covariance = max(spread, 1.0) ** 2 * found.covariance[rows]
        first, last = LengthLaw.unknown(len(judged)), LengthLaw.unknown(len(judged))
        for law, mean in ((first, found.error), (last, found.error + correction)):
            law.put(rows, LengthLaw.of_normal(mean[rows], covariance))
        return cls(first, last, found.any_outside)


@dataclass(frozen=True, eq=False)
class ExpectedErrors:
    """Expected true errors of n visits; lengths in metres, NaN where not known.

    Attributes:
        judged: Whether a visit has a target that it can miss, (n,).
        law: Distributions of the lengths of errors with the correction that was made.
        outside: Whether the state is outside of what was surveyed, (n,).
        before: Expected length of the error without any correction, (n,).
        after: .. with the correction, (n,).
        high: The 95 % bound of that length, (n,).
        below: The length that 95 % of all true errors are expected within.
        below_before: .. without any correction.
    """

    judged: Bools
    law: LengthLaw
    outside: Bools
    before: Floats
    after: Floats
    high: Floats
    below: float
    below_before: float

    @property
    def known(self) -> Bools:
        """Which judged visits have a known error, (n,)."""
        return self.judged & ~np.isnan(self.high)

    @property
    def unknown(self) -> Bools:
        """Which judged visits have none, (n,)."""
        return self.judged & np.isnan(self.high)


def expect_errors(laws: ErrorLaws, judged: Bools) -> ExpectedErrors:
    """Estimate what every visit keeps of its error.

    Args:
        laws: The distributions of the errors of n visits.
        judged: Whether visits have a target that they can miss, (n,).
    """
    first, last = laws.before, laws.after
    before, after, high = np.full((3, len(judged)), np.nan)

    def expect(some: slice) -> None:
        before[some], after[some] = first[some].mean, last[some].mean
        high[some] = last[some].bound

    map_chunks(expect, len(judged), CHUNK, count_cores())
    known = ~np.isnan(high)
    return ExpectedErrors(
        judged, last, laws.outside, before, after, high,
        below=pool_bound(last[known], np.max(high[known], initial=0.0)),
        below_before=pool_bound(
            first[known], WIDE * np.max(before[known], initial=0.0)
        ),
    )  # fmt: skip


def pool_bound(law: LengthLaw, widest: float) -> float:
    """Return the length that 95 % of all errors of n visits are within; NaN for none.

    Args:
        law: Of every visit.
        widest: A length that it is not beyond, such as the largest bound [m].
    """
    n = len(law.half)
    if not n:
        return np.nan
    parts = [law[some] for some in chunks(n, CHUNK)]

    @cache
    def more(length: float) -> float:
        def beyond(some: slice) -> float:
            return float(parts[some.start // CHUNK].beyond(length).sum())

        return sum(map_chunks(beyond, n, CHUNK, count_cores())) / n - (1.0 - BOUND)

    least = 0.0
    if n > MANY:  # some of them tell nearly the same
        near = pool_bound(law[:: n // FEW], widest)
        least, widest = _widen(more, near, widest)
    if more(widest) >= 0.0:
        return widest
    return float(brentq(more, least, widest, xtol=FINE))


def _widen(
    more: Callable[[float], float], near: float, widest: float
) -> tuple[float, float]:
    """Put bounds round a length near the one that is looked for."""
    low, high = near * (1.0 - NEAR), min(near * (1.0 + NEAR), widest)
    return low if more(low) > 0.0 else 0.0, high if more(high) < 0.0 else widest
