"""Samples of the Cartesian paths whose both ends are known before joint angles are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.kernels import native
from postproc.motion.path import Segments, arcs, joined, lines
from postproc.motion.targets import Move, Targets
from postproc.robot.pose import inverse

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
        begins: On both parts of an arc, the edge from its start to VIA, (e,); else -1.
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
    begins: Ints
    start: Ints
    length: Floats
    turning: Floats
    inner: Ints
    flange: Floats

    def count(self, edge: int) -> int:
        """Return the number of samples of an edge."""
        return int(self.start[edge + 1] - self.start[edge])


def sample(targets: Targets, flange: Floats) -> Samples:
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
    begins = _begins(targets, visit, source)
    segments = _lines(targets, flange, source[straight], visit[straight])
    edge = straight
    if (begins >= 0).any():
        round_, arc = _arcs(targets, flange, visit, source, ready, begins)
        segments, edge = joined([segments, arc]), np.append(straight, round_)
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
    return _inner(
        targets, segments, edge, visit, source, cartesian, broken, begins, start
    )


def _inner(
    targets: Targets,
    segments: Segments,
    edge: Ints,
    visit: Ints,
    source: Ints,
    cartesian: Bools,
    broken: Bools,
    begins: Ints,
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
    tool = targets.tool.take(visit[edge[path]], axis=0)
    length, turning = np.zeros(len(visit)), np.zeros(len(visit))
    length[edge], turning[edge] = segments.length, segments.turning
    return Samples(
        visit, source, cartesian, ready, broken, begins, start, length, turning,
        inner=start[edge[path]] + nth, flange=tcp @ inverse(tool),
    )  # fmt: skip


def _lines(targets: Targets, flange: Floats, begin: Ints, end: Ints) -> Segments:
    """Build the straight paths from targets (m,) to others."""
    if native is not None:
        m, nothing = len(end), np.zeros((len(end), 3))
        rotation, turn, centre, chord = native.lines(flange, targets.tool, begin, end)
        return Segments(
            rotation, turn, centre, nothing, nothing, chord,
            angle=np.zeros(m), valid=np.ones(m, dtype=bool),
        )  # fmt: skip
    tool = targets.tool.take(end, axis=0)
    return lines(flange.take(begin, axis=0) @ tool, flange.take(end, axis=0) @ tool)


def _begins(targets: Targets, visit: Ints, source: Ints) -> Ints:
    """Find the edge on which the arc of every edge begins, (e,), -1 without one.

    The edges from VIA to the end are as many as those to VIA, and in their order.
    """
    n, begins = len(targets), np.full(len(visit), -1)
    arc = targets.move[visit] == Move.CIRCULAR
    first = np.flatnonzero(arc & targets.via[visit] & (visit + 1 < n))
    begins[first] = first
    at = np.maximum(source, 0)
    second = np.flatnonzero(
        arc & ~targets.via[visit] & (source == visit - 1) & targets.via[at]
    )
    via = source[second]
    starts = np.diff(targets.pred_start)
    same = np.bincount(via, minlength=n)[via] == starts[via]
    nth = np.arange(len(second)) - np.searchsorted(via, via)
    begins[second[same]] = (targets.pred_start[via] + nth)[same]
    return begins


def _arcs(
    targets: Targets,
    flange: Floats,
    visit: Ints,
    source: Ints,
    ready: Bools,
    begins: Ints,
) -> tuple[Ints, Segments]:
    """Build both parts of every arc: edges (m,) and their segments."""
    n = len(targets)
    to_via = ready & (begins == np.arange(len(visit)))
    to_via &= ~np.isnan(flange[np.minimum(visit + 1, n - 1), 0, 0])
    first = np.flatnonzero(to_via)
    tool = targets.tool[visit[first]]
    to, after = arcs(
        flange[source[first]] @ tool,
        flange[visit[first]] @ tool,
        flange[visit[first] + 1] @ tool,
    )
    row = np.full(len(visit) + 1, -1)  # the last one is that of no edge
    row[first] = np.arange(len(first))
    second = np.flatnonzero(ready & ~targets.via[visit] & (row[begins] >= 0))
    used = row[begins[second]]
    picked = Segments(
        *(getattr(after, name)[used] for name in Segments.__dataclass_fields__)
    )
    return np.append(first, second), joined([to, picked])
