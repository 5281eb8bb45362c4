"""What a registration is off by: tracker and probe points.

Both are found from the same rows as the model, coarsely before the fit, then finely
as this effect of the set-up beside the arm's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.base_shift import rigid_columns, rigid_rotations
from postproc.model.effects.effect import Effect, Origin, Parameter
from postproc.model.kinematics import Batch
from postproc.robot.arm import Arm
from postproc.robot.state import States

SHIFT, TURN = 3e-3, 3e-3  # [m], [rad] how far off the coarse registration may be


@dataclass(frozen=True)
class Placement(Effect):
    """What the coarse registration is still off by: tracker and probe points.

    It belongs to the set-up: the base frame is only known through the arm itself.

    Attributes:
        tools: The `tool_id` of the probe points.
        stations: The places of the tracker, each with its own shift and turn.
    """

    name: ClassVar[str] = "registration"

    tools: tuple[int, ...] = (0,)
    stations: tuple[int, ...] = (0,)

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Placement:
        """List the survey's probe points and stations."""
        return cls(
            tuple(int(t) for t in np.unique(states.tool_id)),
            tuple(int(s) for s in np.unique(states.station)) or (0,),
        )

    def belongs_to(self) -> Origin:
        """Say that it is the set-up's."""
        return "setup"

    def parameters(self) -> tuple[Parameter, ...]:
        """Name shift and turn of the tracker, then the shift of every point."""
        out = []
        for number in range(len(self.stations)):
            of = f"tracker{number + 1}" if number else "tracker"
            out += [Parameter(f"{of}_{a}", "m", SHIFT, "tracker") for a in "xyz"]
            out += [Parameter(f"{of}_r{a}", "rad", TURN, "tracker") for a in "xyz"]
        out += [
            Parameter(f"probe{t}_{a}", "m", SHIFT, "probe")
            for t in self.tools
            for a in "xyz"
        ]
        return tuple(out)

    def points(self, part: slice) -> slice:
        """Say which of its columns are the probe points', point by point."""
        return slice(part.start + 6 * len(self.stations), part.stop)

    def columns(self, batch: Batch) -> Floats:
        """Differentiate the measured position, (n, 3, 6 s + 3 k)."""
        flange, which = batch.walk.flange, batch.states.tool_id
        points = [flange * (which == t)[:, None, None] for t in self.tools]
        placed = self._by_station(batch, rigid_columns(batch))
        return np.concatenate([*placed, *points], axis=2)

    def rotation_columns(self, batch: Batch) -> Floats:
        """Differentiate the measured orientation, (n, 3, 6 s + 3 k)."""
        still = np.zeros((len(batch), 3, 3 * len(self.tools)))
        placed = self._by_station(batch, rigid_rotations(batch))
        return np.concatenate([*placed, still], axis=2)

    def _by_station(self, batch: Batch, moved: Floats) -> list[Floats]:
        """Give motions (n, 3, 6) to the rows of every station; one has all rows."""
        if len(self.stations) == 1:
            return [moved]
        at = batch.states.station
        return [moved * (at == s)[:, None, None] for s in self.stations]
