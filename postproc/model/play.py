"""How far a joint must turn back before it rests on its other flank.

An error of +b and -b from the two sides is a gap of 2 b between the flanks. The fitted
model knows b for every joint, much better than the guess in an arm file. Where b
changes with the joint angle, the way across is its mean over the surveyed range: with
its largest value every joint would be said to reach its other flank too late.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.model.kinematics import Batch
from postproc.model.model import Model
from postproc.robot.arm import Arm
from postproc.robot.direction import WIDTH_IN_PLAYS
from postproc.robot.state import make_states

SAMPLES = 60  # angles over the surveyed range of every joint
LEAST = np.deg2rad(1e-3)  # [rad] plays below this are jitter of the numbers


def half_gap(model: Model, arm: Arm) -> Floats:
    """Give the largest fitted backlash b of every joint over its surveyed range.

    Args:
        model: A fitted model.
        arm: Its arm.

    Returns:
        (6,) [rad]; 0 where the model has no backlash.
    """
    return np.asarray(np.abs(_backlash(model, arm)).max(axis=0))


def _backlash(model: Model, arm: Arm) -> Floats:
    """Give the fitted b at angles over the surveyed range, (m, 6) [rad]."""
    lower, upper = np.array(model.ranges.lower), np.array(model.ranges.upper)
    q = lower + (upper - lower) * np.linspace(0.0, 1.0, SAMPLES)[:, None]
    effects, values, _ = model.compensable()
    batch = Batch(arm, make_states(q, np.ones((SAMPLES, 6))))
    angles = np.zeros((SAMPLES, 6))
    for effect, part in zip(effects.effects, effects.slices, strict=True):
        if effect.direct and not effect.requires():
            angles += effect.angles(batch, values[part])
    return angles


def measured_play(model: Model, arm: Arm) -> Floats:
    """Give the play of every joint that makes the play operator as wide as its gap.

    That is the mean gap over the surveyed range.

    Returns:
        (6,) [rad]; the arm file's guess for a joint whose backlash is not in the model.
    """
    gap = 2.0 * np.abs(_backlash(model, arm).mean(axis=0))
    return np.where(gap > 0.0, np.maximum(gap / WIDTH_IN_PLAYS, LEAST), arm.play)
