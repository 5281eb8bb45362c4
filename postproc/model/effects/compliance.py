"""Compliance: a joint yields to the weight that it carries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import carrying
from postproc.model.effects.effect import (
    Candidate,
    JointEffect,
    Parameter,
    Unasked,
    alternatives,
)
from postproc.model.kinematics import Batch
from postproc.robot.arm import Arm

SCALE = 1e-7  # [rad/(N m)] softness of a usual gear
UNSURE = 0.1  # share of the nominal moments by which real links differ
UNSURE_PAYLOAD = 0.1  # [m] how well a payload's centre of mass is known
MASS_UNKNOWN = 10.0  # [kg] at a link's end, of an arm whose links are not known
YIELDING = (2, 3, 5)  # joints that carry weight on most arms
AXES = "xyz"


def moments(arm: Arm, joint: int) -> tuple[tuple[int, float], ...]:
    """List the links whose first moments load a joint, with what is unsure of them.

    Of an arm whose links are not known all of the moments is unsure: what the joint
    yields by has the shapes of gravity, and the data alone say how much of each.

    Returns:
        (link, standard deviation of its moment [kg m]) of the joint's own link, which
        stands for all that is fixed to it, and of the next one.
    """
    links, out = arm.file.links, []
    for link in range(joint, min(joint + 2, 7)):
        length = float(np.hypot(arm.dh.a[link - 1], arm.dh.d[link - 1]))
        if links is None:
            out.append((link, MASS_UNKNOWN * length + 0.1))
            continue
        mass, com = np.array(links.mass_kg), np.array(links.com_mm) * 1e-3
        own = mass[link - 1] * np.linalg.norm(com[link - 1])
        out.append((link, float(UNSURE * (own + mass[link:].sum() * length) + 0.1)))
    return tuple(out)


@dataclass(frozen=True)
class Compliance(JointEffect):
    """Joint error torque / stiffness, with link moments that the data may correct.

    The torque is that of the nominal links and of the declared payload. Torque is
    linear in the links' first moments, so their deviations are columns too.

    Attributes:
        joints: Joints that yield.
        moments: Per joint, (link, standard deviation of its first moment [kg m]).
        payload: Whether the payload's centre of mass is to be corrected too.
    """

    name: ClassVar[str] = "compliance"
    driven_by: ClassVar[str] = "torque"
    unasked: ClassVar[Unasked | None] = "weighed"

    joints: tuple[int, ...] = YIELDING
    moments: tuple[tuple[tuple[int, float], ...], ...] = ((), (), ())
    payload: bool = False

    @classmethod
    def on(cls, arm: Arm, joints: tuple[int, ...], payload: bool) -> Compliance:
        """Make the effect for some joints of an arm."""
        return cls(joints, tuple(moments(arm, j) for j in joints), payload)

    @classmethod
    def propose(cls, arm: Arm, states: object) -> Compliance:
        """Let the joints yield that carry weight."""
        carried = getattr(states, "payload", np.zeros(0))
        return cls.on(arm, YIELDING, bool(np.nan_to_num(carried).any()))

    @classmethod
    def candidates(cls, batch: Batch) -> list[Candidate]:
        """Try every joint that carries weight, or may if no weight is known."""
        loaded = bool(np.nan_to_num(batch.states.payload).any())
        return [
            c
            for j in carrying(batch) or YIELDING
            for c in alternatives([(cls.on(batch.arm, (j,), loaded), f"torque {j}")], j)
        ]

    def parameters(self) -> tuple[Parameter, ...]:
        """Name softness, and moments over stiffness, joint by joint."""
        out = []
        for j, links in zip(self.joints, self.moments, strict=True):
            out.append(Parameter(f"k{j}", "rad/(N m)", SCALE, f"{j}", j, True))
            for link, spread in links:
                out += [
                    Parameter(f"k{j}_m{link}{a}", "rad kg/N", SCALE * spread, f"{j}", j)
                    for a in AXES
                ]
            if self.payload:
                wide = SCALE * UNSURE_PAYLOAD
                out += [
                    Parameter(f"k{j}_com_{a}", "rad/N", wide, f"{j}", j) for a in AXES
                ]
        return tuple(out)

    def basis(self, batch: Batch) -> Floats:
        """Evaluate torque [N m] and torque per unit of moment, (n, p)."""
        torque = batch.loads.gravity + batch.loads.payload
        unit = batch.loads.basis.reshape(len(batch), 6, 6, 4)
        mass = np.nan_to_num(batch.states.payload)[:, None]
        columns = []
        for j, links in zip(self.joints, self.moments, strict=True):
            columns.append(torque[:, j - 1 : j])
            columns += [unit[:, j - 1, link - 1, 1:] for link, _ in links]
            if self.payload:
                columns.append(mass * unit[:, j - 1, 5, 1:])
        return np.concatenate(columns, axis=1)
