"""Joint map: a free smooth function of one joint's angle, such as a worn spot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.effect import JointEffect, Parameter
from postproc.model.kinematics import Batch
from postproc.robot.arm import Arm
from postproc.robot.state import States

SCALE = 1e-4  # [rad]
SPACING = 1.5  # distance of the bumps of a map, in their widths
KNOTS = 24  # bumps over the range of a joint that is mapped


@dataclass(frozen=True)
class JointMap(JointEffect):
    """Joint error sum_i h_i exp(-(theta - c_i)^2 / (2 w^2)).

    Evenly spaced bumps make a smooth function; a single one is a worn spot. Outside
    the mapped range it fades to zero by itself.

    Attributes:
        bumps: (joint, centre c [rad]) of every bump.
        width: w [rad].
    """

    name: ClassVar[str] = "joint_map"

    bumps: tuple[tuple[int, float], ...] = ()
    width: float = 0.1

    @classmethod
    def over(cls, joint: int, low: float, high: float, knots: int) -> Self:
        """Cover a joint's range with evenly spaced bumps."""
        centres = np.linspace(low, high, knots)
        width = max(float(high - low), 1e-3) / (knots - 1) / SPACING
        return cls(tuple((joint, float(c)) for c in centres), width)

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Map every joint over the largest surveyed range."""
        low, high = states.q.min(axis=0), states.q.max(axis=0)
        width = max(float((high - low).max()), 1e-3) / (KNOTS - 1) / SPACING
        bumps = [
            (j + 1, float(c))
            for j in range(6)
            for c in np.arange(low[j], high[j] + width, SPACING * width)
        ]
        return cls(tuple(bumps), width)

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the height of every bump by its place in degrees."""
        wide = np.degrees(self.width)
        return tuple(
            Parameter(f"h{j}_{np.degrees(c):.2f}w{wide:.2f}", "rad", SCALE, f"{j}", j)
            for j, c in self.bumps
        )

    def basis(self, batch: Batch) -> Floats:
        """Evaluate the bumps, (n, p)."""
        joint = np.array([j - 1 for j, _ in self.bumps], dtype=int)
        centre = np.array([c for _, c in self.bumps])
        away = (batch.states.q[:, joint] - centre) / self.width
        return np.asarray(np.exp(-0.5 * away**2))
