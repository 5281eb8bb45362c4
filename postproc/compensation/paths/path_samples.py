"""The ways of moves in dense samples of the joint angles, one after the other."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Bools, Floats, Ints, spans
from postproc.motion.cycle_time import ProgramCycle
from postproc.robot.pose import lengths

LEVER = 0.1  # [m] what a turn of a joint counts beside the way of the TCP
AS_FAR = 1e-3  # of a way: samples that lie as far along it


@dataclass(frozen=True)
class PathSamples:
    """The ways of m moves, one after the other, each from where it begins on.

    Attributes:
        visit, source: Of each way, (m,).
        q: Joint angles at the samples, (s, 6) [rad].
        first: As in `PathAccuracy`, (m + 1,).
    """

    visit: Ints
    source: Ints
    q: Floats
    first: Ints

    @property
    def begins(self) -> Bools:
        """The first sample of each way, (s,)."""
        out = np.zeros(len(self.q), dtype=bool)
        out[self.first[:-1]] = True
        return out

    @property
    def way(self) -> Ints:
        """The way that every sample belongs to, (s,)."""
        return np.repeat(np.arange(len(self.visit)), np.diff(self.first))

    def as_many(self, other: PathSamples, p: Floats, wanted: Floats) -> PathSamples:
        """Take a sample of every way for each one of another, as far along it.

        How far that is, is told by the TCP and the joints together: a tool may turn in
        place.

        Ways whose samples lie as far along them are taken as they are. Those beside
        corners that are rounded otherwise are not.

        Args:
            other: The other ways.
            p: TCP positions at the samples of these, (s, 3) [m].
            wanted: .. and of the other ones, (t, 3) [m].
        """
        along, there, to = self._shares(p), other._shares(wanted), other.way
        alike = np.diff(self.first) == np.diff(other.first)
        number = np.arange(len(to)) - other.first[to]
        own = np.minimum(self.first[to] + number, self.first[to + 1] - 1)
        off = np.abs(along[own] - there)
        alike &= np.maximum.reduceat(off, other.first[:-1]) < AS_FAR
        if alike.all():
            return self
        step = np.searchsorted(along + 2 * self.way, there + 2 * to, side="right") - 1
        last = np.maximum(self.first[to + 1] - 2, self.first[to])
        step = np.where(alike[to], own, step.clip(self.first[to], last))
        size = along[np.minimum(step + 1, len(along) - 1)] - along[step]
        share = ((there - along[step]) / np.maximum(size, 1e-12)).clip(0.0, 1.0)
        share[alike[to]] = 0.0
        q = _between(self.q, self.begins, step, share)
        return replace(self, q=q, first=other.first)

    def _shares(self, p: Floats) -> Floats:
        """Say how far along each way samples lie, as shares of it, (s,).

        Args:
            p: TCP positions there, (s, 3) [m].
        """
        moved = np.column_stack([p, LEVER * self.q])
        step = np.linalg.norm(np.diff(moved, axis=0, prepend=moved[:1]), axis=1)
        step[self.first[:-1]] = 0.0
        way = np.cumsum(step)
        way -= way[self.first[:-1]][self.way]
        whole = way[self.first[1:] - 1][self.way]
        return np.asarray(way / np.maximum(whole, 1e-12))

    def refine(self, after: Ints, share: Floats) -> PathSamples:
        """Insert samples at a share of the way from some samples to the next ones."""
        new = _between(self.q, self.begins, after, share)
        at = np.append(np.arange(len(self.q)), after + share)
        order = np.argsort(at, kind="stable")
        more = np.bincount(self.way[after], minlength=len(self.visit))
        first = self.first + np.append(0, np.cumsum(more))
        return replace(self, q=np.concatenate([self.q, new])[order], first=first)


def ways_of(cycle: ProgramCycle, rows: Ints) -> PathSamples:
    """Take the ways by which some visits are reached."""
    edge, source = (found[rows] for found in cycle.ways)
    edges = cycle.path.edges
    count = edges.start[edge + 1] - edges.start[edge]
    first = np.append(0, np.cumsum(count + 1))
    q = np.empty((first[-1], 6))
    inner = np.ones(len(q), dtype=bool)
    inner[first[:-1]] = False
    q[first[:-1]] = cycle.path.q[source]
    q[inner] = edges.path[spans(edges.start[edge], count)]
    return PathSamples(rows, source, q, first)


def _between(q: Floats, begins: Bools, after: Ints, share: Floats) -> Floats:
    """Interpolate ways at a share of the way from samples to the next ones, (k, 6).

    Cubic Hermite pieces in the distance of the joints, their slopes by the parabola
    through three neighbours; at both ends of a way by the chord.
    """
    ends = np.append(begins[1:], True)
    chord = np.diff(q, axis=0, append=q[-1:])
    step = np.linalg.norm(chord, axis=1)
    step[ends] = 0.0
    slope = chord / np.maximum(step, 1e-12)[:, None]
    before, h = np.roll(slope, 1, axis=0), np.roll(step, 1)
    both = (h * ~begins + step)[:, None]
    mixed = (before * step[:, None] + slope * h[:, None]) / np.maximum(both, 1e-12)
    tangent = np.where(begins[:, None], slope, np.where(ends[:, None], before, mixed))
    t, width = share[:, None], step[after][:, None]
    a, b = q[after], q[np.minimum(after + 1, len(q) - 1)]
    out = (2 * t**3 - 3 * t**2 + 1) * a + (3 * t**2 - 2 * t**3) * b
    out += width * (t**3 - 2 * t**2 + t) * tangent[after]
    out += width * (t**3 - t**2) * tangent[np.minimum(after + 1, len(q) - 1)]
    return np.asarray(out)


def measure_along(p: Floats, ways: PathSamples) -> tuple[Floats, Floats]:
    """Measure the path up to every place (s, 3), (s,) [m], and its directions."""
    step = np.diff(p, axis=0, prepend=p[:1])
    step[ways.first[:-1]] = 0.0
    total = np.cumsum(lengths(step))
    tangent = step + np.append(step[1:], np.zeros((1, 3)), axis=0)
    size = lengths(tangent)[:, None]
    return total - total[ways.first[:-1]][ways.way], np.where(
        size > 0, tangent / np.maximum(size, 1e-12), 0.0
    )
