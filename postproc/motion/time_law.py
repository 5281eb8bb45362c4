"""Time laws along given paths: TOPP-RA, its linear programs solved in the core.

(Pham and Pham: A New Approach to Time-Optimal Path Parameterization Based on
Reachability Analysis, IEEE Transactions on Robotics 2018. The tests hold it to their
own implementation, toppra, which takes fifty times as long.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from postproc import _native
from postproc.arrays import Bools, Floats
from postproc.robot.arm import Arm

# Natural cubic splines through the waypoints of many runs at once.


def derivatives(s: Floats, q: Floats, begins: Bools) -> tuple[Floats, Floats]:
    """Differentiate at the waypoints the natural spline through each run.

    With the step h and the slope m of an interval, the first derivatives d satisfy
    d_i / h_i + 2 d_i (1/h_i + 1/h_i+1) + .. = 3 (m_i / h_i + m_i+1 / h_i+1), and
    2 d_0 + d_1 = 3 m_0 at a free end (de Boor: A Practical Guide to Splines,
    chapter 4); runs do not see each other.

    Args:
        s: Path positions, increasing within each run, (k,).
        q: Waypoints, (k, p).
        begins: True at the first waypoint of each run, (k,); a run has two or more.

    Returns:
        First and second derivatives, (k, p) each.
    """
    ends = np.append(begins[1:], True)
    h = np.append(np.diff(s), 1.0)
    h[ends] = 1.0
    slope = np.vstack([np.diff(q, axis=0), np.zeros((1, q.shape[1]))]) / h[:, None]
    after = np.where(ends, 0.0, 1.0 / h)  # weight of the interval after a waypoint
    before = np.append(0.0, after[:-1])
    bands = np.zeros((3, len(s)))
    bands[0, 1:], bands[1], bands[2, :-1] = after[:-1], 2 * (before + after), before[1:]
    pull = after[:, None] * slope
    right = 3 * (pull + np.vstack([np.zeros((1, q.shape[1])), pull[:-1]]))
    first = np.ascontiguousarray(solve_banded((1, 1), bands, right))
    following = np.vstack([first[1:], first[-1:]])
    second = (6 * slope - 4 * first - 2 * following) / h[:, None]
    last = np.flatnonzero(ends)
    before_last = slope[last - 1] * 6 - 2 * first[last - 1] - 4 * first[last]
    second[last] = -before_last / h[last - 1, None]
    return first, second


# Time laws.

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
    first, second = derivatives(s, q, begins)
    step = np.diff(s, prepend=s[0])
    with np.errstate(divide="ignore"):
        fastest = (arm.velocity / np.abs(first)).min(axis=1)
    bound = np.minimum(np.minimum(limit, fastest), FASTEST)
    paths, most = (first, second), np.asarray(arm.acceleration, dtype=float)
    rate = _native.fastest(paths, step, bound, begins, most)
    inner = np.flatnonzero(~begins)
    lasts = np.zeros(len(s))
    with np.errstate(divide="ignore"):
        lasts[inner] = 2 * step[inner] / (rate[inner] + rate[inner - 1])
    return Runs(s, q, first, second, rate, _since(lasts, begins), fastest)


def _since(lasts: Floats, begins: Bools) -> Floats:
    """Add what every interval lasts within its run, (k,); NaN where one never ends."""
    run = np.cumsum(begins) - 1
    stuck = np.bincount(run[np.isinf(lasts)], minlength=run[-1] + 1) > 0
    total = np.cumsum(np.where(np.isinf(lasts), 0.0, lasts))
    since = total - total[begins][run]
    return np.where(stuck[run], np.nan, since)
