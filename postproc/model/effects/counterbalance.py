"""Counterbalance: axis 2 yields to its balancing spring."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.effect import (
    Candidate,
    Effect,
    JointEffect,
    Parameter,
    alternatives,
)
from postproc.model.effects.policies import FitPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Term, Terms, angle, law, turn_joint
from postproc.robot.arm import Arm

SCALE = 2e-4  # [rad] at the spring's largest torque
SPRINGS = tuple(
    (ratio, float(np.radians(upright)), preload)
    for ratio in (0.25, 0.4, 0.6)
    for upright in (-12.0, -6.0, 0.0, 6.0, 12.0)
    for preload in (0.05, 0.3)
)  # springs that a search tries


@dataclass(frozen=True)
class Counterbalance(JointEffect):
    """Axis 2 yields to a spring between a fixed pin and one that turns with axis 2.

    With r the moving pin's radius over the fixed pin's, u the angle from where both
    pins align, and length L(u) = sqrt(1 + r^2 - 2 r cos u), the torque follows
    (L - (1 - r) + preload) r sin(u) / L: spring travel times lever.

    Attributes:
        ratio: r.
        upright: Angle of axis 2 where the pins align [rad].
        preload: Travel of the spring at its shortest, in units of the fixed radius.
    """

    name: ClassVar[str] = "counterbalance"
    acts: ClassVar[tuple[tuple[str, str], ...]] = (("joint", "joint"),)
    fit_policy: ClassVar[FitPolicy] = FitPolicy.IF_EVIDENT

    ratio: float = 0.4
    upright: float = 0.0
    preload: float = 0.2

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try springs of usual proportions."""
        return alternatives([(cls(*spring), "joint 2") for spring in SPRINGS], 2)

    def refine(self, offsets: Floats, batch: ArmStates) -> list[Effect]:
        """Turn the spring, and change its pins and its preload."""
        turned = [replace(self, upright=float(self.upright + 0.1 * x)) for x in offsets]
        ratio = [replace(self, ratio=float(self.ratio * 1.5**x)) for x in offsets]
        ratio = [e for e in ratio if 0.1 < e.ratio < 0.9]
        loaded = [replace(self, preload=float(self.preload * 3.0**x)) for x in offsets]
        return [*turned, *ratio, *loaded]

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell how the spring sits."""
        upright = float(self.upright) * float(np.degrees(1.0))
        return {"pin_ratio": (float(self.ratio), "1"), "upright": (upright, "deg")}

    def least_evidence(self) -> float:
        """Ask no more of a spring than of the weight that it carries [nats]."""
        return 0.0

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the size, at u = 90 deg."""
        return (Parameter("c2", "rad", SCALE, "2", 2),)

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn axis 2 by the spring's torque."""
        spring = law("spring", p[0], self.ratio, self.upright, self.preload)
        return [Term(turn_joint(2), spring, (angle(2),))]

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate the spring's torque, 1 at u = 90 deg, (n, 1)."""
        u = batch.states.q[:, 1] - self.upright
        return np.asarray((self._torque(u) / self._torque(np.pi / 2))[:, None])

    def _torque(self, u: Floats | float) -> Floats:
        """Give the torque at angles u [rad], in units of the spring."""
        r = self.ratio
        length = np.sqrt(1 + r**2 - 2 * r * np.cos(u))
        return np.asarray((length - (1 - r) + self.preload) * r * np.sin(u) / length)
