"""Whether weight pulls where the cell says: the evidence of other directions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import log_ndtr

from postproc.arrays import Floats
from postproc.calibration.evidence import LOG_SPREAD, maximise
from postproc.calibration.regression import NEARLY, Fit, beside, fit_effects
from postproc.model.effects.compliance import Compliance
from postproc.model.effects.effect import Effect
from postproc.model.kinematics import Batch

CLEARLY = 10.0  # nats by which another direction must be better
LEAST_ROWS = 60  # fewer tell directions apart by chance
DIRECTIONS = {
    "a floor": (0, 0, -1), "a ceiling": (0, 0, 1), "a wall": (1, 0, 0),
    "a wall, turned by 180 deg": (-1, 0, 0), "a wall, turned by 90 deg": (0, 1, 0),
    "a wall, turned by -90 deg": (0, -1, 0),
    "a frame tilted towards x": (1, 0, -1), "a frame tilted towards -x": (-1, 0, -1),
    "a frame tilted towards y": (0, 1, -1), "a frame tilted towards -y": (0, -1, -1),
}  # fmt: skip
SAME = 25.0  # [deg] within which a direction is the stated one


def direction_warning(fitted: Fit) -> tuple[str, ...]:
    """Return a warning where weight seems to pull in another direction than stated.

    The joints yield to the weight in either: columns of `compliance` under the stated
    direction are exchanged for those under each of `DIRECTIONS`. Effects of other
    causes stay, but for free forms, which would stand in for any direction.

    Args:
        fitted: A fit under the stated direction, with compliance kept or without.
    """
    if len(fitted.batch) < LEAST_ROWS:
        return ()
    arm = fitted.batch.arm
    others = tuple(e for e in fitted.combination.effects if _stays(e))
    stated = Compliance.on(fitted.batch)
    base = fit_effects(
        fitted.batch, fitted.position, (*others, stated), fitted.noise.origin, fitted,
        until=NEARLY,
    )  # fmt: skip
    here = direction_evidence(base, others, arm.weight)
    found = [
        (direction_evidence(base, others, along) - here, name, along)
        for name, along in _unit_directions()
        if _degrees(along, arm.weight) > SAME
    ]
    gain, name, along = max(found, key=lambda each: each[0])
    if gain < CLEARLY:
        return ()
    x, y, z = (round(float(v), 2) + 0.0 for v in along)
    stated_as = ", ".join(f"{round(float(v), 2) + 0.0:g}" for v in arm.weight)
    return (
        f"the rows say that weight pulls along [{x:g}, {y:g}, {z:g}] in the base frame "
        f"of the arm, as on {name}, by {gain:.0f} nats more than along [{stated_as}], "
        "as the cell has it. Check how the arm is mounted, and state it: mounting "
        "under [robot], or [base]",
    )


def direction_evidence(base: Fit, others: tuple[Effect, ...], along: Floats) -> float:
    """Compute the log evidence of joints that yield to weight in a direction.

    Args:
        base: A fit whose noise and rows count.
        others: Effects beside `compliance`, of that fit.
        along: The direction, (3,), base frame.

    Returns:
        Log evidence [nats] with all softnesses above 0, up to a constant.
    """
    batch = Batch(base.batch.arm.mounted(along), base.batch.states)
    yields = Compliance.on(batch)
    laid = beside(replace(base, batch=batch), (*others, yields))
    found = maximise(laid.normal(), laid.group, laid.log_scale)
    value = found.log_evidence
    value -= 0.5 * float((found.log_scale**2).sum()) / LOG_SPREAD**2
    soft = [k for k, p in enumerate(laid.combination.parameters) if p.positive]
    std = np.sqrt(np.diag(found.covariance)[soft])
    above = found.mean[soft] / np.maximum(std, 1e-300)
    return value + float((log_ndtr(above) + np.log(2.0)).sum())


def _stays(effect: Effect) -> bool:
    """Return True if an effect has nothing to do with the direction of weight."""
    return not effect.free and effect.driven_by not in ("torque", "payload")


def _unit_directions() -> list[tuple[str, Floats]]:
    """List the directions with their names, as unit vectors."""
    vectors = {name: np.array(v, dtype=float) for name, v in DIRECTIONS.items()}
    return [(name, v / np.linalg.norm(v)) for name, v in vectors.items()]


def _degrees(a: Floats, b: Floats) -> float:
    """Return the angle between two unit vectors (3,) [deg]."""
    return float(np.degrees(np.arccos(np.clip(a @ b, -1.0, 1.0))))
