"""Station shift: readings of one file lie in another base frame than the first file's.

Every station of the tracker finds the base frame by itself; what it is off by there is
a shift and a turn of all readings of that file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.base_shift import AXES, rigid_columns, rigid_rotations
from postproc.model.effects.effect import Effect, Origin, Parameter
from postproc.model.kinematics import ArmStates
from postproc.robot.arm import Arm
from postproc.robot.state import States

SHIFT, TURN = 1e-3, 1e-3  # [m], [rad] that base frames of two stations may differ by


@dataclass(frozen=True)
class StationShift(Effect):
    """Shift and turn of every further file, or station, against the first.

    Attributes:
        stations: The files or stations that are seen against the first.
    """

    name: ClassVar[str] = "station_shift"
    acts: ClassVar[tuple[tuple[str, str], ...]] = (
        ("base turn", "time"),
        ("base shift", "time"),
    )

    stations: tuple[int, ...] = (1,)

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """List all stations but the first."""
        every = np.unique(states.station)
        return cls(tuple(int(s) for s in every[1:]))

    @classmethod
    def may_show(cls, states: States) -> bool:
        """Return True if there are several stations."""
        return len(np.unique(states.station)) > 1

    def belongs_to(self) -> Origin:
        """Say that it is the survey's."""
        return "setup"

    def parameters(self) -> tuple[Parameter, ...]:
        """Name shift and turn of every station but the first, which is number 1."""
        out = []
        for s in self.stations:
            out += [
                Parameter(f"{a}_file{s + 1}", "m", SHIFT, "shift of files")
                for a in AXES
            ]
            out += [
                Parameter(f"r{a}_file{s + 1}", "rad", TURN, "turn of files")
                for a in AXES
            ]
        return tuple(out)

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position, (n, 3, 6 s)."""
        return self._by_station(batch, rigid_columns(batch))

    def rotation_columns(self, batch: ArmStates) -> Floats:
        """Differentiate the tool's rotation, (n, 3, 6 s)."""
        return self._by_station(batch, rigid_rotations(batch))

    def _by_station(self, batch: ArmStates, moved: Floats) -> Floats:
        """Give motions (n, 3, 6) to the rows of every station, (n, 3, 6 s)."""
        at = batch.states.station
        each = [moved * (at == s)[:, None, None] for s in self.stations]
        return np.concatenate([np.zeros((len(batch), 3, 0)), *each], axis=2)
