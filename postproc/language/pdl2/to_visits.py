"""From the arrivals of a PDL2 program to `Visits`; blocks of moves in array passes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from postproc.arrays import Indices, Interned, Ints, chunks, isin_sorted
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language.analysis.origins import NOWHERE, Origins
from postproc.language.analysis.to_visits import Arrival, Collector
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.conditions import SettingTable
from postproc.language.pdl2.entries import Layout
from postproc.language.pdl2.machine import (
    MOST_AXES,
    Machine,
    MoveBlock,
    MoveForm,
    Pdl2Goal,
    Pdl2Visit,
)
from postproc.language.pdl2.pose_encoding import COMMENTS, PDL2_DIALECT
from postproc.language.pdl2.values import Nothing
from postproc.language.text.templates import number_in_order
from postproc.language.visits import Meaning

_IN_PART = "a target is computed from a part of it"
_UNREAD = Reason(Code.UNREADABLE_NUMBER, "a number of the target cannot be read")
_RECURSIVE = Reason(
    Code.RECURSION, "it stands in a routine that calls itself, which is not followed"
)
_AXES_UNKNOWN = Reason(
    Code.EXTERNAL_AXES, "its auxiliary axes are not known before the program runs"
)


class Pdl2Collector(Collector):
    """Makes the visits of a PDL2 program.

    Attributes:
        settings: What moves are carried out with.
        forms: What moves of blocks have in common.
        setting, form: Of every visit of a block, (n,).
        before, after: Numbers of reasons before and after all others, likewise.
    """

    dialect, comments = PDL2_DIALECT, COMMENTS
    machine: Machine
    found: list[Pdl2Visit]

    def __init__(self, machine: Machine) -> None:
        """Make room for the fields of blocks."""
        self.world = machine.world
        super().__init__(machine, self.world.numbering)
        self.settings, self.forms = SettingTable(), Interned[MoveForm]()
        room: Indices = np.zeros((3, len(self.owner)), np.int32)
        self.setting, self.before, self.after = room
        self.form = np.full(len(self.owner), -1, dtype=np.int32)

    def arrive(self, v: Pdl2Visit) -> Arrival:
        """Say what an arrival is carried out with, of a block the first one."""
        row, goal = self.settings.index(v.modes), v.goal
        first = goal.why or (_RECURSIVE if self._is_again(v) else NO_REASON)
        why = self._explain(row, goal.target, first, v.why, self.aux_problem(goal))
        conditions = self.settings.conditions[row]
        return Arrival(conditions, [why], goal.config is not None, v.fly)

    def _explain(
        self, setting: int, target: int, first: Reason, form: Reason, last: Reason
    ) -> Reason:
        """Say why an arrival stays: by its goal, its move, settings or axes."""
        problem = self.settings.problem(setting, Meaning(target))
        return first or form or problem or last or self.machine.handler

    def _is_again(self, v: Pdl2Visit) -> bool:
        return id(v.scope.body) in self.machine.recursive

    def origins_of(self, v: Pdl2Visit) -> Origins:
        """Return where the arm may come from, in recursion from anywhere."""
        return v.origins | NOWHERE if self._is_again(v) else v.origins

    def list_moves(self) -> Sequence[Indices]:
        """Return the moves of all programs."""
        texts = (program.lines for program in self.world.programs())
        return [
            np.flatnonzero(text.which(lambda said: isinstance(said, ast.Move)))
            for text in texts
        ]

    def _list_goals(self) -> Iterator[tuple[int, Pdl2Goal]]:
        """Yield visits whose goals were evaluated, and these."""
        for v, begin in zip(self.found, self.begin.tolist(), strict=True):
            goals = v.goals if isinstance(v, MoveBlock) else {0: v.goal}
            yield from ((begin + k, goal) for k, goal in goals.items())

    def count_axes(self) -> int:
        """Return the last auxiliary axis, see `Collector.count_axes`."""
        axes = {axis for _, goal in self._list_goals() for axis in goal.axes or ()}
        entries = self.world.initial.entries
        for v in self.found:
            if isinstance(v, MoveBlock) and entries.layouts:
                used = np.unique(entries.layout[v.point[v.point >= 0]]).tolist()
                axes |= {axis for k in used for axis in entries.layouts[k].axes}
        return max([0, *(min(axis, MOST_AXES) for axis in axes)])

    def fill_goals(self, visit: Ints, goals: Sequence[Pdl2Goal]) -> None:
        """Fill configurations, too, see `Collector.fill_goals`."""
        super().fill_goals(visit, goals)
        c = self.columns
        c.config[visit] = c.configs.of([goal.config or "" for goal in goals])
        c.config_given[visit] = [goal.config is not None for goal in goals]
        distances = np.array([goal.distance_mm for goal in goals])
        if np.isfinite(distances).any():
            c.distance_mm = np.array(c.distance_mm)
            c.distance_mm[visit] = distances
        taught = [*self.world.taught_lines.values()]
        places = zip(c.file[visit].tolist(), c.line[visit].tolist(), strict=True)
        marked = (line in taught[file] for file, line in places)
        c.taught[visit] = [
            goal.taught or (mark and not goal.name)
            for goal, mark in zip(goals, marked, strict=True)
        ]

    # Blocks of moves.

    def fill_run(self, v: MoveBlock, rows: slice) -> None:
        """Fill a block, form by form."""
        c, setting = self.columns, self.settings.index(v.modes)
        c.line[rows] = v.scope.program.lines.begin_line[v.rows]
        self.setting[rows] = setting
        if self._is_again(v):
            self.before[rows] = c.reasons[_RECURSIVE]
        for number, form in v.forms.items():
            mine = np.flatnonzero(v.form == number)
            visit = rows.start + mine
            c.kind[visit], c.fly[visit] = form.motion, form.fly
            self.form[visit] = self.forms[form]
            if form.overrides:
                self.setting[visit] = self._override_settings(v, mine, form)
            if form.slots:
                self._fill_written(v, mine, visit, form)
        self._fill_points(v, rows)
        if v.goals:
            goals = [*v.goals.values()]
            held = rows.start + np.array([*v.goals])
            self.fill_goals(held, goals)
            why = c.reasons.of([goal.why for goal in goals])
            self.before[held] = np.where(why, why, self.before[held])
            self.after[held] = c.reasons.of([self.aux_problem(goal) for goal in goals])

    def _override_settings(self, v: MoveBlock, mine: Ints, form: MoveForm) -> Ints:
        """Return the settings at moves of one form whose WITH sets numbers, (m,)."""
        lines, unread = v.scope.program.lines, Nothing("the number cannot be read")
        names = [name for name, _ in form.overrides]
        slots = np.array([slot for _, slot in form.overrides])
        numbers = lines.value[lines.first[v.rows[mine]][:, None] + slots]
        distinct, which = np.unique(numbers, axis=0, return_inverse=True)
        index = []
        for row in distinct.tolist():
            own = {n: unread if x != x else x for n, x in zip(names, row, strict=True)}
            index.append(self.settings.index({**v.modes, **own}))
        return np.array(index, dtype=np.int64)[which.ravel()]

    def _fill_written(
        self, v: MoveBlock, mine: Ints, visit: Ints, form: MoveForm
    ) -> None:
        """Fill moves to six numbers that stand in them."""
        c, lines = self.columns, v.scope.program.lines
        wrong = np.zeros(len(mine), dtype=bool)
        for k in chunks(len(mine)):
            first = lines.first[v.rows[mine[k]]]
            numbers = first[:, None] + np.array(form.slots, dtype=np.int32)
            values = c.values[visit[k]] = lines.value[numbers]
            c.slots[visit[k]] = numbers + v.scope.first
            wrong[k] = ~np.isfinite(values).all(axis=1)
        c.meaning[visit] = Meaning.JOINTS if form.joints else Meaning.POSE
        c.config[visit] = c.configs[form.config or ""]
        c.config_given[visit] = form.config is not None
        bad = visit[wrong]
        c.meaning[bad], c.slots[bad], c.values[bad] = Meaning.UNKNOWN, -1, np.nan
        self.before[bad] = c.reasons[_UNREAD]
        taught = self.world.taught_lines[lines.source.name]
        if taught:
            c.taught[visit] = np.isin(c.line[visit], np.array(sorted(taught)))

    def _fill_points(self, v: MoveBlock, rows: slice) -> None:
        """Fill moves to points that the variable file tells, layout by layout."""
        c, points = self.columns, self.world.initial
        some, entries = np.flatnonzero(v.point >= 0), points.entries
        if len(some) == 0:
            return
        row, visit = v.point[some], rows.start + some
        for k in chunks(len(some)):
            c.values[visit[k]] = entries.numbers[row[k]]
            c.slots[visit[k]] = entries.slots[row[k]] + points.base
        names = entries.name.take(row)
        c.name[visit] = c.names.of(names)
        c.taught[visit], c.shared[visit] = points.taught[row], points.shared[row]
        written = entries.layout[row]
        for number in written[number_in_order(written)[1]].tolist():
            own = written == number
            layout, mine = entries.layouts[number], visit[own]
            c.config[mine] = c.configs[layout.config or ""]
            c.config_given[mine] = layout.config is not None
            joints = layout.kind == "JNTP"
            c.meaning[mine] = Meaning.JOINTS if joints else Meaning.POSE
            for column, axis in enumerate(layout.axes):
                if 1 <= axis <= c.aux.shape[1]:
                    c.aux[mine, axis - 1] = entries.aux[row[own], column]
            self.after[mine] = c.reasons[self.aux_problem(layout)]

    def complete(self) -> None:
        """Say what blocks are carried out with: many moves, few combinations."""
        super().complete()
        c, visit = self.columns, np.flatnonzero(self.form >= 0)
        used, which = np.unique(self.setting[visit], return_inverse=True)
        own = c.conditions.of([self.settings.conditions[k] for k in used.tolist()])
        c.condition[visit] = own[which]
        kinds: list[Indices] = [
            *(self.form, self.setting, self.before, self.after, c.meaning)
        ]
        which, example = _alike([kind[visit] for kind in kinds])
        every, forms, reasons = [*c.reasons], [*self.forms], []
        rows = (kind[visit[example]].tolist() for kind in kinds)
        for form, setting, first, last, target in zip(*rows, strict=True):
            given = every[first], forms[form].reason, every[last]
            reasons.append(c.reasons[self._explain(setting, target, *given)])
        c.reason[visit] = np.array(reasons, dtype=np.int64)[which]

    # What else depends on numbers.

    def find_uses(self, literal: Indices) -> tuple[dict[int, str], Indices]:
        """Find it number by number, see `Collector.find_uses`."""
        slots, pinned = self.columns.slots, self.world.pinned
        follows = np.full(len(literal), -1, dtype=np.int32)
        bases = dict[int, tuple[int, ...]]()
        for visit, goal in self._list_goals():
            for slot in goal.holds:
                pinned.setdefault(slot, _IN_PART)
            if goal.follows[0] >= 0:
                bases[visit] = goal.follows
        wanted = {-1, *pinned, *chain.from_iterable(bases.values())}
        numbers, owner = np.array(sorted(wanted)[1:]), dict[int, int]()
        for some in chunks(len(slots) if len(numbers) else 0):
            row, column = np.nonzero(isin_sorted(slots[some], numbers))
            own = literal[some][row] >= 0
            row, column = some.start + row[own], column[own]
            owner |= zip(slots[row, column].tolist(), row.tolist(), strict=True)
        stay = {int(literal[owner[k]]): why for k, why in pinned.items() if k in owner}
        for visit, base in bases.items():
            at = owner.get(base[0], -1)
            if at >= 0 and (slots[at] == base).all():
                follows[visit] = literal[at]
            else:
                parts = [int(literal[owner[slot]]) for slot in base if slot in owner]
                stay |= {part: _IN_PART for part in parts if part not in stay}
        return stay, follows

    def aux_problem(self, target: Pdl2Goal | Layout) -> Reason:
        """Return why a target stays because of its auxiliary axes."""
        kinds, axes = self.world.start.aux, target.axes
        if axes is None:
            if kinds and all(kind == "gun" for kind in kinds.values()):
                return NO_REASON
            return _AXES_UNKNOWN
        for axis in axes:
            kind = kinds.get(axis)
            if kind is None:
                text = (
                    f"auxiliary axis {axis} is not declared: say under [aux] in the "
                    "cell file whether it is a gun, a track or a positioner"
                )
                return Reason(Code.EXTERNAL_AXES, text)
            if kind != "gun":
                text = f"auxiliary axis {axis} is a {kind}: it moves arm or part"
                return Reason(Code.EXTERNAL_AXES, text)
        return NO_REASON


def _alike(kinds: list[Indices]) -> tuple[Ints, Ints]:
    """Number the combinations of some columns in the order in which they first stand.

    Returns:
        The combination of every row, (n,), and a row of every combination.
    """
    code = example = np.zeros(len(kinds[0]), dtype=np.int64)
    for kind in kinds:
        code, example = number_in_order(code * (int(kind.max(initial=0)) + 1) + kind)
    return code, example
