"""Probe turn: a 6D probe does not sit on the flange quite as declared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.effect import Parameter
from postproc.model.effects.probe import ProbeEffect
from postproc.model.kinematics import ArmStates

SCALE = 1e-4  # [rad] of a mounting that was measured


@dataclass(frozen=True)
class ProbeTurn(ProbeEffect):
    """Turn of a 6D probe in the flange frame. It moves no point, only orientations.

    A turn of the flange about the TCP and a turn of the probe look the same: the
    flange is seen as well as the probe's mounting is known.
    """

    name: ClassVar[str] = "probe_turn"

    def parameters(self) -> tuple[Parameter, ...]:
        """Name three turns per point."""
        return tuple(
            Parameter(f"r{a}_{t}", "rad", SCALE, "mounting")
            for t in self.tools
            for a in "xyz"
        )

    def columns(self, batch: ArmStates) -> Floats:
        """Move nothing, (n, 3, p)."""
        return np.zeros((len(batch), 3, 3 * len(self.tools)))

    def rotation_columns(self, batch: ArmStates) -> Floats:
        """Turn the probe that a row measures, (n, 3, p)."""
        return self.flange_axes(batch)
