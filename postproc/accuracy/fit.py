"""Fitting effects to a survey: Bayesian, robust, with geometry taken exactly.

One pass linearises the arm at the present parameters (Gauss-Newton), solves the
Bayesian linear regression with prior scales by marginal likelihood, re-estimates the
two components of the noise and re-weighs the rows; passes repeat until nothing moves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from postproc.accuracy.batch import Batch
from postproc.accuracy.combination import Combination
from postproc.accuracy.effect import Effect
from postproc.accuracy.evidence import Normal, Posterior, maximise
from postproc.accuracy.noise import Noise, Whitener
from postproc.accuracy.outliers import RowWeights, judge, student_weights

Array = NDArray[np.float64]

PASSES = 30
HEAVY_TAILED = 4  # first passes that a gross outlier must not lead astray
SETTLED = 5e-8  # [m] change of any predicted error that ends the passes
SETTLED_NOISE = 5e-3  # relative change of the noise that ends the passes


@dataclass(frozen=True, eq=False)
class Fit:
    """Fitted effects, with all that tests of further effects need.

    Attributes:
        batch: The survey's states, nominal kinematics.
        combination: The effects.
        error: Measured minus nominal position, (n, 3) [m].
        values: Parameters, (p,) [SI].
        covariance: Of the parameters, (p, p).
        log_scale: Log factor that the data put on each group's prior scale, (g,).
        groups: Names of the prior groups, in the order of `log_scale`.
        noise: Estimated noise components.
        rows: Weight of every row.
        residual: Error that the effects leave, (n, 3) [m].
        columns: Derivatives at the solution, (n, 3, p).
        whitener: Rotations and variances of the rows.
        log_evidence: Log marginal likelihood of the whitened rows.
        effective: Effective number of parameters.
    """

    batch: Batch
    combination: Combination
    error: Array
    values: Array
    covariance: Array
    log_scale: Array
    groups: tuple[str, ...]
    noise: Noise
    rows: RowWeights
    residual: Array
    columns: Array
    whitener: Whitener
    log_evidence: float
    effective: float

    @property
    def std(self) -> Array:
        """Standard errors of the parameters, (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def prior_std(self) -> Array:
        """Prior standard deviations that the data chose, (p,)."""
        index = np.array([self.groups.index(g) for g in self.combination.groups], int)
        std: Array = self.combination.scales * np.exp(self.log_scale)[index]
        return std

    @cached_property
    def row_scale(self) -> Array:
        """What whitening multiplies the rotated components with, (n, 3) [1/m]."""
        v = self.whitener.variance(self.noise)
        scale: Array = np.sqrt(self.rows.weight[:, None] / v)
        return scale

    def whiten(self, rows: Array) -> Array:
        """Whiten (n, 3) or (n, 3, k): the noise of the result has unit variance.

        Returns:
            (3 n,) or (3 n, k).
        """
        turned = self.whitener.rotate(rows)
        if rows.ndim == 2:
            return (turned * self.row_scale).reshape(-1)
        return (turned * self.row_scale[:, :, None]).reshape(-1, rows.shape[2])

    @cached_property
    def basis(self) -> Array:
        """Orthonormal basis of the whitened columns, (3 n, rank)."""
        X = self.whiten(self.columns) * self.prior_std
        Q, R, _ = qr(X, mode="economic", pivoting=True)
        size = np.abs(np.diag(R))
        known = size > max(1e-9 * float(size.max(initial=0.0)), 1e-3)
        return np.asarray(Q[:, : int(known.sum())])

    def project_out(self, whitened: Array) -> Array:
        """Remove from whitened rows what the fitted effects can take up."""
        left: Array = whitened - self.basis @ (self.basis.T @ whitened)
        return left


def fit_effects(
    batch: Batch,
    position: Array,
    effects: tuple[Effect, ...],
    origin: tuple[float, float, float] | None = None,
    start: Fit | None = None,
) -> Fit:
    """Fit effects to measured positions.

    Args:
        batch: States of the survey.
        position: Measured TCP positions in the base frame, (n, 3) [m].
        effects: What may cause the errors.
        origin: Tracker position in the base frame, where it is known.
        start: A fit of some of these effects to the same rows, to begin with.
    """
    combination = Combination(effects)
    state = _begin(batch, position, combination, origin, start)
    heavy = HEAVY_TAILED if start is None else 0
    for number in range(PASSES):
        following = _pass(state, heavy=number < heavy)
        if _settled(state, following) and number >= heavy:
            return following
        state = following
    return state


def _begin(
    batch: Batch,
    position: Array,
    combination: Combination,
    origin: tuple[float, float, float] | None,
    start: Fit | None,
) -> Fit:
    """Make the state before the first pass."""
    n, p = len(batch), len(combination.parameters)
    error = position - batch.walk.tcp
    groups = tuple(dict.fromkeys(combination.groups))
    values, log_scale = np.zeros(p), np.zeros(len(groups))
    lever = float(np.sqrt((batch.jacobian**2).sum(axis=(1, 2)).mean() / 3))
    noise = Noise(1.0, batch.arm.repeatability / (3.0 * lever), origin)
    if start is not None:
        noise = start.noise
        known = dict(zip(start.combination.names, start.values, strict=True))
        values = np.array([known.get(k, 0.0) for k in combination.names])
        scale = dict(zip(start.groups, start.log_scale, strict=True))
        log_scale = np.array([scale.get(g, 0.0) for g in groups])
    whitener = Whitener.build(batch, position, origin)
    ones = RowWeights(np.ones(n), np.zeros(n), np.zeros(n, dtype=bool))
    return Fit(
        batch, combination, error, values, np.eye(p), log_scale, groups, noise,
        ones if start is None else start.rows, error, np.zeros((n, 3, p)), whitener,
        -np.inf, 0.0,
    )  # fmt: skip


def _pass(state: Fit, heavy: bool) -> Fit:
    """Do one pass: linearise, solve, estimate the noise, weigh the rows."""
    c, batch = state.combination, state.batch
    at = c.at(batch, state.values)
    columns = c.columns(at)
    target = state.error - c.error(batch, state.values) + columns @ state.values
    state = replace(state, columns=columns)
    solved = _solve(state, target)
    values = c.scales * solved.mean
    covariance = solved.covariance * np.outer(c.scales, c.scales)
    residual = state.error - c.error(batch, values)
    spread = _spread(state, covariance)
    turned = state.whitener.rotate(residual)
    distance = np.sqrt((turned**2 / state.whitener.variance(state.noise)).sum(axis=1))
    if heavy:
        weight = student_weights(distance)
        rows = replace(state.rows, weight=weight, distance=distance)
    else:
        rows = judge(distance, residual, batch.states.q, batch.jacobian)
    noise = state.whitener.estimate(turned**2 + spread, rows.weight, state.noise)
    return replace(
        state, values=values, covariance=covariance, log_scale=solved.log_scale,
        noise=noise, rows=rows, residual=residual,
        whitener=_with_unknown_sides(state, values),
        log_evidence=solved.log_evidence, effective=solved.effective,
    )  # fmt: skip


def _solve(state: Fit, target: Array) -> Posterior:
    """Solve the linear regression of the present pass."""
    X = state.whiten(state.columns) * state.combination.scales
    y = state.whiten(target)
    v = state.whitener.variance(state.noise)
    used = state.rows.weight > 0
    normal = Normal(
        X.T @ X, X.T @ y, float(y @ y),
        float(np.log(v[used]).sum()), 3.0 * float(used.sum()),
    )  # fmt: skip
    index = {g: i for i, g in enumerate(state.groups)}
    group = np.array([index[g] for g in state.combination.groups], dtype=int)
    return maximise(normal, group, state.log_scale)


def _spread(state: Fit, covariance: Array) -> Array:
    """Posterior variance of every rotated prediction, (n, 3) [m^2]."""
    turned = state.whitener.rotate(state.columns)
    spread: Array = np.maximum(((turned @ covariance) * turned).sum(axis=2), 0.0)
    return spread


def _with_unknown_sides(state: Fit, values: Array) -> Whitener:
    """Add the backlash to the variance of rows whose direction is not known."""
    unknown = (state.batch.states.direction == 0).astype(float)
    if not unknown.any():
        return state.whitener
    slopes = state.combination.direction_slopes(state.batch, values)
    square = np.einsum("nij,nj->n", slopes**2, unknown) / 3.0
    return replace(state.whitener, extra=np.repeat(square[:, None], 3, axis=1))


def _settled(before: Fit, after: Fit) -> bool:
    """Tell whether a pass changed nothing that matters."""
    moved = np.abs(after.residual - before.residual).max(initial=0.0)
    ratio = after.whitener.variance(after.noise) / before.whitener.variance(
        before.noise
    )
    return bool(moved < SETTLED and np.abs(np.log(ratio)).max() < SETTLED_NOISE)
