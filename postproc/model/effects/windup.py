"""Wind-up: after a reversal, friction winds the shaft up over some way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import JOINTS, varies
from postproc.model.effects.effect import (
    Candidate,
    Effect,
    JointEffect,
    Parameter,
    Unasked,
    alternatives,
)
from postproc.model.kinematics import Batch

SCALE = 3e-5  # [rad]
WAYS = tuple(np.radians([0.5, 1.0, 2.0, 4.0, 7.0]))  # d0 that are tried
LONGEST = float(np.radians(8.0))  # what fades more slowly is no wind-up


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
    driven_by: ClassVar[str] = "travel"
    unasked: ClassVar[Unasked | None] = "weighed"
    variation_of: ClassVar[str | None] = "backlash"

    joints: tuple[int, ...] = JOINTS
    d0: float = 0.05

    @classmethod
    def candidates(cls, batch: Batch) -> list[Candidate]:
        """Try short and long ways at every joint whose travel is known."""
        out = []
        for j in JOINTS:
            if varies(batch.states.travel[:, j - 1]):
                members = [(cls((j,), float(d0)), f"travel {j}") for d0 in WAYS]
                out += alternatives(members, j)
        return out

    def refined(self, offsets: Floats, batch: Batch) -> list[Effect]:
        """Change the way."""
        ways = np.unique(np.minimum(self.d0 * 2.0**offsets, LONGEST))
        return [replace(self, d0=float(way)) for way in ways]

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell the way."""
        return {"d0": (float(self.d0) * float(np.degrees(1.0)), "deg")}

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
