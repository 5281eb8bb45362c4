"""A tracker that followed the tool: its readings, laid along the ways of the program.

The tracker's clock is its own, so that a reading tells how far the tool is from its way
but not how far it is along it. Where the arm stops both stand still: the stops that
were measured and those of the program are put together in order, and what was read
between two of them is laid along the moves between.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.compensation.paths.path_error import PredictedWays
from postproc.robot.pose import lengths

WINDOW = 0.05  # [s] over which the tool's speed is looked at
STILL = 1e-4  # [m] less than this in a window is no motion, and
SIGMAS = 5.0  # .. less than so many times what the readings scatter
DWELL = 0.1  # [s] that the arm stands still at a stop, at least
FAR = 0.02  # [m] a stop that is measured farther from the program's is another one
EVERY = 1e-3  # [m] between readings on the way, which are means of those between
NEAR = 0.05  # share of a way by which a reading may lie elsewhere than its length says


@dataclass(frozen=True)
class Track:
    """n readings of a tracker (structure of arrays).

    Attributes:
        time: By its own clock, (n,) [s], ascending.
        position: (n, 3) [m] in the arm's base frame.
    """

    time: Floats
    position: Floats

    @property
    def period(self) -> float:
        """Return the time between readings [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def scatter(self) -> float:
        """Return the standard deviation of one coordinate of a reading [m].

        By second differences, which no steady motion makes.
        """
        bend = np.diff(self.position, n=2, axis=0)
        return float(1.4826 * np.median(np.abs(bend)) / np.sqrt(6.0))


@dataclass(frozen=True)
class Stops:
    """Where the tool stood still, k times.

    Attributes:
        begin, end: Readings begin[i] .. end[i] - 1, (k,).
        place: Their mean, (k, 3) [m].
    """

    begin: Ints
    end: Ints
    place: Floats

    def __len__(self) -> int:
        """Return the number of stops."""
        return len(self.begin)


@dataclass(frozen=True)
class OnTheWay:
    """n places on the way that were measured (structure of arrays).

    Attributes:
        sample: The sample of the predicted ways before each, (n,), and
        share: .. the share of the way to the next one, (n,).
        time: By the tracker's clock, (n,) [s].
        position: Readings, (n, 3) [m].
        off: From the predicted way to the reading, across it, (n, 3) [m].
        heading: Direction of motion, (n, 3).
    """

    sample: Ints
    share: Floats
    time: Floats
    position: Floats
    off: Floats
    heading: Floats

    def __len__(self) -> int:
        """Return the number of places."""
        return len(self.sample)

    def __getitem__(self, rows: Ints | Bools | slice) -> OnTheWay:
        """Return some of them."""
        return OnTheWay(*(getattr(self, f.name)[rows] for f in fields(self)))

    @classmethod
    def join(cls, parts: Sequence[OnTheWay]) -> OnTheWay:
        """Put places one after the other."""
        none = cls(np.empty(0, np.int64), *np.empty((2, 0)), *np.empty((3, 0, 3)))
        every = [none, *parts]
        return cls(
            *(np.concatenate([getattr(p, f.name) for p in every]) for f in fields(cls))
        )


@dataclass(frozen=True)
class Aligned:
    """A track, laid along the ways of a program.

    Attributes:
        on_the_way: What was read between stops.
        ended: Moves at whose ends the arm was found to stop, (k,).
        standing: Readings there, means of a stop, (k, 3) [m].
        time: When, (k,) [s].
        missed: Stops of the program that were not found.
    """

    on_the_way: OnTheWay
    ended: Ints
    standing: Floats
    time: Floats
    missed: int


def find_stops(track: Track) -> Stops:
    """Find where the tool stands still in a track."""
    half = max(round(WINDOW / track.period / 2), 1)
    total = np.vstack([np.zeros(3), np.cumsum(track.position, axis=0)])
    n = len(track.time)
    at = np.arange(half, n - half + 1)
    moved = np.full(n + 1, np.inf)
    ahead = total[at + half] - total[at]
    moved[at] = lengths(ahead - (total[at] - total[at - half])) / half
    limit = max(STILL, SIGMAS * track.scatter * np.sqrt(6.0 / half))
    still = moved[:n] < limit
    edge = np.flatnonzero(np.diff(np.concatenate([[0], still, [0]])))
    begin, end = edge[::2], edge[1::2]
    long = (end - begin) * track.period >= DWELL
    begin, end = begin[long], end[long]
    count = (end - begin)[:, None]
    return Stops(begin, end, (total[end] - total[begin]) / np.maximum(count, 1))


def pair_places(measured: Floats, expected: Floats) -> tuple[Ints, Ints]:
    """Put two sequences of places together, in order.

    What is left out of either costs as much as a distance of `FAR` [m]; the cheapest
    way is taken (Needleman and Wunsch, J. Mol. Biol. 48, 1970).

    Args:
        measured: (k, 3) [m].
        expected: (m, 3) [m].

    Returns:
        Rows of both that belong together, ascending, (p,) each.
    """
    apart = lengths((measured[:, None] - expected).reshape(-1, 3))
    apart = apart.reshape(len(measured), len(expected))
    steps = FAR * np.arange(len(expected) + 1)
    cost = np.empty((len(measured) + 1, len(expected) + 1))
    cost[0] = steps
    for i, row in enumerate(apart):
        best = cost[i] + FAR
        best[1:] = np.minimum(best[1:], cost[i, :-1] + row)
        cost[i + 1] = np.minimum.accumulate(best - steps) + steps
    pairs, i, j = [], len(measured), len(expected)
    while i and j:
        if apart[i - 1, j - 1] < 2 * FAR and np.isclose(
            cost[i, j], cost[i - 1, j - 1] + apart[i - 1, j - 1], rtol=0, atol=1e-12
        ):
            i, j = i - 1, j - 1
            pairs.append((i, j))
        elif np.isclose(cost[i, j], cost[i - 1, j] + FAR, rtol=0, atol=1e-12):
            i -= 1
        else:
            j -= 1
    found = np.array(pairs[::-1], dtype=np.int64).reshape(-1, 2)
    near = apart[found[:, 0], found[:, 1]] < FAR
    return found[near, 0], found[near, 1]


def align(track: Track, ways: PredictedWays, flies: Bools) -> Aligned:
    """Lay a track along the ways of a program.

    Args:
        track: The readings.
        ways: Where the tool should go.
        flies: Visits that the arm passes without a stop, (n,).
    """
    stops, runs = find_stops(track), _runs(ways, flies)
    # Both ends of every run; neighbours share one.
    starts = np.array([ways.first[a] for a, _ in runs], dtype=np.int64)
    ends = np.array([ways.first[b] - 1 for _, b in runs], dtype=np.int64)
    goes_on = np.append(False, ways.source[[a for a, _ in runs][1:]]
                        == ways.visit[[b - 1 for _, b in runs][:-1]])  # fmt: skip
    places = np.sort(np.concatenate([starts[~goes_on], ends]))
    i, j = pair_places(stops.place, ways.place[places])
    at = dict(zip(places[j].tolist(), i.tolist(), strict=True))
    parts = []
    for k, (start, end) in enumerate(zip(starts.tolist(), ends.tolist(), strict=True)):
        before = int(ends[k - 1]) if goes_on[k] else start
        if before in at and end in at and at[end] > at[before]:
            rows = slice(int(stops.end[at[before]]), int(stops.begin[at[end]]))
            parts.append(_lay_readings(track, ways, rows, slice(start, end + 1)))
    ended = np.isin(places[j], ends)
    move = np.searchsorted(ways.first, places[j][ended], side="right") - 1
    stood = [track.time[stops.begin[k] : stops.end[k]].mean() for k in i[ended]]
    return Aligned(
        OnTheWay.join(parts), move, stops.place[i[ended]], np.array(stood),
        len(places) - len(j),
    )  # fmt: skip


def _runs(ways: PredictedWays, flies: Bools) -> list[tuple[int, int]]:
    """List the moves first .. last + 1 from stop to stop."""
    m = len(ways.visit)
    joins = np.zeros(m, dtype=bool)
    joins[1:] = (ways.source[1:] == ways.visit[:-1]) & flies[ways.visit[:-1]]
    begins = np.flatnonzero(~joins)
    return list(zip(begins.tolist(), [*begins[1:].tolist(), m], strict=True))


def _lay_readings(
    track: Track, ways: PredictedWays, rows: slice, samples: slice
) -> OnTheWay:
    """Lay the readings of a run along its ways."""
    time, points = _means(track, rows)
    line = ways.place[samples]
    step = np.diff(line, axis=0)
    size = lengths(step)
    way, run = np.append(0.0, np.cumsum(size)), _length(points)
    guess = np.searchsorted(way, run * way[-1] / max(run[-1:].sum(), 1e-12)) - 1
    wide = max(int(NEAR * len(size)), 20)
    near = np.clip(guess[:, None] + np.arange(-wide, wide + 1), 0, len(size) - 1)
    off = points[:, None] - line[near]
    share = np.einsum("nki,nki->nk", off, step[near])
    share = np.clip(share / np.maximum(size[near] ** 2, 1e-18), 0.0, 1.0)
    distance = np.linalg.norm(off - share[..., None] * step[near], axis=2)
    best, every = distance.argmin(axis=1), np.arange(len(points))
    at, share = near[every, best], share[every, best]
    heading = step[at] / np.maximum(size[at], 1e-12)[:, None]
    apart = points - line[at] - share[:, None] * step[at]
    inner = (size[at] > 0) & ((at > 0) | (share > 0))
    inner &= (at < len(size) - 1) | (share < 1.0)
    return OnTheWay(at + samples.start, share, time, points, apart, heading)[inner]


def _means(track: Track, rows: slice) -> tuple[Floats, Floats]:
    """Take means of readings, as many as the tool moves about `EVERY` in."""
    time, points = track.time[rows], track.position[rows]
    if len(points) < 2:
        return time, points
    step = float(np.median(lengths(np.diff(points, axis=0))))
    many = max(int(EVERY // max(step, 1e-9)), 1)
    first = np.arange(0, len(points), many)
    count = np.diff(np.append(first, len(points)))
    means = np.add.reduceat(points, first, axis=0) / count[:, None]
    return np.add.reduceat(time, first) / count, means


def _length(points: Floats) -> Floats:
    """Measure a way through places up to each of them, (n,) [m]."""
    return np.append(0.0, np.cumsum(lengths(np.diff(points, axis=0))))[: len(points)]
