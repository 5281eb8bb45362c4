"""Paths whose fly points are rounded: new samples, and where each point is passed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Bools, Floats, Ints, in_pieces
from postproc.kernels import native
from postproc.motion.corner import Corners, corners, parabolas
from postproc.motion.paths import along
from postproc.motion.pull import Pull
from postproc.motion.targets import Targets
from postproc.motion.trace import Trace
from postproc.robot.arm import Arm
from postproc.robot.play import Edges

SAMPLES = 4  # on each side of the nearest point of a corner that is not flat
ONE_SAMPLE = [[0], [0], [1]]  # of the three pieces: where the next corner is passed
EMPTY = 1e-9  # part of a move between two zones that is nothing


@dataclass(frozen=True)
class _Pieces:
    """What e edges are made of: the end of a corner, a middle, the begin of a corner.

    Attributes:
        corner: Corner at both ends, (2, e), -1 where there is none.
        begin, end: Where the middle begins and ends, (e,) in u.
        count: Samples of the three pieces, (3, e).
    """

    corner: Ints
    begin: Floats
    end: Floats
    count: Ints


def rounded(arm: Arm, targets: Targets, traced: Trace, timed: bool = True) -> Trace:
    """Round the fly points of a trace.

    Its joint angles at rounded points become those of the point of the path that lies
    nearest to the target; that is also where an edge ends and the next one begins. Its
    flange poses remain those of the targets. Edges without a corner stay as they are.

    Args:
        arm: The arm.
        targets: The moves.
        traced: Their paths without corners.
        timed: Sample the edges for a time law; else where no joint turns there are
            only the ends of the way, which is all that the joints' play sees of it.
    """
    found = corners(arm, targets, traced)
    visit = found.zones.visit
    if len(visit) == 0:
        return traced
    q, aside = np.array(traced.q), np.array(traced.aside)
    q[visit], aside[visit] = found.q, found.aside
    pieces = _pieces(traced, found)
    if not timed:
        pieces.count[:, _one_way(arm, traced, found)] = ONE_SAMPLE
    edges, share = _resampled(traced, found, pieces)
    pull = _pull(targets, traced, found)
    return replace(traced, q=q, aside=aside, edges=edges, share=share, pull=pull)


def _pull(targets: Targets, traced: Trace, found: Corners) -> Pull:
    """Tell how sharp corners move with the targets next to them.

    On a flat one the corrections of neighbours are alike but where a joint turns, and
    to sharpen that step would make the joint turn elsewhere.
    """
    to = np.repeat(np.arange(len(targets)), np.diff(targets.pred_start))
    zones, s = found.zones[~found.flat], found.nearest[~found.flat]
    return Pull(
        zones.visit, traced.edges.source[zones.into], to[zones.out],
        zones.before * (1 - s) ** 2, zones.behind * s**2,
    )  # fmt: skip


def _one_way(arm: Arm, traced: Trace, found: Corners) -> Bools:
    """Tell on which edges no joint's drive turns back, (e,).

    Straight ones into a corner, if at both ends every drive goes on as it goes here:
    so it does on the parabolas between straight moves.
    """
    zones, edges = found.zones, traced.edges
    one = np.diff(edges.start) == 1
    here = traced.q.take(zones.visit, axis=0)
    into = here - traced.q.take(edges.source[zones.into], axis=0)
    out = edges.path.take(edges.start[zones.out], axis=0) - here
    back = (into @ arm.coupling.T) * (out @ arm.coupling.T) < 0
    goes_on = one[zones.into] & one[zones.out] & ~back.any(axis=1)
    before, behind = np.ones_like(one), np.zeros_like(one)
    before[zones.out], behind[zones.into] = goes_on, goes_on
    return np.asarray(before & behind)


def _pieces(traced: Trace, found: Corners) -> _Pieces:
    """Cut the edges at the ends of the zones."""
    e, zones = len(traced.edges.source), found.zones
    rows = np.arange(len(zones.visit))
    corner = np.full((2, e), -1)
    corner[0, zones.out], corner[1, zones.into] = rows, rows
    begin, end = np.zeros(e), np.ones(e)
    begin[zones.out], end[zones.into] = zones.behind, 1 - zones.before
    flat = found.flat
    count = np.zeros((3, e), dtype=np.int64)
    count[0, zones.out] = np.where(flat, 0, SAMPLES)
    count[2, zones.into] = np.where(flat, 1, SAMPLES)
    before = np.diff(traced.edges.start)
    inner = np.ceil(before * (end - begin) - EMPTY).astype(np.int64)
    count[1] = np.where(end - begin > EMPTY, np.minimum(inner, before), 0)
    return _Pieces(corner, begin, end, count)


def _resampled(traced: Trace, found: Corners, pieces: _Pieces) -> tuple[Edges, Floats]:
    """Sample all edges anew; return them and their samples' share of the way."""
    touched = np.asarray((pieces.corner >= 0).any(axis=0))
    start = np.concatenate([[0], np.cumsum(pieces.count.sum(axis=0))])
    path, share = _samples(traced, found, pieces, touched, start)
    uneven = _uneven(pieces, touched, start)
    return replace(traced.edges, path=path, start=start, uneven=uneven), share


def _samples(
    traced: Trace, found: Corners, pieces: _Pieces, touched: Bools, start: Ints
) -> tuple[Floats, Floats]:
    """Place the samples, (s, 6) [rad], and give their shares of the way, (s,)."""
    old = traced.edges
    if native is not None:
        placed: tuple[Floats, Floats] = native.resampled(
            old, traced.share, traced.q, found, pieces
        )
        return placed
    edge = np.repeat(np.arange(len(old.source)), np.diff(start))
    nth = np.arange(len(edge)) - start[edge] + 1
    path, share = np.empty((len(edge), 6)), np.empty(len(edge))
    kept = ~touched[edge]
    same = old.start[edge[kept]] + nth[kept] - 1
    path[kept], share[kept] = old.path[same], traced.share[same]
    split = np.cumsum(pieces.count, axis=0)[:, edge]
    end_of_zone = ~kept & (nth <= split[0])
    middle = ~kept & (nth > split[0]) & (nth <= split[1])
    begin_of_zone = ~kept & (nth > split[1])
    rows = np.flatnonzero(middle)
    at, part = edge[rows], (nth - split[0])[rows]
    long = (pieces.end - pieces.begin)[at] / pieces.count[1, at]
    path[rows] = along(traced, at, pieces.begin[at] + part * long)
    share[rows] = long
    for side, chosen in ((0, end_of_zone), (1, begin_of_zone)):
        rows = np.flatnonzero(chosen)
        corner, count = (
            pieces.corner[side, edge[rows]],
            pieces.count[2 * side][edge[rows]],
        )
        part = nth[rows] - (0 if side == 0 else split[1][rows])
        s, step = _places(found, corner, part, count, side)
        path[rows] = found.q.take(corner, axis=0)
        others = np.flatnonzero(s != found.nearest[corner])
        path[rows[others]] = _on_corners(traced, found, corner[others], s[others])
        size = (found.zones.behind, found.zones.before)[side][corner]
        share[rows] = 2 * size * step
    return path, share


def _on_corners(traced: Trace, found: Corners, corner: Ints, s: Floats) -> Floats:
    """Place samples on corners, (m, 6) [rad]."""
    parts = in_pieces(
        lambda rows: parabolas(traced, found.zones[corner[rows]])(s[rows]), len(s)
    )
    return np.concatenate([np.empty((0, 6)), *parts])


def _places(
    found: Corners, corner: Ints, part: Ints, count: Ints, side: int
) -> tuple[Floats, Floats]:
    """Give s of samples behind (side 0) or before the nearest point, and its step."""
    nearest = found.nearest[corner]
    step = (1 - nearest if side == 0 else nearest) / count
    return (nearest if side == 0 else 0.0) + part * step, step


def _uneven(pieces: _Pieces, touched: Bools, start: Ints) -> Ints:
    """List the samples whose neighbours are not equally far along the path.

    The last one of a piece, and the first one where its piece does not begin at a
    sample because the corner before is flat.
    """
    first, middle, _ = pieces.count
    flat = (pieces.corner[0] >= 0) & (first == 0)
    ends = [start[:-1] + first, start[:-1] + first + middle]
    joints = [ends[0][touched & (first > 0)], ends[1][touched & (middle > 0)]]
    after = start[:-1][touched & flat] + 1
    uneven = np.zeros(start[-1] + 1, dtype=bool)
    for samples in (*joints, after):
        uneven[samples - 1] = True
    return np.flatnonzero(uneven)
