"""Joint spline: the whole error of a joint along its angle.

Where `joint_map` finds a place, this resolves every gear and encoder wave that the rows
can show, without naming them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.model.effects.effect import JointEffect, Parameter, Unasked, fade
from postproc.model.effects.smooth import smooth, smooth_count
from postproc.model.kinematics import Batch
from postproc.model.splines import Splines
from postproc.robot.arm import Arm
from postproc.robot.state import States

SCALE = 1e-4  # [rad]
LONG = np.deg2rad(60.0)
SHORTEST = np.deg2rad(5.0)
ROWS_A_LENGTH = 10.0  # rows that the shortest length must see
LEAST_RANGE = np.deg2rad(10.0)
LEAST_ROWS = 100
LONG_SURVEY = 600  # rows from which no other free form resolves more


@dataclass(frozen=True)
class JointSpline(JointEffect):
    """Joint error f(theta), a sum of smooth functions at a long and a short length.

    Attributes:
        joints: Joints that have one.
        lower, upper: Surveyed range of every joint [rad]; outside, f fades to zero.
        lengths: Correlation lengths [rad]; the data share f among them.
    """

    name: ClassVar[str] = "joint_spline"
    unasked: ClassVar[Unasked | None] = "last"

    joints: tuple[int, ...] = (1, 2, 3, 4, 5, 6)
    lower: tuple[float, ...] = (-np.pi,) * 6
    upper: tuple[float, ...] = (np.pi,) * 6
    lengths: tuple[float, ...] = (LONG, 3 * SHORTEST)

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Resolve as much as the number of rows allows, on every joint that moved."""
        low, high = states.q.min(axis=0), states.q.max(axis=0)
        span = high - low
        short = ROWS_A_LENGTH * float(span.max()) / max(len(states), 1)
        short = float(np.clip(short, SHORTEST, LONG / 2))
        return cls(
            joints=tuple(int(j) + 1 for j in np.flatnonzero(span > LEAST_RANGE)),
            lower=tuple(map(float, low)),
            upper=tuple(map(float, high)),
            lengths=(LONG, short),
        )

    @classmethod
    def may_show(cls, states: States) -> bool:
        """Wait for a survey that is long enough, and moved a joint far enough."""
        moved = np.ptp(states.q, axis=0) > LEAST_RANGE
        return len(states) >= LEAST_ROWS and bool(moved.any())

    def _parts(self) -> list[tuple[int, float]]:
        """List joints (from 0) with lengths."""
        return [(j - 1, length) for j in self.joints for length in self.lengths]

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the columns of every joint and length."""
        out = []
        for j, length in self._parts():
            count = smooth_count(self.lower[j], self.upper[j], length)
            wide = f"{np.rad2deg(length):.1f} deg"
            for k in range(count):
                name = f"f{j + 1} {wide} {k + 1}"
                out.append(
                    Parameter(name, "rad", SCALE, f"joint {j + 1} {wide}", j + 1)
                )
        return tuple(out)

    def fine(self, joint: int) -> NDArray[np.int64]:
        """Take a joint's functions at the short length."""
        count = [
            smooth_count(self.lower[j], self.upper[j], length)
            for j, length in self._parts()
        ]
        short = [
            (j + 1, length) == (joint, min(self.lengths)) for j, length in self._parts()
        ]
        return np.flatnonzero(np.repeat(short, count))

    def splines(self, batch: Batch) -> list[tuple[int, Splines, Floats]]:
        """Write the functions of every joint and length as splines, see `smooth`."""
        q = batch.states.q
        inside = fade(q, np.array(self.lower), np.array(self.upper))
        out = []
        for j, length in self._parts():
            found, mix = smooth(q[:, j], self.lower[j], self.upper[j], length)
            out.append((j, found.faded(inside[:, j]), mix))
        return out

    def basis(self, batch: Batch) -> Floats:
        """Evaluate the functions, (n, p)."""
        columns = [found.mixed(mix) for _, found, mix in self.splines(batch)]
        return np.concatenate(columns, axis=1)

    def angles(self, batch: Batch, p: Floats) -> Floats:
        """Return the joint errors (n, 6) [rad]: one function for every joint."""
        start, out = 0, np.zeros((len(batch), 6))
        for j, found, mix in self.splines(batch):
            part = slice(start, start + mix.shape[1])
            out[:, j] += found.mixed(mix @ p[part])
            start = part.stop
        return out

    def beyond(self, batch: Batch, prior_std: Floats) -> Floats:
        """Give back the prior's variance as far as the functions have faded, (n, 6)."""
        q, out = batch.states.q, np.zeros((len(batch), 6))
        ended = 1.0 - fade(q, np.array(self.lower), np.array(self.upper)) ** 2
        start = 0
        for j, length in self._parts():
            out[:, j] += ended[:, j] * prior_std[start] ** 2
            start += smooth_count(self.lower[j], self.upper[j], length)
        return out
