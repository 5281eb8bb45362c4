"""Azimuth: the tracker's horizontal circle does not run true."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.effect import Candidate, Parameter, alternatives
from postproc.model.effects.sighting import Sighting
from postproc.model.kinematics import Batch

TURN = 2e-5  # [rad]


@dataclass(frozen=True)
class Azimuth(Sighting):
    """Angle error a sin(azimuth) + b cos(azimuth) about the tracker's vertical axis."""

    name: ClassVar[str] = "azimuth"

    @classmethod
    def sighted(
        cls, batch: Batch, tracker: tuple[float, float, float]
    ) -> list[Candidate]:
        """Try it."""
        return alternatives([(cls(tracker), "joint 1")])

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the two parts of the wave."""
        return tuple(Parameter(part, "rad", TURN, "circle") for part in ("sin", "cos"))

    def columns(self, batch: Batch) -> Floats:
        """Differentiate the reading, (n, 3, 2)."""
        x, y, _ = self.beam(batch).T
        across = np.column_stack([-y, x, np.zeros_like(x)])
        bearing = np.column_stack([y, x]) / np.maximum(np.hypot(x, y), 1e-9)[:, None]
        return np.asarray(across[:, :, None] * bearing[:, None, :])
