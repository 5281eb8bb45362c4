"""Whether the joints change their flanks in motion as they do at stops.

Where a joint is predicted to change its flank on the way, the tool steps aside. What
was measured there tells how large the step is beside the predicted one, and where:

    y(s) = o + k c(s) g(s - d),

with y what is measured across the way beside what stands on the old flank, o constant
there, c the predicted step and g from 0 to 1 how much of it is done at s. A model that
was fitted at stops says k = 1 and d = 0; a gap that does not open in motion k = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.compensation.paths.path_error import PredictedWays
from postproc.compensation.paths.track_alignment import OnTheWay
from postproc.model.model import CONFIRMED, UNCERTAIN
from postproc.robot.pose import lengths

LEAST = 0.03  # [m] of the way on both sides that a step is looked for in
AROUND = 0.06  # [m] on both sides, at the most
ELSEWHERE = 0.03  # [m] how far from where it is predicted a step is looked for
STEP = 1e-3  # [m] between places that are tried
CLEAR = 3.0  # a step this many times what readings there scatter by is told
FEW = 3  # steps that tell of a joint, at least
MANY = 12  # of which some may be wrong
LIKE = 0.2  # of the predicted step, that the measured one may differ by
THERE = 0.01  # [m] .. and it may lie elsewhere by
HALF = 0.5  # of the predicted step: one that may be off by more is not known
SURE = 0.975  # in each direction


@dataclass(frozen=True)
class FlankSteps:
    """m changes of a flank that were measured (structure of arrays).

    Attributes:
        joint: 1 to 6, (m,).
        visit: At the end of the move, (m,).
        predicted: Size of the predicted step across the way, (m,) [m].
        share: Size of the measured one beside it, k, (m,), and
        error: .. its standard error, (m,).
        later: How much later it was found, d, (m,) [m].
    """

    joint: Ints
    visit: Ints
    predicted: Floats
    share: Floats
    error: Floats
    later: Floats

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.joint)


@dataclass(frozen=True)
class JointInMotion:
    """What the steps of one joint say.

    Attributes:
        joint: 1 to 6.
        steps: How many were measured.
        predicted: Their mean predicted size [m].
        share: Median of the measured sizes beside the predicted ones.
        error: Its standard error, by the spread of the steps.
        later: Median of how much later they were found [m].
        later_error: Its standard error, likewise.
    """

    joint: int
    steps: int
    predicted: float
    share: float
    error: float
    later: float
    later_error: float

    @property
    def verdict(self) -> str:
        """Say "confirmed", "refuted", "elsewhere" or "uncertain", at 95 %."""
        if self.steps < FEW:
            return UNCERTAIN
        from scipy.special import stdtrit  # slow to load, and seldom wanted

        times = float(stdtrit(self.steps - 1, SURE))
        off, wide = abs(self.share - 1.0), times * self.error
        away = abs(self.later)
        if off - wide > LIKE:
            return "refuted"
        if off + wide > HALF:
            return UNCERTAIN
        if away - times * self.later_error > THERE:
            return "elsewhere"
        near = away <= THERE and away + times * self.later_error <= ELSEWHERE
        return CONFIRMED if near else UNCERTAIN


def measure_steps(ways: PredictedWays, read: OnTheWay, scatter: float) -> FlankSteps:
    """Measure the steps that joints make where they change their flanks.

    Args:
        ways: The ways, with the sides of the joints along them.
        read: What was read on them.
        scatter: Standard deviation of a coordinate of a single reading there [m].
    """
    found: list[tuple[float, ...]] = []
    for k in range(len(ways.visit)):
        own = slice(int(ways.first[k]), int(ways.first[k + 1]))
        rows = np.flatnonzero((read.sample >= own.start) & (read.sample < own.stop - 1))
        if len(rows):
            found += _of_move(ways, own, int(ways.visit[k]), read[rows], scatter)
    columns = np.array(found).reshape(-1, 6).T
    return FlankSteps(columns[0].astype(int), columns[1].astype(int), *columns[2:])


def _of_move(
    ways: PredictedWays, own: slice, visit: int, read: OnTheWay, scatter: float
) -> list[tuple[float, ...]]:
    """Measure the steps of one move."""
    way = _way(ways.place[own])
    at = read.sample - own.start
    s = way[at] + read.share * (way[np.minimum(at + 1, len(way) - 1)] - way[at])
    found: list[tuple[float, ...]] = []
    crossings = _crossings(ways.side[own], way)
    for joint, low, high in crossings:
        others = [x for j, a, b in crossings if j != joint for x in (a, b)]
        begin = max([low - AROUND, *(x for x in others if x < low)])
        end = min([high + AROUND, *(x for x in others if x > high)])
        inside = (s > begin) & (s < end)
        if low - begin < LEAST or end - high < LEAST or inside.sum() < 2 * FEW:
            continue
        if any(low <= x <= high for x in others):
            continue
        one = _step(ways, own, joint, s[inside], read[inside]).fit_step(scatter)
        if one is not None:
            found.append((joint + 1.0, float(visit), *one))
    return found


def _step(
    ways: PredictedWays, own: slice, joint: int, s: Floats, read: OnTheWay
) -> _Step:
    """Take what was measured around the change of one joint (from 0)."""
    side = ways.side[own, joint]
    here = side[read.sample - own.start]
    step = np.sign(side[-1] - side[0]) * ways.flank[read.sample, joint]
    along = np.einsum("ni,ni->n", step, read.heading)[:, None]
    across = step - along * read.heading
    return _Step(s, across, np.abs(here - side[0]) / 2.0, read.off)


def _crossings(side: Floats, way: Floats) -> list[tuple[int, float, float]]:
    """List joints (from 0) that go from flank to flank: where they leave and arrive."""
    found = []
    for joint in range(side.shape[1]):
        column = side[:, joint]
        if abs(column[-1] - column[0]) < 1.9 or (np.abs(np.diff(column)) > 0).sum() < 1:
            continue
        sense = np.sign(column[-1] - column[0])
        if (sense * np.diff(column) < 0).any():
            continue  # there and back
        inner = np.flatnonzero(np.abs(np.diff(column)) > 0)
        found.append((joint, float(way[inner[0]]), float(way[inner[-1] + 1])))
    return found


@dataclass(frozen=True)
class _Step:
    """What was measured around one change of a flank, n readings.

    Attributes:
        s: Where on the way, (n,) [m].
        across: The predicted step across the way, (n, 3) [m].
        done: How much of it is done there, (n,) from 0 to 1.
        off: From the predicted place to the reading, (n, 3) [m].
    """

    s: Floats
    across: Floats
    done: Floats
    off: Floats

    def fit_step(self, scatter: float) -> tuple[float, float, float, float] | None:
        """Fit a step: predicted size, its share, the error of that, how much later."""
        size = float(lengths(self.across).mean())
        if size < CLEAR * scatter / np.sqrt(len(self.s) / 4.0):
            return None
        y = _centre(self.off + self.done[:, None] * self.across)
        tried = []
        for later in np.arange(-ELSEWHERE, ELSEWHERE + STEP, STEP):
            done = np.interp(self.s - later, self.s, self.done)
            c = _centre(done[:, None] * self.across)
            power = float((c * c).sum())
            if power >= (CLEAR * scatter) ** 2:
                share = float((c * y).sum()) / power
                tried.append((float(((y - share * c) ** 2).sum()), share, power, later))
        if not tried:
            return None
        left, share, power, later = min(tried)
        error = np.sqrt(left / max(2 * len(self.s) - 4, 1) / power)
        return size, share, float(error), float(later)


def _centre(rows: Floats) -> Floats:
    return np.asarray(rows - rows.mean(axis=0))


def _way(place: Floats) -> Floats:
    return np.append(0.0, np.cumsum(lengths(np.diff(place, axis=0))))


def in_motion(steps: FlankSteps) -> tuple[JointInMotion, ...]:
    """Say of every joint what its steps say."""
    found = []
    for joint in sorted(set(steps.joint.tolist())):
        mine = steps.joint == joint
        least = float(np.median(steps.error[mine]))
        share, error = _middle(steps.share[mine], least)
        later, later_error = _middle(steps.later[mine], STEP / np.sqrt(12.0))
        size = float(steps.predicted[mine].mean())
        count = int(mine.sum())
        found.append(
            JointInMotion(joint, count, size, share, error, later, later_error)
        )
    return tuple(found)


def _middle(told: Floats, least: float) -> tuple[float, float]:
    """Return a median and its standard error, of a scatter that is no less.

    Of few the scatter is their standard deviation: their median deviation may be small
    by chance.
    """
    middle = float(np.median(told))
    spread = 1.4826 * float(np.median(np.abs(told - middle)))
    if len(told) < MANY:
        spread = float(np.std(told, ddof=1)) if len(told) > 1 else np.inf
    return middle, 1.2533 * max(spread, least) / float(np.sqrt(len(told)))
