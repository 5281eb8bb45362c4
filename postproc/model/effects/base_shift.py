"""Base shift: the foundation gives way, or the tracker is knocked, at one moment."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.effect import (
    Candidate,
    Effect,
    Origin,
    Parameter,
    alternatives,
)
from postproc.model.kinematics import Batch

SHIFT, TURN = 1e-4, 5e-5  # [m], [rad]
AXES = "xyz"
STEPS = 48  # moments at which a step is tried
EDGE = 10  # rows before and after a step that must show it


def moments(batch: Batch) -> Floats:
    """List the places in the visit order at which a step is tried; none of few rows."""
    order = np.sort(batch.states.order)
    if len(order) < 3 * EDGE:
        return np.zeros(0)
    places = np.unique(np.linspace(EDGE, len(order) - EDGE, STEPS).astype(int))
    return np.asarray(order[places])


def moments_near(row: float, offsets: Floats, batch: Batch) -> Floats:
    """List the places near one, offsets (k,) in steps of `moments`."""
    order = np.sort(batch.states.order)
    half = max(len(order) / STEPS, 1.0)
    near = np.searchsorted(order, row) + np.round(half * offsets).astype(int)
    return np.asarray(order[np.unique(np.clip(near, 1, len(order) - 1))])


def rigid_columns(batch: Batch) -> Floats:
    """Differentiate the TCP by a shift and a turn of the base frame, (n, 3, 6)."""
    n, tcp = len(batch), batch.walk.tcp
    moved = [np.tile(np.eye(3)[k], (n, 1)) for k in range(3)]
    moved += [np.cross(np.eye(3)[k], tcp) for k in range(3)]
    return np.stack(moved, axis=2)


def rigid_rotations(batch: Batch) -> Floats:
    """Differentiate the tool's rotation by the same six motions, (n, 3, 6)."""
    turned = np.concatenate([np.zeros((3, 3)), np.eye(3)], axis=1)
    return np.tile(turned, (len(batch), 1, 1))


@dataclass(frozen=True)
class BaseShift(Effect):
    """A step of the base frame: a shift and a turn at one row.

    The rows after the step show the cell as it is now, so the step counts backwards:
    it moves the rows before it.

    Attributes:
        row: Place in the visit order of the first row after the step.
    """

    name: ClassVar[str] = "base_shift"
    driven_by: ClassVar[str] = "order"

    row: float = 0.0

    @classmethod
    def candidates(cls, batch: Batch) -> list[Candidate]:
        """Try moments all along the campaign."""
        return alternatives([(cls(float(r)), "order") for r in moments(batch)])

    def refined(self, offsets: Floats, batch: Batch) -> list[Effect]:
        """Move the moment."""
        rows = moments_near(self.row, offsets, batch)
        return [replace(self, row=float(r)) for r in rows]

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell the moment."""
        return {"row": (float(self.row), "rows")}

    def belongs_to(self) -> Origin:
        """Say that it is the set-up's."""
        return "setup"

    def parameters(self) -> tuple[Parameter, ...]:
        """Name shift and turn, from before to after."""
        group = f"row {self.row:g}"
        shift = [Parameter(f"{a}_row{self.row:g}", "m", SHIFT, group) for a in AXES]
        turn = [Parameter(f"r{a}_row{self.row:g}", "rad", TURN, group) for a in AXES]
        return (*shift, *turn)

    def columns(self, batch: Batch) -> Floats:
        """Differentiate the TCP position, (n, 3, 6)."""
        before = (batch.states.order < self.row)[:, None, None]
        return np.where(before, -rigid_columns(batch), 0.0)

    def rotation_columns(self, batch: Batch) -> Floats:
        """Differentiate the tool's rotation, (n, 3, 6)."""
        before = (batch.states.order < self.row)[:, None, None]
        return np.where(before, -rigid_rotations(batch), 0.0)
