"""Laws that depend on how a joint arrives: gaps, friction, load, speed.

Sign: a link lags behind its motor, so a joint that arrives forward (side +1) stands
short by half the gap: error = side * b with b negative.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.virtual.arrivals import Arrivals
from postproc.virtual.joint_laws import KILO, total_torque
from postproc.virtual.law import Draw, Law, Where, on_joint


def backlash(draw: Draw) -> Law:
    """Every gear has a gap of 0.05 to 0.2 mrad that changes with the joint angle.

    error_j = side_j * b_j (1 + first + second harmonic of the angle).
    """
    half_gap = draw.rng.uniform(0.05e-3, 0.2e-3, 6)  # [rad]
    depth = draw.rng.uniform(0.0, 0.2, (2, 6))
    phase = draw.rng.uniform(0.0, 2 * np.pi, (2, 6))

    def shape(arrivals: Arrivals) -> Floats:
        wave = sum(depth[k - 1] * np.cos(k * arrivals.q + phase[k - 1]) for k in (1, 2))
        return np.asarray(-arrivals.side * half_gap * (1 + wave))

    parameters = {f"b_{j + 1}": -float(half_gap[j]) for j in range(6)}
    joints = tuple(range(1, 7))
    return Law("backlash", Where.JOINTS, joints, 0, parameters, shape)


def load_backlash(draw: Draw) -> Law:
    """The lost motion of a joint grows with the load on its teeth."""
    joint, power = draw.pick([2, 3, 5]), draw.rng.uniform(0.8, 1.2)

    def shape(arrivals: Arrivals) -> Floats:
        load = np.abs(total_torque(draw, arrivals)[:, joint - 1] / KILO)
        return on_joint(joint, -arrivals.side[:, joint - 1] * load**power)

    return Law("load_backlash", Where.JOINTS, (joint,), 0, {"power": power}, shape)


def gravity_side(draw: Draw) -> Law:
    """A gear whose load picks the flank, whatever the direction: tanh(torque / t0).

    Its name for an engineer is that of the other load-dependent backlash.
    """
    joint = draw.pick([2, 3, 5])
    threshold = draw.rng.uniform(0.1, 0.5)  # of what the joint usually carries
    usual = np.array([1.0, 5.0, 1.5, 0.1, 0.1, 0.01])[joint - 1]  # [kN m]

    def shape(arrivals: Arrivals) -> Floats:
        load = total_torque(draw, arrivals)[:, joint - 1] / KILO
        return on_joint(joint, np.tanh(load / (threshold * usual)))

    parameters = {"t0": threshold * usual * KILO}
    return Law("load_backlash", Where.JOINTS, (joint,), 0, parameters, shape)


def windup(draw: Draw) -> Law:
    """Friction winds a shaft up again after every reversal, over a way d0."""
    joint = draw.pick(range(1, 6))
    way = np.radians(draw.rng.uniform(1.0, 6.0))

    def shape(arrivals: Arrivals) -> Floats:
        wound = 1 - 2 * np.exp(-arrivals.travel[:, joint - 1] / way)
        return on_joint(joint, -arrivals.side[:, joint - 1] * wound)

    return Law("windup", Where.JOINTS, (joint,), 0, {"d0": way}, shape)


def lag(draw: Draw) -> Law:
    """A joint trails its command in proportion to the speed."""
    joint = draw.pick(range(1, 6))

    def shape(arrivals: Arrivals) -> Floats:
        return on_joint(joint, -arrivals.side[:, joint - 1] * arrivals.speed)

    return Law("lag", Where.JOINTS, (joint,), 0, {}, shape)


def hysteresis(draw: Draw) -> Law:
    """An error that no catalogue names: it remembers the last two reversals.

    A short way between them leaves the grease and the seals wound up: the error is
    large after a short loop and fades with the way since.
    """
    joint = draw.pick(range(1, 6))
    way, loop = np.radians(draw.rng.uniform([5.0, 10.0], [15.0, 40.0]))

    def shape(arrivals: Arrivals) -> Floats:
        fresh = np.exp(-arrivals.travel[:, joint - 1] / way)
        short = 1 - np.exp(-arrivals.loop[:, joint - 1] / loop)
        return on_joint(joint, -arrivals.side[:, joint - 1] * fresh * short)

    parameters = {"way": way, "loop": loop}
    return Law("", Where.JOINTS, (joint,), 0, parameters, shape)
