"""Tool shift: the tool slips in its holder, or a nest is moved, at one moment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.effect import (
    Candidate,
    Cells,
    Parameter,
    alternatives,
    cells_in_time,
)
from postproc.model.effects.policies import SearchPolicy
from postproc.model.effects.step import CampaignStep, moments
from postproc.model.kinematics import ArmStates

SHIFT, TURN = 1e-4, 2e-4  # [m], [rad]
AXES = "xyz"


@dataclass(frozen=True)
class ToolShift(CampaignStep):
    """A step of the tool in the flange frame at one row.

    Attributes:
        turns: Whether the tool may also turn, which several probe points show.
    """

    name: ClassVar[str] = "tool_shift"
    search_policy: ClassVar[SearchPolicy] = SearchPolicy.RIVAL
    cells: ClassVar[Cells] = cells_in_time("tool", "step")

    turns: bool = False

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try moments all along the campaign."""
        several = len(np.unique(batch.states.tool.round(6), axis=0)) > 1
        return alternatives([(cls(float(r), several), "order") for r in moments(batch)])

    def parameters(self) -> tuple[Parameter, ...]:
        """Name shift and turn, from before to after, in the flange frame."""
        group = f"row {self.row:g}"
        shift = [Parameter(f"{a}_row{self.row:g}", "m", SHIFT, group) for a in AXES]
        turn = [Parameter(f"r{a}_row{self.row:g}", "rad", TURN, group) for a in AXES]
        return (*shift, *(turn if self.turns else ()))

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position, (n, 3, p)."""
        axes, before = batch.walk.flange, self.before(batch)
        if self.turns:
            arms = np.cross(np.eye(3)[None], batch.states.tool[:, None, :])
            axes = np.concatenate([axes, axes @ np.swapaxes(arms, 1, 2)], axis=2)
        return np.where(before[:, None, None], -axes, 0.0)

    def rotation_columns(self, batch: ArmStates) -> Floats | None:
        """Differentiate the tool's rotation, (n, 3, p)."""
        if not self.turns:
            return None
        axes, before = batch.walk.flange, self.before(batch)
        axes = np.concatenate([np.zeros_like(axes), axes], axis=2)
        return np.where(before[:, None, None], -axes, 0.0)
