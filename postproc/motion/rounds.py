"""Arcs as a whole: their three points, and how far a correction bends them between.

Three points make a circle, and where they lie badly for that, moving one of them by a
millimetre makes quite another one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.motion.path import Segments, arcs
from postproc.motion.targets import Move, Targets
from postproc.robot.pose import inverse

NEAR = 1e-4  # [m] points nearer than this do not tell where their circle goes
BETWEEN = (0.25, 0.5, 0.75)  # fractions of both parts of an arc that are looked at


@dataclass(frozen=True)
class Rounds:
    """k arcs: one for every place from which a CIRCULAR move may begin.

    Attributes:
        visit: Their start, VIA and end, (k, 3).
        points: The TCP there, in the frame of the arm's base, (k, 3, 3) [m]; NaN where
            not known.
    """

    visit: Ints
    points: Floats

    def __len__(self) -> int:
        """Return the number of arcs."""
        return len(self.visit)

    @property
    def on_a_line(self) -> Bools:
        """Tell which make no circle at all, (k,)."""
        known = ~np.isnan(self.points).any(axis=(1, 2))
        return np.asarray(known & ~_parts(self.points)[0].valid)

    @property
    def too_near(self) -> Bools:
        """Tell where two of the three points are nearly one, (k,)."""
        gap = self.points - np.roll(self.points, 1, axis=1)
        return np.asarray((np.linalg.norm(gap, axis=2) < NEAR).any(axis=1))

    def strays(self, shift: Floats) -> Floats:
        """Tell how much farther the path moves between its points than these do.

        Args:
            shift: What the points move by, (k, 3, 3) [m].

        Returns:
            (k,) [m]; infinite where no circle is left, NaN where nothing is known.
        """
        before, after = _parts(self.points), _parts(self.points + shift)
        moved = np.array([
            np.linalg.norm(_place(new, u) - _place(old, u), axis=1)
            for old, new in zip(before, after, strict=True)
            for u in BETWEEN
        ])  # fmt: skip
        extra = moved.max(axis=0) - np.linalg.norm(shift, axis=2).max(axis=1)
        known = ~np.isnan(self.points + shift).any(axis=(1, 2))
        return np.where(known & ~after[0].valid, np.inf, extra)


def rounds(targets: Targets, tcp: Floats, aside: Floats) -> Rounds:
    """Find the arcs of a program.

    Args:
        targets: Its n moves.
        tcp: TCP poses where the path passes them, each with its own tool,
            (n, 4, 4) [m].
        aside: From the targets to there, (n, 3) [m].
    """
    if not targets.via.any():
        return Rounds(np.empty((0, 3), dtype=np.int64), np.empty((0, 3, 3)))
    visit = np.repeat(np.arange(len(targets)), np.diff(targets.pred_start))
    source = targets.pred
    arc = (targets.move[visit] == Move.CIRCULAR) & targets.via[visit]
    arc &= (source >= 0) & (visit + 1 < len(targets))
    start, via = source[arc], visit[arc]
    own = tcp[start] @ inverse(targets.tool[start]) @ targets.tool[via]
    points = np.stack([own, tcp[via], tcp[via + 1]], axis=1)[:, :, :3, 3]
    arcs_at = np.stack([start, via, via + 1], axis=1)
    return Rounds(arcs_at, points - aside[arcs_at])


def from_every_start(
    move: Ints, via: Bools, pred_start: Ints, pred: Ints
) -> tuple[Ints, Ints]:
    """Let the end of an arc have VIA as its predecessor once for every start of it.

    From another start the same VIA and end make another circle.

    Args:
        move: `Move` of n moves, (n,).
        via: True at the point on the way of an arc, (n,).
        pred_start: Predecessors of move v are pred[pred_start[v] : pred_start[v + 1]].
        pred: Predecessors; negative for a place that is not known.

    Returns:
        `pred_start` and `pred` with the repetitions.
    """
    visit = np.repeat(np.arange(len(move)), np.diff(pred_start))
    ends = (move[visit] == Move.CIRCULAR) & ~via[visit]
    at = np.maximum(pred, 0)  # no move: looked up, and never used
    ends &= (pred >= 0) & (pred == visit - 1) & via[at]
    starts = np.diff(pred_start)[at]
    times = np.where(ends, np.maximum(starts, 1), 1)
    if (times == 1).all():
        return pred_start, pred
    before = np.concatenate([[0], np.cumsum(times)])
    return before[pred_start], np.repeat(pred, times)


def _parts(points: Floats) -> tuple[Segments, Segments]:
    """Build both parts of arcs through points (k, 3, 3) [m]."""
    poses = np.tile(np.eye(4), (*points.shape[:2], 1, 1))
    poses[:, :, :3, 3] = points
    return arcs(poses[:, 0], poses[:, 1], poses[:, 2])


def _place(part: Segments, u: float) -> Floats:
    """Place the TCP at a fraction of every arc, (k, 3) [m]."""
    k = len(part.angle)
    return part.poses(np.arange(k), np.full(k, u))[:, :3, 3]
