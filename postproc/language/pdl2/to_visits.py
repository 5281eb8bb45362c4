"""Columns of visits: those of all moves of a program in a few array passes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from postproc.arrays import (
    Indices,
    Interned,
    Ints,
    chunks,
    isin_sorted,
    release_memory,
    spans,
)
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language.analysis.origins import NOWHERE, Origins
from postproc.language.analysis.to_visits import Collector, find_measured
from postproc.language.analysis.visit_columns import (
    TOO_COMPLEX,
    VisitColumns,
    find_literals,
    to_visits,
)
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.conditions import SettingTable
from postproc.language.pdl2.job import World, base_variable
from postproc.language.pdl2.machine import WRITTEN, Goal, Machine, MoveForm, MoveRun
from postproc.language.pdl2.pose_encoding import COMMENTS, PDL2_DIALECT
from postproc.language.pdl2.program import Program
from postproc.language.pdl2.values import Nothing, Position
from postproc.language.text.comment_directives import MEASURE
from postproc.language.text.symbol_column import NameColumn
from postproc.language.text.templates import number_in_order
from postproc.language.visits import Literals, Meaning, Visits, ZoneRule, texts_of

_COMPUTED = (Meaning.POSE, Meaning.NEAR, Meaning.FOR)  # may move along with a literal
_IN_PART = "a target is computed from a part of it"
MOST_AXES = 12  # auxiliary axes that are told
_UNREAD = Reason(Code.UNREADABLE_NUMBER, "a number of the target cannot be read")


_RECURSIVE = Reason(
    Code.RECURSION, "it stands in a routine that calls itself, which is not followed"
)
_AXES_UNKNOWN = Reason(
    Code.EXTERNAL_AXES, "its auxiliary axes are not known before the program runs"
)


@dataclass
class ProgramMoves:
    """All moves of a program.

    Attributes:
        program: The program.
        runs: Its runs, in the order of their visits, and the first visit of each.
        visit: The visits, (n,).
        row: Rows of the moves in the program, (n,).
        run: The run of each, (n,).
        forms: What their forms are.
        form: The form of each, (n,).
        point: See `MoveRun`, (n,).
        first, last: Numbers of reasons that come before and after all others, (n,).
    """

    program: Program
    runs: list[tuple[int, MoveRun]]

    def __post_init__(self) -> None:
        at, runs = zip(*self.runs, strict=True)
        sizes = np.array([run.count for run in runs])
        self.visit: Ints = spans(np.array(at), sizes)
        self.row: Ints = _together([run.rows for run in runs])
        self.run: Indices = np.repeat(np.arange(len(runs), dtype=np.int32), sizes)
        self.point: Ints = _together([run.point for run in runs])
        numbers = Interned[MoveForm]()
        self.form: Indices = np.concatenate(
            [_number_forms(run, numbers) for run in runs]
        )
        self.forms = [*numbers]
        self.first = np.zeros(len(self.row), dtype=np.int32)
        self.last = np.zeros(len(self.row), dtype=np.int32)

    def of_forms(self, said: Callable[[MoveForm], int]) -> Ints:
        """Return what is said of every move's form, (n,)."""
        return np.array([said(form) for form in self.forms])[self.form]

    def list_evaluated(self) -> Iterator[tuple[int, MoveRun, Goal]]:
        """Yield the moves whose goals were evaluated: index, run, goal."""
        begin = 0
        for _, run in self.runs:
            for k, goal in run.goals.items():
                yield begin + k, run, goal
            begin += run.count


def _together(columns: Sequence[Ints]) -> Ints:
    """Put columns one after the other; one by itself is not copied."""
    return columns[0] if len(columns) == 1 else np.concatenate(columns)


def _number_forms(run: MoveRun, numbers: Interned[MoveForm]) -> Indices:
    """Return the numbers of the forms of a run's moves."""
    if len(run.forms) == 1:
        (form,) = run.forms.values()
        return np.full(len(run.rows), numbers[form], dtype=np.int32)
    table = np.zeros(max(run.forms) + 1, dtype=np.int32)
    for number, form in run.forms.items():
        table[number] = numbers[form]
    return table[run.form]


class Pdl2Collector(Collector):
    """Fills the columns of the visits that a machine has found, runs of moves.

    Attributes:
        columns: The visits.
        bases: The six numbers that computed targets are made of, by visit.
    """

    machine: Machine
    found: list[MoveRun]

    def __init__(self, machine: Machine) -> None:
        """Put runs in order, and make room."""
        world = machine.world
        super().__init__(machine, world.numbering)
        width, n = PDL2_DIALECT.width, int(self.counts.sum())
        axes = _most_axes(self.found, world)
        self.columns = VisitColumns(n, width, axes, len(self.numbering))
        self.bases: dict[int, tuple[int, ...]] = {}
        self.settings = SettingTable(self.columns.conditions)
        self._setting = np.zeros(n, dtype=np.int32)

    def collect(self) -> Visits:
        """Put the visits in program order and make arrays of them."""
        c = self.columns
        self._fill()
        self._mark_pauses()
        release_memory(len(c))
        literals, literal = find_literals(c, self.numbering)
        literals, follows = self._find_uses(literals, literal)
        own = self.numbering.names, self.graph(), literals, literal, follows
        return to_visits(c, *own, PDL2_DIALECT)

    def _find_uses(
        self, literals: Literals, literal: Indices
    ) -> tuple[Literals, Indices]:
        """Find which literals computed targets move along with, and which must stay.

        Args:
            literals: m literals.
            literal: Literal of every visit, (n,), -1 where it has none.

        Returns:
            The literals with what pins them, and for every visit the literal that it
            moves along with, (n,), -1 where there is none.
        """
        slots, pinned = self.columns.slots, self.machine.world.pinned
        follows = np.full(len(literal), -1, dtype=np.int32)
        wanted = {-1, *pinned, *chain.from_iterable(self.bases.values())}
        owner = _visits_of(np.array(sorted(wanted)[1:]), slots, literal)
        stay = {int(literal[owner[k]]): why for k, why in pinned.items() if k in owner}
        for visit, base in self.bases.items():
            at = owner.get(base[0], -1)
            if at >= 0 and (slots[at] == base).all():
                follows[visit] = literal[at]
            else:
                rows = [int(literal[owner[slot]]) for slot in base if slot in owner]
                stay |= {row: _IN_PART for row in rows if row not in stay}
        if stay:
            literals = replace(literals, pinned=texts_of(len(literals), stay))
        return literals, follows

    def _mark_pauses(self) -> None:
        """Say of which fly points it is not known whether the arm stops there."""
        c = self.columns
        rows = self.last[[*self.machine.find_unsure_stops()]]
        rows, conditions = rows[c.fly[rows]], [*c.conditions]
        for number in np.unique(c.condition[rows]).tolist():
            one, mine = conditions[number], rows[c.condition[rows] == number]
            if not (one.zone.rule == ZoneRule.PASS or one.zone.size_mm < 0.0):
                zone = replace(one.zone, rule=ZoneRule.UNKNOWN)
                c.condition[mine] = c.conditions[replace(one, zone=zone)]

    def rows_of(self, run: MoveRun) -> tuple[int, Ints]:
        """Return the file of a run and its rows, see `Collector.rows_of`."""
        return self.numbering.rows.index(run.place.offset), run.rows

    def origins_of(self, run: MoveRun) -> Origins:
        """Return where the arm may come from, in recursion from anywhere."""
        again = id(run.place.body) in self.machine.recursive
        return run.origins | NOWHERE if again else run.origins

    def _fill(self) -> None:
        """Fill the visits of all runs."""
        of_program: dict[int, list[tuple[int, MoveRun]]] = {}
        for at, run in zip(self.begin.tolist(), self.found, strict=True):
            of_program.setdefault(id(run.place.program), []).append((at, run))
        for mine in of_program.values():
            moves = ProgramMoves(mine[0][1].place.program, mine)
            self._place(moves)
            self._settings(moves)
            self._fill_written(moves)
            self._names(moves)
            self._points(moves)
            self._fill_evaluated(moves)
            self._reasons(moves)
            self._marks(moves)
        if self.machine.exhausted:
            self.columns.reason[:] = self.columns.reasons[TOO_COMPLEX]
        self.columns.names.settle()

    def _place(self, moves: ProgramMoves) -> None:
        """Enter where moves stand, and what their forms say."""
        c, visit, lines = self.columns, moves.visit, moves.program.lines
        c.file[visit], _ = self.rows_of(moves.runs[0][1])
        c.line[visit] = lines.begin_line[moves.row]
        c.kind[visit] = moves.of_forms(lambda form: form.motion)
        c.fly[visit] = moves.of_forms(lambda form: form.fly)
        c.via[visit] = moves.of_forms(lambda form: form.via)

    def _settings(self, moves: ProgramMoves) -> None:
        """Enter the settings at moves; WITH may set numbers for them."""
        index = [self.settings.index(run.settings) for _, run in moves.runs]
        setting = np.array(index, dtype=np.int64)[moves.run]
        for number, form in enumerate(moves.forms):
            if form.overrides:
                mine = np.flatnonzero(moves.form == number)
                setting[mine] = self._override_settings(moves, mine, setting[mine])
        self._setting[moves.visit] = setting
        self.columns.condition[moves.visit] = self.settings.conditions(setting)

    def _override_settings(
        self, moves: ProgramMoves, mine: Ints, setting: Ints
    ) -> Ints:
        """Return the settings at moves of one form whose WITH sets numbers, (m,)."""
        lines, overrides = (
            moves.program.lines,
            moves.forms[moves.form[mine[0]]].overrides,
        )
        names = [name for name, _ in overrides]
        slots = np.array([slot for _, slot in overrides])
        numbers = lines.value[lines.first[moves.row[mine]][:, None] + slots]
        both = np.column_stack([setting, numbers])
        distinct, which = np.unique(both, axis=0, return_inverse=True)
        index, unread = [], Nothing("the number cannot be read")
        for base, *row in distinct.tolist():
            own = dict(self.settings.get_settings(int(base)))
            own |= {n: unread if x != x else x for n, x in zip(names, row, strict=True)}
            index.append(self.settings.index(own))
        return np.array(index, dtype=np.int64)[which.ravel()]

    def _fill_written(self, moves: ProgramMoves) -> None:
        """Fill moves to six numbers that stand in them."""
        c, lines = self.columns, moves.program.lines
        base = moves.runs[0][1].place.first
        here = moves.point == WRITTEN
        for number, form in enumerate(moves.forms):
            if not form.slots:
                continue
            some = np.flatnonzero(here & (moves.form == number))
            mine = moves.visit[some]
            for k in chunks(len(some)):
                first = lines.first[moves.row[some[k]]]
                numbers = first[:, None] + np.array(form.slots, dtype=np.int32)
                c.values[mine[k]] = lines.value[numbers]
                c.slots[mine[k]] = numbers + base
            c.meaning[mine] = Meaning.JOINTS if form.joints else Meaning.POSE
            if form.config is not None:
                c.config[mine] = self.columns.configs[form.config]
                c.config_given[mine] = True
        mine = moves.visit[here]
        wrong = np.zeros(len(mine), dtype=bool)
        for k in chunks(len(mine)):
            wrong[k] = ~np.isfinite(c.values[mine[k]]).all(axis=1)
        bad = mine[wrong]
        c.meaning[bad], c.slots[bad], c.values[bad] = Meaning.UNKNOWN, -1, np.nan
        if len(bad):
            moves.first[np.flatnonzero(here)[wrong]] = self.columns.reasons[_UNREAD]
        taught = self.machine.world.taught_lines[lines.source.name]
        if taught:
            c.taught[mine] = np.isin(c.line[mine], np.array(sorted(taught)))

    def _names(self, moves: ProgramMoves) -> None:
        """Enter the names of the points that moves go to."""
        at = np.flatnonzero(moves.point >= 0)
        names = self.machine.world.initial.entries.name.take(moves.point[at])
        told = {
            k: goal.position.name
            for k, _, goal in moves.list_evaluated()
            if goal.position
        }
        if told:  # among the others, ascending
            places = np.append(np.array([*told], dtype=np.int64), at)
            every, order = NameColumn(told.values()), np.argsort(places)
            every.extend(names)
            at, names = places[order], every.take(order)
        self.columns.name[moves.visit[at]] = self.columns.names.of(names)

    def _points(self, moves: ProgramMoves) -> None:
        """Fill moves to points that the variable file tells, layout by layout."""
        points = self.machine.world.initial
        some = np.flatnonzero(moves.point >= 0)
        if len(some) == 0:
            return
        c, entries = self.columns, points.entries
        rows, visit = moves.point[some], moves.visit[some]
        for k in chunks(len(some)):
            c.values[visit[k]] = entries.numbers[rows[k]]
            c.slots[visit[k]] = entries.slots[rows[k]] + points.base
        c.taught[visit], c.shared[visit] = points.taught[rows], points.shared[rows]
        if self.machine.world.start.taught:
            names = entries.name.take(rows)
            c.taught[visit] |= [self.is_listed(name) for name in names]
        written = entries.layout[rows]
        for number in written[number_in_order(written)[1]].tolist():
            layout, mine = entries.layouts[number], written == number
            c.config[visit[mine]] = self.columns.configs[layout.config or ""]
            c.config_given[visit[mine]] = layout.config is not None
            joints = layout.kind == "JNTP"
            c.meaning[visit[mine]] = Meaning.JOINTS if joints else Meaning.POSE
            for column, axis in enumerate(layout.axes):
                if 1 <= axis <= c.aux.shape[1]:
                    c.aux[visit[mine], axis - 1] = entries.aux[rows[mine], column]
            moves.last[some[mine]] = self.columns.reasons[self.aux_problem(layout.axes)]

    def _fill_evaluated(self, moves: ProgramMoves) -> None:
        c, found = self.columns, [*moves.list_evaluated()]
        if not found:
            return
        index = np.array([k for k, _, _ in found])
        visit = moves.visit[index]
        goals = [goal for _, _, goal in found]
        c.meaning[visit] = [goal.target for goal in goals]
        c.values[visit] = np.array([goal.numbers for goal in goals], dtype=float)
        distances = np.array([goal.distance for goal in goals], dtype=float)
        if np.isfinite(distances).any():
            c.distance_mm = np.array(c.distance_mm)
            c.distance_mm[visit] = distances
        moves.first[index] = self.columns.reasons.of([goal.reason for goal in goals])
        for at, k, goal in zip(visit.tolist(), index.tolist(), goals, strict=True):
            if goal.position is not None:
                self._position(at, moves.program, goal.target, goal.position)
                aux = goal.position.aux
                axes = None if aux is None else tuple(axis for axis, _ in aux)
                moves.last[k] = self.columns.reasons[self.aux_problem(axes)]

    def _position(
        self, at: int, program: Program, target: Meaning, position: Position
    ) -> None:
        """Fill what is known of the position value that a visit goes to."""
        c, world = self.columns, self.machine.world
        c.config[at] = self.columns.configs[position.config or ""]
        c.config_given[at] = position.config is not None
        for axis, value in position.aux or ():
            if 1 <= axis <= c.aux.shape[1] and value is not None:
                c.aux[at, axis - 1] = value
        if position.editable and target in (Meaning.POSE, Meaning.JOINTS):
            c.slots[at] = position.slots
        elif -1 not in position.slots and target in _COMPUTED:
            self.bases[at] = position.slots
        else:
            world.pin(position, "a target is computed from a part of it")
        lines = world.taught_lines[program.lines.source.name]
        inline = not position.name and int(c.line[at]) in lines
        listed = self.is_listed(position.name)
        c.taught[at] = position.taught or inline or listed
        c.shared[at] = position.shared

    def _reasons(self, moves: ProgramMoves) -> None:
        """Say why moves must not be compensated: many moves, few combinations."""
        c, runs = self.columns, [run for _, run in moves.runs]
        whole = Interned[Reason]()
        kinds: list[Indices]
        recursive = [id(run.place.body) in self.machine.recursive for run in runs]
        own = [
            run.reason or (_RECURSIVE if again else NO_REASON)
            for run, again in zip(runs, recursive, strict=True)
        ]
        kinds = [moves.first, whole.of(own)[moves.run]]
        kinds += [
            moves.form,
            self._setting[moves.visit],
            c.meaning[moves.visit],
            moves.last,
        ]
        which, example = _alike(kinds)
        firsts, of_runs = [*self.columns.reasons], [*whole]
        reasons = []
        for first, run, form, setting, target, last in zip(
            *(kind[example].tolist() for kind in kinds), strict=True
        ):
            reason = firsts[first] or of_runs[run] or moves.forms[form].reason
            problem = self.settings.problem(setting, Meaning(target))
            why = reason or problem or firsts[last] or self.machine.handler
            reasons.append(self.columns.reasons[why])
        c.reason[moves.visit] = np.array(reasons, dtype=np.int64)[which]

    def aux_problem(self, axes: tuple[int, ...] | None) -> Reason:
        """Return why a target with some auxiliary axes stays, None: not known which."""
        kinds = self.machine.world.start.aux
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

    def is_listed(self, name: str) -> bool:
        """Tell whether the cell file says that a point was taught."""
        taught = self.machine.world.start.taught
        name = name.lower()
        return name in taught or base_variable(name) in taught

    def _marks(self, moves: ProgramMoves) -> None:
        """Enter the ids of moves that are measured."""
        lines = moves.program.lines
        marks = [*COMMENTS.marks(lines.source, MEASURE)]
        if not marks:
            return
        rows = np.flatnonzero(lines.which(lambda said: isinstance(said, ast.Move)))
        ids = find_measured(marks, lines.begin_line[rows], rows)
        own = np.isin(moves.row, [*ids]) & ~self.columns.via[moves.visit]
        named = [ids[row] for row in moves.row[own].tolist()]
        self.columns.measured |= zip(moves.visit[own].tolist(), named, strict=True)


def _alike(kinds: list[Indices]) -> tuple[Ints, Ints]:
    """Number the combinations of some columns in the order in which they first stand.

    Returns:
        The combination of every row, (n,), and a row of every combination.
    """
    code = example = np.zeros(len(kinds[0]), dtype=np.int64)
    for kind in kinds:
        code, example = number_in_order(code * (int(kind.max()) + 1) + kind)
    return code, example


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


def _most_axes(runs: list[MoveRun], world: World) -> int:
    """Return the last auxiliary axis that targets give a value of."""
    goals = (goal.position for run in runs for goal in run.goals.values())
    axes = {axis for p in goals if p is not None for axis, _ in p.aux or ()}
    entries = world.initial.entries
    if entries.layouts and runs:
        rows = np.concatenate([run.point for run in runs])
        used: list[int] = np.unique(entries.layout[rows[rows >= 0]]).tolist()
        axes |= {axis for k in used for axis in entries.layouts[k].axes}
    return max([0, *(min(axis, MOST_AXES) for axis in axes)])
