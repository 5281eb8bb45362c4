"""Coupling: a joint is dragged along by another one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.effect import (
    Candidate,
    Cells,
    JointEffect,
    Parameter,
    alternatives,
)
from postproc.model.effects.policies import FitPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Term, Terms, angle, linear, turn_joint
from postproc.robot.arm import Arm

SCALE = 5e-5  # [rad/rad]
HOLLOW_WRIST = ((3, 2), (5, 4), (6, 4), (6, 5))  # receiving, driving
TRIED = (*HOLLOW_WRIST, (2, 3), (4, 5), (4, 6), (5, 6))


@dataclass(frozen=True)
class Coupling(JointEffect):
    """Error of one joint c * theta of another, as through a hollow wrist's gears.

    Attributes:
        pairs: (receiving joint, driving joint) of every coupling.
    """

    name: ClassVar[str] = "coupling"
    fit_policy: ClassVar[FitPolicy] = FitPolicy.IF_EVIDENT
    cells: ClassVar[Cells] = tuple(
        (f"joint {j}", f"joint {k}", "linear") for j, k in TRIED
    )

    pairs: tuple[tuple[int, int], ...] = HOLLOW_WRIST

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try neighbours, both ways; what drives a joint is part of the name."""
        out = []
        for pair in TRIED:
            driver = f"joint {pair[1]}"
            out += alternatives([(cls((pair,)), driver)], pair[0], driver)
        return out

    def parameters(self) -> tuple[Parameter, ...]:
        """Name one factor per pair: c<receiving>_<driving>."""
        return tuple(
            Parameter(f"c{j}_{k}", "rad/rad", SCALE, f"{j} by {k}", j)
            for j, k in self.pairs
        )

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn every joint in proportion to the angle of another one."""
        pairs = zip(self.pairs, p, strict=True)
        return [Term(turn_joint(j), linear(c), (angle(k),)) for (j, k), c in pairs]

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate the driving angles, (n, p)."""
        driving = np.array([k - 1 for _, k in self.pairs], dtype=int)
        theta: Floats = batch.states.q[:, driving]
        return theta
