"""Transmission error: a gear or encoder runs out of centre, or its teeth show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import JOINTS
from postproc.model.effects.effect import (
    NAMED,
    Candidate,
    Effect,
    Family,
    JointEffect,
    Parameter,
    Unasked,
)
from postproc.model.kinematics import Batch

SCALE = 5e-5  # [rad]
ECCENTRIC = (1.0, 2.0)  # orders of a gear or encoder out of centre
FIRST_FREE, LAST_FREE = 3.0, 60.0  # orders of a gear's teeth
LOWEST = 2.5  # order that refining never falls below
FINEST = 0.25  # step of the free orders


@dataclass(frozen=True)
class Transmission(JointEffect):
    """Joint error s sin(k theta) + c cos(k theta), for some joints and orders.

    Attributes:
        waves: (joint, order k per turn of the joint) of every wave. Orders need not be
            whole numbers: a gear's input side turns faster than the joint.
    """

    name: ClassVar[str] = "transmission"
    unasked: ClassVar[Unasked | None] = "weighed"

    waves: tuple[tuple[int, float], ...] = tuple(
        (j, float(k)) for j in range(1, 7) for k in (1, 2)
    )

    @classmethod
    def candidates(cls, batch: Batch) -> list[Candidate]:
        """Try every joint: half of the prior is eccentricity's, half the teeth's."""
        half, out = float(np.log(0.5)), []
        for j in JOINTS:
            low = [cls(((j, k),)) for k in ECCENTRIC]
            high = [cls(((j, float(k)),)) for k in _free_orders(batch, j)]
            family = Family(cls.name, j, None, NAMED)
            for members in (low, high):
                share = half - float(np.log(len(members)))
                out += [Candidate(family, e, f"joint {j}", share) for e in members]
        return out

    def refined(self, offsets: Floats, batch: Batch) -> list[Effect]:
        """Change the order of one wave; those of eccentricity are what they are."""
        (joint, order), *others = self.waves
        if others or order <= ECCENTRIC[-1]:
            return []
        step = np.pi / _covered(batch, joint)
        tries = np.unique(np.clip(order + step * offsets, LOWEST, LAST_FREE))
        return [Transmission(((joint, float(k)),)) for k in tries]

    def plainer(self) -> Effect:
        """Return waves of whole orders: gears have whole numbers of teeth."""
        return Transmission(tuple((j, float(round(k))) for j, k in self.waves))

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell the order of the first wave."""
        return {"order": (float(self.waves[0][1]), "1/turn")}

    def parameters(self) -> tuple[Parameter, ...]:
        """Name sine and cosine of every wave."""
        return tuple(
            Parameter(f"{wave}{j}_{k:g}", "rad", SCALE, f"{j} order {k:g}", j)
            for j, k in self.waves
            for wave in ("sin", "cos")
        )

    def basis(self, batch: Batch) -> Floats:
        """Evaluate the waves, (n, p)."""
        joint = np.array([j - 1 for j, _ in self.waves])
        order = np.array([k for _, k in self.waves])
        angle = batch.states.q[:, joint] * order
        both = np.stack([np.sin(angle), np.cos(angle)], axis=2)
        return both.reshape(len(batch), 2 * len(self.waves))


def _covered(batch: Batch, joint: int) -> float:
    """Return the surveyed range of a joint, a tenth of a radian at least [rad]."""
    return max(float(np.ptp(batch.states.q[:, joint - 1])), 0.1)


def _free_orders(batch: Batch, joint: int) -> Floats:
    """Give the free orders to try: steps of half of what the range resolves."""
    step = max(np.pi / _covered(batch, joint), FINEST)
    return np.arange(FIRST_FREE, LAST_FREE, step)
