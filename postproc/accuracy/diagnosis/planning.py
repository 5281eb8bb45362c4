"""What to measure next."""

from __future__ import annotations

import numpy as np

from postproc.accuracy.batch import Batch
from postproc.accuracy.diagnosis.extending import extend
from postproc.accuracy.diagnosis.score import Score
from postproc.accuracy.effect import Array
from postproc.accuracy.fitted import Fit
from postproc.robot.state import make_states

TRIED = 400  # random poses
WANTED = 8
APART = 0.15  # of the joint ranges: poses that differ by less are one


def poses_that_separate(fit: Fit, place: int, rival: Score, seed: int) -> Array:
    """Choose poses at which two explanations of the same rows differ most.

    Both are fitted to the rows there are; where their predictions then differ, one more
    measurement tells them apart.

    Args:
        fit: The fit with one explanation.
        place: Place of that effect in the fit.
        rival: The other explanation.
        seed: Of the random poses.

    Returns:
        (WANTED, 6) [rad].
    """
    other = extend(fit, rival.best, instead_of=place)
    batch = _tries(fit, seed)
    apart = fit.combination.error(batch, fit.values) - other.combination.error(
        batch, other.values
    )
    return _spread_out(batch.states.q, np.linalg.norm(apart, axis=1))


def poses_that_sharpen(fit: Fit, seed: int) -> tuple[str, Array]:
    """Choose poses that lower the model's uncertainty most, one after the other.

    Each step takes the pose whose predicted error is known worst against the noise,
    which is the step of a D-optimal design, and updates the covariance.

    Returns:
        The parameter that is known better then by most of the TCP's way, and the poses,
        (WANTED, 6) [rad].
    """
    batch = _tries(fit, seed)
    at = fit.combination.at(batch, fit.values)
    X = fit.combination.columns(at)
    noise = float(fit.whitener.variance(fit.noise).mean())
    before = np.array(fit.covariance)
    C = before
    chosen: list[int] = []
    for _ in range(WANTED):
        spread = X @ C @ np.swapaxes(X, 1, 2)
        gain = np.linalg.slogdet(np.eye(3) + spread / noise)[1]
        gain[chosen] = -np.inf
        best = int(np.argmax(gain))
        chosen.append(best)
        CX = C @ X[best].T
        C = C - CX @ np.linalg.solve(noise * np.eye(3) + X[best] @ CX, CX.T)
    fall = np.sqrt(np.diag(before)) - np.sqrt(np.maximum(np.diag(C), 0.0))
    moved = np.sqrt((X**2).sum(axis=1).mean(axis=0))
    name = fit.combination.names[int(np.argmax(fall * moved))]
    return name, np.asarray(batch.states.q[chosen])


def _tries(fit: Fit, seed: int) -> Batch:
    """Draw poses between the surveyed ranges, from random sides, in surveyed states."""
    rng = np.random.default_rng(seed)
    seen, arm = fit.batch.states, fit.batch.arm
    low = np.maximum(seen.q.min(axis=0), arm.lower)
    high = np.minimum(seen.q.max(axis=0), arm.upper)
    like = seen[rng.integers(len(seen), size=TRIED)]
    states = make_states(
        rng.uniform(low, high, (TRIED, 6)), rng.choice([-1.0, 1.0], (TRIED, 6)),
        like.tool, travel=like.travel, speed=like.speed, payload=like.payload,
        payload_com=like.payload_com, temperature=like.temperature,
        time=np.full(TRIED, np.nanmax(seen.time, initial=0.0)),
        order=np.full(TRIED, seen.order.max() + 1),
    )  # fmt: skip
    return Batch(arm, states)


def _spread_out(q: Array, value: Array) -> Array:
    """Take the poses of highest value that are not close to one already taken."""
    unit = q / np.maximum(np.ptp(q, axis=0), 1e-9)
    chosen: list[int] = []
    for k in np.argsort(-value):
        if all(np.abs(unit[k] - unit[c]).max() > APART for c in chosen):
            chosen.append(int(k))
        if len(chosen) == WANTED:
            break
    return np.asarray(q[chosen])
