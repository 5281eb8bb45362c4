"""Joint step: the zero of a joint changes at one moment, by a crash or a new motor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import JOINTS
from postproc.model.effects.effect import (
    Candidate,
    Cells,
    JointEffect,
    Parameter,
    alternatives,
    own_cells,
)
from postproc.model.effects.policies import SearchPolicy
from postproc.model.effects.step import CampaignStep, moments
from postproc.model.kinematics import ArmStates

TURN = 1e-4  # [rad]


@dataclass(frozen=True)
class JointStep(CampaignStep, JointEffect):
    """A step of the zero of some joints at one row.

    It is the arm's own: the zero after the step is the geometry's, and is compensated.
    The step itself turns the rows before it only, see `CampaignStep`.

    Attributes:
        joints: Joints whose zero changed.
    """

    name: ClassVar[str] = "joint_step"
    sets_zero: ClassVar[bool] = True
    search_policy: ClassVar[SearchPolicy] = SearchPolicy.ALWAYS
    cells: ClassVar[Cells] = (*own_cells("order", "step"), *own_cells("time", "step"))

    joints: tuple[int, ...] = JOINTS

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try every joint at moments all along the campaign."""
        rows = moments(batch)
        return [
            candidate
            for j in JOINTS
            for candidate in alternatives(
                [(cls(float(r), (j,)), "order") for r in rows], j
            )
        ]

    def has_mean(self) -> bool:
        """Return True: a zero that changed is another one than a given model has."""
        return True

    def refers_to(self) -> str:
        """Name the state after the step."""
        return "the zero of the joint as it is after the step"

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the change of every joint's zero, from before to after."""
        return tuple(
            Parameter(f"theta{j}_row{self.row:g}", "rad", TURN, f"{j} {self.row:g}", j)
            for j in self.joints
        )

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate -1 before the step and 0 after it, (n, p)."""
        turned = np.where(self.before(batch), -1.0, 0.0)
        return np.tile(turned[:, None], (1, len(self.joints)))
