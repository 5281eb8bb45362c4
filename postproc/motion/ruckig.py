"""Time laws of JOINT moves between stops. The only importer of ruckig.

Always state to state: intermediate waypoints would call a remote service.
(Berscheid and Kroeger: Jerk-limited Real-time Trajectory Generation with Arbitrary
Target States, RSS 2021.)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import ruckig

from postproc.arrays import Floats
from postproc.exceptions import PlanError
from postproc.robot.arm import Arm

MOMENTS = 33  # at which a move is looked at


@dataclass(frozen=True, eq=False)
class JointMove:
    """The time law of one JOINT move.

    Attributes:
        duration: [s].
        peaks: Largest velocities [rad/s] and accelerations [rad/s^2], (2, 6).
    """

    duration: float
    _trajectory: Any

    @property
    def peaks(self) -> Floats:
        """Sample the whole move: jerk changes at a few moments alone."""
        times = np.linspace(0.0, self.duration, MOMENTS)
        told = np.array([self._trajectory.at_time(t)[1:] for t in times.tolist()])
        return np.asarray(np.abs(told).max(axis=0))

    def at(self, time: float) -> tuple[Floats, Floats, Floats]:
        """Return joint angles, velocities and accelerations, (6,) each, at a time."""
        q, v, a = self._trajectory.at_time(time)
        return np.array(q), np.array(v), np.array(a)


class JointMoves:
    """Computes JOINT moves of one arm, all axes in phase, from stop to stop."""

    def __init__(self, arm: Arm) -> None:
        """Take the limits of an arm."""
        self._otg = ruckig.Ruckig(6)
        self._input = ruckig.InputParameter(6)
        self._input.synchronization = ruckig.Synchronization.Phase
        self._arm = arm

    def move(self, begin: Floats, end: Floats, override: float = 1.0) -> JointMove:
        """Plan one move.

        Args:
            begin: Joint angles at the start, (6,) [rad].
            end: Joint angles at the end, (6,) [rad].
            override: Share of the arm's velocity; acceleration and jerk scale with its
                square and cube, as when the whole time law is stretched.

        Raises:
            PlanError: ruckig finds no time law.
        """
        given, arm = self._input, self._arm
        given.current_position, given.target_position = begin.tolist(), end.tolist()
        given.max_velocity = (arm.velocity * override).tolist()
        given.max_acceleration = (arm.acceleration * override**2).tolist()
        given.max_jerk = (arm.jerk * override**3).tolist()
        trajectory = ruckig.Trajectory(6)
        try:
            result = self._otg.calculate(given, trajectory)
        except (ruckig.RuckigError, ValueError) as error:  # ValueError: its own result
            raise PlanError(f"no time law for a JOINT move: {error}") from error
        if result not in (ruckig.Result.Working, ruckig.Result.Finished):
            raise PlanError(f"no time law for a JOINT move: {result}")
        return JointMove(float(trajectory.duration), trajectory)
