"""From the arrivals that a machine has found to `Visits`."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import (
    Collection,
    Hashable,
    Iterable,
    Iterator,
    Mapping,
    Sequence,
    Set,
)
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

from postproc.arrays import Indices, Ints, release_memory
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language import visits
from postproc.language.analysis.call_context import Point
from postproc.language.analysis.conditions import Conditions, Zone
from postproc.language.analysis.found_goals import (
    FoundGoal,
    FoundVisit,
    array_of,
    whole_name,
)
from postproc.language.analysis.origins import Origins, number_origins
from postproc.language.analysis.task_machine import TaskMachine
from postproc.language.analysis.visit_columns import (
    TOO_COMPLEX,
    Numbering,
    VisitColumns,
    chain_visits,
    find_literals,
    to_visits,
)
from postproc.language.pose_encoding import Dialect
from postproc.language.text.comment_directives import MEASURE, Comments

ONLY_SHIFTED = Reason(
    Code.NUMBERS_NOT_OWN,
    "it is shifted from a point that no move goes to: what to correct?",
)


@dataclass(frozen=True)
class Arrival:
    """What a language says of an arrival.

    Attributes:
        conditions: What it is carried out with.
        reasons: Why it cannot be compensated; `NO_REASON` does not count.
        flagged: It has configuration flags.
        flies: The arm passes it without stopping.
    """

    conditions: Conditions
    reasons: Sequence[Reason]
    flagged: bool
    flies: bool


def zone_at(
    via: bool,
    size_mm: float = math.nan,
    overlap: float = math.nan,
    exact: bool = False,
    unsized: bool = False,
) -> Zone:
    """Tell how an arrival is passed; where the arm stops no blend is set.

    Args:
        via: It is the point on an arc.
        size_mm: Size of its zone; NaN or negative: none.
        overlap: Of moves that begin before the last has ended [%], NaN for a zone.
        exact: It is passed exactly, without stopping.
        unsized: It may be a stop, or be passed in a zone of any size.
    """
    if overlap >= 0.0:
        return Zone(
            size_mm if size_mm >= 0.0 else math.nan, overlap, visits.Blend.OVERLAP
        )
    if not (via or exact or unsized or size_mm >= 0.0):
        return Zone(overlap_percent=100.0)
    rule = visits.ZoneRule.PASS if exact else visits.ZoneRule.FROM
    rule = visits.ZoneRule.UNKNOWN if unsized and not via else rule
    size = size_mm if size_mm >= 0.0 else math.nan
    return Zone(size, 100.0, visits.Blend.ZONE, rule)


# Which numbers must stay, and which targets move along with others.

_NO_LITERAL = -2  # follows numbers that are no literal
MOST_NUMBERS = 17  # of a target
UNKNOWN_POINT = "its move shifts a point, too, whose numbers are not known or computed"
TAUGHT_SHIFT = "a target that is computed from it is marked as taught"
ANY_ELEMENT = "a move goes to an element of {} that only the run tells"
ANY_VALUE = "a move goes to {} where only the run tells what it holds"
ANY_COPY = (
    "a move goes to {}, which {} is copied to, where only the run tells what it holds"
)
BESIDE = (
    "the move in line {} of {} goes there too: how it is reached there is not followed"
)


class Collector(ABC):
    """Makes visits of what a machine has found, r, in the order of the program: n.

    Attributes:
        dialect: What the numbers mean.
        comments: How the language writes them.
        machine: It has followed all ways.
        numbering: The numbers of all files.
        found: What it has found.
        counts, begin: How many visits each stands for, and the first of them, (r,).
        last: The last of them, by the number that the machine knows it by, (r,).
        owner, inside: Whose a visit is, and its place there, (n,).
        columns: The visits.
    """

    dialect: ClassVar[Dialect]
    comments: ClassVar[Comments]

    def __init__(self, machine: Any, numbering: Numbering) -> None:
        """Sort what was found."""
        self.machine, self.numbering = machine, numbering
        keys = [(Point(context, at), k) for context, at, k in machine.keys]
        order = sorted(range(len(keys)), key=keys.__getitem__)
        self.found: list[Any] = [machine.visits[k] for k in order]
        self.counts = np.array([one.count for one in self.found], np.int64)
        self.begin = np.cumsum(self.counts) - self.counts
        self.last = np.empty(len(order), np.int64)
        self.last[order] = self.begin + self.counts - 1
        every = np.arange(len(order), dtype=np.int32)
        self.owner: Indices = np.repeat(every, self.counts)
        own = self.begin.astype(np.int32)[self.owner]
        self.inside: Indices = np.arange(len(own), dtype=np.int32) - own

    # What a language says.

    @abstractmethod
    def arrive(self, v: Any) -> Arrival:
        """Say what an arrival is carried out with."""

    @abstractmethod
    def list_moves(self) -> Sequence[Indices]:
        """Return the rows of the moves of every file that is followed."""

    @abstractmethod
    def fill_run(self, v: Any, rows: slice) -> None:
        """Fill the columns of moves that stand for more than the first of them.

        Args:
            v: The first of them.
            rows: Their visits; what is said of an arrival has been filled.
        """

    @abstractmethod
    def find_uses(self, literal: Indices) -> tuple[dict[int, str], Indices]:
        """Find what else depends on literals.

        Args:
            literal: Literal of every visit, (n,), -1 where it has none.

        Returns:
            Why literals must stay, and for every visit the literal that it moves along
            with, (n,), -1 where there is none.
        """

    def origins_of(self, one: Any) -> Origins:
        """Return where the arm may come from before what was found."""
        found: Origins = one.origins
        return found

    def count_axes(self) -> int:
        """Return the last auxiliary axis that targets give a value of."""
        aux = np.array([v.goal.aux for v in self.found], float)
        used = ~np.isnan(aux).all(axis=0) if len(aux) else []
        return int(np.flatnonzero(used).max(initial=-1)) + 1

    # What follows from that.

    def collect(self) -> visits.Visits:
        """Put the arrivals into columns."""
        numbers, n = len(self.numbering), len(self.owner)
        self.columns = c = VisitColumns(
            n, self.dialect.width, self.count_axes(), numbers
        )
        self._fill_places()
        self.fill_goals(self.begin, [v.goal for v in self.found])
        self._fill_conditions()
        for v, begin in zip(self.found, self.begin.tolist(), strict=True):
            if v.is_run:
                self.fill_run(v, slice(begin, begin + v.count))
        self.complete()
        self._mark_pauses()
        if self.machine.exhausted:
            c.reason[:] = c.reasons[TOO_COMPLEX]
        c.names.settle()
        release_memory(n)
        literals, literal = find_literals(c, self.numbering)
        pinned, follows = self.find_uses(literal)
        if pinned:
            texts = visits.texts_of(len(literals), pinned)
            literals = replace(literals, pinned=texts)
        c.slots = c.slots[:0].copy()  # the others need the room
        own = self.numbering.names, self.graph(), literals, literal, follows
        return to_visits(c, *own, self.dialect)

    def complete(self) -> None:
        """Fill what only this language says, and which moves are measured."""
        self.columns.measured = self._read_measure_ids()

    def spread(self, own: Iterable[Any], dtype: DTypeLike) -> NDArray[Any]:
        """Return what is said of what was found, for every visit, (n,)."""
        return np.array([*own], dtype)[self.owner]

    def _fill_places(self) -> None:
        """Fill where moves stand, and how they move."""
        c, found = self.columns, self.found
        c.file[:] = self.spread((v.scope.file for v in found), np.int64)
        row = self.spread((v.row for v in found), np.int32) + self.inside
        for number, text in enumerate(self.numbering.texts):
            mine = c.file == number
            c.line[mine] = text.begin_line[row[mine]]
        c.kind[:] = self.spread((v.motion for v in found), np.int64)
        c.via[:] = self.spread((v.via for v in found), bool)

    def fill_goals(self, visit: Ints, goals: Sequence[Any]) -> None:
        """Fill where some moves go, each for itself.

        Args:
            visit: Their visits, (k,).
            goals: Where they go, k.
        """
        c = self.columns
        if not len(visit):
            return
        c.meaning[visit] = [goal.target for goal in goals]
        c.values[visit] = np.array([goal.values for goal in goals], float)
        c.name[visit] = c.names.of([goal.name for goal in goals])
        c.aux[visit] = np.array([goal.aux for goal in goals])[:, : c.aux.shape[1]]
        c.shared[visit] = [g.shared and not g.is_rewritten_by_shift for g in goals]
        written = [k for k, goal in enumerate(goals) if goal.writes[0] >= 0]
        if written:
            c.slots[visit[written]] = [goals[k].writes for k in written]

    def fill_numbers(
        self, visit: Ints | slice, slots: Iterable[tuple[int, Ints]], file: int
    ) -> None:
        """Fill numbers that stand in moves, and where; column by column: short of room.

        Args:
            visit: The visits, k.
            slots: Columns of targets, and the numbers of all files there, (k,).
            file: The file of the moves.
        """
        c, value = self.columns, self.numbering.texts[file].value
        for column, own in slots:
            c.slots[visit, column] = own
            c.values[visit, column] = value[own - self.numbering.first[file]]

    def _fill_conditions(self) -> None:
        """Fill what moves are carried out with, and why they must stay."""
        c, arrivals = self.columns, [self.arrive(v) for v in self.found]
        conditions = [one.conditions for one in arrivals]
        c.condition[:] = c.conditions.of(conditions)[self.owner]
        c.fly[:] = self.spread((one.flies for one in arrivals), bool)
        c.config_given[:] = self.spread((one.flagged for one in arrivals), bool)
        reasons = [next(filter(None, one.reasons), NO_REASON) for one in arrivals]
        c.reason[:] = c.reasons.of(reasons)[self.owner]

    def _mark_pauses(self) -> None:
        """Say of which fly points it is not known whether the arm stops there."""
        c = self.columns
        rows = self.last[[*self.machine.find_unsure_stops()]]
        rows, conditions = rows[c.fly[rows]], [*c.conditions]
        for number in np.unique(c.condition[rows]).tolist():
            one, mine = conditions[number], rows[c.condition[rows] == number]
            if not (one.zone.rule == visits.ZoneRule.PASS or one.zone.size_mm < 0.0):
                zone = replace(one.zone, rule=visits.ZoneRule.UNKNOWN)
                c.condition[mine] = c.conditions[replace(one, zone=zone)]

    def graph(self) -> visits.Graph:
        """Translate origins to visits in the order of the program."""
        every = map(self.origins_of, self.found)
        origins = [number_origins(one, self.last) for one in every]
        return chain_visits(self.counts, origins)

    def find_unreached(self, moves: Iterable[Indices]) -> dict[str, Ints]:
        """Return the lines of moves that no way leads to, ascending, by file.

        Args:
            moves: Rows of the moves of every file.
        """
        texts = self.numbering.texts
        missed = [np.zeros(len(text), bool) for text in texts]
        for own, rows in zip(missed, moves, strict=False):
            own[rows] = True
        for v in self.found:
            missed[v.scope.file][v.rows] = False
        lines = (
            np.unique(t.begin_line[own]) for t, own in zip(texts, missed, strict=True)
        )
        found = zip(self.numbering.names, lines, strict=True)
        return {name: own.astype(np.int64) for name, own in found if len(own)}

    def _read_measure_ids(self) -> dict[int, str]:
        """Return the ids that comments give to visits: a mark counts for the next move.

        It may stand before the move, or on its last line.
        """
        ids = list[dict[int, str]]()
        for text, rows in zip(self.numbering.texts, self.list_moves(), strict=False):
            marks = [*self.comments.marks(text.source, MEASURE)]
            last = text.end_line[rows] if marks else rows
            ids.append({})
            for line, mark in marks:
                at = int(np.searchsorted(last, line))
                if at < len(rows):
                    ids[-1].setdefault(int(rows[at]), mark)
        found = dict[int, str]()
        begins = self.begin.tolist()
        for v, begin in zip(self.found if any(ids) else (), begins, strict=False):
            own = {} if v.via else ids[v.scope.file]
            rows = v.rows
            each = range(rows.start, rows.stop) if isinstance(rows, slice) else rows
            found |= {begin + k: own[row] for k, row in enumerate(each) if row in own}
        return found


class TaskCollector(Collector):
    """Makes visits of what the machine of a task has found."""

    machine: TaskMachine
    found: list[FoundVisit]

    def __init__(self, machine: Any) -> None:
        """Find what counts for several: it is filled for all of them."""
        super().__init__(machine, machine.task.numbering)
        first = dict[int, int]()  # by the numbers that moves write
        for k, v in enumerate(self.found):
            if v.goal.writes[0] >= 0:
                first.setdefault(v.goal.writes[0], k)
        self.index = {place: k for k, place in enumerate(first)}
        self.example = [*first.values()]
        self.followed = self._find_followed()

    def list_moves(self) -> Sequence[Indices]:
        """Return the moves of the files of the task."""
        return [file.moves for file in self.machine.task.files]

    def fill_run(self, v: FoundVisit, rows: slice) -> None:
        """Fill moves that differ in their numbers alone, see `Collector.fill_run`."""
        c, text = self.columns, self.machine.texts[v.scope.file]
        for column in (c.meaning, c.values, c.slots, c.name, c.aux, c.shared):
            column[rows] = column[rows.start]
        stride = int(text.first[v.row + 1] - text.first[v.row])  # of a statement
        own, steps = v.goal.writes, stride * np.arange(v.count)
        places = ((at, slot + steps) for at, slot in enumerate(own) if slot >= 0)
        self.fill_numbers(rows, places, v.scope.file)

    def complete(self) -> None:
        """Fill splines, shifts and taught points, see `Collector.complete`."""
        super().complete()
        c, found = self.columns, self.found
        c.arc_angle = self.spread((v.arc_angle for v in found), float)
        c.block = np.append(self.begin, -1)[_blocks(found)].astype(np.int32)[self.owner]
        c.curved = self.spread((v.curved for v in found), bool)
        posed = (
            v.goal.shift if v.goal.target == visits.Meaning.POSE else None
            for v in found
        )  # fmt: skip
        own = (-1 if one is None else c.shifts[one.shift] for one in posed)
        c.shift = self.spread(own, np.int64)
        lost = (self.followed == _NO_LITERAL)[self.owner] & (c.reason == 0)
        if lost.any():
            c.reason[lost] = c.reasons[ONLY_SHIFTED]
        c.taught = self.spread(self._find_taught(), bool)

    def find_uses(self, literal: Indices) -> tuple[dict[int, str], Indices]:
        """Find it by the first of each run: what pins that one pins its run."""
        pinned = self._find_pinned([*_goals_beside(self.machine)])
        self._hold_for_taught(pinned)
        texts = dict[int, str]()
        for k, why in zip(self.example, pinned, strict=True):
            if why:
                own = literal[self.begin[k] : self.begin[k] + self.counts[k]]
                texts |= dict.fromkeys(own[own >= 0].tolist(), why)
        own = np.append(literal[self.begin[np.array(self.example, np.int64)]], -1)
        return texts, own[np.maximum(self.followed, -1)][self.owner]

    def _find_followed(self) -> Ints:
        """Find what computed targets move along with, (r,), -1 for none.

        Where a shift can make up for all, the point need be no move's own. Targets do
        not move along with a point that stays.
        """
        follows = np.full(len(self.found), -1, dtype=np.int64)
        for k, v in enumerate(self.found):
            if v.goal.slots[0] < 0 <= v.goal.follows[0]:
                none = -1 if v.goal.is_rewritten_by_shift else _NO_LITERAL
                known = v.goal.target == visits.Meaning.POSE and not v.goal.stays
                follows[k] = self.index.get(v.goal.point, none) if known else -1
        return follows

    def _find_pinned(self, other: Sequence[tuple[FoundGoal, str]]) -> list[str]:
        """Say why numbers that are written must stay, "" where they need not.

        Args:
            other: Where moves go that run beside, and why those numbers stay.
        """
        found, index = self.found, self.index
        goals = [(v.goal, ANY_ELEMENT.format(v.goal.name)) for v in found]
        # Of moves to an element of an array that is not known.
        elements = {goal.name: why for goal, why in (*goals, *other)
                    if goal.name and max(goal.slots[0], goal.follows[0]) < 0
                    and not array_of(goal.name)}  # fmt: skip
        elements |= {
            name: ANY_VALUE.format(name) for v in found for name in v.goal.doubtful
        }
        stays = {goal.point: why for goal, why in other}
        stays |= {goal.writes[0]: why for goal, why in other}
        pinned = []
        for v in (found[k] for k in self.example):
            by = v.goal.shift if v.goal.is_rewritten_by_shift else None
            own = elements.get(array_of(v.goal.name), "") if by is None else by.pins
            pinned.append(stays.get(v.goal.writes[0], "") or own)
        uncertain = _find_uncertain({*elements}, self.machine.task.uses.copies)
        copied = uncertain.keys() - elements.keys()
        for v in found:
            unknown = {v.goal.name, array_of(v.goal.name)} & copied
            unknown |= v.goal.names & uncertain.keys()
            if unknown:
                places = v.goal.point, v.goal.writes[0]
                for at in {index.get(place, -1) for place in places} - {-1}:
                    pinned[at] = pinned[at] or uncertain[min(unknown)]
            at = index.get(v.goal.point, -1)
            if at >= 0:
                pinned[at] = pinned[at] or v.goal.pins
            for shift in {index.get(place, -1) for place in v.goal.holds} - {-1}:
                pinned[shift] = pinned[shift] or UNKNOWN_POINT
        return pinned

    def _hold_for_taught(self, pinned: list[str]) -> None:
        """Hold the points of targets that are computed and marked as taught."""
        lines = self.machine.task.taught_lines
        for v in self.found if any(lines) else ():
            at, file = self.index.get(v.goal.point, -1), v.scope.file
            if at < 0 or v.goal.slots[0] >= 0 or v.goal.is_rewritten_by_shift:
                continue
            if not lines[file].isdisjoint(self.machine.texts[file].lines(v.row)):
                pinned[at] = pinned[at] or TAUGHT_SHIFT

    def _find_taught(self) -> list[bool]:
        """Tell which go to taught points, or to targets shifted from one, (r,)."""
        taught = self.machine.task.start.taught
        if not (any(self.machine.task.taught_lines) or taught):
            return [False] * len(self.found)
        goals = [v.goal for v in self.found]
        places = [{one.writes[0], one.point} for one in goals]
        written = {place for some in places for place in some if place >= 0}
        marked = _find_marked(written, self.machine) | self.machine.task.listed_slots
        names = [{*one.names, whole_name(one.name).strip().lower()} for one in goals]
        return [
            not (own.isdisjoint(taught) and marked.isdisjoint(some))
            for own, some in zip(names, places, strict=True)
        ]


def _blocks(found: Sequence[FoundVisit]) -> Ints:
    """Return the first visit of the curve of each, -1 where it is on none."""
    first: dict[Hashable, int] = {}
    own = [-1 if v.block is None else first.setdefault(v.block, k)
           for k, v in enumerate(found)]  # fmt: skip
    return np.array(own, np.int64)


def _find_uncertain(names: set[str], copies: Set[tuple[str, str]]) -> Mapping[str, str]:
    """Add what points are made from that moves go to where they are not known.

    Returns:
        Why each of these names must keep its numbers.

    >>> found = _find_uncertain({"q"}, {("q", "p1"), ("p1", "p0"), ("r", "p2")})
    >>> sorted(found), found["q"]
    (['p0', 'p1', 'q'], 'a move goes to q where only the run tells what it holds')
    """
    goal = {name: name for name in names}  # what the move goes to, by what it may hold
    before = -1
    while before != len(goal):
        before = len(goal)
        for target, source in sorted(copies):
            if target in goal:
                goal.setdefault(source, goal[target])
    return {
        name: ANY_VALUE.format(to) if to == name else ANY_COPY.format(to, name)
        for name, to in goal.items()
    }


def _goals_beside(machine: TaskMachine) -> Iterator[tuple[FoundGoal, str]]:
    """Yield where moves go that run in ways that are not followed, and say so."""
    files = machine.task.files  # and no others: of those beside the task nothing moves
    for file, row in sorted({*machine.rows_of(machine.beside)}):
        if file >= len(files) or not files[file].is_move(row):
            continue
        text = machine.texts[file]
        why = BESIDE.format(text.line(row), text.source.name)
        for goal in machine.goals_of(file, row):
            yield goal, why


def _find_marked(places: Collection[int], machine: TaskMachine) -> set[int]:
    """Find the targets, by their first numbers, that a comment marks as taught.

    It speaks of those whose numbers stand on its line; where none do, of all in its
    statement.
    """
    found, begins = set[int](), machine.task.numbering.first
    for file, lines in enumerate(machine.task.taught_lines):
        text, (begin, behind) = machine.texts[file], begins[file : file + 2]
        own = sorted(slot - begin for slot in places if begin <= slot < behind)
        own, on_line, of_row = own if lines else [], defaultdict(set), defaultdict(set)
        for slot, other in zip(own, [*own[1:], behind - begin], strict=False):
            row = text.row_of(slot)
            of_row[row].add(begin + slot)
            end = min(slot + MOST_NUMBERS, other, int(text.first[row + 1]))
            starts = text.numbers.starts(slice(slot, end))
            for line in text.source.lines_of(starts).tolist():
                on_line[line].add(begin + slot)
        for line in lines if own else ():
            near = (slot for row in text.rows_on(line) for slot in of_row[row])
            found |= on_line[line] or {*near}
    return found
