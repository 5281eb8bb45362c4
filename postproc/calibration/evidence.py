"""Bayesian linear regression whose prior scales the data choose (empirical Bayes).

Columns are scaled by their prior standard deviation, so a parameter of a group g has
prior N(0, s_g^2) with s_g near 1; s_g maximises the marginal likelihood (MacKay,
Bayesian interpolation, 1992).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dsymv
from scipy.linalg.lapack import dpotrf, dpotri

from postproc import _native
from postproc.arrays import Bools, Floats, Ints

LOG_BOUNDS = (-8.0, 7.0)  # of log s_g
STEPS = 60
FIRST_STEP = 2.0  # of any log s_g
SMALLEST_STEP = 1e-6
LEAST_BEND = 1e-3
SETTLED = 1e-5  # nats that a further step promises
HOPE = 5.0  # times what a step promises that a search is thought to bring
FAR = 1000.0  # nats that it may bring besides: it climbs out of saddles, step by step
ROUNDED = 16.0  # units in the last place by which sums over many rows are off
FEWEST = 4.0  # degrees of freedom that a prior scale is credited with at least
LOG_SPREAD = 3.0  # hyperprior of log s_g: an order of magnitude is no surprise
WEAK, LIKELY = 3.0, 6.0  # nats: odds of 20 to 1, and of 400 to 1


def name_evidence(nats: float) -> str:
    """Return evidence in a word: it is relative to what was tried, and never certain.

    >>> [name_evidence(nats) for nats in (2.9, 3.0, 6.1)]
    ['weak', 'likely', 'strong']
    """
    return "weak" if nats < WEAK else "likely" if nats <= LIKELY else "strong"


@dataclass(frozen=True)
class Normal:
    """Whitened normal equations: all that the fit needs of the rows.

    Attributes:
        gram: X^T X of whitened, prior-scaled columns, (p, p).
        moment: X^T y, (p,).
        square: y^T y.
        log_noise: Sum of the log variances of the rows.
        rows: Number of scalar rows.
    """

    gram: Floats
    moment: Floats
    square: float
    log_noise: float
    rows: float

    def root(self) -> Floats:
        """Take rows, (p, p), that have the same sums as all the rows that there are.

        They tell the size of directions down to some 1e-7 of the largest.
        """
        values, vectors = np.linalg.eigh(self.gram)
        rows: Floats = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
        return rows

    def marginalise(self, aside: Bools, s: Floats) -> Normal:
        """Integrate over some parameters, which have known prior scales.

        With Z their columns, rows that had unit variance have 1 + Z s^2 Z^T: exactly
        the same evidence, in the columns of the others alone.

        Args:
            aside: Which parameters, (p,).
            s: Their prior scales, (k,).
        """
        rest, own = ~aside, self.gram[np.ix_(aside, aside)]
        log_det, inverse, told = invert_information(
            np.eye(len(s)) + own * np.outer(s, s)
        )
        across = self.gram[np.ix_(rest, aside)] * s
        inside = inverse if told is None else told
        mixed, moment = across @ inside, s * self.moment[aside]
        gram = self.gram[np.ix_(rest, rest)] - mixed @ across.T
        return Normal(
            (gram + gram.T) / 2.0, self.moment[rest] - mixed @ moment,
            self.square - float(moment @ inside @ moment),
            self.log_noise + log_det, self.rows,
        )  # fmt: skip

    def __add__(self, other: Normal) -> Normal:
        """Put the rows of another set of measurements beside these."""
        return Normal(
            self.gram + other.gram, self.moment + other.moment,
            self.square + other.square, self.log_noise + other.log_noise,
            self.rows + other.rows,
        )  # fmt: skip


@dataclass(frozen=True)
class Posterior:
    """What the data say about the parameters, in units of their prior scales.

    Attributes:
        mean: (p,).
        covariance: (p, p).
        log_scale: Log of the factor s_g of every group, (g,).
        log_evidence: Log marginal likelihood at these scales.
        effective: Effective number of parameters that the data determine.
    """

    mean: Floats
    covariance: Floats
    log_scale: Floats
    log_evidence: float
    effective: float


@dataclass(frozen=True, eq=False)
class Solved:
    """The regression at given prior scales, parameters in units of them.

    With S the prior scales, B = 1 + S G S, P its inverse and m the moment, the mean is
    z = P S m.

    Attributes:
        log_scale: Log prior scale of every group, (g,).
        s: Prior scale of every parameter, (p,).
        lower: P, (p, p), of which the lower half counts.
        z: (p,).
        log_evidence: Log marginal likelihood.
    """

    log_scale: Floats
    s: Floats
    lower: Floats
    z: Floats
    log_evidence: float

    @classmethod
    def at(
        cls, normal: Normal, group: Ints, log_scale: Floats, room: Floats | None = None
    ) -> Solved:
        """Solve it, see `posterior`; P is written into `room`, (p, p), if there is."""
        s = np.exp(log_scale)[group]
        gram = np.ascontiguousarray(normal.gram)
        lower = np.empty(gram.shape) if room is None else room
        _native.scaled(gram, s, lower)
        log_det, told = _invert_lower(lower), None
        if log_det is None:
            _native.scaled(gram, s, lower)
            log_det, lower, told = _invert_above_rounding(_mirror_lower(lower))
        moment = s * normal.moment
        z = _times(lower, moment) if told is None else told @ moment
        fit = normal.square - float(moment @ z)
        evidence = -0.5 * (
            normal.log_noise + log_det + fit + normal.rows * np.log(2 * np.pi)
        )
        return cls(log_scale, s, lower, z, evidence)

    @property
    def to_dict(self) -> Floats:
        """Diagonal of P: the share of each prior variance that is left, (p,)."""
        return np.diag(self.lower)

    def posterior(self) -> Posterior:
        """Write it in units of the prior scales before the data rescale them."""
        covariance = _mirror_lower(self.lower)
        covariance *= self.s[:, None]
        covariance *= self.s
        effective = float((1.0 - self.to_dict).sum())
        return Posterior(
            self.s * self.z, covariance, self.log_scale, self.log_evidence, effective
        )


def posterior(normal: Normal, group: Ints, log_scale: Floats) -> Posterior:
    """Compute the posterior for given prior scales.

    Args:
        normal: Normal equations.
        group: Group of every parameter, (p,).
        log_scale: Log prior scale of every group, (g,).
    """
    return Solved.at(normal, group, log_scale).posterior()


def invert_information(B: Floats) -> tuple[float, Floats, Floats | None]:
    """Invert 1 + C, where C has no negative eigenvalue.

    Columns that are nearly the same, on scales far above what the rows tell of them,
    leave more rounding in C than the 1. Of such directions the rows tell nothing.

    Returns:
        Log determinant, inverse, and its part in the directions that rows tell of, None
        where that is all of it.
    """
    lower = np.array(B, order="C")
    log_det = _invert_lower(lower)
    return (
        _invert_above_rounding(B)
        if log_det is None
        else (log_det, _mirror_lower(lower), None)
    )


def _invert_lower(lower: Floats) -> float | None:
    """Invert 1 + C in place, lower half alone.

    Returns:
        Log determinant, None where C holds more rounding than the 1: nothing of the
        array is left then.
    """
    if len(lower) == 0:
        return 0.0
    rounding = _rounding(np.diag(lower))
    upper = lower.T  # the same, as Fortran lays it out
    _, failed = dpotrf(upper, lower=False, overwrite_a=True, clean=False)
    root = np.diag(lower)
    if failed or float((root**2).min(initial=np.inf)) <= rounding:
        return None
    log_det = 2.0 * float(np.log(root).sum())
    dpotri(upper, lower=False, overwrite_c=True)
    return log_det


def _invert_above_rounding(B: Floats) -> tuple[float, Floats, Floats | None]:
    """Invert 1 + C by its eigenvalues, those that are rounding counting as 1."""
    values, vectors = np.linalg.eigh(B)
    told = values > _rounding(np.diag(B))
    values = np.where(told, np.maximum(values, 1.0), 1.0)
    part = vectors[:, told] / values[told] @ vectors[:, told].T
    return float(np.log(values).sum()), vectors / values @ vectors.T, part


def _rounding(diagonal: Floats) -> float:
    """Say by how much eigenvalues may be off."""
    size = float(diagonal.max(initial=0.0))
    return ROUNDED * len(diagonal) * float(np.finfo(float).eps) * size


def _mirror_lower(lower: Floats) -> Floats:
    """Fill the upper half from the lower one."""
    full: Floats = np.tril(lower)
    full += np.tril(lower, -1).T
    return full


def _times(lower: Floats, x: Floats) -> Floats:
    """Multiply a symmetric array, lower half given, (p, p), by x (p,)."""
    if len(x) == 0:
        return x
    product: Floats = dsymv(1.0, lower.T, x, lower=False)
    return product


def maximise(
    normal: Normal, group: Ints, start: Floats, steps: int = STEPS
) -> Posterior:
    """Choose the prior scales by marginal likelihood.

    Args:
        normal: Normal equations.
        group: Group of every parameter, (p,).
        start: Log prior scales to begin with, (g,).
        steps: Most steps of the search.
    """
    return _climb(normal, group, start, steps).solved.posterior()


def highest(
    normal: Normal, group: Ints, start: Floats, steps: int, least: float
) -> float:
    """Find the log evidence with the hyperprior at its best prior scales.

    Args:
        normal: Normal equations.
        group: Group of every parameter, (p,).
        start: Log prior scales to begin with, (g,).
        steps: Most steps of the search.
        least: The search gives up where it is far from promising as much; what it
            returns then is less.
    """
    return _climb(normal, group, start, steps, least).value


def _climb(
    normal: Normal,
    group: Ints,
    start: Floats,
    steps: int,
    least: float = -np.inf,
) -> _Here:
    """Take Newton's steps until they promise nothing more, or too little."""
    count, room = len(start), np.empty(normal.gram.shape)
    at = _Here.of(normal, group, np.clip(start, *LOG_BOUNDS))
    radius = FIRST_STEP
    for _ in range(steps if count else 0):
        step, gained = at.step(radius)
        done = gained < SETTLED or radius < SMALLEST_STEP
        if done or at.value + FAR + HOPE * at.promise < least:
            break
        u = np.clip(at.solved.log_scale + step, *LOG_BOUNDS)
        there = _Here.of(normal, group, u, room)
        ratio = (there.value - at.value) / gained
        radius = radius / 4 if ratio < 0.25 else radius * (2 if ratio > 0.75 else 1)
        if ratio > 0.0:
            room, at = at.solved.lower, there
    return at


@dataclass(frozen=True, eq=False)
class _Here:
    """The log evidence with the hyperprior and its slopes at some prior scales.

    With P and z as in `Solved`, the slope by log s_a is z_a^2 - tr(1 - P)_aa, and the
    curvature between groups a and b 2 |P_ab|^2 + 4 z_a P_ab z_b, less
    2 tr(P_aa) + 2 z_a^2 where a = b.
    """

    solved: Solved
    value: float
    slope: Floats
    curvature: Floats

    @classmethod
    def of(
        cls, normal: Normal, group: Ints, u: Floats, room: Floats | None = None
    ) -> _Here:
        """Solve the regression at log scales u."""
        solved = Solved.at(normal, group, u, room)
        z, told, count = solved.z, solved.to_dict, len(u)
        both = np.bincount(group, told + z**2, count)
        slope = both - np.bincount(group, minlength=count) - u / LOG_SPREAD**2
        curvature = 2.0 * _native.by_groups(solved.lower, z, group, count)
        curvature -= np.diag(2.0 * both + 1.0 / LOG_SPREAD**2)
        value = solved.log_evidence - 0.5 * float((u**2).sum()) / LOG_SPREAD**2
        return cls(solved, value, slope, curvature)

    @property
    def promise(self) -> float:
        """What Newton's step would bring if it were not too long, free of bounds."""
        bent, axes = np.linalg.eigh(self.curvature)
        slope = axes.T @ self.slope
        return float(0.5 * (slope**2 / np.maximum(np.abs(bent), LEAST_BEND)).sum())

    def step(self, radius: float) -> tuple[Floats, float]:
        """Take Newton's step uphill, no log scale by more than a radius.

        Returns:
            The step, and the rise that the curvature promises.
        """
        u, (low, high) = self.solved.log_scale, LOG_BOUNDS
        free = ~((u <= low) & (self.slope < 0) | (u >= high) & (self.slope > 0))
        out = np.zeros(len(u))
        bent, axes = np.linalg.eigh(self.curvature[np.ix_(free, free)])
        along = axes.T @ self.slope[free] / np.maximum(np.abs(bent), LEAST_BEND)
        out[free] = axes @ along
        out *= min(1.0, radius / max(float(np.abs(out).max(initial=0.0)), 1e-300))
        out = np.clip(u + out, low, high) - u
        rise = float(self.slope @ out + 0.5 * out @ self.curvature @ out)
        return out, rise


def widen_covariance(normal: Normal, group: Ints, at: Posterior) -> Floats:
    """Covariance at prior scales that are known no better than the data tell them.

    A scale that g well-determined parameters have told leaves a Student t with g
    degrees of freedom for the others of its group (MacKay, 1992, section 2: the error
    bar of a log variance is sqrt(2 / g)); its variance is g / (g - 2) times the normal
    one's. Directions that the data determine are not affected.

    Returns:
        (p, p), in units of the prior scales.
    """
    known = 1.0 - np.diag(at.covariance) / np.exp(2.0 * at.log_scale)[group]
    told = np.bincount(group, known, minlength=len(at.log_scale))
    freedom = np.maximum(told, FEWEST)
    wide = at.log_scale + 0.5 * np.log(freedom / (freedom - 2.0))
    return posterior(normal, group, wide).covariance
