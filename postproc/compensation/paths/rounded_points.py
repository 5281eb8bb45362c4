"""How far moves leave their paths, however the points on them are rounded.

No corner is larger than half of a neighbouring piece; what cuts it off straight passes
the point farthest. On an arc it is no larger than zones are, by any law.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from postproc.arrays import Floats, Ints, spans
from postproc.compensation.paths.arcs import (
    is_arc,
    largest_zones,
    measure_passing,
    zone_sizes,
)
from postproc.compensation.paths.changed_windows import Part
from postproc.compensation.paths.insertion_prediction import PathPrediction
from postproc.compensation.paths.path_error import apart, largest_in
from postproc.robot.arm import Arm
from postproc.robot.pose import lengths


@dataclass(frozen=True)
class RoundedPoints:
    """How k points on ways may be rounded.

    Attributes:
        half: Half of their largest zones, (k,) [m].
        moved: What these move the path by at the points, (k, 3) [m].
        done: How much of it the plan has, (k,).
        beside: How far arcs are passed besides, (k,) [m].
    """

    half: Floats
    moved: Floats
    done: Floats
    beside: Floats

    def farthest(self, at: Ints, aside: Floats, off: Floats, tangent: Floats) -> Floats:
        """Say how far paths are off at the most, however points are rounded, (s,).

        Args:
            at: The points that samples are beside, (s,).
            aside: How far samples are from these along the way, (s,) [m].
            off: From the path to the TCP there, (s, 3) [m].
            tangent: Directions of the path, (s, 3).
        """
        half, done = np.maximum(self.half, 1e-12)[at], self.done[at][:, None]
        bend = 1 - (aside / half) ** 2  # bounds chords and parabolas
        by = bend[:, None] * self.moved[at]
        far = [apart(off + u * by, tangent)[0] for u in (-done, 1.0 - done)]
        rounded = np.maximum(*far) + self.beside[at] * bend
        return np.where(bend >= 0, rounded, 0.0)


def measure_rounded(
    now: PathPrediction, moves: Sequence[int]
) -> dict[int, tuple[float, float]]:
    """Say how far moves leave their paths, however their points are rounded.

    Args:
        now: The program with points.
        moves: Moves whose paths are predicted.

    Returns:
        The distance [m], and where, as a share of the way, by move.
    """
    found = dict[int, tuple[float, float]]()
    number = now.part[list(moves)].tolist()
    for k, part in enumerate(now.parts):
        own = [v for v, mine in zip(moves, number, strict=True) if mine == k]
        if own:
            found.update(_measure_in(now, part, own))
    return found


def _measure_in(
    now: PathPrediction, part: Part, moves: list[int]
) -> Iterator[tuple[int, tuple[float, float]]]:
    """Yield the moves of a part, and how they leave their paths."""
    paths, shares = part.paths, [now.plan.points.get(v, ()) for v in moves]
    points, share = _points_in(now, part, moves), np.array([*chain(*shares)])
    start, count = paths.spans_to(np.array(moves))
    rows, begin = spans(start, count), np.cumsum(count) - count
    whole, worst = paths.way[start + count - 1], paths.after.across[rows]
    many = np.array([len(own) for own in shares])
    for k in range(int(many.max(initial=0))):
        some = np.flatnonzero(many > k)
        here = spans(begin[some], count[some])
        at = np.repeat((np.cumsum(many) - many)[some] + k, count[some])
        there = share[at] * np.repeat(whole[some], count[some])
        off, tangent = paths.after.off[rows[here]], paths.tangent[rows[here]]
        aside = np.abs(paths.way[rows[here]] - there)
        far = points.farthest(at, aside, off, tangent)
        worst[here] = np.maximum(worst[here], far)
    top = largest_in(worst, np.repeat(np.arange(len(moves)), count), begin)
    place = paths.way[rows[top]] / np.maximum(whole, 1e-12)
    told = zip(worst[top].tolist(), place.tolist(), strict=True)
    yield from zip(moves, told, strict=True)


def _points_in(now: PathPrediction, part: Part, moves: list[int]) -> RoundedPoints:
    """Say how points on moves of a part may be rounded, where they are no stops."""
    task, plan = now.task, now.plan
    arm, cycle = task.setting.cell.arm, part.in_time.after
    on = np.array([v for v in moves for _ in plan.points.get(v, ())], dtype=np.int64)
    rows = _rows_of_points(part, on, task.visits.graph.before)
    before, behind, half = _slopes(arm, part, rows)
    beside = np.zeros(len(on))
    bent = np.flatnonzero([is_arc(task.visits, v) for v in on.tolist()])
    if len(bent):
        half[bent] = np.minimum(half[bent], largest_zones(arm, cycle)[rows[1][bent]])
        radius = task.list_wanted_arcs(plan).radius_of(on[bent])
        beside[bent] = measure_passing(half[bent], radius)
    moved = (behind - before) * half[:, None] / 2
    planned = zone_sizes(arm, cycle, cycle.targets)[rows[1]]
    stops = (np.diff(on, prepend=-1) != 0) & np.isin(on, [*plan.stops])
    moved[stops] = beside[stops] = 0.0
    done = np.minimum(planned / np.maximum(half, 1e-12), 1.0)
    return RoundedPoints(half, moved, done, beside)


def _rows_of_points(part: Part, on: Ints, before: Ints) -> tuple[Ints, Ints, Ints]:
    """Find points and both ends of the pieces beside them in a part, (k,) each.

    Args:
        part: The part.
        on: The move that each point is on, in the order of the moves, (k,).
        before: The visit before each of the source, (n,).
    """
    ends, first = np.flatnonzero(~part.visits.motion.via), np.diff(on, prepend=-1) != 0
    number = np.arange(len(on))
    number -= np.maximum.accumulate(np.where(first, number, 0))
    begin = np.where(on > 0, part.own[on - 1], -1)
    at = np.searchsorted(ends, begin, side="right") + number
    return np.where(first, part.own[before[on]], ends[at - 1]), ends[at], ends[at + 1]


def _slopes(
    arm: Arm, part: Part, rows: tuple[Ints, Ints, Ints]
) -> tuple[Floats, Floats, Floats]:
    """Say how corrections change before points and behind them, (k, 3) each.

    Args:
        arm: The arm.
        part: What was predicted.
        rows: The points, and what is beside them, see `_rows_of_points`.

    Returns:
        What they change by [m a metre of the way], and half of the shorter piece, (k,)
        [m].
    """
    p, c = (
        arm.tcp(cycle.path.q, cycle.targets.tool[:, :3, 3])
        for cycle in (part.in_time.after, part.in_time.before)
    )
    pieces, moved = (rows[:2], rows[1:]), p - c
    size = [np.maximum(lengths(p[b] - p[a]), 1e-9) for a, b in pieces]
    before, behind = (
        (moved[b] - moved[a]) / long[:, None]
        for (a, b), long in zip(pieces, size, strict=True)
    )
    return before, behind, np.minimum(*size) / 2
