"""Payload: a joint yields to the payload, beyond what its own weight does."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import carrying, varies
from postproc.model.effects.compliance import AXES, SCALE, UNSURE_PAYLOAD
from postproc.model.effects.effect import (
    Candidate,
    JointEffect,
    Origin,
    Parameter,
    alternatives,
)
from postproc.model.effects.policies import FitPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Term, Terms, about_joint, linear, turn_joint, weight
from postproc.robot.arm import Arm

UNSURE_LEVER = 0.5  # [m] along the links of an arm of this size


@dataclass(frozen=True)
class Payload(JointEffect):
    """Joint error payload torque / stiffness, with levers that the data may correct.

    A structure that bends under a load does not turn its joints quite as the torque
    about them says, so levers along the joint's own link and the next one are columns
    too, besides the payload's centre of mass.

    Attributes:
        joints: Joints that yield.
    """

    name: ClassVar[str] = "payload"
    renewed_by: ClassVar[frozenset[str]] = frozenset({"payload", "arm"})
    acts: ClassVar[tuple[tuple[str, str], ...]] = (("joint", "payload"),)
    driven_by: ClassVar[str] = "payload"
    fit_policy: ClassVar[FitPolicy] = FitPolicy.IF_EVIDENT

    joints: tuple[int, ...] = (2, 3, 5)

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try every joint that carries weight, where the payload varies."""
        if not varies(batch.states.payload):
            return []
        return [
            c
            for j in carrying(batch)
            for c in alternatives([(cls((j,)), "payload")], j)
        ]

    def pieces(self) -> tuple[Self, ...]:
        """Return the effect of each joint alone."""
        return tuple(replace(self, joints=(j,)) for j in self.joints)

    def belongs_to(self) -> Origin:
        """Say that it is of the state: the cell declares the payload."""
        return "state"

    def requires(self) -> tuple[str, ...]:
        """Need the payload."""
        return ("payload",)

    def _places(self, joint: int) -> list[tuple[str, int, float]]:
        """List name, link and standard deviation [m] of a joint's levers."""
        links = range(joint, min(joint + 2, 6))
        own = [(f"lever{link}", link, UNSURE_LEVER) for link in links]
        return [*own, ("com", 6, UNSURE_PAYLOAD)]

    def parameters(self) -> tuple[Parameter, ...]:
        """Name softness, and softness times the change of every lever."""
        out = []
        for j in self.joints:
            out.append(Parameter(f"k{j}", "rad/(N m)", SCALE, f"{j}", j, True))
            out += [
                Parameter(f"k{j}_{name}_{a}", "rad/N", SCALE * spread, f"{j}", j)
                for name, _, spread in self._places(j)
                for a in AXES
            ]
        return tuple(out)

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn every joint by the torque of a load that is scaled and moved."""
        out, left = [], list(p)
        for j in self.joints:
            carried, places = float(left.pop(0)), np.zeros((6, 3))
            for _, link, _ in self._places(j):
                places[link - 1] += [left.pop(0) for _ in AXES]
            none = np.zeros((6, 4))
            load = weight(arm, about_joint(arm, j), none, carried, places)
            out.append(Term(turn_joint(j), linear(1.0), (load,)))
        return out

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate the payload's torque, and that per metre of every lever, (n, p)."""
        unit = batch.loads.basis.reshape(len(batch), 6, 6, 4)
        mass = np.nan_to_num(batch.states.payload)[:, None]
        columns = []
        for j in self.joints:
            columns.append(batch.loads.payload[:, j - 1 : j])
            columns += [
                mass * unit[:, j - 1, link - 1, 1:] for _, link, _ in self._places(j)
            ]
        return np.concatenate(columns, axis=1)
