"""Columns of the visits of a stretch of moves: a few array passes for each variant."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Ints
from postproc.language import pdl2 as ast
from postproc.language.arrivals import Arrival, Run
from postproc.language.columns import Collector
from postproc.language.destinations import UNSURE, from_value
from postproc.language.initial_values import Points
from postproc.language.values import Nothing, Value
from postproc.language.visits import Target

KINDS = max(Target) + 1  # what a target can be is less


def fill_run(collector: Collector, at: int, run: Run) -> None:
    """Fill the visits of a stretch, the first of which is visit `at`."""
    c, lines = collector.columns, run.place.program.lines
    here = slice(at, at + len(run))
    c.file[here] = collector.machine.world.files.index(lines.source.name)
    c.line[here] = lines.line[run.rows]
    for variant, (motion, _) in run.ways.items():
        mine = np.flatnonzero(run.variant == variant)
        move = run.moves[variant]
        c.motion[at + mine], c.fly[at + mine] = motion, move.fly
        c.setting[at + mine] = _settings(collector, run, move, run.rows[mine])
        if not isinstance(move.where[0], ast.Reference):
            _written(collector, at + mine, run, variant, run.rows[mine])
    points = collector.machine.world.initial.points
    if points is not None and (run.point >= 0).any():
        _points(collector, at, run, points)
    for k, value in run.held.items():
        collector.arrival(at + k, _held(collector, at + k, run, k, value))
    _marks(collector, at, run)


def _settings(collector: Collector, run: Run, move: ast.Move, rows: Ints) -> Ints | int:
    """Return the settings at moves of one variant; WITH may set numbers for them."""
    if not move.settings:
        return collector.settings.index(run.settings)
    lines = run.place.program.lines
    names = [reference.name.lstrip("$") for reference, _ in move.settings]
    slots = [v.slot for _, v in move.settings if isinstance(v, ast.Number)]
    numbers = lines.value[lines.first[rows][:, None] + np.array(slots)]
    distinct, which = np.unique(numbers, axis=0, return_inverse=True)
    index = [
        collector.settings.index({**run.settings, **_set(names, row)})
        for row in distinct.tolist()
    ]
    return np.array(index, dtype=np.int64)[which.ravel()]


def _set(names: list[str], numbers: list[float]) -> dict[str, Value]:
    """Return the settings that WITH changes to some numbers."""
    unread = Nothing("the number cannot be read")
    pairs = zip(names, numbers, strict=True)
    return {name: unread if n != n else n for name, n in pairs}


def _written(
    collector: Collector, mine: Ints, run: Run, variant: int, rows: Ints
) -> None:
    """Fill moves of one variant to six numbers that stand in them."""
    c, world = collector.columns, collector.machine.world
    lines = run.place.program.lines
    literal = run.moves[variant].where[0]
    items = literal_items(literal)
    slots = np.array([i.slot for i in items[:6] if isinstance(i, ast.Number)])
    numbers = lines.first[rows][:, None] + slots[None, :]
    c.values[mine] = lines.value[numbers]
    c.slots[mine] = numbers + world.slot_base[lines.source.name]
    joints = isinstance(literal, ast.Aggregate)
    c.target[mine] = Target.JOINTS if joints else Target.POSE
    config = items[6] if len(items) > 6 else None
    if isinstance(config, ast.Text):
        c.config[mine] = collector.configs(config.value)
        c.config_given[mine] = True
    _reasons(collector, mine, run, variant, "")
    wrong = mine[~np.isfinite(c.values[mine]).all(axis=1)]
    if len(wrong):
        c.target[wrong] = Target.UNKNOWN
        c.slots[wrong] = -1
        c.values[wrong] = np.nan
        c.reason[wrong] = collector.reasons("a number of the target cannot be read")
    taught = world.taught_lines[lines.source.name]
    if taught:
        c.taught[mine] = np.isin(c.line[mine], np.array(sorted(taught)))


def _reasons(
    collector: Collector, mine: Ints, run: Run, variant: int, otherwise: str
) -> None:
    """Say why moves of one variant must not be compensated."""
    c = collector.columns
    known = run.reason or run.ways[variant][1] or collector.recursion(run)
    pairs = c.setting[mine] * KINDS + c.target[mine]  # many rows, few pairs
    distinct, which = np.unique(pairs, return_inverse=True)
    reason = [
        collector.reasons(
            known or collector.settings.problem(setting, Target(target)) or otherwise
        )
        for setting, target in (divmod(pair, KINDS) for pair in distinct.tolist())
    ]
    c.reason[mine] = np.array(reason, dtype=np.int64)[which]


def _points(collector: Collector, at: int, run: Run, points: Points) -> None:
    """Fill moves to points that the variable file tells, layout by layout."""
    c, entries = collector.columns, points.entries
    some = np.flatnonzero(run.point >= 0)
    rows, visits = run.point[some], at + some
    c.values[visits] = entries.numbers[rows]
    c.slots[visits] = entries.slots[rows] + points.base
    c.taught[visits], c.shared[visits] = points.taught[rows], points.shared[rows]
    names = [entries.name[row] for row in rows.tolist()]
    c.name[visits] = collector.names.many(names)
    if collector.machine.world.start.taught:
        c.taught[visits] |= [collector.is_listed(name) for name in names]
    found, first = np.unique(entries.layout[rows], return_index=True)
    for number in found[np.argsort(first)].tolist():
        layout = entries.layouts[number]
        mine = np.flatnonzero(entries.layout[rows] == number)
        c.config[visits[mine]] = collector.configs(layout.config or "")
        c.config_given[visits[mine]] = layout.config is not None
        joints = layout.kind == "JNTP"
        c.target[visits[mine]] = Target.JOINTS if joints else Target.POSE
        for column, axis in enumerate(layout.axes):
            if 1 <= axis <= c.aux.shape[1]:
                c.aux[visits[mine], axis - 1] = entries.aux[rows[mine], column]
        otherwise = collector.aux_problem(layout.axes)
        variants = run.variant[some[mine]]
        for variant in np.unique(variants).tolist():
            own = visits[mine[variants == variant]]
            _reasons(collector, own, run, variant, otherwise)


def _held(collector: Collector, visit: int, run: Run, k: int, value: Value) -> Arrival:
    """Return a move to a variable that holds something else than the file says."""
    variant = int(run.variant[k])
    if isinstance(value, Nothing):
        collector.machine.world.pin(value, UNSURE)
    goal, (motion, reason) = from_value(value), run.ways[variant]
    return Arrival(
        run.place,
        int(run.rows[k]),
        run.predecessors,
        collector.settings.kept(int(collector.columns.setting[visit])),
        motion,
        goal.target,
        goal.numbers,
        goal.position,
        fly=run.moves[variant].fly,
        reason=goal.reason or run.reason or reason,
    )


def _marks(collector: Collector, at: int, run: Run) -> None:
    """Enter the ids of moves that are measured."""
    rows, ids = collector.measured(run.place.program)
    first, last = np.searchsorted(rows, [run.rows[0], run.rows[-1] + 1]).tolist()
    for row, mark in zip(rows[first:last].tolist(), ids[first:last], strict=True):
        k = int(np.searchsorted(run.rows, row))
        if run.rows[k] == row:
            collector.columns.measure_id[at + k] = mark


def literal_items(
    literal: ast.Expression,
) -> tuple[ast.Expression | None, ...]:
    """Return what stands between the brackets of ``{..}`` or ``POS(..)``."""
    if isinstance(literal, ast.Aggregate):
        return literal.items
    return literal.arguments if isinstance(literal, ast.Invoke) else ()
