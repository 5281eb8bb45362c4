"""Stretches that begin behind a known target, followed all together.

Each keeps to the branch nearest to where it begins, as long as every step along it is a
small one. Where one is not, the stretch is left to be followed on its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints, spans
from postproc.motion.branches import LOST, SUSPICIOUS, nearest_slots
from postproc.motion.reasons import CODE, PATH_JUMP
from postproc.motion.workspace import Workspace


@dataclass(frozen=True)
class _Stretches:
    """r stretches of targets, each the only way on from the one before.

    Attributes:
        first: First target, (r,).
        count: Number of targets, (r,).
        begin: First sample, (r,).
        size: Number of samples, (r,).
    """

    first: Ints
    count: Ints
    begin: Ints
    size: Ints

    def __getitem__(self, rows: Bools) -> _Stretches:
        """Return some of them."""
        return _Stretches(
            self.first[rows], self.count[rows], self.begin[rows], self.size[rows]
        )

    @property
    def targets(self) -> Ints:
        """List all targets."""
        return spans(self.first, self.count)

    @property
    def samples(self) -> Ints:
        """List all samples."""
        return spans(self.begin, self.size)


def at_once(work: Workspace, smooth: Bools, most: int) -> Bools:
    """Follow what goes on from known targets; tell which targets that settles, (n,).

    Args:
        work: The workspace.
        smooth: Targets that continue a Cartesian path from the one before, (n,).
        most: Targets of a stretch that are followed.
    """
    settled = np.zeros(len(smooth), dtype=bool)
    some = _stretches(work, smooth, most)
    if len(some.first) == 0:
        return settled
    flange = work.flange_at(some.samples)
    near, head = work.q[some.first - 1], np.cumsum(some.size) - some.size
    slot = nearest_slots(work.arm.inverse(flange[head]).q, near)
    q = work.arm.on_branch(flange, np.repeat(slot, some.size))
    short = np.repeat(~work.long[some.first], some.size)
    q[short] = work.arm.into_range(q[short])
    q = _unwrapped(q, near, head, some.size)
    good = _small_steps(q, near, head) & (slot >= 0)
    _settle(work, some[good], q[np.repeat(good, some.size)], slot[good])
    settled[some[good].targets] = True
    return settled


def _stretches(work: Workspace, smooth: Bools, most: int) -> _Stretches:
    """Find the stretches."""
    ends = np.flatnonzero(np.diff(np.concatenate([[0], smooth, [0]])))
    first, count = ends[::2], np.minimum(ends[1::2] - ends[::2], most)
    known = ~np.isnan(work.q[first - 1, 0])
    first, count = first[known], count[known]
    edge, start = work.targets.pred_start[first], work.samples.start
    return _Stretches(first, count, start[edge], start[edge + count] - start[edge])


def _steps(q: Floats, near: Floats, head: Ints) -> Floats:
    """Measure what every joint turns by from sample to sample, (s, 6) [rad]."""
    step = np.empty_like(q)
    step[1:] = q[1:] - q[:-1]
    step[head] = q[head] - near
    return np.abs(step, out=step)


def _unwrapped(q: Floats, near: Floats, head: Ints, size: Ints) -> Floats:
    """Put samples on the turns that continue their stretches, (s, 6) [rad]."""
    wraps = (_steps(q, near, head) >= np.pi).any(axis=1)
    for i in np.flatnonzero(np.logical_or.reduceat(wraps, head)).tolist():
        rows = slice(head[i], head[i] + size[i])
        q[rows] = np.unwrap(np.vstack([near[i], q[rows]]), axis=0)[1:]
    return q


def _small_steps(q: Floats, near: Floats, head: Ints) -> Bools:
    """Tell which stretches take none but small steps, (r,); their first may be larger.

    As in `follow`: no other branch makes it shorter.
    """
    step = _steps(q, near, head).max(axis=1)
    large = ~(step <= SUSPICIOUS)
    large[head] = ~(step[head] <= LOST)
    return ~np.logical_or.reduceat(large, head)


def _settle(work: Workspace, some: _Stretches, q: Floats, slot: Ints) -> None:
    """Write down where stretches lead."""
    v = some.first
    before = work.branches_at(v - 1)
    work.reason[v[(before >= 0) & (before != slot)]] = CODE[PATH_JUMP]
    work.path[some.samples] = q
    edge = spans(work.targets.pred_start[v], some.count)
    work.q[some.targets] = work.path[work.samples.start[edge + 1] - 1]
    work.slot[some.targets] = np.repeat(slot, some.count)
