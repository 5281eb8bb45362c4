"""The Bayesian, robust fit of effects to rows, and what they cannot see."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import qr, solve_triangular

from postproc.arrays import Floats, Ints
from postproc.calibration.design_matrix import DesignMatrix
from postproc.calibration.evidence import Normal, Posterior, maximise, widen_covariance
from postproc.calibration.noise_estimate import estimate_noise
from postproc.calibration.orientations import RowWeights, Turns, judge, student_weights
from postproc.model.effect_sum import Combination
from postproc.model.effects.effect import Effect
from postproc.model.kinematics import ArmStates
from postproc.model.noise import Noise, poses_of
from postproc.model.whitening import Whitener, Whitening

# What a fit has found, with all that tests of further effects need.

HELD, WITHIN = 0.95, 1.96  # share of normal deviates, within as many sigma
HARDLY = 0.01  # effective parameters a coordinate, which two rows hardly share
LEAST = 0.1  # of its noise that is left at least of a row that tells of itself alone


@dataclass(frozen=True, eq=False)
class Fit:
    """Fitted effects.

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
        design: Derivatives at the solution.
        whitener: Rotations and variances of the rows.
        log_evidence: Log marginal likelihood of the whitened rows.
        effective: Effective number of parameters.
        turns: Measured orientations, where the survey has them.
    """

    batch: ArmStates
    combination: Combination
    error: Floats
    values: Floats
    covariance: Floats
    log_scale: Floats
    groups: tuple[str, ...]
    noise: Noise
    rows: RowWeights
    residual: Floats
    design: DesignMatrix
    whitener: Whitener
    log_evidence: float
    effective: float
    turns: Turns | None = None

    @property
    def position(self) -> Floats:
        """Measured TCP positions in the base frame, (n, 3) [m]."""
        return self.error + self.batch.walk.tcp

    @property
    def std(self) -> Floats:
        """Standard errors of the parameters, (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def prior_std(self) -> Floats:
        """Prior standard deviations that the data chose, (p,)."""
        std: Floats = self.combination.scales * np.exp(self.log_scale)[self.group]
        return std

    @cached_property
    def group(self) -> Ints:
        """Index into `groups` of every parameter, (p,)."""
        index = {g: i for i, g in enumerate(self.groups)}
        return np.array([index[g] for g in self.combination.groups], dtype=np.int64)

    @property
    def poses(self) -> int:
        """Number of poses: what no effect describes of one all its rows share."""
        return len(np.unique(self.pose))

    @property
    def shared(self) -> Floats | None:
        """Covariance of the parameters that rows of a pose share, (p, p).

        None where few parameters are fitted to many rows, and it is next to nothing.
        """
        few = self.effective < HARDLY * self.residual.size
        return None if few else self.covariance

    def move(self, part: slice) -> Floats:
        """Move the positions by some of the parameters alone, (n, 3) [m]."""
        own = np.zeros(len(self.values))
        own[part] = self.values[part]
        return self.design.times(own)

    @cached_property
    def whitening(self) -> Whitening:
        """What makes the noise of the rotated rows independent, of unit variance."""
        return self.whitener.whitening(self.noise, self.rows.weight)

    def whiten(self, rows: Floats) -> Floats:
        """Whiten (n, 3) or (n, 3, k): the noise of the result has unit variance.

        Returns:
            (3 n,) or (3 n, k).
        """
        white = self.whitening.apply(self.whitener.rotate(rows))
        return white.reshape(-1) if rows.ndim == 2 else white.reshape(-1, rows.shape[2])

    @property
    def whitened(self) -> DesignMatrix:
        """Derivatives at the solution, whitened."""
        by = self.whitening
        turned = self.design.rotate(by.scale[:, :, None] * self.whitener.turn)
        return replace(turned, blocks=by.blocks)

    @cached_property
    def pose(self) -> Ints:
        """Number of the commanded pose of every row, (n,)."""
        return poses_of(self.batch.states)

    @property
    def target(self) -> Floats:
        """Whitened error that the columns explain, linearised here, (3 n,)."""
        return self.whiten(self.residual + self.design.times(self.values))

    def normal(self) -> Normal:
        """Write the regression, linearised at the present values, as its normal sums.

        Columns are scaled by the prior scales before the data rescale them.
        """
        scales = self.combination.scales
        whitened, y = self.whitened, self.target.reshape(-1, 3)
        used = self.rows.weight > 0
        normal = Normal(
            whitened.gram() * np.outer(scales, scales), whitened.moment(y) * scales,
            float((y * y).sum()),
            self.whitening.log_det, 3.0 * float(used.sum()),
        )  # fmt: skip
        if self.turns is None:
            return normal
        return normal + self.turns.normal(self.values, scales)

    @cached_property
    def stated(self) -> Floats:
        """Covariance that knows how unsure the prior scales are themselves, (p, p)."""
        scales = self.combination.scales
        at = Posterior(
            self.values / scales, self.covariance / np.outer(scales, scales),
            self.log_scale, self.log_evidence, self.effective,
        )  # fmt: skip
        return widen_covariance(self.normal(), self.group, at) * np.outer(
            scales, scales
        )

    @property
    def _tracker_variance(self) -> Floats:
        """Variance per axis that the tracker gives the rows, (n,) [m^2]."""
        std = self.noise.tracker_std(self.position)
        variance: Floats = std**2 / self.batch.states.readings
        return variance

    @cached_property
    def reading_spread(self) -> float:
        """Factor on the standard deviation of a reading so that 1.96 hold 95 %.

        Readings have heavier tails than a normal distribution. Each row is predicted
        without itself: of its residual r, whose variance is the noise R less what it
        told of the effects, V, r / sqrt(R - V) is that prediction's error over its
        standard deviation (leave one out). At least 1: the noise is what it is.
        """
        noise = self.noise.arrival_variance(self.design.jacobian)
        noise = noise + self.noise.pose_variance(self.design.jacobian)
        noise = noise + self._tracker_variance[:, None]
        noise = noise + self.whitener.extra
        told = (1.0 - 2.0 * self.rows.weight[:, None]) * self.design.variance(
            self.stated
        )
        off = np.abs(self.residual) / np.sqrt(np.maximum(noise + told, LEAST * noise))
        level = min(HELD * (off.size + 1) / max(off.size, 1), 1.0)
        return max(float(np.quantile(off, level)) / WITHIN, 1.0) if off.size else 1.0


# Fitting effects to a survey: Bayesian, robust, with geometry taken exactly.
#
# One pass linearises the arm at the present parameters (Gauss-Newton), solves the
# Bayesian linear regression with prior scales by marginal likelihood, re-estimates the
# components of the noise and re-weighs the rows; passes repeat until nothing moves. A
# step so long that the arm is not linear along it tells nothing of noise and rows: they
# wait until the arm is linearised where it led.

PASSES = 30
HEAVY_TAILED = 4  # first passes that a gross outlier must not lead astray
ROWS_AT_ONCE = 2048  # of which products are formed
BENT = 0.3  # sigma beyond which a step tells nothing of the noise


@dataclass(frozen=True)
class Tolerance:
    """Changes that end the passes.

    Attributes:
        moved: Of any predicted error [m].
        noise: Of the noise, relative.
    """

    moved: float
    noise: float


SETTLED = Tolerance(5e-8, 5e-3)
NEARLY = Tolerance(3e-6, 2e-2)  # for fits that others begin with


def fit_effects(
    batch: ArmStates,
    position: Floats,
    effects: tuple[Effect, ...],
    origin: tuple[float, float, float] | None = None,
    start: Fit | None = None,
    turns: Turns | None = None,
    until: Tolerance = SETTLED,
) -> Fit:
    """Fit effects to measured positions, and to orientations where there are any.

    Args:
        batch: States of the survey.
        position: Measured TCP positions in the base frame, (n, 3) [m].
        effects: What may cause the errors.
        origin: Tracker position in the base frame, where it is known.
        start: A fit of some of these effects to the same rows, to begin with.
        turns: Measured orientations of the same rows; those of `start` if None.
        until: When the passes may end.
    """
    combination = Combination(effects)
    state = _begin(batch, position, combination, origin, start)
    if turns is not None:
        state = replace(state, turns=turns)
    heavy = HEAVY_TAILED if start is None else 0
    for number in range(PASSES):
        following = _pass(state, heavy=number < heavy)
        if _has_settled(state, following, until) and number >= heavy:
            return following
        state = following
    return state


def beside(fitted: Fit, effects: tuple[Effect, ...]) -> Fit:
    """Lay effects beside those of a fit, those that are new at 0, nothing fitted.

    Noise and rows are those of the fit. What it has and `effects` lack is left out.
    """
    position, origin = fitted.position, fitted.noise.origin
    state = _begin(fitted.batch, position, Combination(effects), origin, fitted)
    return _linearise(replace(state, whitener=fitted.whitener))


def _begin(
    batch: ArmStates,
    position: Floats,
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
    turns = None if start is None else start.turns
    return Fit(
        batch, combination, error, values, np.eye(p), log_scale, groups, noise,
        ones if start is None else start.rows, error,
        DesignMatrix.of(combination, batch), whitener, -np.inf, 0.0, turns,
    )  # fmt: skip


def _pass(state: Fit, heavy: bool) -> Fit:
    """Do one pass: linearise, solve, estimate the noise, weigh the rows."""
    state = _linearise(state)
    c, batch = state.combination, state.batch
    solved = maximise(state.normal(), state.group, state.log_scale)
    values = c.scales * solved.mean
    covariance = solved.covariance * np.outer(c.scales, c.scales)
    residual = state.error - c.error_at(_at(state, values), batch, values)
    found = replace(
        state, values=values, covariance=covariance, log_scale=solved.log_scale,
        residual=residual, log_evidence=solved.log_evidence, effective=solved.effective,
    )  # fmt: skip
    if not heavy and _measure_nonlinearity(state, found) > BENT:
        return found
    return _weigh_rows(found, heavy)


def _measure_nonlinearity(before: Fit, after: Fit) -> float:
    """Tell by how much a pass went beyond where it is linear, in sigma (rms)."""
    step = before.design.times(after.values - before.values)
    bend = before.whitener.rotate(after.residual - before.residual + step)
    variance = before.whitener.variance(before.noise)
    return float(np.sqrt((bend**2 / variance).mean()))


def _weigh_rows(state: Fit, heavy: bool) -> Fit:
    """Estimate the noise from what is left, and weigh the rows by it."""
    c, batch, residual = state.combination, state.batch, state.residual
    design = state.design.rotate(state.whitener.turn)
    turned = state.whitener.rotate(residual)
    distance = state.whitener.distances(turned, state.noise, state.rows.weight)
    if heavy:
        weight = student_weights(distance)
        rows = replace(state.rows, weight=weight, distance=distance)
    else:
        rows = judge(distance, residual, batch.states.q, batch.jacobian, state.pose)
    spread = design.variance(state.covariance)
    noise = estimate_noise(state.whitener, turned**2 + spread, rows.weight, state.noise,
        [products_of_rows(design, turned, block.rows, spread, state.shared)
         for block in state.whitener.blocks],
    )  # fmt: skip
    turns = state.turns
    if turns is not None:
        turns = turns.subtract_effects(c, batch, state.values)
        turns = turns.weigh_rows(state.covariance, rows.weight, heavy)
    whitener = _with_unknown_sides(state, state.values)
    return replace(state, noise=noise, rows=rows, turns=turns, whitener=whitener)


def products_of_rows(
    design: DesignMatrix,
    rotated: Floats,
    rows: Ints,
    spread_of_rows: Floats,
    covariance: Floats | None,
) -> Floats:
    """Return expected products of the residuals of poses, (groups, 3 m, 3 m) [m^2].

    Args:
        design: Rotated columns.
        rotated: Rotated residuals, (n, 3) [m].
        rows: Rows of every pose, (groups, m).
        spread_of_rows: Variance that the parameters give each component, (n, 3) [m^2].
        covariance: Of the parameters, (p, p); None where it is left out what two rows
            share of it.
    """
    count, m = rows.shape
    left = rotated[rows].reshape(count, 3 * m)
    out = left[:, :, None] * left[:, None]
    if covariance is None:
        k = np.arange(3 * m)
        out[:, k, k] += spread_of_rows[rows].reshape(count, 3 * m)
        return out
    at_once = max(1, ROWS_AT_ONCE // m)
    for first in range(0, count, at_once):
        some = rows[first : first + at_once]
        X = design[some.reshape(-1)].dense().reshape(-1, len(covariance))
        shape = len(some), 3 * m, -1
        spread = (X @ covariance).reshape(shape), X.reshape(shape)
        out[first : first + at_once] += spread[0] @ spread[1].swapaxes(1, 2)
    return out


def _linearise(state: Fit) -> Fit:
    """Take columns and residuals at the present values."""
    c, batch = state.combination, state.batch
    at = _at(state, state.values)
    residual = state.error - c.error_at(at, batch, state.values)
    turns = state.turns
    if turns is not None:
        turns = turns.subtract_effects(c, batch, state.values).linearise(c, at)
    design = state.design.at(c, at)
    return replace(state, design=design, residual=residual, turns=turns)


def _at(state: Fit, values: Floats) -> ArmStates:
    """Take the kinematics at some values of the parameters."""
    shift = state.design.shift(values)
    return state.batch.move(state.combination.deviation(values), shift)


def _with_unknown_sides(state: Fit, values: Floats) -> Whitener:
    """Add the backlash to the variance of rows whose direction is not known."""
    unknown = (state.batch.states.direction == 0).astype(float)
    if not unknown.any():
        return state.whitener
    slopes = state.combination.direction_slopes(state.batch, values)
    square = np.einsum("nij,nj->n", slopes**2, unknown) / 3.0
    return replace(state.whitener, extra=np.repeat(square[:, None], 3, axis=1))


def _has_settled(before: Fit, after: Fit, until: Tolerance) -> bool:
    """Tell whether a pass changed nothing that matters."""
    moved = np.abs(after.residual - before.residual).max(initial=0.0)
    ratio = after.whitener.variance(after.noise) / before.whitener.variance(
        before.noise
    )
    quiet = np.abs(np.log(ratio)).max() < until.noise
    if before.turns is not None and after.turns is not None:
        change = np.log(after.turns.std / before.turns.std)
        quiet = quiet and abs(change) < until.noise
    return bool(moved < until.moved and quiet)


# What a survey can see, and the names of what it cannot.

EXACT = 1e-8  # relative size below which a direction is no direction at all
PARTNER = 0.2  # coefficient from which a parameter is named as a partner


@dataclass(frozen=True)
class Unseen:
    """A parameter whose effect others already have, and those others."""

    name: str
    partners: tuple[str, ...]

    def __str__(self) -> str:
        return (
            f"{self.name} with {', '.join(self.partners)}"
            if self.partners
            else (f"{self.name} (too small to see)")
        )


@dataclass(frozen=True)
class Observability:
    """Rank of a design and its condition.

    Attributes:
        rank: Number of directions that the rows determine.
        unseen: Directions that they do not; the fit leaves them at their prior.
        condition: Ratio of the largest to the smallest determined singular value.
        o1: Observability index O1 of Borm and Menq (1991): geometric mean of the
            singular values over the square root of the number of rows.
    """

    rank: int
    unseen: tuple[Unseen, ...]
    condition: float
    o1: float


def observe(X: Floats, names: tuple[str, ...], floor: float = 0.0) -> Observability:
    """Find the rank of scaled columns by pivoted QR and name what is redundant.

    Args:
        X: Columns times their prior scales, (rows, p).
        names: Names of the columns.
        floor: Size below which a direction counts as unseen. With whitened rows, 1
            means that the data say less than the prior.
    """
    if X.shape[1] == 0:
        return Observability(0, (), 1.0, 0.0)
    _, R, pivot = qr(X, mode="economic", pivoting=True)
    size = np.abs(np.diag(R))
    rank = int((size > max(floor, EXACT * float(size.max(initial=0.0)))).sum())
    unseen = []
    if rank:
        mix = np.asarray(solve_triangular(R[:rank, :rank], R[:rank, rank:])).T
        for k, share in enumerate(mix):
            order = np.argsort(-np.abs(share))[:4]
            keep = order[np.abs(share[order]) > PARTNER]
            partners = tuple(names[pivot[i]] for i in keep)
            unseen.append(Unseen(names[pivot[rank + k]], partners))
    values = np.linalg.svd(R[:rank, :], compute_uv=False) if rank else np.ones(1)
    o1 = float(np.exp(np.log(values).mean()) / np.sqrt(len(X)))
    return Observability(rank, tuple(unseen), float(values[0] / values[-1]), o1)
