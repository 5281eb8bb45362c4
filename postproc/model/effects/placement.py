"""What a registration is off by: tracker and probe points.

Both are found from the same rows as the model, coarsely before the fit, then finely
as this effect of the set-up beside the arm's own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.model.effects.base_shift import (
    rigid_columns,
    rigid_motions,
    rigid_rotations,
)
from postproc.model.effects.effect import Effect, Origin, Parameter
from postproc.model.kinematics import ArmStates
from postproc.robot.arm import Arm
from postproc.robot.state import States

SHIFT, TURN = 3e-3, 3e-3  # [m], [rad] how far off the coarse registration may be
POINT = 0.3  # [m] how far from its point a probe may sit that no row shows
TURNED = 0.03  # [rad] rms turn of the tool from which a probe's place shows
ROUGH = 1e-3  # [m] what a nominal arm is off by, which a slight turn must exceed


@dataclass(frozen=True)
class UnseenAxis:
    """A direction along which hardly any row shows where the probe sits.

    Attributes:
        axis: Unit vector in the flange frame.
        follow: Shift and turn of every station that follow a probe's shift along it,
            (6 s,) [1], [rad/m].
        std: How far off the probe may be along it [m].
    """

    axis: tuple[float, ...]
    follow: tuple[float, ...]
    std: float


def unseen_axes(flange: Floats, tcp: Floats, station: Ints) -> tuple[UnseenAxis, ...]:
    """Find directions along which no row shows where a probe sits.

    A tool that never turned shows none; one that turned about one axis shows all but
    that axis. The tracker's place then follows the probe's.

    Args:
        flange: Rotations of the flange, (n, 3, 3).
        tcp: Probe points, base frame, (n, 3) [m].
        station: Station of every row, (n,), from 0.

    Returns:
        The directions: what a prior says of the probe there counts, and what rows show
        beside the errors of a nominal arm.
    """
    count = int(station.max(initial=0)) + 1
    follow, shown = np.zeros((count, 6, 3)), np.zeros((len(tcp), 3, 3))
    for s in range(count):
        rows = station == s
        rigid, own = rigid_motions(tcp[rows]).reshape(-1, 6), flange[rows]
        follow[s] = -np.linalg.lstsq(rigid, own.reshape(-1, 3))[0]
        shown[rows] = own + (rigid @ follow[s]).reshape(-1, 3, 3)
    flat = shown.reshape(-1, 3)
    size, axes = np.linalg.eigh(flat.T @ flat / max(len(tcp), 1))
    turned = np.sqrt(np.maximum(size, 0.0))
    std = 1.0 / np.sqrt(1.0 / POINT**2 + len(tcp) * (turned / ROUGH) ** 2)
    return tuple(
        UnseenAxis(
            tuple(axis.tolist()), tuple((follow @ axis).reshape(-1).tolist()), float(s)
        )
        for axis, s, turn in zip(axes.T, std, turned, strict=True)
        if turn < TURNED
    )


@dataclass(frozen=True)
class Placement(Effect):
    """What the coarse registration is still off by: tracker and probe points.

    It belongs to the set-up: the base frame is only known through the arm itself.

    Attributes:
        tools: The `tool_id` of the probe points.
        stations: The places of the tracker, each with its own shift and turn.
        unseen: Directions along which no row shows where the probe sits: its prior
            alone says where, and nothing is fitted along them.
    """

    name: ClassVar[str] = "registration"

    tools: tuple[int, ...] = (0,)
    stations: tuple[int, ...] = (0,)
    unseen: tuple[tuple[tuple[float, ...], tuple[float, ...], float], ...] = ()

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Placement:
        """List the survey's probe points and stations, and what no row shows."""
        found = cls(
            tuple(int(t) for t in np.unique(states.tool_id)),
            tuple(int(s) for s in np.unique(states.station)) or (0,),
        )
        if len(states) == 0:
            return found
        walk, which = ArmStates(arm, states).walk, np.array(found.stations)
        number = np.searchsorted(which, states.station)
        hidden = unseen_axes(walk.flange, walk.tcp, number)
        return replace(found, unseen=tuple((u.axis, u.follow, u.std) for u in hidden))

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

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the measured position, (n, 3, 6 s + 3 k)."""
        flange, which = batch.walk.flange, batch.states.tool_id
        points = [flange * (which == t)[:, None, None] for t in self.tools]
        placed = self._by_station(batch, rigid_columns(batch))
        return np.concatenate([*placed, *points], axis=2)

    def unknown_variance(self, at: ArmStates) -> Floats | None:
        """Return the variance of readings by what no row shows, (n, 3) [m^2]."""
        if not self.unseen:
            return None
        nominal, out = ArmStates(at.arm, at.states), np.zeros((len(at), 3))
        own = self._by_station(nominal, rigid_columns(nominal))
        placed, flange = np.concatenate(own, axis=2), nominal.walk.flange
        for axis, follow, std in self.unseen:
            moved = flange @ np.array(axis) + placed @ np.array(follow)
            out += (std * moved) ** 2
        return out

    def rotation_columns(self, batch: ArmStates) -> Floats:
        """Differentiate the measured orientation, (n, 3, 6 s + 3 k)."""
        still = np.zeros((len(batch), 3, 3 * len(self.tools)))
        placed = self._by_station(batch, rigid_rotations(batch))
        return np.concatenate([*placed, still], axis=2)

    def _by_station(self, batch: ArmStates, moved: Floats) -> list[Floats]:
        """Give motions (n, 3, 6) to the rows of every station; one has all rows."""
        if len(self.stations) == 1:
            return [moved]
        at = batch.states.station
        return [moved * (at == s)[:, None, None] for s in self.stations]
