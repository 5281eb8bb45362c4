"""Curves, and points that may be rounded: which joints may have turned before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.motion.targets import Fly, Targets
from postproc.robot.arm import Arm
from postproc.robot.direction import Arrivals, Sides
from postproc.robot.pose import lengths, rotation_vector
from postproc.robot.trajectory import Motion

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


# Of some points it is not known whether the arm stops there, or how large their zones
# are. A joint whose drive goes on behind such a point as it came there arrives on the
# same side in any case: within the zone its motion is made of that before and behind.

LITTLE = 0.05  # of the play: a shorter way leaves a joint where it lies in its play
SINGULAR = 1e-9  # determinant of the Jacobian [m^3], below which rates say nothing


def turns_at_unknown_blends(
    arm: Arm, targets: Targets, q: Floats, side: Floats
) -> Bools:
    """Return which joints may arrive on another side where rounding is not known.

    Args:
        arm: The arm; its coupling is used.
        targets: n moves.
        q: Joint angles there, (n, 6) [rad].
        side: Where the joints lie in their play if the arm stops there, (n, 6).

    Returns:
        (n, 6).
    """
    unknown = targets.fly & (targets.rounding == Fly.UNKNOWN)
    out = np.zeros((len(q), 6), dtype=bool)
    if not unknown.any():
        return out
    to = np.repeat(np.arange(len(q)), np.diff(targets.pred_start))
    known = targets.pred >= 0
    source, to = targets.pred[known], to[known]
    into, behind = unknown[to], unknown[source]
    for at, way in (
        (to[into], _ways(arm, q, source[into], to[into])),
        (source[behind], _ways(arm, q, source[behind], to[behind])),
        (source[behind], _begins(arm, targets, q, source[behind], to[behind])),
    ):
        np.logical_or.at(out, at, ~(way * side[at] >= 0.0))
    out[unknown] |= side[unknown] == 0.0
    return out


def _ways(arm: Arm, q: Floats, begin: Ints, end: Ints) -> Floats:
    """Return how the drives turn between places, (k, 6) [rad], 0 where they rest."""
    return _counted(arm, q[end] - q[begin])


def _counted(arm: Arm, way: Floats) -> Floats:
    """Return ways of joints as ways of their drives, 0 where they cross no play."""
    way = way @ arm.coupling.T
    return np.where(np.abs(way) < LITTLE * arm.play, 0.0, way)


def _begins(arm: Arm, targets: Targets, q: Floats, begin: Ints, end: Ints) -> Floats:
    """Return how the drives begin moves between places, as `_ways`.

    On joint moves, and on the chords of arcs, they go on as the whole way tells.
    """
    rate = q[end] - q[begin]
    line = np.flatnonzero(targets.move[end] == Motion.LINEAR)
    one, other = begin[line], end[line]
    start, target = (arm.flange(q[rows]) @ targets.tool[rows] for rows in (one, other))
    twist = np.hstack([(target - start)[:, :3, 3], _turn(start, target)])
    jacobian = arm.jacobian(q[one], targets.tool[one][:, :3, 3])
    rate[line] = _solved(jacobian, twist)
    return _counted(arm, rate)


def _turn(start: Floats, target: Floats) -> Floats:
    """Return how tools turn from poses to others, base frame, (k, 3) [rad]."""
    return rotation_vector(target[:, :3, :3] @ np.swapaxes(start[:, :3, :3], 1, 2))


def _solved(jacobian: Floats, twist: Floats) -> Floats:
    """Return the joint rates of twists, (k, 6), NaN where the arm is singular."""
    good: Bools = np.asarray(~np.isnan(jacobian).any(axis=(1, 2)))
    good[good] = np.abs(np.linalg.det(jacobian[good])) > SINGULAR
    out = np.full(twist.shape, np.nan)
    out[good] = np.linalg.solve(jacobian[good], twist[good][:, :, None])[:, :, 0]
    return out


def arrivals_on_curves(
    arm: Arm, targets: Targets, q: Floats, found: Arrivals
) -> Arrivals:
    """Take back the sides of joints that may have turned before they arrived."""
    unsure = turns_unsure(arm, targets, q)
    unsure |= turns_at_unknown_blends(arm, targets, q, found.side)
    if not unsure.any():
        return found
    side, direction = np.array(found.side), np.array(found.direction)
    side[unsure] = direction[unsure] = 0.0
    return replace(found, side=side, direction=direction)


def sides_on_curves(arm: Arm, targets: Targets, q: Floats, found: Sides) -> Sides:
    """Do as `arrivals_on_curves` with sides alone."""
    unsure = turns_unsure(arm, targets, q)
    unsure |= turns_at_unknown_blends(arm, targets, q, found.side)
    if not unsure.any():
        return found
    return replace(found, side=np.where(unsure, 0.0, found.side))
