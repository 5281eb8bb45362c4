"""Directions in a file that are not those that the arm came from."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.calibration.regression import Fit, fit_effects
from postproc.model.kinematics import ArmStates

MOST_AT_ONCE = 2  # joints of a row that are wrong together
TAIL = 4.0  # degrees of freedom of the readings, as of the first passes of a fit
TELLING = 2.0  # sigma that a joint's gap must be wide to tell its direction
ENOUGH = 10.0  # nats that wrong directions must be worth
RARE = 0.2  # a larger share is no mistake of a file: the arm does something else
SURE = 0.9  # probability from which a direction is taken, or taken the other way
FIRST_RATE, STEPS = 0.01, 200
ROUNDS = 6


@dataclass(frozen=True, eq=False)
class WrongDirections:
    """Which directions of n rows are probably wrong.

    Attributes:
        told: Directions as the file tells them, (n, 6).
        probability: That a direction is wrong, (n, 6).
        telling: Which directions the rows can tell, (n, 6).
        rate: Estimated share of wrong directions.
        gain: What they are worth: log likelihood ratio to none [nats].
    """

    told: Floats
    probability: Floats
    telling: Bools
    rate: float
    gain: float

    @property
    def is_believed(self) -> bool:
        """Whether the file has wrong directions, and not an arm a habit."""
        return self.gain > ENOUGH and self.rate < RARE

    @property
    def mended(self) -> Floats:
        """Directions the likelier way; 0, not known, where neither is sure, (n, 6)."""
        turned = np.where(self.probability > SURE, -self.told, self.told)
        unsure = (self.probability > 1.0 - SURE) & (self.probability < SURE)
        return np.where(unsure & self.telling, 0.0, turned)


def judge_directions(fit: Fit, told: Floats) -> WrongDirections:
    """Ask every row which of its directions are wrong.

    A mixture: every direction is wrong with the same unknown probability, by itself,
    and the reading is then off by the whole gap of that joint. The rate maximises the
    likelihood (EM).

    Args:
        fit: A fit of the rows; which of its directions are mended does not matter.
        told: Directions as the file tells them, (n, 6).
    """
    batch = fit.batch.arriving(told)
    residual = fit.error - fit.combination.error(batch, fit.values)
    gaps = 2.0 * fit.combination.direction_slopes(batch, fit.values) * told[:, None]
    scale = 1.0 / np.sqrt(fit.whitener.variance(fit.noise))
    gaps = scale[:, :, None] * (fit.whitener.turn @ gaps)
    left = scale * fit.whitener.rotate(residual)
    telling = np.linalg.norm(gaps, axis=1) > TELLING
    wrong = _subsets()
    off = left[:, None] + np.einsum("nij,wj->nwi", gaps * telling[:, None], wrong)
    log_like = -0.5 * (TAIL + 3.0) * np.log1p((off**2).sum(axis=2) / TAIL)
    rate, chance, gain = _mixture(log_like, wrong, telling)
    return WrongDirections(told, chance @ wrong * telling, telling, rate, gain)


def _subsets() -> Floats:
    """List which joints of a row may be wrong together, (w, 6); the first: none."""
    chosen = [c for k in range(MOST_AT_ONCE + 1) for c in combinations(range(6), k)]
    out = np.zeros((len(chosen), 6))
    for row, joints in zip(out, chosen, strict=True):
        row[list(joints)] = 1.0
    return out


def _mixture(
    log_like: Floats, wrong: Floats, telling: Bools
) -> tuple[float, Floats, float]:
    """Estimate the rate; return it, the chance of every subset (n, w), and the gain.

    Args:
        log_like: Log likelihood of every row and subset, (n, w).
        wrong: The subsets, (w, 6).
        telling: Directions that count, (n, 6).
    """
    known = telling.astype(float) @ wrong.T == wrong.sum(axis=1)  # (n, w)
    count, asked = wrong.sum(axis=1), telling.sum(axis=1)[:, None]
    rate, chance = FIRST_RATE, np.zeros_like(log_like)
    gain, total = 0.0, float(telling.sum())
    for _ in range(STEPS if total else 0):
        prior = count * np.log(rate) + (asked - count) * np.log1p(-rate)
        joint = np.where(known, log_like + prior, -np.inf)
        top = joint.max(axis=1, keepdims=True)
        summed = np.log(np.exp(joint - top).sum(axis=1, keepdims=True)) + top
        chance = np.exp(joint - summed)
        gain = float((summed[:, 0] - log_like[:, 0]).sum())
        before, rate = rate, float((chance @ count).sum()) / total
        rate = float(np.clip(rate, 1e-9, 0.5))
        if abs(rate - before) < 1e-4 * rate:
            break
    return rate, chance, gain


def mend_directions(fit: Fit, position: Floats) -> Fit:
    """Fit again with wrong directions the other way, until they stay; or leave it.

    Args:
        fit: A fit of rows with the directions of the file.
        position: Measured positions in the base frame, (n, 3) [m].

    Returns:
        The same effects fitted with mended directions; the given fit where the file's
        are right as far as the rows can tell.
    """
    told, found = fit.batch.states.direction, fit
    for _ in range(ROUNDS):
        judged = judge_directions(found, told)
        if not judged.is_believed:
            return fit
        if (judged.mended == found.batch.states.direction).all():
            break
        states = found.batch.states.with_(direction=judged.mended)
        batch = ArmStates(fit.batch.arm, states)
        origin, effects = fit.noise.origin, fit.combination.effects
        found = fit_effects(batch, position, effects, origin, start=found)
    return found
