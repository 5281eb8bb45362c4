"""Sightings: what a tracker reads wrongly, depending on where the point lies to it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from postproc.arrays import Floats
from postproc.exceptions import PostprocError
from postproc.model.effects.effect import Effect, Origin
from postproc.model.effects.policies import FitPolicy
from postproc.model.kinematics import ArmStates


@dataclass(frozen=True)
class Sighting(Effect):
    """An error of the reading along the beam of the tracker; the arm has no part in it.

    Its vertical axis is taken to be that of the arm's base frame.

    Attributes:
        tracker: Where the tracker stands, base frame [m].
        told: Whether somebody said so; else its place is found by a search, from what
            it reads wrongly.
    """

    fit_policy: ClassVar[FitPolicy] = FitPolicy.WITH_TRACKER

    tracker: tuple[float, float, float] = (0.0, 0.0, 0.0)
    told: bool = True

    def see_from(self, tracker: tuple[float, float, float] | None) -> Self:
        """Put the tracker where it stands.

        Raises:
            PostprocError: Nobody knows where.
        """
        if tracker is None:
            raise PostprocError(
                f"effect {self.name} needs the tracker's place. Add [tracker] xyz_mm "
                "to the cell, or give positions in the tracker's frame"
            )
        return replace(self, tracker=tracker)

    def belongs_to(self) -> Origin:
        """Say that it is the set-up's."""
        return "setup"

    def beam(self, batch: ArmStates) -> Floats:
        """Return the way from the tracker to the TCP, (n, 3) [m]."""
        return np.asarray(batch.walk.tcp - np.array(self.tracker))
