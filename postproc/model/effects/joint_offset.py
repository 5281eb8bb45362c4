"""Joint offset: a joint was mastered again, and its zero is another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import JOINTS
from postproc.model.effects.effect import (
    ZERO,
    Candidate,
    JointEffect,
    Parameter,
    alternatives,
)
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Term, Terms, constant, turn_joint
from postproc.robot.arm import Arm

MASTERED = 3e-4  # [rad] by which two masterings of a joint differ
FIRST, LAST = 1, 6  # joints that turn as the base, and as the tool, is turned


@dataclass(frozen=True)
class JointOffset(JointEffect):
    """A constant error of some joints, since the model was made.

    Geometry holds the same constant. A model that is revised has it known already, as
    the survey left it, and a joint that was mastered again is far outside of that. A
    change at one row of the campaign is `joint_step`.

    Attributes:
        joints: Joints whose zero is another.
    """

    name: ClassVar[str] = "joint_offset"
    renewed_by: ClassVar[frozenset[str]] = ZERO
    acts: ClassVar[tuple[tuple[str, str], ...]] = (("joint", "constant"),)
    everywhere: ClassVar[bool] = True

    joints: tuple[int, ...] = JOINTS

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try every joint."""
        return [c for j in JOINTS for c in alternatives([(cls((j,)), f"joint {j}")], j)]

    def list_tied(self, batch: ArmStates) -> tuple[str, ...]:
        """Name the shift of base or tool that turns the arm as the joint does.

        Joint 1 turns about the axis of the base, joint 6 about that of the flange: one
        nest on the flange does not tell its zero from a tool that has moved.
        """
        nests = len(np.unique(batch.states.tool.round(6), axis=0))
        base = ("base_shift",) if self.joints == (FIRST,) else ()
        tool = ("tool_shift",) if self.joints == (LAST,) and nests < 2 else ()
        return (*base, *tool)

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the constant of every joint."""
        return tuple(
            Parameter(f"theta{j}", "rad", MASTERED, f"{j}", j) for j in self.joints
        )

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn every joint by a constant."""
        pairs = zip(self.joints, p, strict=True)
        return [Term(turn_joint(j), constant(k)) for j, k in pairs]

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate 1, (n, p)."""
        return np.ones((len(batch), len(self.joints)))

    def joint_zeros(self, p: Floats) -> Floats:
        """Return the constants, (6,) [rad]."""
        out = np.zeros(6)
        out[np.array(self.joints, dtype=int) - 1] = p
        return out
