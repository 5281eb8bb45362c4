"""How much the servos lag, as far as the bends of a way tell.

Joints that follow their commands with a lag of T cut bends: at the speed v, on a way
of the curvature k, the tool goes k (v T)^2 / 2 inside of it, which is to be seen across
the way. Along it, where it is v T late, a tracker whose clock is its own sees nothing;
and of rounded corners nobody knows how the controller commands them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.compensation.paths.path_error import PredictedWays
from postproc.compensation.paths.track_alignment import OnTheWay
from postproc.robot.pose import lengths

REACH = 0.01  # [m] on both sides of a place over which its way bends
CORNER = 0.03  # [m] from a rounded corner: there the way is the controller's
AROUND = 5  # readings on both sides over which a speed is taken
CLEAR = 3.0  # standard errors by which a lag is told
FEW = 5  # moves that bend, at least


@dataclass(frozen=True)
class ServoLag:
    """What bends tell of a lag.

    Attributes:
        square: T^2 [s^2].
        error: Its standard error, by what moves differ by; infinite where few bend.
        moves: How many bend.
    """

    square: float
    error: float
    moves: int

    @property
    def is_certain(self) -> bool:
        """Tell whether there is one for certain."""
        return self.square > CLEAR * self.error

    @property
    def seconds(self) -> float:
        """Return T [s]; NaN where it is not told."""
        return float(np.sqrt(self.square)) if self.is_certain else float("nan")

    @property
    def most(self) -> float:
        """Return what T is below with two standard errors to spare [s]."""
        return float(np.sqrt(max(self.square, 0.0) + 2.0 * self.error))


def servo_lag(
    ways: PredictedWays, nominal: Floats, read: OnTheWay, rounded: Bools
) -> ServoLag:
    """Fit a lag to what was read on ways that bend.

    Args:
        ways: Where the tool should go.
        nominal: Where the drawing has the TCP at their samples, (s, 3) [m]: it bends as
            the command does, whatever flanks change.
        read: What was read on them.
        rounded: Visits at rounded corners, (n,).
    """
    sums = []
    for k in range(len(ways.visit)):
        own = slice(int(ways.first[k]), int(ways.first[k + 1]))
        rows = np.flatnonzero((read.sample >= own.start) & (read.sample < own.stop - 1))
        if len(rows) > 2 * AROUND:
            ends = (bool(rounded[v]) for v in (ways.source[k], ways.visit[k]))
            inside, pull = _pulls(nominal[own], read[rows], own.start, *ends)
            off = read.off[rows][inside]
            sums.append(((pull * off).sum(), (pull * pull).sum()))
    xy, xx = np.array(sums).reshape(-1, 2).T
    power = float(xx.sum())
    moves = int((xx > 0.0).sum())
    if moves < FEW or power == 0.0:
        return ServoLag(0.0, float("inf"), moves)
    square = float(xy.sum()) / power
    error = float(np.sqrt(((xy - square * xx) ** 2).sum())) / power
    return ServoLag(square, error * np.sqrt(moves / (moves - 1)), moves)


def _pulls(
    place: Floats, read: OnTheWay, first: int, begin: bool, end: bool
) -> tuple[Bools, Floats]:
    """Say what a lag of a second would pull the tool aside by on a move, if squared.

    Args:
        place: Its samples, (s, 3) [m].
        read: n readings on it.
        first: Number of its first sample.
        begin: It begins at a rounded corner, and
        end: .. ends at one.

    Returns:
        Which readings lie where the way is known to bend, (n,), and k v^2 / 2 towards
        the middle of the bend there, (m, 3) [m/s^2].
    """
    way = np.append(0.0, np.cumsum(lengths(np.diff(place, axis=0))))
    at = read.sample - first
    s = way[at] + read.share * (way[at + 1] - way[at])
    low, high = (REACH + CORNER * corner for corner in (begin, end))
    inside = (s > low) & (s < way[-1] - high)
    inside[:AROUND] = inside[-AROUND:] = False
    rows = np.flatnonzero(inside)
    a, b = rows - AROUND, rows + AROUND
    speed = lengths(read.position[b] - read.position[a]) / (read.time[b] - read.time[a])
    before, here, after = (_at(way, place, s[rows] + d) for d in (-REACH, 0, REACH))
    bend = (before - 2.0 * here + after) / REACH**2
    return inside, bend * speed[:, None] ** 2 / 2.0


def _at(way: Floats, place: Floats, s: Floats) -> Floats:
    """Interpolate places along a way, (m, 3) [m]."""
    return np.stack([np.interp(s, way, column) for column in place.T], axis=1)
