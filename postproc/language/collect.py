"""From the analysis' records to the arrays of `Visits`."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from postproc.arrays import Ints
from postproc.language.arrivals import Arrival, Run
from postproc.language.columns import Collector, Columns
from postproc.language.literals import Numbering, find_literals
from postproc.language.machine import HERE, Key, Machine
from postproc.language.run_columns import fill_run
from postproc.language.setting_columns import SettingColumns
from postproc.language.store import MANY
from postproc.language.uses import find_uses
from postproc.language.values import Position
from postproc.language.visits import ELSEWHERE, Visits, slim
from postproc.language.world import World

MOST_AXES = 12  # auxiliary axes that are told


def collect(machine: Machine) -> Visits:
    """Put the visits in program order and make arrays of them."""
    ordered = sorted(machine.arrivals.items(), key=lambda item: _order(item[0]))
    counts = [len(record) for _, record in ordered]
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    axes = max((_axes(record, machine.world) for _, record in ordered), default=0)
    settings = SettingColumns()
    numbering = Numbering.of(machine.world)
    columns = Columns(int(offsets[-1]), axes, len(numbering.start))
    collector = Collector(machine, columns, settings)
    for at, (_, record) in zip(offsets.tolist(), ordered, strict=False):
        if isinstance(record, Run):
            fill_run(collector, at, record)
        else:
            collector.arrival(at, record)
    c, world = collector.columns, machine.world
    if machine.exhausted:
        c.reason[:] = collector.reasons("the program is too complex to be followed")
    literals, literal = find_literals(c, numbering, collector.names)
    literals, follows = find_uses(literals, c.slots, c.bases, literal, world.pinned)
    overlapping = (literal < 0) & (c.slots[:, 0] >= 0) & (c.reason == 0)
    if overlapping.any():
        apart = overlapping & numbering.apart(c.slots)
        why = "a number of the target belongs to another target too"
        c.reason[overlapping] = collector.reasons(why)
        if apart.any():
            why = (
                "some of its numbers stand in the program, others in another file: "
                "write them in one"
            )
            c.reason[apart] = collector.reasons(why)
    pred_start, pred = _predecessors(machine, ordered, offsets)
    return Visits(
        files=tuple(world.files),
        file=slim(c.file),
        line=slim(c.line),
        motion=slim(c.motion),
        target=slim(c.target),
        via=slim(c.via),
        values=c.values,
        distance_mm=slim(c.distance_mm),
        aux=slim(c.aux),
        config=slim(c.config),
        configs=collector.configs.texts(),
        config_given=slim(c.config_given),
        literal=literal,
        follows=slim(follows),
        name=slim(c.name),
        names=collector.names.texts(),
        fly=slim(c.fly),
        reason=slim(c.reason),
        reasons=collector.reasons.texts(),
        pred_start=pred_start,
        pred=pred,
        measure_id=tuple(c.measure_id),
        literals=literals,
        **settings.columns(c.setting),
    )


def _order(key: Key) -> tuple[tuple[tuple[int, int], ...], int]:
    context, at, sub = key
    return (*context, (at, HERE)), sub


def _axes(record: Arrival | Run, world: World) -> int:
    """Return the last auxiliary axis that targets give a value of."""
    if isinstance(record, Arrival):
        return _last_axis([record.position])
    held = [value for value in record.held.values() if isinstance(value, Position)]
    points, rows = world.initial.points, record.point[record.point >= 0]
    if points is None:
        return _last_axis(held)
    used: list[int] = np.unique(points.entries.layout[rows]).tolist()
    axes = [axis for k in used for axis in points.entries.layouts[k].axes]
    return max([_last_axis(held), *(min(axis, MOST_AXES) for axis in axes)])


def _last_axis(positions: Iterable[Position | None]) -> int:
    found = [axis for p in positions if p is not None for axis, _ in p.aux or ()]
    return max([0, *(min(axis, MOST_AXES) for axis in found)])


def _predecessors(
    machine: Machine, ordered: list[tuple[Key, Arrival | Run]], offsets: Ints
) -> tuple[Ints, Ints]:
    """Translate predecessor ids to visits, in CSR form."""
    n = int(offsets[-1])
    visit = np.zeros(machine.next_id, dtype=np.int64)
    for at, (key, record) in zip(offsets.tolist(), ordered, strict=False):
        base = machine.ids[key]
        visit[base : base + len(record)] = np.arange(at, at + len(record))
    counts = np.ones(n, dtype=np.int64)
    sets: list[tuple[int, list[int]]] = []
    for at, (_, record) in zip(offsets.tolist(), ordered, strict=False):
        found = {int(visit[p]) if p >= 0 else p for p in record.predecessors - {MANY}}
        if MANY in record.predecessors:
            found.add(ELSEWHERE)
        if id(record.place.body) in machine.recursive:
            found.add(ELSEWHERE)
        origins = sorted(found)
        counts[at] = len(origins)
        sets.append((at, origins))
    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    pred = np.repeat(np.arange(n) - 1, counts)
    for at, origins in sets:
        pred[start[at] : start[at] + len(origins)] = origins
    return start, pred
