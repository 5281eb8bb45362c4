"""JOINT moves in time, by ruckig, state to state: a door of the second opinion's own.

Waypoints would call a remote service.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import Floats
from postproc.verify.toppra_run import TimedRun

SAMPLES = 24  # of a move


def move_in_time(begin: Floats, end: Floats, limits: Floats) -> TimedRun | None:
    """Find the trajectory of a JOINT move, all axes in phase.

    Args:
        begin: Joint angles, (6,) [rad].
        end: Joint angles, (6,) [rad].
        limits: Velocity, acceleration and jerk of the joints, (3, 6).

    Returns:
        The move, or None where ruckig finds no time law.
    """
    import ruckig

    given, found = ruckig.InputParameter(6), ruckig.Trajectory(6)
    given.current_position, given.target_position = begin.tolist(), end.tolist()
    most = limits.tolist()
    given.max_velocity, given.max_acceleration, given.max_jerk = most
    given.synchronization = ruckig.Synchronization.Phase
    try:
        result = ruckig.Ruckig(6).calculate(given, found)
    except (ruckig.RuckigError, ValueError):
        return None
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        return None
    times = np.linspace(0.0, found.duration, SAMPLES).tolist()
    q = np.array([found.at_time(t)[0] for t in times])
    return TimedRun(q, float(found.duration))
