"""When the arm arrives, and its way there in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints

MOST_SAMPLES = 10_000  # between two waypoints


@dataclass(frozen=True)
class ArrivalTimes:
    """Times of n arrivals.

    Attributes:
        time: Since the first move, along the first predecessors, (n,) [s].
        speed: TCP speed at the target, (n,) [m/s], 0 where the arm stops.
        untimed: No time law was found; time and speed are as if the arm kept to the
            programmed speed or to full joint speed, (n,).
        velocity, acceleration: Largest share of its limit that every joint uses on the
            way there, (n, 6); of the acceleration only where a time law was found.
        allowed: Least share of the programmed speed that the joints' velocities allow
            on the way there, (n,); 1 where they allow all of it.
        runs: The trajectory of the runs of moves that are not lone JOINT moves.
    """

    time: Floats
    speed: Floats
    untimed: Bools
    velocity: Floats
    acceleration: Floats
    allowed: Floats
    runs: Trajectory


@dataclass(frozen=True)
class Trajectory:
    """Runs of moves in time at their k waypoints (structure of arrays).

    Attributes:
        q: Joint angles, (k, 6) [rad].
        s: Path length, which goes on from run to run, (k,) [s].
        rate: ds/dt, (k,).
        since: Time since the run began, (k,) [s].
        begins: True at the first waypoint of each run, (k,).
        visit: The move that each waypoint belongs to, (k,).
    """

    q: Floats
    s: Floats
    rate: Floats
    since: Floats
    begins: Bools
    visit: Ints

    def sample(self, step: float, most: int = MOST_SAMPLES) -> tuple[Floats, Ints]:
        """Sample the runs at least so often, up to the end of each interval.

        Between waypoints each joint goes on a cubic that does not turn there (Fritsch
        and Butland: A method for constructing local monotone piecewise cubic
        interpolants, SIAM J. Sci. Stat. Comput. 5, 1984): where a path bends, a smooth
        spline would swing on by more than the play of a joint.

        Args:
            step: Time between two samples [s]; more where a move lasts long, as no
                joint turns between waypoints.
            most: Samples of an interval, at the most; the last one is its end.

        Returns:
            Joint angles, (m, 6) [rad], and the move of each sample, (m,).
        """
        i = np.flatnonzero(~self.begins[1:])  # intervals by the waypoint they begin at
        lasts = self.since[i + 1] - self.since[i]
        count = np.clip(np.ceil(lasts / step), 1, most).astype(np.int64)
        own = np.repeat(np.arange(len(i)), count)
        nth = np.arange(len(own)) - np.repeat(np.cumsum(count) - count, count) + 1
        t, i = nth / count[own], i[own]
        h = self.s[i + 1] - self.s[i]
        push = (self.rate[i + 1] ** 2 - self.rate[i] ** 2) / (2 * h)
        dt = t * lasts[own]
        u = np.clip((dt * self.rate[i] + push * dt**2 / 2) / h, 0, 1)[:, None]
        a, b, h = self.q[i], self.q[i + 1], h[:, None]
        q = a + (3 - 2 * u) * u**2 * (b - a)
        slope = self._slopes()
        q += h * u * (1 - u) * ((1 - u) * slope[i] - u * slope[i + 1])
        return np.asarray(q), self.visit[i + 1]

    def _slopes(self) -> Floats:
        """Slopes of the cubics at the waypoints, (k, 6)."""
        ends = np.append(self.begins[1:], True)
        h = np.where(ends, 1.0, np.diff(self.s, append=self.s[-1:]))[:, None]
        after = np.diff(self.q, axis=0, append=self.q[-1:]) / h
        before, h0 = np.roll(after, 1, axis=0), np.roll(h, 1, axis=0)
        same = before * after > 0
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = (2 * h + h0) / before + (h + 2 * h0) / after
            mixed = np.where(same, 3 * (h + h0) / mean, 0.0)
        mixed = np.where(self.begins[:, None], after, mixed)
        return np.asarray(np.where(ends[:, None], before, mixed))


def no_time(n: int) -> ArrivalTimes:
    """Leave the times of n arrivals unknown."""
    unknown, joints = np.full(n, np.nan), np.full((n, 6), np.nan)
    no = np.zeros(n, dtype=bool)
    none, nowhere = np.empty(0), np.empty((0, 6))
    runs = Trajectory(nowhere, none, none, none, no[:0], np.empty(0, int))
    return ArrivalTimes(unknown, unknown, no, joints, joints, unknown, runs)
