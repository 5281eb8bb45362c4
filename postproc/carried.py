"""Targets that move although no number of theirs is written anew.

A computed target moves along with the literal that it is computed from, a step
(RELATIVE, AWAY, ..) with the place that it begins at.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from postproc.arcs import strayed
from postproc.arrays import Bools, Floats, Ints
from postproc.language.visits import Visits
from postproc.motion.replan import IS_STEP
from postproc.motion.targets import Kind
from postproc.planning import Planned
from postproc.resolve import moved_targets
from postproc.robot.cell import Cell
from postproc.robot.pose import MM


def strayed_along(
    visits: Visits, planned: Planned, cell: Cell, values: Floats, shift: Floats
) -> Bools:
    """Tell which targets must stay for every arc to stay what it is, (n,).

    Args are those of `with_carried`.
    """
    if not planned.targets.via.any():
        return np.zeros(len(visits), dtype=bool)
    moves = with_carried(visits, planned, cell, values, shift)
    step = cell.limits.step_mm * MM
    away = strayed(planned.targets, planned.plan, moves, step)
    return with_movers(visits, planned, away)


def with_carried(
    visits: Visits, planned: Planned, cell: Cell, values: Floats, shift: Floats
) -> Floats:
    """Tell what all targets move by, (n, 3) [m], base frame.

    Args:
        visits: n arrivals.
        planned: Their plan.
        cell: The robot's surroundings.
        values: Numbers of every visit after the correction, (n, 6).
        shift: What those with numbers of their own move by, (n, 3) [m]; else 0.
    """
    t, moves = planned.targets, np.array(shift)
    rows = np.flatnonzero((visits.follows >= 0) & (values != visits.values).any(axis=1))
    if len(rows):
        moves[rows] = _followed(visits, planned, cell, values, rows)
    for v, sources in _steps(planned):
        source = sources[np.argmax(np.linalg.norm(moves[sources], axis=1))]
        towards = np.zeros(3)
        if t.kind[v] == Kind.TOWARDS:
            way = t.tcp[v, :3, 3] - planned.plan.tcp[source, :3, 3]
            towards = _turned(way, t.distance[v], moves[v] - moves[source])
        moves[v] = moves[source] + towards
    return moves


def with_movers(visits: Visits, planned: Planned, found: Bools) -> Bools:
    """Add to some targets, (n,), those along with which they move."""
    found = np.array(found)
    for v, sources in reversed([*_steps(planned)]):
        found[sources] |= found[v]
    literals = visits.follows[found & (visits.follows >= 0)]
    return np.asarray(found | np.isin(visits.literal, literals))


def _followed(
    visits: Visits, planned: Planned, cell: Cell, values: Floats, rows: Ints
) -> Floats:
    """Tell what computed targets move by, (m, 3) [m]."""
    now = moved_targets(
        planned.targets, replace(visits, values=values), cell, rows
    ).tcp[rows]
    return np.nan_to_num((now - planned.targets.tcp[rows])[:, :3, 3])


def _turned(way: Floats, distance: float, by: Floats) -> Floats:
    """Tell what a place at a distance on a way moves by as the end of the way does."""
    length = np.linalg.norm(way)
    if not 0.0 < distance <= length:  # so short a way is not known either
        return np.zeros(3)
    u = way / length
    turned: Floats = (by - (by @ u) * u) * (distance / length)
    return turned


def _steps(planned: Planned) -> Iterator[tuple[int, Ints]]:
    """Yield the moves by a step, in the program's order, and where they begin."""
    t = planned.targets
    for v in np.flatnonzero(IS_STEP[t.kind]).tolist():
        sources = t.pred[t.pred_start[v] : t.pred_start[v + 1]]
        sources = sources[sources >= 0]
        if len(sources):
            yield v, sources
