"""Terms of an error, as the core evaluates them: what moves, by which law of what.

An effect of known parameters is a sum of terms. A term moves a joint or a part by a law
of one driver or two, times factors; `native/src/terms.rs` states the laws. Drivers that
follow from joint angles, directions and loads are evaluated in the core, so that they
follow a command as it changes; the others are covariates of the states.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from postproc import _native
from postproc.arrays import Floats, floats
from postproc.model.carrier import Carrier
from postproc.robot.arm import Arm
from postproc.robot.state import States

Numbers = tuple[float, ...]
Named = tuple[str, Numbers]


class Driver(NamedTuple):
    """What a law or a factor is a function of.

    Attributes:
        name: "angle", "drive", "side", "given", "weight" or "size".
        numbers: What the core must know of it.
        covariate: Name of a covariate that is "given".
        unknown: Value of that where it is not known.
        column: Or an effect, and which column of its basis is given.
    """

    name: str
    numbers: Numbers = ()
    covariate: str = ""
    unknown: float = 0.0
    column: tuple[Any, int] | None = None


class TermLaw(NamedTuple):
    """A function, see `native/src/terms.rs`.

    Attributes:
        name: Its name there.
        numbers: Its numbers, the size first where it has one.
    """

    name: str
    numbers: Numbers


@dataclass(frozen=True)
class Term:
    """One term of an error.

    Attributes:
        moves: What moves: ("joint", j) through the whole kinematics, ("joints", six
            shares) at the first order, ("turn", link, axis) or ("shift", link, axis) of
            a carrier; joints and axes from 0.
        law: By how much [rad] or [m].
        by: The law's drivers.
        times: Factors.
    """

    moves: Named
    law: TermLaw
    by: tuple[Driver, ...] = ()
    times: tuple[Driver, ...] = ()


@dataclass(frozen=True)
class Neurons:
    """A layer of neurons that turns all joints, or moves the TCP.

    Attributes:
        lower, upper: Joint angles that become -1 and +1, (6,) [rad].
        weights: Of 6 angles and perhaps 6 directions, (k, 6) or (k, 12).
        bias: (k,).
        shape: "logistic" or "tanh" of weights . inputs + bias, or "gaussian": of the
            distance between inputs and weights.
        turns: Whether they turn joints and fade outside their range.
        sizes: (6, k) [rad], or (3, k) [m].
        units: Of a gaussian's inputs, (12,).
    """

    lower: Floats
    upper: Floats
    weights: Floats
    bias: Floats
    shape: str
    turns: bool
    sizes: Floats
    units: tuple[float, ...] = ()


@dataclass(frozen=True)
class Neighbours:
    """Errors that were measured at places: the nearest ones count, by their distance.

    Attributes:
        places: (m, 3) [m].
        errors: (m, 3) [m].
        count: How many of them count.
        power: Of the distance.
    """

    places: Floats
    errors: Floats
    count: int
    power: float


Terms = Sequence[Term | Neurons | Neighbours]


def joint_angles(terms: Terms, states: States) -> Floats:
    """Return what joints turn by, (n, 6) [rad], by terms of angles and directions."""
    written = [
        (t.moves, t.law, [d[:2] for d in t.by], [d[:2] for d in t.times])
        for t in terms
        if isinstance(t, Term)
    ]
    return _native.turned(written, floats(states.q), floats(states.direction))


# What moves.


def turn_joint(joint: int) -> Named:
    """Turn a joint, from 1, through the whole kinematics."""
    return "joint", (float(joint - 1),)


def turn_joints(shares: Floats) -> Named:
    """Turn joints by shares (6,), as far as the TCP follows at the first order."""
    return "joints", tuple(map(float, shares))


def move(carrier: Carrier) -> Named:
    """Move a part as a carrier does."""
    if carrier.part == "joint":
        return turn_joints(np.eye(6)[carrier.link - 1])
    return carrier.motion, (float(carrier.link), float(carrier.axis))


# What drives them.


def angle(joint: int) -> Driver:
    """Return the angle of a joint, from 1."""
    return Driver("angle", (float(joint - 1),))


def drive(shares: Sequence[float]) -> Driver:
    """Return the angle of a drive: joint angles times shares (6,)."""
    return Driver("drive", tuple(map(float, shares)))


def side(joint: int) -> Driver:
    """Return the direction in which a joint, from 1, arrives."""
    return Driver("side", (float(joint - 1),))


def state_value(covariate: str, unknown: float = 0.0) -> Driver:
    """Return a covariate of the states by its name, see `covariate`."""
    return Driver("given", (), covariate, unknown)


def weight(
    arm: Arm,
    share: Floats,
    links: Floats | None = None,
    carried: float = 1.0,
    places: Floats | None = None,
) -> Driver:
    """Return shares of the moments of all weight behind joints.

    Args:
        arm: The arm: its links, and where weight pulls.
        share: Shares of the moments about x, y and z of D-H frame k, which does not
            turn with joint k + 1, of all behind its origin, (6, 3).
        links: Mass [kg] and first moment [kg m] of every link, (6, 4); default: the
            arm's.
        carried: Share of the load that counts.
        places: Places [m] in the links' frames by which the load counts too, (6, 3).
    """
    links = arm.lumps if links is None else links
    places = np.zeros((6, 3)) if places is None else places
    parts = arm.pull, share.ravel(), links.ravel(), [carried], places.ravel()
    return Driver("weight", tuple(map(float, np.concatenate(parts))))


def about_axis(frame: int, axis: int) -> Floats:
    """Return the share of one moment, see `weight`: frame from 0, axis 0 to 2."""
    share = np.zeros((6, 3))
    share[frame, axis] = 1.0
    return share


def about_joints(arm: Arm, shares: Floats) -> Floats:
    """Return the shares of moments that joint torques times shares (6,) are, (6, 3)."""
    share = np.zeros((6, 3))
    share[:, 2] = arm.dh.sense * (arm.dh.mix @ shares)
    return share


def about_joint(arm: Arm, joint: int) -> Floats:
    """Return the same for the torque about one joint, from 1, (6, 3)."""
    return about_joints(arm, np.eye(6)[joint - 1])


def heavier(arm: Arm, moments: dict[int, Floats]) -> Floats:
    """Return the arm's links with more first moment, (6, 4).

    Args:
        arm: The arm.
        moments: By link, from 1, (3,) [kg m].
    """
    links = np.array(arm.lumps)
    for link, moment in moments.items():
        links[link - 1, 1:] += moment
    return links


def driver(
    arm: Arm,
    name: str,
    moments: dict[int, Floats] | None = None,
    unknown: float = 0.0,
) -> Driver:
    """Return what a covariate is in the core, see `covariate`.

    Args:
        arm: The arm.
        name: Its name.
        moments: By what links weigh more, see `heavier`.
        unknown: Its value where it is not known.
    """
    kind, _, number = name.partition(" ")
    links = heavier(arm, moments or {})
    match kind:
        case "joint":
            return angle(int(number))
        case "drive":
            return drive(arm.coupling[int(number) - 1])
        case "lambda":
            return side(int(number))
        case "torque":
            return weight(arm, about_joint(arm, int(number)), links)
        case "moment":
            joint, across = int(number[0]) - 1, "xy".index(number[1])
            return weight(arm, about_axis(joint, across), links)
        case "tilting":
            each = [weight(arm, about_axis(0, k)).numbers for k in range(3)]
            return Driver("size", tuple(x for numbers in each for x in numbers))
    return state_value(name, unknown)


# Laws that several effects have.


def law(name: str, *numbers: float) -> TermLaw:
    """Return a law by its name and numbers."""
    return TermLaw(name, tuple(map(float, numbers)))


def linear(k: float, middle: float = 0.0, half: float = 1.0) -> TermLaw:
    """Return k (x - middle) / half."""
    return law("linear", k, middle, half)


def constant(k: float) -> TermLaw:
    """Return k."""
    return law("constant", k)
