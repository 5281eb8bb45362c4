"""Azimuth: the tracker's horizontal circle does not run true."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.effect import Candidate, Effect, Parameter, alternatives
from postproc.model.effects.sighting import Sighting
from postproc.model.kinematics import ArmStates

TURN = 2e-5  # [rad]
NEAREST, FARTHER, RINGS = 1.5, 2.0**0.5, 7  # [m], ratio: rings of places to try
BEARINGS = 24  # places of a ring
CLEAR = 0.3  # [m] that the TCP keeps of the tracker's vertical axis


@dataclass(frozen=True)
class Azimuth(Sighting):
    """Angle error a sin(azimuth) + b cos(azimuth) about the tracker's vertical axis."""

    name: ClassVar[str] = "azimuth"
    acts: ClassVar[tuple[tuple[str, str], ...]] = (("base turn", "joint"),)

    @classmethod
    def propose_sighted(
        cls, batch: ArmStates, tracker: tuple[float, float, float] | None
    ) -> list[Candidate]:
        """Try it at the tracker's place, or where the tracker may stand."""
        if tracker:
            return alternatives([(cls(tracker), "joint 1")])
        # Round the base: its height changes nothing.
        rings = NEAREST * FARTHER ** np.arange(RINGS)
        turns = 2 * np.pi * np.arange(BEARINGS) / BEARINGS
        round_it = [cls._at(r, t) for r, t in product(rings, turns)]
        places = cls._clear(batch, round_it)
        return alternatives([(place, "joint 1") for place in places])

    @classmethod
    def _at(cls, reach: float, turn: float) -> Azimuth:
        """Put the tracker on a ring [m], at a bearing from the base [rad]."""
        x, y = reach * np.cos(turn), reach * np.sin(turn)
        return cls((float(x), float(y), 0.0), told=False)

    @staticmethod
    def _clear(batch: ArmStates, places: list[Azimuth]) -> list[Effect]:
        """Leave out what stands where the arm works."""
        level = [np.hypot(*p.beam(batch)[:, :2].T).min() for p in places]
        return [p for p, near in zip(places, level, strict=True) if near > CLEAR]

    def refine(self, offsets: Floats, batch: ArmStates) -> list[Effect]:
        """Move a tracker whose place nobody told."""
        if self.told:
            return []
        x, y, _ = self.tracker
        reach, turn, step = np.hypot(x, y), np.arctan2(y, x), 2 * np.pi / BEARINGS
        moved = [
            self._at(reach * FARTHER**far, turn + step * aside)
            for far, aside in product(offsets, offsets)
        ]
        return self._clear(batch, moved)

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell where the tracker seems to stand, where nobody told."""
        places = zip("xy", self.tracker[:2], strict=True)
        return {} if self.told else {f"tracker_{a}": (w, "m") for a, w in places}

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the two parts of the wave."""
        return tuple(Parameter(part, "rad", TURN, "circle") for part in ("sin", "cos"))

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the reading, (n, 3, 2)."""
        x, y, _ = self.beam(batch).T
        across = np.column_stack([-y, x, np.zeros_like(x)])
        bearing = np.column_stack([y, x]) / np.maximum(np.hypot(x, y), 1e-9)[:, None]
        return np.asarray(across[:, :, None] * bearing[:, None, :])
