"""Samples of the Cartesian paths whose both ends are known before joint angles are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.motion.path import Segments, arcs, joined, lines
from postproc.motion.targets import Move, Targets
from postproc.pose import inverse

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

LEAST = 4  # intervals of a path between stops, however short
BLIND = 32  # intervals of a path whose length is not known beforehand


@dataclass(frozen=True)
class Samples:
    """Where the samples of e edges (predecessor to move) stand.

    Attributes:
        visit: Move an edge leads to, (e,).
        source: Where it comes from, (e,), negative where that is not known.
        cartesian: The TCP's path is a line or an arc, (e,).
        ready: The poses of the samples are known, (e,).
        broken: The three points of an arc make no circle, (e,).
        start: Samples start[i] .. start[i + 1] - 1 are those of edge i, the last of
            them the move's own target, (e + 1,).
        length: Length of the TCP's path, (e,) [m], 0 where it is not ready.
        turning: Reorientation on it, (e,) [rad], 0 where it is not ready.
        inner: Samples of ready edges that are no targets, (k,).
        flange: Their flange poses, (k, 4, 4) [m].
    """

    visit: Ints
    source: Ints
    cartesian: Bools
    ready: Bools
    broken: Bools
    start: Ints
    length: Array
    turning: Array
    inner: Ints
    flange: Array

    def count(self, edge: int) -> int:
        """Return the number of samples of an edge."""
        return int(self.start[edge + 1] - self.start[edge])


def sample(targets: Targets, flange: Array) -> Samples:
    """Place samples on all Cartesian paths between known flange poses.

    Args:
        targets: The moves.
        flange: Flange poses at the targets, (n, 4, 4) [m], NaN where not known yet.
    """
    visit = np.repeat(np.arange(len(targets)), np.diff(targets.pred_start))
    source = np.array(targets.pred)
    at = np.maximum(source, 0)  # no visit: looked up, and never used
    cartesian = targets.move[visit] != Move.JOINT
    known = ~np.isnan(flange[:, 0, 0])
    tool_known = ~np.isnan(targets.tool[:, 0, 0])
    ready = cartesian & (source >= 0) & known[visit] & tool_known[visit]
    ready &= known[at] & ~targets.wrist_joint[visit]
    straight = np.flatnonzero(ready & (targets.move[visit] == Move.LINEAR))
    begin = flange[source[straight]] @ targets.tool[visit[straight]]
    end = flange[visit[straight]] @ targets.tool[visit[straight]]
    round_, arc = _arcs(targets, flange, visit, source, ready)
    segments, edge = joined([lines(begin, end), arc]), np.append(straight, round_)
    broken = np.zeros(len(visit), dtype=bool)
    broken[edge] = ~segments.valid
    ready = np.zeros(len(visit), dtype=bool)
    ready[edge] = segments.valid
    passing = targets.fly | targets.via
    free = passing[visit] | ((source >= 0) & passing[at])
    count = np.where(cartesian & (source >= 0) & ~ready & ~broken, BLIND, 1)
    count[edge] = segments.intervals(np.where(free[edge], 1, LEAST))
    count[broken] = 1
    start = np.concatenate([[0], np.cumsum(count)])
    return _inner(targets, segments, edge, visit, source, cartesian, broken, start)


def _inner(
    targets: Targets,
    segments: Segments,
    edge: Ints,
    visit: Ints,
    source: Ints,
    cartesian: Bools,
    broken: Bools,
    start: Ints,
) -> Samples:
    """Place the inner samples of the segments that belong to edges."""
    ready = np.zeros(len(visit), dtype=bool)
    ready[edge] = segments.valid
    intervals = np.diff(start)[edge]
    path = np.repeat(np.arange(len(edge)), np.where(segments.valid, intervals - 1, 0))
    first = np.concatenate([[0], np.cumsum(np.bincount(path, minlength=len(edge)))])
    nth = np.arange(len(path)) - first[path]
    tcp = segments.poses(path, (nth + 1) / intervals[path])
    tool_inverse = inverse(targets.tool[visit[edge]])
    length, turning = np.zeros(len(visit)), np.zeros(len(visit))
    length[edge], turning[edge] = segments.length, segments.turning
    return Samples(
        visit, source, cartesian, ready, broken, start, length, turning,
        inner=start[edge[path]] + nth, flange=tcp @ tool_inverse[path],
    )  # fmt: skip


def _arcs(
    targets: Targets, flange: Array, visit: Ints, source: Ints, ready: Bools
) -> tuple[Ints, Segments]:
    """Build both parts of every arc: edges (m,) and their segments.

    The part after VIA belongs to the circle from VIA's first predecessor.
    """
    arc = ready & (targets.move[visit] == Move.CIRCULAR)
    to_via = arc & targets.via[visit]
    n = len(targets)
    to_via &= visit + 1 < n
    to_via &= ~np.isnan(flange[np.minimum(visit + 1, n - 1), 0, 0])
    first = np.flatnonzero(to_via)
    begin = flange[source[first]] @ targets.tool[visit[first]]
    via = flange[visit[first]] @ targets.tool[visit[first]]
    end = flange[visit[first] + 1] @ targets.tool[visit[first]]
    to, after = arcs(begin, via, end)
    row, at = np.full(n, -1), np.maximum(source, 0)
    row[visit[first][::-1]] = np.arange(len(first))[::-1]
    second = np.flatnonzero(arc & ~targets.via[visit] & (row[at] >= 0))
    second = second[source[second] == visit[second] - 1]
    used = row[source[second]]
    picked = Segments(
        *(getattr(after, name)[used] for name in Segments.__dataclass_fields__)
    )
    return np.append(first, second), joined([to, picked])
