"""What can move a little: the base, a link or the tool, by a turn or a shift.

Every quasi-static error of an arm is a small rigid motion of a part as a function of
its state. A carrier is one of the six motions of a part: all behind it turns about, or
shifts along, an axis of the frame before the link's joint, which does not turn with it
(Denavit-Hartenberg frame k - 1 of link k); of the flange for the tool. A joint's own
turn is the one about z, and counts by the controller's angle.
"""

from __future__ import annotations

from functools import cache
from typing import Literal, NamedTuple

import numpy as np

from postproc.arrays import Floats
from postproc.model.kinematics import ArmStates
from postproc.robot.pose import cross

Motion = Literal["turn", "shift"]
AXES = "xyz"


class Carrier(NamedTuple):
    """One small motion of a part.

    Attributes:
        part: "joint", "base", "link" or "tool".
        link: Number of the joint or the link, 1 to 6; 1 of the base, 7 of the tool.
        motion: "turn" or "shift".
        axis: 0 to 2 for x, y, z.
    """

    part: str
    link: int
    motion: Motion
    axis: int

    def __str__(self) -> str:
        if self.part == "joint":
            return f"joint {self.link}"
        of = f"link {self.link}" if self.part == "link" else self.part
        return f"{of} {self.motion} {AXES[self.axis]}"

    @property
    def joint(self) -> int | None:
        """The joint that turns about its own axis, from 1, or None."""
        return self.link if self.part == "joint" else None

    def sentence(self) -> str:
        """Say what moves, and how."""
        if self.part == "joint":
            return f"joint {self.link} turns"
        of = f"link {self.link}" if self.part == "link" else f"the {self.part}"
        how = "turns about" if self.motion == "turn" else "shifts along"
        return f"{of} {how} the {AXES[self.axis]} of its frame"

    def move(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position by the motion, (n, 3) [m/rad] or [1]."""
        if self.part == "joint":
            return np.asarray(batch.jacobian[:, :, self.link - 1])
        axis = self._axis(batch)
        if self.motion == "shift":
            return axis
        moved: Floats = cross(axis, batch.walk.tcp - self._origin(batch))
        return moved

    def turn(self, batch: ArmStates) -> Floats | None:
        """Differentiate the tool's rotation by the motion, (n, 3), None without."""
        if self.part == "joint":
            return np.asarray(batch.angular[:, :, self.link - 1])
        return self._axis(batch) if self.motion == "turn" else None

    def _axis(self, batch: ArmStates) -> Floats:
        """Return the axis in the base frame, (n, 3)."""
        w, k = batch.walk, self.link - 1
        if self.part == "tool":
            return np.asarray(w.flange[:, :, self.axis])
        if k == 0:
            return np.tile(np.eye(3)[self.axis], (len(batch), 1))
        x, z = w.link[:, k - 1], w.turn[:, k]
        return np.asarray((x, cross(z, x), z)[self.axis])

    def _origin(self, batch: ArmStates) -> Floats:
        """Return a point on the axis, (n, 3) [m]."""
        w = batch.walk
        if self.part == "tool":
            stands = np.einsum("nij,nj->ni", w.flange, batch.states.tool)
            return np.asarray(w.tcp - stands)
        return np.asarray(w.pivot[:, self.link - 1])


@cache
def carrier(text: str) -> Carrier:
    """Read a carrier: "joint 3", "link 3 turn x", "base shift z", "tool turn y".

    >>> carrier("link 3 turn x").sentence()
    'link 3 turns about the x of its frame'

    Raises:
        ValueError: There is no such carrier.
    """
    match text.split():
        case ["joint", k]:
            return Carrier("joint", int(k), "turn", 2)
        case ["link", k, ("turn" | "shift") as motion, a]:
            return Carrier("link", int(k), motion, AXES.index(a))
        case [("base" | "tool") as part, ("turn" | "shift") as motion, a]:
            link = 1 if part == "base" else 7
            return Carrier(part, link, motion, AXES.index(a))
    raise ValueError(f"there is no carrier {text!r}")


@cache
def every_carrier() -> tuple[Carrier, ...]:
    """List all motions once: a turn about z is a joint's, that of link 1 the base's."""
    joints = [Carrier("joint", k, "turn", 2) for k in range(1, 7)]
    turns = [Carrier("link", k, "turn", a) for k in range(2, 7) for a in range(2)]
    shifts = [Carrier("link", k, "shift", a) for k in range(2, 7) for a in range(3)]
    base = [Carrier("base", 1, "turn", a) for a in range(2)]
    base += [Carrier("base", 1, "shift", a) for a in range(3)]
    motions: tuple[Motion, ...] = ("turn", "shift")
    tool = [Carrier("tool", 7, how, a) for how in motions for a in range(3)]
    return (*joints, *turns, *shifts, *base, *tool)
