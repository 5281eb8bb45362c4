"""The gap in every gear, followed along the motion.

A gear with a gap of 2 g [rad] moves its link only when a flank touches: its place in
the gap is s = clip(s + dq / g, -1, 1). A joint that stands keeps its flank. The side
s is thus a physical state, not a sign computed from two targets.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.virtual.arrivals import LONG_TRAVEL

STILL = 1e-12  # [rad] below the rounding of the inverse kinematics


@dataclass(frozen=True)
class Gears:
    """The gears of an arm.

    Attributes:
        gap: Half the gap of every gear, (6,) [rad] on the joint side.
        coupling: (6, 6), motor-side angles = coupling @ joint angles.
    """

    gap: Floats
    coupling: Floats


@dataclass(frozen=True)
class GearState:
    """Where the gears are; all (6,), angles on the motor side [rad].

    Attributes:
        angle: Present angle.
        side: Place in the gap, -1 .. 1.
        heading: Direction of the last motion that was more than the gap, +1 or -1.
        extreme: Furthest angle reached since the last reversal.
        turn: Where the last reversal was.
        turn_before: Where the reversal before it was.
    """

    angle: Floats
    side: Floats
    heading: Floats
    extreme: Floats
    turn: Floats
    turn_before: Floats

    @property
    def travel(self) -> Floats:
        """Way since the last reversal, (6,) [rad]."""
        return np.abs(self.angle - self.turn)

    @property
    def loop(self) -> Floats:
        """Way between the last two reversals, (6,) [rad]."""
        return np.abs(self.turn - self.turn_before)


def at_start(gears: Gears, q: Floats, side: Floats) -> GearState:
    """Return the state of an arm that stands at q (6,) with the given sides (6,)."""
    angle = gears.coupling @ q
    turn = angle - side * LONG_TRAVEL
    return GearState(angle, side, side, angle, turn, turn + side * LONG_TRAVEL)


def move(gears: Gears, state: GearState, path: Floats) -> GearState:
    """Follow a joint path.

    Args:
        gears: Gaps and coupling.
        state: The state before.
        path: Joint angles, (m, 6) [rad]; between two of them every joint moves one way.
    """
    for angle in turning_points(np.vstack([state.angle, path @ gears.coupling.T])):
        state = _step(gears.gap, state, angle)
    return state


def turning_points(path: Floats) -> Floats:
    """Return the points (k, 6) of a path (m, 6) where a joint turns, and its end."""
    steps = np.diff(path, axis=0)
    steps[np.abs(steps) < STILL] = 0.0
    before, after = steps[:-1], steps[1:]
    turns = (before * after <= 0) & ((before != 0) | (after != 0))
    keep = np.append(turns.any(axis=1), True)
    return np.asarray(path[1:][keep])


def _step(gap: Floats, state: GearState, angle: Floats) -> GearState:
    """Move every motor one way to the given angles (6,)."""
    side = np.clip(state.side + (angle - state.angle) / gap, -1.0, 1.0)
    advance = state.heading * (angle - state.extreme)
    reversed_ = advance < -gap
    return GearState(
        angle=angle,
        side=side,
        heading=np.where(reversed_, -state.heading, state.heading),
        extreme=np.where(reversed_ | (advance > 0), angle, state.extreme),
        turn=np.where(reversed_, state.extreme, state.turn),
        turn_before=np.where(reversed_, state.turn, state.turn_before),
    )
