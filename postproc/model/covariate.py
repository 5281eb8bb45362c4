"""What an error may depend on: every quantity recorded or planned, by name."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.model.kinematics import ArmStates
from postproc.robot.state import States

JOINT_KINDS = (
    "joint", "drive", "lambda", "before", "travel", "way", "loop", "turned", "torque",
)  # fmt: skip
SHORTEST = 1e-4  # [rad] of a way whose logarithm is taken
TILTING = "tilting"
PLAIN = ("speed", "payload", "temperature", "time", "order")
DRIVERS = (
    "torque", "joint", "lambda", "before", "travel", "loop",
    "time", "order", "temperature", "payload", "speed",
)  # fmt: skip
JOINTS = (1, 2, 3, 4, 5, 6)
CARRYING = 0.02  # of the largest torque: a joint that carries less cannot yield
LEAST = {"temperature": 1.0, "payload": 1.0, "speed": 0.05}  # [K], [kg], [m/s]


def covariate(batch: ArmStates, name: str) -> Floats:
    """Look up a covariate by its name, (n,), NaN where it is not known.

    Names are ``joint 5`` (its angle [rad]), ``drive 5`` (that of its coupled drive
    [rad]), ``lambda 5`` (its direction), ``before 5`` (its direction at the visit
    before), ``way 5`` (since its last reversal [rad]), ``travel 5`` (its logarithm),
    ``loop 5`` (between its last two reversals [log rad]), ``turned 5`` (the same
    [rad]), ``torque 5`` (of gravity about it [N m]),
    ``moment 5x`` (of gravity across it, about x of the frame before it [N m]),
    ``tilting`` (moment of all weight about the base's origin [N m]),
    ``speed``, ``payload``, ``temperature``, ``time`` and ``order`` (SI units).

    Raises:
        ValueError: There is no such covariate.
    """
    kind, _, number = name.partition(" ")
    if name == TILTING:
        about_x, about_y, about_z = batch.loads.tilting.T
        return np.asarray(np.hypot(np.hypot(about_x, about_y), about_z))
    if kind == "moment" and number[:1] in set("123456") and number[1:] in ("x", "y"):
        return np.asarray(
            batch.loads.bending[:, int(number[0]) - 1, "xy".index(number[1])]
        )
    if kind in PLAIN and not number:
        return np.asarray(getattr(batch.states, kind), dtype=float)
    if kind in JOINT_KINDS and number in set("123456"):
        j = int(number) - 1
        if kind == "joint":
            return np.asarray(batch.states.q[:, j])
        if kind == "drive":
            return np.asarray(batch.states.q @ batch.arm.coupling[j])
        if kind == "way":
            return np.asarray(batch.states.travel[:, j])
        if kind == "travel":
            return np.log(np.maximum(batch.states.travel[:, j], SHORTEST))
        if kind == "lambda":
            return np.asarray(batch.states.direction[:, j])
        if kind == "before":
            return sides_before(batch, j)
        if kind == "loop":
            return np.log(np.maximum(loops(batch, j), SHORTEST))
        if kind == "turned":
            return loops(batch, j)
        return np.asarray((batch.loads.gravity + batch.loads.payload)[:, j])
    raise ValueError(f"there is no covariate {name!r}")


def by_weight(batch: ArmStates, name: str) -> Floats | None:
    """Return a load per unit of the links' first moments, None of what is no load.

    Returns:
        (n, 6, 3) [N m/(kg m)], of every link in its own frame.
    """
    kind, _, which = name.partition(" ")
    if kind == "moment":
        across = "xy".index(which[1])
        return np.asarray(batch.loads.bending_basis[:, int(which[0]) - 1, across])
    if kind == "torque":
        return batch.loads.basis.reshape(len(batch), 6, 6, 4)[:, int(which) - 1, :, 1:]
    return None


def unit(name: str) -> str:
    """Name the unit of a covariate in SI."""
    kind = name.partition(" ")[0]
    return {
        "joint": "rad", "drive": "rad", "lambda": "1", "before": "1",
        "way": "rad",
        "travel": "log rad", "loop": "log rad", "torque": "N m", "moment": "N m",
        TILTING: "N m",
        "speed": "m/s",
        "payload": "kg", "temperature": "deg C", "time": "s", "order": "rows",
    }[kind]  # fmt: skip


def varies(values: Floats) -> bool:
    """Tell whether a covariate (n,) was recorded in every row and varies at all."""
    return bool(
        not np.isnan(values).any()
        and len(values) > 1
        and np.ptp(values) > 1e-9 * max(1.0, float(np.abs(values).max()))
    )


def varies_enough(states: States, kind: str) -> bool:
    """Tell whether rows differ enough in a kind of covariate to show what it drives.

    Angles and their kin always do: no survey determines the geometry otherwise.
    """
    if kind not in LEAST:
        return True
    values = getattr(states, kind)
    known = values[~np.isnan(values)]
    return len(known) > 0 and float(np.ptp(known)) > LEAST[kind]


def carrying(batch: ArmStates) -> tuple[int, ...]:
    """List the joints, 1 to 6, that carry weight worth the name."""
    torque = np.abs(batch.loads.gravity + batch.loads.payload).max(axis=0)
    enough = torque > CARRYING * float(torque.max(initial=0.0))
    return tuple(int(j) + 1 for j in np.flatnonzero(enough & (torque > 0)))


def loops(batch: ArmStates, joint: int) -> Floats:
    """Measure the way of a joint (from 0) between its last two reversals, (n,) [rad].

    It follows from this visit and the one before it in the visit order; NaN where that
    one is missing, or a direction or a travel is not known.
    """
    s = batch.states
    order = np.argsort(s.order, kind="stable")
    q, side = s.q[order, joint], s.direction[order, joint]
    turn = q - side * s.travel[order, joint]
    before = np.full(len(q), np.nan)
    follows = np.diff(s.order[order]) == 1
    same = side[1:] == side[:-1]
    before[1:] = np.where(same, q[:-1], turn[:-1])
    before[1:][~follows | (side[1:] == 0) | (side[:-1] == 0)] = np.nan
    loop = np.abs(turn - before)
    still = np.zeros(len(q), dtype=bool)  # on the way that the visit before was on
    still[1:] = same & follows & (np.abs(turn[1:] - turn[:-1]) < SHORTEST)
    begun = np.maximum.accumulate(np.where(still, 0, np.arange(len(q))))
    out = np.empty(len(q))
    out[order] = loop[begun]
    return out


def sides_before(batch: ArmStates, joint: int) -> Floats:
    """Return the direction of a joint (from 0) at the visit before, NaN if missing."""
    s = batch.states
    order = np.argsort(s.order, kind="stable")
    before = np.full(len(order), np.nan)
    follows = np.diff(s.order[order]) == 1
    before[1:] = np.where(follows, s.direction[order, joint][:-1], np.nan)
    out = np.empty(len(order))
    out[order] = before
    return out
