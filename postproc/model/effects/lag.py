"""Lag: a joint trails its command in proportion to the speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import JOINTS, varies
from postproc.model.effects.effect import (
    Candidate,
    Cells,
    JointEffect,
    Parameter,
    alternatives,
    own_cells,
)
from postproc.model.effects.policies import FitPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Term, Terms, linear, side, state_value, turn_joint
from postproc.robot.arm import Arm

SCALE = 2e-4  # [rad s/m]


@dataclass(frozen=True)
class Lag(JointEffect):
    """Joint error lambda * k * speed of the TCP on arrival; 0 where it is not known.

    Attributes:
        joints: Joints that lag.
    """

    name: ClassVar[str] = "lag"
    renewed_by: ClassVar[frozenset[str]] = frozenset({"motor", "arm", "software"})
    direct: ClassVar[bool] = True
    driven_by: ClassVar[str] = "speed"
    fit_policy: ClassVar[FitPolicy] = FitPolicy.IF_EVIDENT
    cells: ClassVar[Cells] = own_cells("lambda {j} x speed", "linear")

    joints: tuple[int, ...] = JOINTS

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try every joint, where the speed varies."""
        if not varies(batch.states.speed):
            return []
        return [c for j in JOINTS for c in alternatives([(cls((j,)), "speed")], j)]

    def requires(self) -> tuple[str, ...]:
        """Need the speed."""
        return ("speed",)

    def parameters(self) -> tuple[Parameter, ...]:
        """Name one k per joint."""
        return tuple(
            Parameter(f"k{j}", "rad s/m", SCALE, f"{j}", j) for j in self.joints
        )

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn every joint in proportion to the speed, times its direction."""
        return [
            Term(turn_joint(j), linear(k), (state_value("speed"),), (side(j),))
            for j, k in zip(self.joints, p, strict=True)
        ]

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate lambda * speed [m/s], (n, p)."""
        speed = np.nan_to_num(batch.states.speed)[:, None]
        return np.asarray(batch.states.direction[:, self.acts_on()] * speed)
