"""Scale: an encoder or a gear ratio that is slightly wrong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from postproc.arrays import Floats
from postproc.model.covariate import JOINTS
from postproc.model.effects.effect import (
    DRIVEN,
    Candidate,
    Cells,
    JointEffect,
    Parameter,
    alternatives,
    own_cells,
)
from postproc.model.effects.policies import FitPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Term, Terms, angle, linear, turn_joint
from postproc.robot.arm import Arm

SCALE = 5e-5  # [rad/rad]


@dataclass(frozen=True)
class Scale(JointEffect):
    """Joint error gain * theta.

    Attributes:
        joints: Joints with a gain.
    """

    name: ClassVar[str] = "scale"
    renewed_by: ClassVar[frozenset[str]] = DRIVEN
    fit_policy: ClassVar[FitPolicy] = FitPolicy.IF_EVIDENT
    cells: ClassVar[Cells] = own_cells("joint {j}", "linear")

    joints: tuple[int, ...] = JOINTS

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try every joint."""
        return [c for j in JOINTS for c in alternatives([(cls((j,)), f"joint {j}")], j)]

    def parameters(self) -> tuple[Parameter, ...]:
        """Name one gain per joint."""
        return tuple(
            Parameter(f"gain{j}", "rad/rad", SCALE, f"{j}", j) for j in self.joints
        )

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn every joint in proportion to its angle."""
        pairs = zip(self.joints, p, strict=True)
        return [Term(turn_joint(j), linear(k), (angle(j),)) for j, k in pairs]

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate theta, (n, p)."""
        theta: Floats = batch.states.q[:, self.acts_on()]
        return theta
