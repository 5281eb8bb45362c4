"""What to measure next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.calibration.diagnosis.score import Score
from postproc.calibration.diagnosis.search import extend
from postproc.calibration.regression import Fit
from postproc.model.kinematics import ArmStates
from postproc.robot.state import make_states

TRIED = 400  # random poses
WANTED = 8
APART = 0.15  # of the joint ranges: poses that differ by less are one


def poses_that_separate(
    fit: Fit, place: int, rival: Score, seed: int, wanted: int = WANTED
) -> tuple[float, Floats]:
    """Choose poses at which two explanations of the same rows differ most.

    Both are fitted to the rows there are. If the first is right, one more visit speaks
    against the other by d^T S^-1 d / 2 nats, d the difference of their predictions and
    S the noise with the other's own uncertainty: what it could still take up by moving
    its parameters is no difference. It is moved so after every pose, before the next is
    chosen (a design after Box and Hill, Technometrics 9, 1967).

    Args:
        fit: The fit with one explanation.
        place: Place of that effect in the fit.
        rival: The other explanation.
        seed: Of the random poses.
        wanted: Number of poses.

    Returns:
        What one visit to each of them is expected to be worth [nats], and the poses,
        (wanted, 6) [rad].
    """
    other = extend(fit, rival.best, instead_of=place)
    batch = _tries(fit, seed)
    X, C = _uncertainty(other, batch)
    apart = fit.combination.error(batch, fit.values) - other.combination.error(
        batch, other.values
    )
    noise = fit.whitener.read_variance(fit.noise) * np.eye(3)
    total, chosen = 0.0, list[int]()
    for _ in range(wanted):
        S = noise + X @ C @ np.swapaxes(X, 1, 2)
        solved = np.linalg.solve(S, apart[:, :, None])[:, :, 0]
        worth = 0.5 * (apart * solved).sum(axis=1)
        worth[_close(batch.states.q, chosen)] = -np.inf
        best = int(np.argmax(worth))
        chosen.append(best)
        total += float(worth[best])
        taken = C @ X[best].T
        apart = apart - X @ (taken @ solved[best])
        C = C - taken @ np.linalg.solve(S[best], taken.T)
    return total, np.asarray(batch.states.q[chosen])


def poses_that_sharpen(fit: Fit, seed: int) -> tuple[str, Floats]:
    """Choose poses that lower the model's uncertainty most, one after the other.

    Each step takes the pose whose predicted error is known worst against the noise,
    which is the step of a D-optimal design, and updates the covariance.

    Returns:
        The parameter that is known better then by most of the TCP's way, and the poses,
        (WANTED, 6) [rad].
    """
    batch = _tries(fit, seed)
    X, before = _uncertainty(fit, batch)
    noise = fit.whitener.read_variance(fit.noise)
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


def _tries(fit: Fit, seed: int) -> ArmStates:
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
    return ArmStates(arm, states)


def _uncertainty(fit: Fit, batch: ArmStates) -> tuple[Floats, Floats]:
    """Return columns at other states, (n, 3, p), and the parameters' covariance."""
    at = fit.combination.at(batch, fit.values)
    return fit.combination.columns(at), np.array(fit.covariance)


def _close(q: Floats, chosen: list[int]) -> NDArray[np.bool_]:
    """Mark the poses (n, 6) that are close to one already taken, (n,)."""
    unit = q / np.maximum(np.ptp(q, axis=0), 1e-9)
    gaps = np.abs(unit[:, None] - unit[None, chosen]).max(axis=2)
    close: NDArray[np.bool_] = (gaps <= APART).any(axis=1)
    return close
