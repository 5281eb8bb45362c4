"""Curves through many points: which joints may have turned before they arrive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.motion.targets import Targets
from postproc.robot.arm import Arm
from postproc.robot.direction import Arrivals, Sides
from postproc.robot.pose import lengths

# How a controller leads a curve from point to point is its own. It is planned by its
# chords; and a joint that goes on beyond a point much as it came to it has not turned
# there, whatever the curve. Of one that does not nobody knows whether it turns before.

MUCH = 0.2  # of the larger of two rates, from which a joint goes on much as it came
NEAR = 1e-9  # [m] places nearer than this have no distance
RESTS = 1e-9  # [rad] a joint that turns no farther from point to point rests


def turns_unsure(arm: Arm, targets: Targets, q: Floats) -> Bools:
    """Tell which joints may turn shortly before points of curves, or behind them.

    At the last point of a curve what counts is how the motion goes on by the change of
    its rate from the chord before to the last one.

    Args:
        arm: The arm; its coupling is used.
        targets: n moves.
        q: Joint angles there, (n, 6) [rad].

    Returns:
        (n, 6).
    """
    out = np.zeros((len(q), 6), dtype=bool)
    v = np.flatnonzero(targets.curved)
    if len(v) == 0:
        return out
    angles, block = q @ arm.coupling.T, targets.block
    behind = np.minimum(v + 1, len(q) - 1)
    goes_on = (block[behind] == block[v]) & (behind > v)
    began = block[v - 1] != block[v]
    came, way = _rates(targets, angles, v - 1, v)
    left, _ = _rates(targets, angles, v, behind)
    earlier, last = _rates(targets, angles, v - 2, v - 1)
    ends = np.where(began, came, came + (came - earlier) * way / (way + last))
    onwards = np.where(goes_on, left, ends)
    sizes = np.abs(came), np.abs(onwards)
    alike = np.minimum(*sizes) >= MUCH * np.maximum(*sizes)
    rests = np.maximum(*sizes) * way < RESTS
    out.T[:, v] = ~((came * onwards > 0.0) & alike | rests)
    return out


def _rates(
    targets: Targets, angles: Floats, begin: Ints, end: Ints
) -> tuple[Floats, Floats]:
    """Rates of joints between places, (6, k) [rad/m], and their distances, (k,) [m]."""
    place = targets.tcp[:, :3, 3]
    way = np.maximum(lengths(place[end] - place[begin]), NEAR)
    return (angles[end] - angles[begin]).T / way, way


def arrivals_on_curves(
    arm: Arm, targets: Targets, q: Floats, found: Arrivals
) -> Arrivals:
    """Take back the sides of joints that may have turned before they arrived."""
    unsure = turns_unsure(arm, targets, q)
    if not unsure.any():
        return found
    side, direction = np.array(found.side), np.array(found.direction)
    side[unsure] = direction[unsure] = 0.0
    return replace(found, side=side, direction=direction)


def sides_on_curves(arm: Arm, targets: Targets, q: Floats, found: Sides) -> Sides:
    """Do as `arrivals_on_curves` with sides alone."""
    unsure = turns_unsure(arm, targets, q)
    if not unsure.any():
        return found
    return replace(found, side=np.where(unsure, 0.0, found.side))
