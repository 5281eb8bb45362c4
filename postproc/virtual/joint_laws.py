"""Laws that bend or turn a joint: weight, gear teeth, encoders, wear."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.virtual.arrivals import Arrivals
from postproc.virtual.gravity import link_torque, payload_torque
from postproc.virtual.law import Draw, Law, Where, on_joint
from postproc.virtual.reference import WORKING_RANGE

KILO = 1e3  # [N m] torques in the laws are counted in thousands


def total_torque(draw: Draw, arrivals: Arrivals) -> Floats:
    """Return the torque (n, 6) [N m] of links and payload about the joints."""
    payload = payload_torque(
        draw.body.chain, arrivals.q, arrivals.payload, arrivals.payload_com
    )
    return link_torque(draw.body, arrivals.q) + payload


def compliance(draw: Draw) -> Law:
    """One or two joints yield to the weight they carry: torque / stiffness."""
    first = draw.pick([2, 3, 5])
    joints = [first]
    if not draw.joint and draw.rng.random() < 0.5:
        joints.append(int(draw.rng.choice([j for j in (2, 3) if j != first])))
    softness = np.zeros(6)  # relative; the scale makes it rad / kN m
    softness[first - 1] = 1.0
    for joint in joints[1:]:
        softness[joint - 1] = draw.rng.uniform(0.4, 1.0)

    def shape(arrivals: Arrivals) -> Floats:
        return total_torque(draw, arrivals) / KILO * softness

    parameters = {f"softness_{j}": float(softness[j - 1]) for j in joints}
    return Law("compliance", Where.JOINTS, tuple(joints), 0, parameters, shape)


def payload(draw: Draw) -> Law:
    """A joint yields to the declared payload."""
    joint = draw.pick([2, 3, 5])

    def shape(arrivals: Arrivals) -> Floats:
        torque = payload_torque(
            draw.body.chain, arrivals.q, arrivals.payload, arrivals.payload_com
        )
        return on_joint(joint, torque[:, joint - 1] / KILO)

    return Law("payload", Where.JOINTS, (joint,), 0, {}, shape)


def counterbalance(draw: Draw) -> Law:
    """Axis 2 yields to its balancing spring: one between a fixed and a moving pin."""
    fixed, moving = draw.rng.uniform(0.5, 0.8), draw.rng.uniform(0.2, 0.35)  # [m]
    upright = draw.rng.uniform(-0.2, 0.2)  # [rad] where the pins and axis 2 align
    preload = draw.rng.uniform(0.0, 0.3)  # [m] of spring travel at the shortest length
    shortest = fixed - moving

    def shape(arrivals: Arrivals) -> Floats:
        angle = arrivals.q[:, 1] - upright
        length = np.sqrt(
            fixed**2 + moving**2 - 2 * fixed * moving * np.cos(angle)
        )  # law of cosines
        lever = fixed * moving * np.sin(angle) / length
        return on_joint(2, -(length - shortest + preload) * lever)

    parameters = {"fixed_pin": fixed, "moving_pin": moving, "upright": upright}
    return Law("counterbalance", Where.JOINTS, (2,), 0, parameters, shape)


def transmission(draw: Draw) -> Law:
    """A gear runs out of centre: a wave of order 1 or 2 of the joint angle."""
    return _wave(draw, int(draw.rng.choice([1, 2])))


def transmission_free(draw: Draw) -> Law:
    """Gear teeth: a wave of a free order between 7 and 30 of the joint angle."""
    return _wave(draw, int(draw.rng.integers(7, 31)))


def _wave(draw: Draw, order: int) -> Law:
    joint = draw.pick(range(1, 7))
    phase = draw.phase()

    def shape(arrivals: Arrivals) -> Floats:
        return on_joint(joint, np.cos(order * arrivals.q[:, joint - 1] + phase))

    parameters = {"order": float(order), "phase": phase}
    return Law("transmission", Where.JOINTS, (joint,), 0, parameters, shape)


def scale(draw: Draw) -> Law:
    """An encoder or gear ratio that is slightly wrong: gain * angle."""
    joint, sign = draw.pick(range(1, 7)), draw.sign()

    def shape(arrivals: Arrivals) -> Floats:
        return on_joint(joint, sign * arrivals.q[:, joint - 1])

    return Law("scale", Where.JOINTS, (joint,), 0, {}, shape)


def coupling(draw: Draw) -> Law:
    """A wrist joint is dragged along by the joint before it."""
    joint = draw.pick([5, 6])
    source = int(draw.rng.choice([4] if joint == 5 else [4, 5]))
    sign = draw.sign()

    def shape(arrivals: Arrivals) -> Floats:
        return on_joint(joint, sign * arrivals.q[:, source - 1])

    return Law("coupling", Where.JOINTS, (joint,), source, {}, shape)


def worn_spot(draw: Draw) -> Law:
    """Worn teeth at one place: a bump a few degrees wide in one joint's error."""
    joint, sign = draw.pick(range(1, 7)), draw.sign()
    low, high = WORKING_RANGE[joint - 1]
    centre = draw.rng.uniform(low + 0.2 * (high - low), high - 0.2 * (high - low))
    width = np.radians(draw.rng.uniform(4.0, 9.0))

    def shape(arrivals: Arrivals) -> Floats:
        away = (arrivals.q[:, joint - 1] - centre) / width
        return on_joint(joint, sign * np.exp(-0.5 * away**2))

    parameters = {"centre": centre, "width": width}
    return Law("joint_map", Where.JOINTS, (joint,), 0, parameters, shape)


def joint_product(draw: Draw) -> Law:
    """An error that no catalogue names: a joint follows a product of two angles."""
    joint = draw.joint or 3
    others = [j for j in range(1, 7) if j != joint]
    one, two = (int(j) for j in draw.rng.choice(others, 2, replace=False))
    middle, sign = WORKING_RANGE.mean(axis=1), draw.sign()

    def shape(arrivals: Arrivals) -> Floats:
        away = arrivals.q - middle
        return on_joint(joint, sign * away[:, one - 1] * away[:, two - 1])

    parameters = {"first": float(one), "second": float(two)}
    return Law("", Where.JOINTS, (joint,), 0, parameters, shape)
