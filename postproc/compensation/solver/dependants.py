"""Targets that move along with others: computed from them, or steps from there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from postproc.arrays import Bools, Floats, Interned, Ints, any_in_rows
from postproc.compensation.eligibility.arcs import find_strayed
from postproc.compensation.eligibility.unchanged import find_taught
from postproc.compensation.outcome import Decisions, Status
from postproc.compensation.program import PlannedProgram
from postproc.compensation.solver.agreement import Agreement
from postproc.compensation.solver.shifts import shift_values
from postproc.compensation.solver.targets import move_targets
from postproc.language.visits import Meaning, Visits
from postproc.motion.replan import IS_STEP
from postproc.motion.targets import TargetKind
from postproc.robot.cell import Cell
from postproc.robot.pose import MM, lengths


def dependants(visits: Visits, agreement: Agreement, among: Bools) -> tuple[Ints, Ints]:
    """Find the visits that move along with a literal, and its row in the agreement."""
    rows = np.flatnonzero((visits.target.follows >= 0) & among)
    return rows, np.searchsorted(agreement.literal, visits.target.follows[rows])


def would_worsen(
    visits: Visits,
    agreement: Agreement,
    change_mm: Floats,
    trusted: Bools,
    agree_mm: float,
    absorbing: Bools,
) -> Bools:
    """Tell which literals would carry a computed target farther off, (m,).

    A target such as ``POS_SHIFT(p, ..)`` or ``NEAR p BY d`` needs a change of its own
    and gets that of ``p``. What it is then off must be no more than what it is off now.
    ``FOR d TO p`` only takes its direction from ``p``: it is a part of the way there.
    A taught target needs none.

    Args:
        visits: n arrivals.
        agreement: What the m literals would change by.
        change_mm: The change that every visit needs, (n, 3) [mm].
        trusted: The model can say what a visit needs, (n,).
        agree_mm: Changes that differ less are the same.
        absorbing: Their move makes up for what the literal changes by, (n,).
    """
    carries = ~absorbing & (visits.target.meaning != Meaning.FOR)
    rows, at = dependants(visits, agreement, carries)
    needed = np.where(find_taught(visits)[rows, None], 0.0, change_mm[rows])
    moved = agreement.change_mm[at]
    shifted = visits.target.shift[rows] >= 0
    if shifted.any():
        after = shift_values(
            visits, agreement.literal, agreement.values, visits.target.values, own=False
        )
        own = rows[shifted]
        moved[shifted] = (after - visits.target.values)[own, :3]
    left = np.linalg.norm(moved - needed, axis=1)
    allowed = np.maximum(np.linalg.norm(needed, axis=1), agree_mm)
    worse = ~(trusted[rows] & (left <= allowed))
    found = np.zeros(len(agreement.literal), dtype=bool)
    found[at[worse]] = True
    return found


def move_dependants(
    visits: Visits, agreement: Agreement, chosen: Bools, values: Floats
) -> None:
    """Move the computed targets along with the literals that change, in place.

    Args:
        visits: n arrivals.
        agreement: What the m literals change by.
        chosen: Literals that do change, (m,).
        values: Numbers of every visit, (n, w).
    """
    rows, at = dependants(visits, agreement, visits.target.shift < 0)
    rows, at = rows[chosen[at]], at[chosen[at]]
    if len(rows) == 0:
        return
    direct = np.flatnonzero(visits.target.literal >= 0)
    written = np.zeros((len(visits.literals), values.shape[1]))
    written[visits.target.literal[direct]] = visits.target.values[direct]
    values[rows] += agreement.values[at] - written[agreement.literal[at]]


# Targets that move although no number of theirs is written anew.
#
# A computed target moves along with the literal that it is computed from, a step
# (RELATIVE, AWAY, ..) with the place that it begins at.


def find_bent_arcs(
    visits: Visits, planned: PlannedProgram, cell: Cell, values: Floats, shift: Floats
) -> Bools:
    """Tell which targets must stay for every arc to stay what it is, (n,).

    Args are those of `with_dependants`.
    """
    if not planned.targets.via.any():
        return np.zeros(len(visits), dtype=bool)
    moves = with_dependants(visits, planned, cell, values, shift)
    step = cell.limits.correction_step_mm * MM
    away = find_strayed(planned.targets, planned.plan, moves, step)
    return with_origins(visits, planned, away)


def with_dependants(
    visits: Visits, planned: PlannedProgram, cell: Cell, values: Floats, shift: Floats
) -> Floats:
    """Tell what all targets move by, (n, 3) [m], base frame.

    Args:
        visits: n arrivals.
        planned: Their plan.
        cell: The robot's surroundings.
        values: Numbers of every visit after the correction, (n, w).
        shift: What those with numbers of their own move by, (n, 3) [m]; else 0.
    """
    moves = np.array(shift)
    rows = np.flatnonzero(
        (visits.target.follows >= 0) & any_in_rows(values != visits.target.values)
    )
    if len(rows):
        now = move_targets(
            planned.targets, visits.with_columns(values=values), cell, rows
        ).tcp[rows]
        moves[rows] = np.nan_to_num((now - planned.targets.tcp[rows])[:, :3, 3])
    for v, sources in _steps(planned):
        source = sources[np.argmax(np.linalg.norm(moves[sources], axis=1))]
        moves[v] = _carry_step(planned, v, int(source), moves)
    return moves


ALONG = 1e-6  # [m]: what moves by less stays
WITH_POINT = "it still moves with the point that it is computed from"
WITH_BEGIN = "it still moves with the target that it begins at"


def moves_along(
    visits: Visits, planned: PlannedProgram, cell: Cell, found: Decisions
) -> Floats:
    """Tell what targets that are left move by all the same, (n, 3) [m], base frame.

    Args:
        visits: n arrivals.
        planned: Their plan.
        cell: The robot's surroundings.
        found: What was decided for them.
    """
    own = (found.status == Status.CORRECTED)[:, None]
    values, shift = found.corrected, np.where(own, found.correction, 0.0)
    moves = np.nan_to_num(with_dependants(visits, planned, cell, values, shift))
    return np.where(own, 0.0, moves)


def with_what_moves_along(visits: Visits, found: Decisions, moves: Floats) -> Decisions:
    """Say of targets that are left where they move all the same.

    Args:
        visits: n arrivals.
        found: What was decided for them.
        moves: What those move by, see `moves_along`, (n, 3) [m].
    """
    along = lengths(moves) > ALONG
    told = np.isin(
        visits.target.meaning, (Meaning.PARTIAL_POSE, Meaning.PARTIAL_JOINTS)
    )
    rows = np.flatnonzero(along & ~told)
    if len(rows) == 0:
        return found
    why, reasons = np.array(found.why), Interned(found.reasons)
    for v in rows.tolist():
        how = WITH_POINT if visits.target.follows[v] >= 0 else WITH_BEGIN
        why[v] = reasons[found.reasons[why[v]].within(f"{{}}; {how}")]
    return replace(found, why=why, reasons=tuple(reasons))


def _carry_step(planned: PlannedProgram, v: int, source: int, moves: Floats) -> Floats:
    """Tell what a step moves by as the place that it begins at does, (3,) [m]."""
    t, moved = planned.targets, np.asarray(moves[source])
    if t.kind[v] == TargetKind.TOWARDS:
        way = t.tcp[v, :3, 3] - planned.plan.tcp[source, :3, 3]
        return moved + _turn_place(way, t.distance[v], moves[v] - moved)
    if t.kind[v] == TargetKind.PARTIAL_POSE:  # along the axes of what is not written
        axes = t.tcp[v, :3, :3][:, np.isnan(t.tcp[v, :3, 3])]
        return np.asarray(axes @ (axes.T @ moved))
    return moved


def with_origins(visits: Visits, planned: PlannedProgram, found: Bools) -> Bools:
    """Add to some targets, (n,), those along with which they move."""
    found = np.array(found)
    for v, sources in reversed([*_steps(planned)]):
        found[sources] |= found[v]
    literals = visits.target.follows[found & (visits.target.follows >= 0)]
    return np.asarray(found | np.isin(visits.target.literal, literals))


def _turn_place(way: Floats, distance: float, by: Floats) -> Floats:
    """Tell what a place at a distance on a way moves by as the end of the way does."""
    length = np.linalg.norm(way)
    if not 0.0 < distance <= length:  # so short a way is not known either
        return np.zeros(3)
    u = way / length
    turned: Floats = (by - (by @ u) * u) * (distance / length)
    return turned


def _steps(planned: PlannedProgram) -> Iterator[tuple[int, Ints]]:
    """Yield the moves by a step, in the program's order, and where they begin."""
    t = planned.targets
    for v in np.flatnonzero(IS_STEP[t.kind]).tolist():
        sources = t.pred[t.pred_start[v] : t.pred_start[v + 1]]
        sources = sources[sources >= 0]
        if len(sources):
            yield v, sources
