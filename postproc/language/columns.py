"""Columns of visits, filled record by record."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from postproc.language import pdl2 as ast
from postproc.language.arrivals import Arrival, Run
from postproc.language.machine import Machine
from postproc.language.program import Program
from postproc.language.setting_columns import SettingColumns
from postproc.language.visits import Motion, Target
from postproc.language.world import base_variable

Ints = NDArray[np.int64]

_COMPUTED = (Target.POSE, Target.NEAR, Target.FOR)  # may move along with a literal


@dataclass
class Table:
    """Distinct texts in order of appearance; index 0 is ""."""

    index: dict[str, int] = field(default_factory=lambda: {"": 0})

    def __call__(self, text: str) -> int:
        """Return the index of a text."""
        return self.index.setdefault(text, len(self.index))

    def texts(self) -> tuple[str, ...]:
        """Return the texts by index."""
        return tuple(self.index)


class Columns:
    """Columns of n visits, filled visit by visit or stretch by stretch."""

    def __init__(self, n: int, axes: int) -> None:
        self.file = np.zeros(n, dtype=np.int64)
        self.line = np.zeros(n, dtype=np.int64)
        self.motion = np.zeros(n, dtype=np.int64)
        self.target = np.zeros(n, dtype=np.int64)
        self.via = np.zeros(n, dtype=bool)
        self.fly = np.zeros(n, dtype=bool)
        self.values = np.full((n, 6), np.nan)
        self.distance_mm = np.full(n, np.nan)
        self.aux = np.full((n, axes), np.nan)
        self.config = np.zeros(n, dtype=np.int64)
        self.config_given = np.zeros(n, dtype=bool)
        self.name = np.zeros(n, dtype=np.int64)
        self.reason = np.zeros(n, dtype=np.int64)
        self.setting = np.zeros(n, dtype=np.int64)
        self.slots = np.full((n, 6), -1, dtype=np.int64)
        self.bases = np.full((n, 6), -1, dtype=np.int64)
        self.taught = np.zeros(n, dtype=bool)
        self.shared = np.zeros(n, dtype=bool)
        self.measure_id = [""] * n


@dataclass
class Collector:
    """Fills the columns; holds the tables that they index."""

    machine: Machine
    columns: Columns
    settings: SettingColumns
    configs: Table = field(default_factory=Table)
    names: Table = field(default_factory=Table)
    reasons: Table = field(default_factory=Table)
    marks: dict[int, dict[int, str]] = field(default_factory=dict)

    def arrival(self, at: int, arrival: Arrival) -> None:
        """Fill one visit."""
        c, program = self.columns, arrival.place.program
        c.file[at] = self.machine.world.files.index(program.lines.source.name)
        c.line[at] = program.lines.line[arrival.row]
        c.motion[at], c.target[at] = arrival.motion, arrival.target
        c.via[at], c.fly[at] = arrival.via, arrival.fly
        c.values[at] = [np.nan if v is None else v for v in arrival.numbers]
        if arrival.distance is not None:
            c.distance_mm[at] = arrival.distance
        c.setting[at] = self.settings.index(arrival.settings)
        if not arrival.via:
            c.measure_id[at] = self.measured(program).get(arrival.row, "")
        self._position(at, arrival)
        c.reason[at] = self.reasons(
            arrival.reason
            or self._recursion(arrival)
            or self.settings.problem(c.setting[at], arrival.target)
            or self._aux_problem(arrival)
        )

    def _position(self, at: int, arrival: Arrival) -> None:
        c, position = self.columns, arrival.position
        if position is None:
            return
        world = self.machine.world
        c.name[at] = self.names(position.name)
        c.config[at] = self.configs(position.config or "")
        c.config_given[at] = position.config is not None
        for axis, value in position.aux or ():
            if 1 <= axis <= c.aux.shape[1] and value is not None:
                c.aux[at, axis - 1] = value
        if position.editable and arrival.target in (Target.POSE, Target.JOINTS):
            c.slots[at] = position.slots
        elif -1 not in position.slots and arrival.target in _COMPUTED:
            c.bases[at] = position.slots
        else:
            world.pin(position, "a target is computed from a part of it")
        lines = world.taught_lines[arrival.place.program.lines.source.name]
        inline = not position.name and int(c.line[at]) in lines
        name = position.name.lower()
        taught = world.start.taught
        listed = name in taught or base_variable(name) in taught
        c.taught[at] = position.taught or inline or listed
        c.shared[at] = position.shared

    def _recursion(self, record: Arrival | Run) -> str:
        if id(record.place.body) not in self.machine.recursive:
            return ""
        return "it stands in a routine that calls itself, which is not followed"

    def _aux_problem(self, arrival: Arrival) -> str:
        kinds = self.machine.world.start.aux
        if arrival.position is None:
            return ""
        if arrival.position.aux is None:
            if kinds and all(kind == "gun" for kind in kinds.values()):
                return ""
            return "its auxiliary axes are not known before the program runs"
        for axis, _ in arrival.position.aux:
            kind = kinds.get(axis)
            if kind is None:
                return (
                    f"auxiliary axis {axis} is not declared: say under [aux] in the "
                    "cell file whether it is a gun, a track or a positioner"
                )
            if kind != "gun":
                return f"auxiliary axis {axis} is a {kind}: it moves arm or part"
        return ""

    def run(self, at: int, run: Run) -> None:
        """Fill a stretch of moves to inline literals, shape by shape."""
        c, program = self.columns, run.place.program
        lines = program.lines
        rows = np.arange(run.first, run.last)
        here = slice(at, at + len(rows))
        c.file[here] = self.machine.world.files.index(lines.source.name)
        c.line[here] = lines.line[rows]
        setting = self.settings.index(run.settings)
        c.setting[here] = setting
        base = self.machine.world.slot_base[lines.source.name]
        shapes = lines.shape[rows]
        for shape in np.unique(shapes).tolist():
            statement = program.statements[shape]
            assert isinstance(statement, ast.Move)
            mine = at + np.flatnonzero(shapes == shape)
            self._shape(mine, statement, run, lines.first[rows[mine - at]], base)
        taught = self.machine.world.taught_lines[lines.source.name]
        if taught:
            c.taught[here] = np.isin(c.line[here], np.array(sorted(taught)))
        for row, mark in self.measured(program).items():
            if run.first <= row < run.last:
                c.measure_id[at + row - run.first] = mark

    def _shape(
        self, mine: Ints, statement: ast.Move, run: Run, first: Ints, base: int
    ) -> None:
        c, lines = self.columns, run.place.program.lines
        literal = statement.where[0]
        joints = isinstance(literal, ast.Aggregate)
        items = literal_items(literal)
        slots = np.array([i.slot for i in items[:6] if isinstance(i, ast.Number)])
        numbers = first[:, None] + slots[None, :]
        c.values[mine] = lines.value[numbers]
        c.slots[mine] = numbers + base
        said = statement.trajectory.lower() or str(run.settings.get("move_type"))
        c.motion[mine] = Motion.LINEAR if said == "linear" else Motion.JOINT
        target = Target.JOINTS if joints else Target.POSE
        c.target[mine] = target
        c.fly[mine] = statement.fly
        config = items[6] if len(items) > 6 else None
        if isinstance(config, ast.Text):
            c.config[mine] = self.configs(config.value)
            c.config_given[mine] = True
        setting = self.settings.index(run.settings)
        reason = (
            run.reason or self._recursion(run) or self.settings.problem(setting, target)
        )
        c.reason[mine] = self.reasons(reason)
        wrong = mine[~np.isfinite(c.values[mine]).all(axis=1)]
        c.target[wrong] = Target.UNKNOWN
        c.slots[wrong] = -1
        c.values[wrong] = np.nan
        if len(wrong):
            c.reason[wrong] = self.reasons("a number of the target cannot be read")

    def measured(self, program: Program) -> dict[int, str]:
        """Return the ids of ``-- MEASURE`` comments by the row of their move."""
        known = self.marks.get(id(program))
        if known is None:
            known = self.marks[id(program)] = _measured(program)
        return known


def literal_items(
    literal: ast.Expression,
) -> tuple[ast.Expression | None, ...]:
    """Return what stands between the brackets of ``{..}`` or ``POS(..)``."""
    if isinstance(literal, ast.Aggregate):
        return literal.items
    return literal.arguments if isinstance(literal, ast.Invoke) else ()


def _measured(program: Program) -> dict[int, str]:
    lines = program.lines
    moves = np.array([isinstance(s, ast.Move) for s in program.statements], dtype=bool)
    rows = np.flatnonzero(moves[lines.shape])
    found: dict[int, str] = {}
    for line, mark in lines.marks("MEASURE"):
        at = int(np.searchsorted(lines.line[rows], line))
        if at < len(rows):
            found.setdefault(int(rows[at]), mark)
    return found
