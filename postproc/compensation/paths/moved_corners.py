"""Rounded corners of the source that are passed otherwise with points beside them.

How a fly point is rounded may depend on how long the moves beside it are. What its
passage changes by is a deviation from the path of the source, as any other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints, any_in_rows
from postproc.compensation.paths.arcs import zone_sizes
from postproc.compensation.paths.path_samples import PathSamples
from postproc.motion.cycle_time import ProgramCycle
from postproc.robot.arm import Arm

LEAST = 1e-7  # [m] a corner that moves by less stays


@dataclass(frozen=True)
class SourceCorners:
    """How n visits are passed in the source; NaN where it does not make them.

    Attributes:
        aside: From each visit to where the path passes it, (n, 3) [m].
        zone: How much of the way it is rounded on, (n,) [m].
    """

    aside: Floats
    zone: Floats

    @classmethod
    def of(cls, arm: Arm, cycle: ProgramCycle, via: Bools) -> SourceCorners:
        """Look at the corners of the source; points on the ways of arcs are none."""
        aside = np.where(via[:, None], np.nan, cycle.path.aside)
        return cls(aside, zone_sizes(arm, cycle, cycle.targets))

    def at(self, own: Ints, count: int) -> SourceCorners:
        """Return them for a program with points, m visits.

        Args:
            own: Which of its visits each of the source is, (n,), -1 where none is.
            count: m.
        """
        aside, zone = np.full((count, 3), np.nan), np.zeros(count)
        known = own >= 0
        aside[own[known]], zone[own[known]] = self.aside[known], self.zone[known]
        return SourceCorners(aside, zone)

    def off(
        self, arm: Arm, cycle: ProgramCycle, ways: PathSamples, way: Floats
    ) -> Floats:
        """Return how far ways are from those of the source at corners, (s, 3) [m].

        Most at a corner, and less towards where its rounding ends.

        Args:
            arm: The arm.
            cycle: The program with points, as it was written.
            ways: Its ways.
            way: Their lengths up to every sample, (s,) [m].
        """
        moved = np.nan_to_num(cycle.path.aside - self.aside)
        moved[~any_in_rows(np.abs(moved) > LEAST)] = 0.0
        out = np.zeros((len(way), 3))
        if not moved.any():
            return out
        zone = np.maximum(self.zone, zone_sizes(arm, cycle, cycle.targets))
        whole = way[ways.first[1:] - 1][ways.way]
        for visit, aside in ((ways.visit, whole - way), (ways.source, way)):
            corner = visit[ways.way]
            share = aside / np.maximum(zone[corner], 1e-12)
            bend = np.clip(1.0 - share**2, 0.0, 1.0)
            out += bend[:, None] * moved[corner]
        return out
