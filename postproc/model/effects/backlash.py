"""Backlash: a joint stands on one flank of its gear or on the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import JOINTS
from postproc.model.effects.effect import (
    PLAY,
    Candidate,
    Cells,
    JointEffect,
    Parameter,
    alternatives,
    own_cells,
)
from postproc.model.effects.policies import FitPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Term, Terms, linear, side, turn_joint
from postproc.robot.arm import Arm

SCALE = 1e-4  # [rad] prior scale of half a backlash


@dataclass(frozen=True)
class Backlash(JointEffect):
    """Joint error lambda * b: half the gap, on the side that the joint comes from."""

    name: ClassVar[str] = "backlash"
    renewed_by: ClassVar[frozenset[str]] = PLAY
    direct: ClassVar[bool] = True
    driven_by: ClassVar[str] = "lambda"
    fit_policy: ClassVar[FitPolicy] = FitPolicy.ALWAYS
    cells: ClassVar[Cells] = own_cells("lambda {j}", "linear")

    joints: tuple[int, ...] = JOINTS

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try every joint."""
        return [
            c for j in JOINTS for c in alternatives([(cls((j,)), f"lambda {j}")], j)
        ]

    def parameters(self) -> tuple[Parameter, ...]:
        """Name one b per joint."""
        return tuple(Parameter(f"b{j}", "rad", SCALE, "b", j) for j in self.joints)

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn every joint in proportion to its direction."""
        pairs = zip(self.joints, p, strict=True)
        return [Term(turn_joint(j), linear(b), (side(j),)) for j, b in pairs]

    def angles(self, batch: ArmStates, p: Floats) -> Floats:
        """Return the joint errors (n, 6) [rad], those of all joints in one go."""
        if len(self.joints) < len(JOINTS):
            return super().angles(batch, p)
        own = np.empty(len(JOINTS))
        own[self.acts_on()] = p
        return np.asarray(batch.states.direction * own)

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate lambda, (n, p)."""
        side: Floats = batch.states.direction[:, self.acts_on()]
        return side
