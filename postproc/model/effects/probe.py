"""Probe: every nest of a survey's probe plate sits a little off its nominal place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.effect import Effect, Origin, Parameter
from postproc.model.kinematics import ArmStates
from postproc.robot.arm import Arm
from postproc.robot.state import States

SCALE = 5e-5  # [m]


@dataclass(frozen=True)
class ProbeEffect(Effect):
    """What is off at every probe point by itself.

    Attributes:
        tools: The `tool_id` of the points.
    """

    tools: tuple[int, ...] = (0,)

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """List the survey's probe points."""
        return cls(tuple(int(t) for t in np.unique(states.tool_id)))

    def belongs_to(self) -> Origin:
        """Say that it is the set-up's."""
        return "setup"

    def flange_axes(self, batch: ArmStates) -> Floats:
        """Return the flange's axes, at the point that a row measures, (n, 3, p)."""
        R = batch.walk.flange
        parts = [R * (batch.states.tool_id == t)[:, None, None] for t in self.tools]
        return np.concatenate(parts, axis=2)


@dataclass(frozen=True)
class Probe(ProbeEffect):
    """Shift of every probe point in the flange frame, besides the tool's own."""

    name: ClassVar[str] = "probe"

    def parameters(self) -> tuple[Parameter, ...]:
        """Name three shifts per point."""
        return tuple(
            Parameter(f"{a}_{t}", "m", SCALE, "nest") for t in self.tools for a in "xyz"
        )

    def columns(self, batch: ArmStates) -> Floats:
        """Shift the point that a row measures, (n, 3, p)."""
        return self.flange_axes(batch)
