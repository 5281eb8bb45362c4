"""Wind-up: after a reversal, friction winds the shaft up over some way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.effect import JointEffect, Parameter
from postproc.model.kinematics import Batch

SCALE = 3e-5  # [rad]


@dataclass(frozen=True)
class Windup(JointEffect):
    """Joint error lambda * w * (1 - 2 exp(-travel / d0)).

    Where the travel since the last reversal is not known, it counts as long.

    Attributes:
        joints: Joints that wind up.
        d0: Way over which they do [rad].
    """

    name: ClassVar[str] = "windup"
    direct: ClassVar[bool] = True

    joints: tuple[int, ...] = (1, 2, 3, 4, 5, 6)
    d0: float = 0.05

    def parameters(self) -> tuple[Parameter, ...]:
        """Name one size per joint."""
        return tuple(
            Parameter(f"w{j}", "rad", SCALE, f"{j} over {self.d0:.4g}", j)
            for j in self.joints
        )

    def basis(self, batch: Batch) -> Floats:
        """Evaluate lambda (1 - 2 exp(-travel / d0)), (n, p)."""
        joint = self.acts_on()
        travel = np.nan_to_num(batch.states.travel[:, joint], nan=np.inf)
        wound = 1.0 - 2.0 * np.exp(-travel / self.d0)
        return np.asarray(batch.states.direction[:, joint] * wound)
