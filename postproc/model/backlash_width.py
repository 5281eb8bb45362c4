"""How far a joint must turn back before it rests on its other flank.

An error of +b and -b from the two sides is a gap of 2 b between the flanks. The fitted
model knows b for every joint, much better than the guess in an arm file. Where b
changes with the joint angle so does the way across. One play for all angles is its mean
over the surveyed range: with its largest value every joint would be said to reach its
other flank too late.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.robot.arm import Arm
from postproc.robot.direction import WIDTH_IN_PLAYS, half_width
from postproc.robot.state import make_states

SAMPLES = 60  # angles over the surveyed range of every joint
LEAST = np.deg2rad(1e-3)  # [rad] plays below this are jitter of the numbers
SHARP = 1.5  # gaps: a flank that is no wider is that of a sharp gap


def half_gap(model: Model, arm: Arm) -> Floats:
    """Give the largest fitted backlash b of every joint over its surveyed range.

    Args:
        model: A fitted model.
        arm: Its arm.

    Returns:
        (6,) [rad]; 0 where the model has no backlash.
    """
    return np.asarray(np.abs(_over_range(model, arm)).max(axis=0))


def ahead(model: Model, arm: Arm) -> Bools:
    """Tell which links rest ahead of their drives, as they arrive, by the fitted b.

    A drive that pushes its link is ahead of it: b is negative. Where the link is ahead
    of its drive, it ran on as the arm braked, or its weight put it there, and what
    flank it is on in motion no measurement at stops tells.

    Args:
        model: A fitted model.
        arm: Its arm.

    Returns:
        (6,); False where the model has no backlash.
    """
    return np.asarray(_over_range(model, arm).mean(axis=0) > 0.0)


def on_the_way(side: Floats | float, width: Floats | float) -> Floats:
    """Say where links lie that are on their way from flank to flank.

    A link with a sharp gap rests until its drive has crossed it. An elastic flank gives
    way before it carries, more the nearer the middle it is: half a sine.

    Args:
        side: Where each drive is on that way, -1 at one end of it, 1 at the other.
        width: How long that way is [gaps], 1 for a sharp gap.

    Returns:
        -1 on one flank, 1 on the other.
    """
    side = np.asarray(np.clip(side, -1.0, 1.0))
    if np.all(np.less_equal(width, 1.0)):
        return side
    between = np.greater(width, 1.0) & (np.abs(side) < 1.0)
    return np.sin(np.pi / 2 * side, where=between, out=side)


def half_widths(model: Model, arm: Arm, q: Floats) -> Floats:
    """Give half of the way on which every drive crosses its gap at joint angles.

    Args:
        model: A fitted model.
        arm: Its arm, with the measured play.
        q: Joint angles, (n, 6) [rad].

    Returns:
        (n, 6) [rad]; by the arm's play for a joint whose backlash is not in the model.
    """
    gap = np.abs(_backlash(model, arm, q))
    known = gap.any(axis=0)
    return np.where(known, np.maximum(gap, 2.0 * LEAST), half_width(arm))


def _over_range(model: Model, arm: Arm) -> Floats:
    """Give the fitted b at angles over the surveyed range, (m, 6) [rad]."""
    lower, upper = np.array(model.ranges.lower), np.array(model.ranges.upper)
    q = lower + (upper - lower) * np.linspace(0.0, 1.0, SAMPLES)[:, None]
    return _backlash(model, arm, q)


def _backlash(model: Model, arm: Arm, q: Floats) -> Floats:
    """Give the fitted b at joint angles (n, 6), (n, 6) [rad]."""
    effects, values, _ = model.compensable()
    batch = ArmStates(arm, make_states(q, np.ones(q.shape)))
    angles = np.zeros(q.shape)
    for effect, part in zip(effects.effects, effects.slices, strict=True):
        if effect.direct and not effect.requires():
            angles += effect.angles(batch, values[part])
    return angles


def play_of_model(model: Model, arm: Arm) -> Floats:
    """Give the play of every joint that makes the play operator as wide as its gap.

    That is the mean gap over the surveyed range.

    Returns:
        (6,) [rad]; the arm file's guess for a joint whose backlash is not in the model.
    """
    gap = 2.0 * np.abs(_over_range(model, arm).mean(axis=0))
    return np.where(gap > 0.0, np.maximum(gap / WIDTH_IN_PLAYS, LEAST), arm.play)
