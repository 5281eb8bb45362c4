"""Time laws along given paths: TOPP-RA, its linear programs solved in the core.

(Pham and Pham: A New Approach to Time-Optimal Path Parameterization Based on
Reachability Analysis, IEEE Transactions on Robotics 2018. The tests hold it to their
own implementation, toppra, which takes fifty times as long.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc import _native
from postproc.arrays import Bools, Floats
from postproc.robot.arm import Arm

FASTEST = 1e4  # bound of ds/dt where neither joints nor the program give one


@dataclass(frozen=True)
class Runs:
    """Time laws of runs from stop to stop, at their k waypoints.

    Attributes:
        s: Path positions, (k,).
        q: Joint angles, (k, 6) [rad].
        slope, curve: dq/ds and its derivative, (k, 6) each.
        rate: ds/dt, (k,), 0 at both ends of each run.
        time: Time since the run began, (k,) [s]; NaN in a run that stands still
            on the way.
        fastest: ds/dt that the joints' velocities allow, (k,).
    """

    s: Floats
    q: Floats
    slope: Floats
    curve: Floats
    rate: Floats
    time: Floats
    fastest: Floats

    @property
    def acceleration(self) -> Floats:
        """Joint accelerations behind the waypoints, (k, 6) [rad/s^2]."""
        squares, ds = np.diff(self.rate**2), np.diff(self.s)
        push = np.zeros((len(self.s), 1))
        moves = np.flatnonzero(ds > 0)  # from a run to the next nothing does
        push[moves, 0] = squares[moves] / (2 * ds[moves])
        return np.asarray(self.curve * self.rate[:, None] ** 2 + self.slope * push)

    @property
    def velocity(self) -> Floats:
        """Joint velocities at the waypoints, (k, 6) [rad/s]."""
        return self.slope * self.rate[:, None]


def time_laws(arm: Arm, q: Floats, s: Floats, limit: Floats, begins: Bools) -> Runs:
    """Find the fastest time laws along paths, from stop to stop.

    Args:
        arm: Its joint velocity and acceleration limits hold.
        q: Joint angles at the waypoints, each one a gridpoint, (k, 6) [rad].
        s: Path positions of the waypoints, increasing within a run, (k,).
        limit: Bound of ds/dt at the waypoints, (k,), inf where there is none.
        begins: True at the first waypoint of each run, (k,).
    """
    first, second = _native.splines(s, q, begins)  # natural: no bend at both ends
    step = np.diff(s, prepend=s[0])
    with np.errstate(divide="ignore", over="ignore"):  # of joints that hardly move
        fastest = (arm.velocity / np.abs(first)).min(axis=1)
    bound = np.minimum(np.minimum(limit, fastest), FASTEST)
    paths, most = (first, second), np.asarray(arm.acceleration, dtype=float)
    rate = _native.fastest(paths, step, bound, begins, most)
    inner = np.flatnonzero(~begins)
    lasts = np.zeros(len(s))
    with np.errstate(divide="ignore"):
        lasts[inner] = 2 * step[inner] / (rate[inner] + rate[inner - 1])
    run = np.cumsum(begins) - 1
    # What every interval lasts within its run, (k,) [s]; NaN where one never ends.
    stuck = np.bincount(run[np.isinf(lasts)], minlength=run[-1] + 1) > 0
    total = np.cumsum(np.where(np.isinf(lasts), 0.0, lasts))
    since = total - total[begins][run]
    return Runs(s, q, first, second, rate, np.where(stuck[run], np.nan, since), fastest)
