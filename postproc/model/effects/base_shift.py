"""Base shift: the foundation gives way, or the tracker is knocked, at one moment."""

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

SHIFT, TURN = 1e-4, 5e-5  # [m], [rad]
AXES = "xyz"


def rigid_columns(batch: ArmStates) -> Floats:
    """Differentiate the TCP by a shift and a turn of the base frame, (n, 3, 6)."""
    return rigid_motions(batch.walk.tcp)


def rigid_motions(points: Floats) -> Floats:
    """Differentiate points (n, 3) by a shift, and a turn about zero, (n, 3, 6)."""
    moved = [np.tile(np.eye(3)[k], (len(points), 1)) for k in range(3)]
    moved += [np.cross(np.eye(3)[k], points) for k in range(3)]
    return np.stack(moved, axis=2)


def rigid_rotations(batch: ArmStates) -> Floats:
    """Differentiate the tool's rotation by the same six motions, (n, 3, 6)."""
    turned = np.concatenate([np.zeros((3, 3)), np.eye(3)], axis=1)
    return np.tile(turned, (len(batch), 1, 1))


@dataclass(frozen=True)
class BaseShift(CampaignStep):
    """A step of the base frame: a shift and a turn at one row."""

    name: ClassVar[str] = "base_shift"
    search_policy: ClassVar[SearchPolicy] = SearchPolicy.RIVAL
    cells: ClassVar[Cells] = cells_in_time("base", "step")

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try moments all along the campaign."""
        return alternatives([(cls(float(r)), "order") for r in moments(batch)])

    def parameters(self) -> tuple[Parameter, ...]:
        """Name shift and turn, from before to after."""
        group = f"row {self.row:g}"
        shift = [Parameter(f"{a}_row{self.row:g}", "m", SHIFT, group) for a in AXES]
        turn = [Parameter(f"r{a}_row{self.row:g}", "rad", TURN, group) for a in AXES]
        return (*shift, *turn)

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position, (n, 3, 6)."""
        before = self.before(batch)[:, None, None]
        return np.where(before, -rigid_columns(batch), 0.0)

    def rotation_columns(self, batch: ArmStates) -> Floats:
        """Differentiate the tool's rotation, (n, 3, 6)."""
        before = self.before(batch)[:, None, None]
        return np.where(before, -rigid_rotations(batch), 0.0)
