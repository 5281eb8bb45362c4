"""Fitting effects to a survey: Bayesian, robust, with geometry taken exactly.

One pass linearises the arm at the present parameters (Gauss-Newton), solves the
Bayesian linear regression with prior scales by marginal likelihood, re-estimates the
two components of the noise and re-weighs the rows; passes repeat until nothing moves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.accuracy.evidence import maximise
from postproc.accuracy.fitted import Fit
from postproc.accuracy.outliers import RowWeights, judge, student_weights
from postproc.accuracy.turns import Turns
from postproc.arrays import Floats
from postproc.model.combination import Combination
from postproc.model.effects.effect import Effect
from postproc.model.kinematics import Batch
from postproc.model.noise import Noise, Whitener

PASSES = 30
HEAVY_TAILED = 4  # first passes that a gross outlier must not lead astray
SETTLED = 5e-8  # [m] change of any predicted error that ends the passes
SETTLED_NOISE = 5e-3  # relative change of the noise that ends the passes


def fit_effects(
    batch: Batch,
    position: Floats,
    effects: tuple[Effect, ...],
    origin: tuple[float, float, float] | None = None,
    start: Fit | None = None,
    turns: Turns | None = None,
) -> Fit:
    """Fit effects to measured positions, and to orientations where there are any.

    Args:
        batch: States of the survey.
        position: Measured TCP positions in the base frame, (n, 3) [m].
        effects: What may cause the errors.
        origin: Tracker position in the base frame, where it is known.
        start: A fit of some of these effects to the same rows, to begin with.
        turns: Measured orientations of the same rows; those of `start` if None.
    """
    combination = Combination(effects)
    state = _begin(batch, position, combination, origin, start)
    if turns is not None:
        state = replace(state, turns=turns)
    heavy = HEAVY_TAILED if start is None else 0
    for number in range(PASSES):
        following = _pass(state, heavy=number < heavy)
        if _settled(state, following) and number >= heavy:
            return following
        state = following
    return state


def _begin(
    batch: Batch,
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
        ones if start is None else start.rows, error, np.zeros((n, 3, p)), whitener,
        -np.inf, 0.0, turns,
    )  # fmt: skip


def _pass(state: Fit, heavy: bool) -> Fit:
    """Do one pass: linearise, solve, estimate the noise, weigh the rows."""
    state = _linearised(state)
    c, batch = state.combination, state.batch
    solved = maximise(state.normal(), state.group, state.log_scale)
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
    turns = state.turns
    if turns is not None:
        turns = turns.left(c, batch, values).judged(covariance, rows.weight, heavy)
    return replace(
        state, values=values, covariance=covariance, log_scale=solved.log_scale,
        noise=noise, rows=rows, residual=residual, turns=turns,
        whitener=_with_unknown_sides(state, values),
        log_evidence=solved.log_evidence, effective=solved.effective,
    )  # fmt: skip


def _linearised(state: Fit) -> Fit:
    """Take columns and residuals at the present values."""
    c, batch = state.combination, state.batch
    at = c.at(batch, state.values)
    residual = state.error - c.error(batch, state.values)
    turns = state.turns
    if turns is not None:
        turns = turns.left(c, batch, state.values).linearised(c, at)
    return replace(state, columns=c.columns(at), residual=residual, turns=turns)


def _spread(state: Fit, covariance: Floats) -> Floats:
    """Posterior variance of every rotated prediction, (n, 3) [m^2]."""
    turned = state.whitener.rotate(state.columns)
    spread: Floats = np.maximum(((turned @ covariance) * turned).sum(axis=2), 0.0)
    return spread


def _with_unknown_sides(state: Fit, values: Floats) -> Whitener:
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
    quiet = np.abs(np.log(ratio)).max() < SETTLED_NOISE
    if before.turns is not None and after.turns is not None:
        change = np.log(after.turns.std / before.turns.std)
        quiet = quiet and abs(change) < SETTLED_NOISE
    return bool(moved < SETTLED and quiet)
