"""A program run once, in time: how long it takes, and what it asks of the joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.motion.arrival_times import ArrivalTimes
from postproc.motion.blending import blend
from postproc.motion.joint_path import Trace, trace
from postproc.motion.targets import Targets
from postproc.motion.timing import main_edges, tell_time
from postproc.robot.arm import Arm
from postproc.robot.direction import Arrivals, arrivals

SLOWED = 0.99  # of the programmed speed: what the joints allow is less
SAME_USE = 1e-6  # shares that differ by less are the same


@dataclass(frozen=True)
class ProgramCycle:
    """n moves as the controller runs them, one after the other.

    Attributes:
        targets: The moves.
        path: Their ways, fly points rounded, sampled for the time law.
        arrived: How every joint arrives.
        arm: The arm; its limits hold.
    """

    targets: Targets
    path: Trace
    arrived: Arrivals
    arm: Arm

    def __len__(self) -> int:
        """Return the number of moves."""
        return len(self.targets)

    @cached_property
    def clock(self) -> ArrivalTimes:
        """When the arm arrives, and what that asks of the joints."""
        return tell_time(self.arm, self.targets, self.path)

    @property
    def seconds(self) -> float:
        """Time of all moves from known places, each run once [s]."""
        return float(np.nan_to_num(np.nanmax(self.clock.time, initial=0.0)))

    @cached_property
    def ways(self) -> tuple[Ints, Ints]:
        """The edge by which each move is reached, and where from, (n,); else -1."""
        return main_edges(self.targets, self.path)

    @property
    def velocity_use(self) -> tuple[Floats, Ints]:
        """Largest share of its velocity that each joint uses, (6,), and where, (6,)."""
        return _largest(self.clock.velocity)

    @property
    def acceleration_use(self) -> tuple[Floats, Ints]:
        """Likewise of its acceleration."""
        return _largest(self.clock.acceleration)

    @property
    def slow_moves(self) -> Ints:
        """Moves on which the joints do not reach the programmed speed, (k,).

        There the controller slows down or faults: the joints would have to be faster,
        as they must be near singularities.
        """
        return np.flatnonzero(self.clock.allowed < SLOWED)


def _largest(use: Floats) -> tuple[Floats, Ints]:
    """Return the largest value of every column (n, 6), and its row; 0, -1 of none.

    Of rows that differ by rounding alone (limits are reached often) it is the first.
    """
    if not len(use):
        return np.zeros(6), np.full(6, -1)
    most = use.max(axis=0)
    return most, np.asarray((use >= most - SAME_USE).argmax(axis=0))


def run(arm: Arm, targets: Targets) -> ProgramCycle:
    """Run a program once, in time.

    Args:
        arm: The arm; its limits hold.
        targets: The moves.
    """
    path = blend(arm, targets, trace(arm, targets))
    arrived = arrivals(arm, path.q, path.driven)
    return ProgramCycle(targets, path, arrived, arm)
