"""Curves, and points that may be rounded: which joints may have turned before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.motion.targets import Fly, Targets
from postproc.robot.arm import Arm
from postproc.robot.direction import Arrivals, FlankState
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
    leads = np.isin(np.arange(len(q)), source)
    out[unknown & ~leads] = True  # a joint that goes on anywhere may turn back
    return out


def _ways(arm: Arm, q: Floats, begin: Ints, end: Ints) -> Floats:
    """Return how the drives turn between places, (k, 6) [rad], 0 where they rest."""
    return _count_drive_travel(arm, q[end] - q[begin])


def _count_drive_travel(arm: Arm, way: Floats) -> Floats:
    """Return ways of joints as ways of their drives, 0 where they cross no play."""
    way = way @ arm.coupling.T
    return np.where(np.abs(way) < LITTLE * arm.play, 0.0, way)


def _begins(arm: Arm, targets: Targets, q: Floats, begin: Ints, end: Ints) -> Floats:
    """Return how the drives begin moves between places, as `_ways`.

    On joint moves they go on as the whole way tells.
    """
    rate = q[end] - q[begin]
    line = np.flatnonzero(targets.move[end] == Motion.LINEAR)
    one, other = begin[line], end[line]
    start, target = (arm.flange(q[rows]) @ targets.tool[rows] for rows in (one, other))
    twist = np.hstack([(target - start)[:, :3, 3], _turn(start, target)])
    jacobian = arm.jacobian(q[one], targets.tool[one][:, :3, 3])
    rate[line] = _solve_rates(jacobian, twist)
    arc = np.flatnonzero((targets.move[end] == Motion.CIRCULAR) & targets.via[end])
    rate[arc] = _arcs_begin(arm, targets, q, begin[arc], end[arc])
    return _count_drive_travel(arm, rate)


def _arcs_begin(
    arm: Arm, targets: Targets, q: Floats, begin: Ints, via: Ints
) -> Floats:
    """Return how joints begin arcs, as if the way to their VIA went on so, (k, 6)."""
    tool = targets.tool[via]
    last = np.minimum(via + 1, len(q) - 1)
    poses = [arm.flange(q[rows]) @ tool for rows in (begin, via, last)]
    a, b, c = (pose[:, :3, 3] for pose in poses)
    part = _angle_between(c, a, b) / (_angle_between(c, a, b) + _angle_between(a, b, c))
    twist = -_tangents(c, b, a)[1] * part[:, None]
    twist[:, 3:] = _turn(poses[0], poses[1])
    return _solve_rates(arm.jacobian(q[begin], tool[:, :3, 3]), twist)


def _angle_between(place: Floats, one: Floats, other: Floats) -> Floats:
    """Return the angle at which places see two others apart, (k,) [rad]."""
    a, b = one - place, other - place
    across = np.linalg.norm(np.cross(a, b), axis=1)
    return np.asarray(np.maximum(np.arctan2(across, (a * b).sum(axis=1)), 1e-12))


def _turn(start: Floats, target: Floats) -> Floats:
    """Return how tools turn from poses to others, base frame, (k, 3) [rad]."""
    return rotation_vector(target[:, :3, :3] @ np.swapaxes(start[:, :3, :3], 1, 2))


def _solve_rates(jacobian: Floats, twist: Floats) -> Floats:
    """Return the joint rates of twists, (k, 6), NaN where the arm is singular."""
    good: Bools = np.asarray(~np.isnan(jacobian).any(axis=(1, 2)))
    good[good] = np.abs(np.linalg.det(jacobian[good])) > SINGULAR
    out = np.full(twist.shape, np.nan)
    out[good] = np.linalg.solve(jacobian[good], twist[good][:, :, None])[:, :, 0]
    return out


# On some arcs it is not known how the tool turns. It is off by no more than a few times
# what it turns by in all. A joint that goes much farther than it must turn to make up
# for that arrives on the side that is planned.

NO_TURN = np.deg2rad(0.01)  # of the tool: it moves no joint to another side
OFF = 3.0  # times the turn of the tool by which its orientation may be off
LAST = 0.25  # of an arc, on which a joint goes farther than it turns for that
FARTHER = 3.0  # times what a joint turns for that: it goes farther, and is sure


def turns_on_arcs(arm: Arm, targets: Targets, q: Floats, side: Floats) -> Bools:
    """Return which joints may arrive on another side than planned on arcs.

    Args:
        arm: The arm; its coupling is used.
        targets: n moves.
        q: Joint angles there, (n, 6) [rad].
        side: Where the joints lie in their play as planned, (n, 6).

    Returns:
        (n, 6).
    """
    out = np.zeros((len(q), 6), dtype=bool)
    if not targets.along.any():
        return out
    out[targets.along] = True
    via = np.flatnonzero(targets.along & targets.via)
    start = targets.pred[np.minimum(targets.pred_start[via], len(targets.pred) - 1)]
    good = (np.diff(targets.pred_start)[via] == 1) & (start >= 0)
    start, via = start[good], via[good]
    tools = targets.tool[via]
    poses = [arm.flange(q[at]) @ tools for at in (start, via, via + 1)]
    rates = _tangents(*(pose[:, :3, 3] for pose in poses))
    axes = np.eye(6)[3:]
    for k, (begin, at) in enumerate(((start, via), (via, via + 1))):
        turn = OFF * lengths(_turn(poses[0], poses[k + 1]))
        jacobian = arm.jacobian(q[at], tools[:, :3, 3])
        by_axis = [_solve_rates(jacobian, np.tile(a, (len(turn), 1))) for a in axes]
        each = np.linalg.norm(np.stack(by_axis) @ arm.coupling.T, axis=0)
        made_up = each * turn[:, None]  # by the drives, about whatever axis
        sign = np.sign(side[at])
        way = (q[at] - q[begin]) @ arm.coupling.T * sign
        last = _solve_rates(jacobian, rates[k]) @ arm.coupling.T * sign * LAST
        steady = (way > FARTHER * made_up) & (last > made_up + arm.play)
        out[at] = ~(steady | (turn <= OFF * NO_TURN)[:, None])
    return out


def _tangents(start: Floats, via: Floats, end: Floats) -> list[Floats]:
    """Return twists along arcs where they pass and end, as if all went on so, (k, 6).

    Args:
        start: Where arcs begin, (k, 3) [m].
        via: The points on their way.
        end: Where they end.
    """
    a, b = via - start, end - start
    normal = np.cross(a, b)
    square = np.maximum(np.einsum("kc,kc->k", normal, normal), 1e-30)[:, None]
    to_centre = (
        np.cross(normal, a) * np.einsum("kc,kc->k", b, b)[:, None]
        - np.cross(normal, b) * np.einsum("kc,kc->k", a, a)[:, None]
    ) / (2.0 * square)
    centre = start + to_centre
    unit = normal / np.sqrt(square)
    found = []
    for at in (via, end):
        first, last = start - centre, end - centre
        sine = np.einsum("kc,kc->k", np.cross(first, last), unit)
        angle = np.arctan2(sine, np.einsum("kc,kc->k", first, last))
        angle = np.where(angle <= 0.0, angle + 2.0 * np.pi, angle)
        along = np.cross(unit, at - centre) * angle[:, None]
        found.append(np.hstack([along, np.zeros_like(along)]))
    return found


def arrivals_on_curves(
    arm: Arm, targets: Targets, q: Floats, found: Arrivals
) -> Arrivals:
    """Take back the sides of joints that may have turned before they arrived."""
    unsure = turns_unsure(arm, targets, q)
    unsure |= turns_at_unknown_blends(arm, targets, q, found.side)
    unsure |= turns_on_arcs(arm, targets, q, found.side)
    if not unsure.any():
        return found
    side, direction = np.array(found.side), np.array(found.direction)
    side[unsure] = direction[unsure] = 0.0
    return replace(found, side=side, direction=direction)


def sides_on_curves(
    arm: Arm, targets: Targets, q: Floats, found: FlankState
) -> FlankState:
    """Do as `arrivals_on_curves` with sides alone."""
    unsure = turns_unsure(arm, targets, q)
    unsure |= turns_at_unknown_blends(arm, targets, q, found.side)
    unsure |= turns_on_arcs(arm, targets, q, found.side)
    if not unsure.any():
        return found
    return replace(found, side=np.where(unsure, 0.0, found.side))
