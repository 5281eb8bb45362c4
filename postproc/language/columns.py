"""Columns of visits, filled record by record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from postproc.arrays import Ints
from postproc.language import pdl2 as ast
from postproc.language.arrivals import Arrival, Run
from postproc.language.machine import Machine
from postproc.language.program import Program
from postproc.language.sequences import Numbers
from postproc.language.setting_columns import SettingColumns
from postproc.language.values import Position
from postproc.language.visits import Target
from postproc.language.world import base_variable

_COMPUTED = (Target.POSE, Target.NEAR, Target.FOR)  # may move along with a literal


class Table:
    """Distinct texts in order of appearance; index 0 is ""."""

    def __init__(self) -> None:
        """Begin with ""."""
        self._index = Numbers[str]()
        self("")

    def __call__(self, text: str) -> int:
        """Return the index of a text."""
        return self._index[text]

    def many(self, texts: Sequence[str]) -> Ints:
        """Return the indices of texts, (m,)."""
        return self._index.of(texts)

    def texts(self) -> tuple[str, ...]:
        """Return the texts by index."""
        return tuple(self._index)


class Columns:
    """Columns of n visits, filled visit by visit or stretch by stretch."""

    def __init__(self, n: int, axes: int, slots: int) -> None:
        """Make room.

        Args:
            n: Visits.
            axes: The last auxiliary axis.
            slots: Numbers in all files: theirs are the longest columns.
        """
        short = np.int32 if slots < 2**31 else np.int64
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
        self.slots = np.full((n, 6), -1, dtype=short)
        self.bases: dict[int, tuple[int, ...]] = {}
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
    marks: dict[int, tuple[Ints, list[str]]] = field(default_factory=dict)

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
            c.measure_id[at] = self._mark(program, arrival.row)
        self._position(at, arrival)
        c.reason[at] = self.reasons(
            arrival.reason
            or self.recursion(arrival)
            or self.settings.problem(c.setting[at], arrival.target)
            or (arrival.position and self.aux_problem(_axes(arrival.position)))
            or ""
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
        listed = self.is_listed(position.name)
        c.taught[at] = position.taught or inline or listed
        c.shared[at] = position.shared

    def recursion(self, record: Arrival | Run) -> str:
        """Return why visits of a routine that calls itself stay, "" for others."""
        if id(record.place.body) not in self.machine.recursive:
            return ""
        return "it stands in a routine that calls itself, which is not followed"

    def aux_problem(self, axes: tuple[int, ...] | None) -> str:
        """Return why a target with some auxiliary axes stays, None: not known which."""
        kinds = self.machine.world.start.aux
        if axes is None:
            if kinds and all(kind == "gun" for kind in kinds.values()):
                return ""
            return "its auxiliary axes are not known before the program runs"
        for axis in axes:
            kind = kinds.get(axis)
            if kind is None:
                return (
                    f"auxiliary axis {axis} is not declared: say under [aux] in the "
                    "cell file whether it is a gun, a track or a positioner"
                )
            if kind != "gun":
                return f"auxiliary axis {axis} is a {kind}: it moves arm or part"
        return ""

    def is_listed(self, name: str) -> bool:
        """Tell whether the cell file says that a point was taught."""
        taught = self.machine.world.start.taught
        name = name.lower()
        return name in taught or base_variable(name) in taught

    def _mark(self, program: Program, row: int) -> str:
        rows, ids = self.measured(program)
        k = int(np.searchsorted(rows, row)) if len(rows) else 0
        return ids[k] if k < len(rows) and rows[k] == row else ""

    def measured(self, program: Program) -> tuple[Ints, list[str]]:
        """Return the rows of moves with a ``-- MEASURE`` comment, and its ids."""
        known = self.marks.get(id(program))
        if known is None:
            known = self.marks[id(program)] = _measured(program)
        return known


def _axes(position: Position) -> tuple[int, ...] | None:
    return None if position.aux is None else tuple(axis for axis, _ in position.aux)


def _measured(program: Program) -> tuple[Ints, list[str]]:
    lines = program.lines
    moves = program.statements.which(lambda said: isinstance(said, ast.Move))
    rows = np.flatnonzero(moves[lines.shape])
    found: dict[int, str] = {}
    for line, mark in lines.marks("MEASURE"):
        at = int(np.searchsorted(lines.line[rows], line))
        if at < len(rows):
            found.setdefault(int(rows[at]), mark)
    return np.array([*found], dtype=np.int64), [*found.values()]
