"""Transmission error: a gear or encoder runs out of centre, or its teeth show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.effect import JointEffect, Parameter
from postproc.model.kinematics import Batch

SCALE = 5e-5  # [rad]


@dataclass(frozen=True)
class Transmission(JointEffect):
    """Joint error s sin(k theta) + c cos(k theta), for some joints and orders.

    Attributes:
        waves: (joint, order k per turn of the joint) of every wave. Orders need not be
            whole numbers: a gear's input side turns faster than the joint.
    """

    name: ClassVar[str] = "transmission"

    waves: tuple[tuple[int, float], ...] = tuple(
        (j, float(k)) for j in range(1, 7) for k in (1, 2)
    )

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
