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
from postproc.model.kinematics import ArmStates
from postproc.model.registration import Registration

CLEARLY = 10.0  # nats by which another direction must be better, and than none
REVERSED = 10.0  # nats besides for the opposite one, of which signs alone speak
LEAST_ROWS = 60  # fewer tell directions apart by chance
DIRECTIONS = {
    "a floor": (0, 0, -1), "a ceiling": (0, 0, 1), "a wall": (1, 0, 0),
    "a wall, turned by 180 deg": (-1, 0, 0), "a wall, turned by 90 deg": (0, 1, 0),
    "a wall, turned by -90 deg": (0, -1, 0),
    "a frame tilted towards x": (1, 0, -1), "a frame tilted towards -x": (-1, 0, -1),
    "a frame tilted towards y": (0, 1, -1), "a frame tilted towards -y": (0, -1, -1),
}  # fmt: skip
LEVEL = 2.0  # [deg] that a levelled tracker may seem to lean, and an arm on its foot
SAME = 25.0  # [deg] within which a direction is the stated one


def direction_warning(fitted: Fit) -> tuple[str, ...]:
    """Return a warning where weight seems to pull in another direction than stated.

    The joints yield to the weight in either: columns of `compliance` under the stated
    direction are exchanged for those under each of `DIRECTIONS`. Effects of other
    causes stay. Another direction must be better beside the free forms of the fit,
    which could stand in for any direction, and without them, as what has no name may
    look like any direction.

    Args:
        fitted: A fit under the stated direction, with compliance kept or without.
    """
    if len(fitted.batch) < LEAST_ROWS:
        return ()
    arm = fitted.batch.arm
    of_weight, every = ("torque", "payload"), fitted.combination.effects
    effects = tuple(e for e in every if e.driven_by not in of_weight)
    laws = tuple(e for e in effects if not e.free)
    gains = np.array(_gains(fitted, laws))
    if gains.max() < CLEARLY:
        return ()
    if laws != effects:
        gains = np.minimum(gains, _gains(fitted, effects))
    best = int(np.argmax(gains))
    name, along = unit_directions()[best]
    if gains[best] < CLEARLY:
        return ()
    return (
        f"the rows are strong evidence that weight pulls along {_format(along)} in the "
        f"base frame of the arm, as on {name}, and not along {_format(arm.weight)}, as "
        "the cell has it. Check how the arm is mounted, and state it: mounting under "
        "[robot], or [base]",
    )


def level_warning(placed: Registration, weight: Floats) -> tuple[str, ...]:
    """Return a warning where weight pulls otherwise than a levelled tracker says.

    Args:
        placed: The registration of a survey whose trackers' z points up.
        weight: Direction in which weight pulls by the cell, (3,), base frame.
    """
    for name, T in zip(placed.stations, placed.transforms, strict=True):
        along = -T[:3, 2]
        apart = degrees_between(along, weight)
        if apart > LEVEL:
            at = f" at {name}" if len(placed.stations) > 1 else ""
            return (
                f"the tracker{at} is levelled, and its z says that weight pulls along "
                f"{_format(along)} in the base frame of the arm, {apart:.0f} deg from "
                f"{_format(weight)}, as the cell has it. Check how the arm is mounted, "
                "and state it: mounting under [robot], or [base]; or is z of these "
                "rows not up? Then leave levelled under [survey] out",
            )
    return ()


def _gains(fitted: Fit, others: tuple[Effect, ...]) -> list[float]:
    """Compute by how much every direction is better than the stated one [nats].

    Returns:
        For each, less than that where it is hardly better than no weight at all.
    """
    stated = fitted.batch.arm.weight
    origin, effects = fitted.noise.origin, (*others, Compliance.on(fitted.batch))
    base = fit_effects(
        fitted.batch, fitted.position, effects, origin, fitted, until=NEARLY
    )
    here = direction_evidence(base, others, stated)
    none = direction_evidence(base, others, None)
    gains = []
    for _, along in unit_directions():
        apart = degrees_between(along, stated)
        if apart < SAME:
            gains.append(-np.inf)
            continue
        there = direction_evidence(base, others, along)
        less = REVERSED if apart > 180.0 - SAME else 0.0
        gains.append(min(there - here - less, there - none))
    return gains


def direction_evidence(
    base: Fit, others: tuple[Effect, ...], along: Floats | None
) -> float:
    """Compute the log evidence of joints that yield to weight in a direction.

    Args:
        base: A fit whose noise and rows count.
        others: Effects beside `compliance`, of that fit.
        along: The direction, (3,), base frame; None: no joint yields.

    Returns:
        Log evidence [nats] with all softnesses above 0, up to a constant.
    """
    if along is None:
        laid = beside(base, others)
    else:
        batch = ArmStates(base.batch.arm.mount(along), base.batch.states)
        laid = beside(replace(base, batch=batch), (*others, Compliance.on(batch)))
    known = np.array([e.free for e in laid.combination.effects
                      for _ in e.parameters()], dtype=bool)  # fmt: skip
    scales = np.exp(laid.log_scale)[laid.group[known]]
    normal = laid.normal().marginalise(known, scales)
    used, group = np.unique(laid.group[~known], return_inverse=True)
    found = maximise(normal, group, laid.log_scale[used])
    value = found.log_evidence
    value -= 0.5 * float((found.log_scale**2).sum()) / LOG_SPREAD**2
    parameters = np.array(laid.combination.parameters, dtype=object)[~known]
    soft = [k for k, p in enumerate(parameters) if p.positive]
    std = np.sqrt(np.diag(found.covariance)[soft])
    above = found.mean[soft] / np.maximum(std, 1e-300)
    return value + float((log_ndtr(above) + np.log(2.0)).sum())


def unit_directions() -> list[tuple[str, Floats]]:
    """List the directions with their names, as unit vectors."""
    vectors = {name: np.array(v, dtype=float) for name, v in DIRECTIONS.items()}
    return [(name, v / np.linalg.norm(v)) for name, v in vectors.items()]


def _format(direction: Floats) -> str:
    """Write a direction.

    >>> _format(np.array([0.0, -0.0, -1.0]))
    '[0, 0, -1]'
    """
    return "[" + ", ".join(f"{round(float(v), 2) + 0.0:g}" for v in direction) + "]"


def degrees_between(a: Floats, b: Floats) -> float:
    """Return the angle between two unit vectors (3,) [deg]."""
    return float(np.degrees(np.arccos(np.clip(a @ b, -1.0, 1.0))))
