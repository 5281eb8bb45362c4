"""Backlash that varies along the gear: lambda * (b0 + Fourier(theta))."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.batch import Batch
from postproc.accuracy.effect import FAR, JointEffect, Parameter, fade_turns
from postproc.robot.arm import Arm
from postproc.robot.state import States

Array = NDArray[np.float64]

SCALE = 5e-5  # [rad]


@dataclass(frozen=True)
class BacklashProfile(JointEffect):
    """Joint error lambda * (b0 + sum_k s_k sin(k theta) + c_k cos(k theta)).

    Attributes:
        joints: Joints that have a profile.
        orders: Orders k.
        constant: Whether b0 belongs to it; not where `backlash` holds it already.
        lower, upper: Surveyed range of every joint [rad]; the profile fades outside.
    """

    name: ClassVar[str] = "backlash_profile"
    direct: ClassVar[bool] = True

    joints: tuple[int, ...] = (1, 2, 3, 4, 5, 6)
    orders: tuple[int, ...] = (1, 2, 3)
    constant: bool = False
    lower: tuple[float, ...] = (-FAR,) * 6
    upper: tuple[float, ...] = (FAR,) * 6

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Remember the surveyed range."""
        low, high = states.q.min(axis=0), states.q.max(axis=0)
        return cls(lower=tuple(map(float, low)), upper=tuple(map(float, high)))

    def parameters(self) -> tuple[Parameter, ...]:
        """Name b0 and the harmonics of every joint."""
        out = []
        for j in self.joints:
            if self.constant:
                out.append(Parameter(f"b{j}_0", "rad", 2 * SCALE, "order 0", j))
            for k in self.orders:
                for wave in ("sin", "cos"):
                    name = f"b{j}_{wave}{k}"
                    out.append(Parameter(name, "rad", SCALE, f"order {k}", j))
        return tuple(out)

    def basis(self, batch: Batch) -> Array:
        """Evaluate lambda times the harmonics, (n, p)."""
        inside, waves = batch.once(self, self._waves)
        turned: Array = batch.states.direction[:, self.acts_on()] * inside * waves
        return turned

    def _waves(self, q: Array) -> tuple[Array, Array]:
        """Evaluate how far inside of the range, and the harmonics, (n, p) each."""
        within = fade_turns(q, np.array(self.lower), np.array(self.upper))
        inside, waves = (np.ones((len(q), len(self.acts_on()))) for _ in range(2))
        column = 0
        for j in np.array(self.joints, dtype=int) - 1:
            column += self.constant
            for k in self.orders:
                both = slice(column, column + 2)
                inside[:, both] = within[:, j, None]
                waves[:, column] = np.sin(k * q[:, j])
                waves[:, column + 1] = np.cos(k * q[:, j])
                column += 2
        return inside, waves
