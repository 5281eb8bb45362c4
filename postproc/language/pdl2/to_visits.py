"""From the records of the analysis to `Visits`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import chain

import numpy as np

from postproc.arrays import Indices, Ints, chunks, isin_sorted, release_memory, spans
from postproc.language.analysis.call_context import Point
from postproc.language.analysis.visit_columns import (
    TOO_COMPLEX,
    Numbering,
    VisitColumns,
    chain_visits,
    find_literals,
    to_visits,
)
from postproc.language.pdl2.abstract_state import MANY
from postproc.language.pdl2.columns import Collector
from postproc.language.pdl2.job import World
from postproc.language.pdl2.machine import Key, Machine, MoveRun
from postproc.language.pdl2.pose_encoding import PDL2_DIALECT
from postproc.language.visits import (
    ELSEWHERE,
    Graph,
    Literals,
    Visits,
    ZoneRule,
    texts_of,
)

_IN_PART = "a target is computed from a part of it"


def find_uses(
    literals: Literals,
    slots: Ints,
    bases: Mapping[int, tuple[int, ...]],
    literal: Ints,
    pinned: Mapping[int, str],
) -> tuple[Literals, Indices]:
    """Find which literals computed targets move along with, and which must stay.

    Args:
        literals: m literals.
        slots: Numbers of every visit's literal, (n, 6), -1 where it has none.
        bases: The six numbers that computed targets are made of, by visit.
        literal: Literal of every visit, (n,), -1 where it has none.
        pinned: Numbers that must stay, and why.

    Returns:
        The literals with what pins them, and for every visit the literal that it moves
        along with, (n,), -1 where there is none.
    """
    follows = np.full(len(literal), -1, dtype=np.int32)
    wanted = {-1, *pinned, *chain.from_iterable(bases.values())}
    owner = _visits_of(np.array(sorted(wanted)[1:]), slots, literal)
    stay = {int(literal[owner[k]]): why for k, why in pinned.items() if k in owner}
    for visit, base in bases.items():
        at = owner.get(base[0], -1)
        if at >= 0 and (slots[at] == base).all():
            follows[visit] = literal[at]
        else:
            rows = [int(literal[owner[slot]]) for slot in base if slot in owner]
            stay |= {row: _IN_PART for row in rows if row not in stay}
    if not stay:
        return literals, follows
    return replace(literals, pinned=texts_of(len(literals), stay)), follows


def _visits_of(wanted: Ints, slots: Indices, literal: Indices) -> dict[int, int]:
    """Return a visit by each of some numbers that belong to its literal.

    Args:
        wanted: The numbers, ascending, none below 0.
        slots: As in `find_uses`, and
        literal: .. likewise.
    """
    found: dict[int, int] = {}
    for rows in chunks(len(slots) if len(wanted) else 0):
        at, column = np.nonzero(isin_sorted(slots[rows], wanted))
        for k, slot in zip(at.tolist(), slots[rows][at, column].tolist(), strict=True):
            if literal[rows.start + k] >= 0:
                found[slot] = rows.start + k
    return found


MOST_AXES = 12  # auxiliary axes that are told


def collect(machine: Machine) -> Visits:
    """Put the visits in program order and make arrays of them."""
    ordered = sorted(
        machine.arrivals.items(),
        key=lambda item: (Point(item[0][0], item[0][1]), item[0][2]),
    )
    runs, world = [run for _, run in ordered], machine.world
    offsets = np.concatenate([[0], np.cumsum([len(run) for run in runs])])
    offsets = offsets.astype(np.int64)
    texts = [(one.lines.source, one.lines.numbers) for one in world.programs()]
    if (values := world.variables) is not None:
        texts.append((values.source, values.lines.numbers))
    numbering = Numbering.of(texts)
    collector = _collect_visits(machine, runs, offsets, len(numbering))
    c = collector.columns
    release_memory(len(c))
    literals, literal = find_literals(c, numbering)
    literals, follows = find_uses(
        literals, c.slots, collector.bases, literal, world.pinned
    )
    ids = np.array([machine.ids[key] for key, _ in ordered], dtype=np.int64)
    numbers = np.full(machine.next_id, -1, dtype=np.int32)  # the visit of every id
    numbers[spans(ids, np.diff(offsets))] = np.arange(offsets[-1], dtype=np.int32)
    graph = _graph(machine, ordered, offsets, numbers)
    visits = to_visits(c, world.files, graph, literals, literal, follows, PDL2_DIALECT)
    return _mark_pauses(visits, machine, numbers)


def _collect_visits(
    machine: Machine, runs: list[MoveRun], offsets: Ints, numbers: int
) -> Collector:
    """Fill the columns of all visits.

    Args:
        machine: Has followed the program.
        runs: Of moves, in program order.
        offsets: The first visit of every run, and how many there are, (r + 1,).
        numbers: How many numbers the files hold.
    """
    axes = _most_axes(runs, machine.world)
    columns = VisitColumns(int(offsets[-1]), PDL2_DIALECT.width, axes, numbers)
    collector = Collector(machine, columns)
    collector.fill(zip(offsets.tolist(), runs, strict=False))
    if machine.exhausted:
        columns.reason[:] = columns.reasons[TOO_COMPLEX]
    columns.names.settle()
    return collector


def _most_axes(runs: list[MoveRun], world: World) -> int:
    """Return the last auxiliary axis that targets give a value of."""
    goals = (goal.position for run in runs for goal in run.goals.values())
    axes = {axis for p in goals if p is not None for axis, _ in p.aux or ()}
    points = world.initial.points
    if points is not None and runs:
        rows = np.concatenate([run.point for run in runs])
        used: list[int] = np.unique(points.entries.layout[rows[rows >= 0]]).tolist()
        axes |= {axis for k in used for axis in points.entries.layouts[k].axes}
    return max([0, *(min(axis, MOST_AXES) for axis in axes)])


def _mark_pauses(visits: Visits, machine: Machine, visit: Indices) -> Visits:
    """Say of which fly points it is not known whether the arm stops there."""
    paused, lost = ([visit[k] for k in ids if k >= 0]
                    for ids in (machine.paused, machine.lost))  # fmt: skip
    unsure = {*lost, *np.intersect1d(paused, visits.graph.pred).tolist()}
    rows = np.array(sorted(k for k in unsure if k >= 0), dtype=np.int64)
    rule = visits.zone.rule[rows]
    exact = (rule == ZoneRule.PASS) | (visits.zone.size_mm[rows] < 0.0)
    rows = rows[visits.motion.fly[rows] & ~exact]
    if len(rows) == 0:
        return visits
    rules = np.array(visits.zone.rule)
    rules[rows] = ZoneRule.UNKNOWN
    return visits.with_columns(rule=rules)


def _graph(
    machine: Machine, ordered: list[tuple[Key, MoveRun]], offsets: Ints, visit: Indices
) -> Graph:
    """Translate predecessor ids to visits, in CSR form."""
    origins = []
    for _, run in ordered:  # the visits that its first move may come from
        found = {int(visit[p]) if p >= 0 else p for p in run.predecessors - {MANY}}
        if MANY in run.predecessors or id(run.place.body) in machine.recursive:
            found.add(ELSEWHERE)
        origins.append(sorted(found))
    return chain_visits(np.diff(offsets), origins)
