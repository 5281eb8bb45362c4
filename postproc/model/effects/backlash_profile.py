"""Backlash that varies along the gear: lambda * (b0 + Fourier(theta))."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.model.covariate import JOINTS
from postproc.model.effects.effect import (
    ANY,
    FAR,
    PLAY,
    Candidate,
    Cells,
    JointEffect,
    Parameter,
    alternatives,
    fade_turns,
    own_cells,
)
from postproc.model.effects.policies import FitPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Term, Terms, angle, joint_angles, law, side, turn_joint
from postproc.robot.arm import Arm
from postproc.robot.state import States

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
    renewed_by: ClassVar[frozenset[str]] = PLAY
    direct: ClassVar[bool] = True
    driven_by: ClassVar[str] = "lambda"
    fit_policy: ClassVar[FitPolicy] = FitPolicy.ALWAYS
    variation_of: ClassVar[str | None] = "backlash"
    cells: ClassVar[Cells] = own_cells("lambda {j} x joint {j}", *ANY)

    joints: tuple[int, ...] = JOINTS
    orders: tuple[int, ...] = (1, 2, 3)
    constant: bool = False
    lower: tuple[float, ...] = (-FAR,) * 6
    upper: tuple[float, ...] = (FAR,) * 6

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Remember the surveyed range."""
        low, high = states.q.min(axis=0), states.q.max(axis=0)
        return cls(lower=tuple(map(float, low)), upper=tuple(map(float, high)))

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try every joint."""
        every = cls.propose(batch.arm, batch.states)
        return [
            c
            for j in JOINTS
            for c in alternatives([(replace(every, joints=(j,)), f"joint {j}")], j)
        ]

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

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate lambda times the harmonics, (n, p)."""
        joint, waves = self.acts_on(), batch.once(self, self._waves)
        flat = waves.reshape(len(joint), len(batch))
        turned: Floats = batch.states.direction.T[joint] * flat
        return turned.T

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn every joint by its waves, times its direction."""
        sizes = p.reshape(len(self.joints), self.constant + 2 * len(self.orders))
        first, out = int(self.constant), []
        for j, own in zip(self.joints, sizes, strict=True):
            waves = np.zeros((max(self.orders, default=0), 2))
            waves[np.array(self.orders, dtype=int) - 1] = own[first:].reshape(-1, 2)
            ends = self.lower[j - 1], self.upper[j - 1], own[0] if first else 0.0
            own_law = law("waves", *ends, *waves.ravel())
            out.append(Term(turn_joint(j), own_law, (angle(j),), (side(j),)))
        return out

    def angles(self, batch: ArmStates, p: Floats) -> Floats:
        """Return the joint errors (n, 6) [rad], as in the base class but in one go."""
        return joint_angles(self.terms(batch.arm, p), batch.states)

    @property
    def _profile_joints(self) -> NDArray[np.int64]:
        """Return the 0-based joints that have a profile, (j,)."""
        return np.array(self.joints, dtype=int) - 1

    def _waves(self, q: Floats) -> Floats:
        """Evaluate b0 and the harmonics of every joint, (j, m, n), as far as surveyed.

        Sine and cosine of k theta come from those of (k - 1) theta, which takes a
        quarter of the time and is as good but for the last digit.
        """
        angle = np.ascontiguousarray(q[:, self._profile_joints].T)
        waves = np.ones((len(angle), self.constant + 2 * len(self.orders), len(q)))
        sin, cos = np.sin(angle), np.cos(angle)
        s, c = np.zeros_like(sin), np.ones_like(cos)
        for k in range(1, max(self.orders, default=0) + 1):
            s, c = s * cos + c * sin, c * cos - s * sin
            if k in self.orders:
                at = self.constant + 2 * self.orders.index(k)
                waves[:, at], waves[:, at + 1] = s, c
        within = fade_turns(q, np.array(self.lower), np.array(self.upper))
        if (within != 1.0).any():
            waves[:, int(self.constant) :] *= within.T[self._profile_joints, None]
        return waves
