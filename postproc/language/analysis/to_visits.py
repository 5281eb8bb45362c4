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
from postproc.language.analysis.move_blocks import MoveBlock
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
    """Makes visits of what a machine has found, in the order of the program: n.

    Attributes:
        dialect: What the numbers mean.
        comments: How the language writes them.
        machine: It has followed all ways.
        numbering: The numbers of all files.
        runs: What it has found: arrivals, and blocks of them, r.
        counts: How many visits each stands for, (r,).
        last: The last of them, by the number that the machine knows it by, (r,).
        found: The arrivals, each of which may stand for some visits of a block, g.
        begin: The first visit of each, (g,).
        owner, row: Which of them a visit is, and its row, (n,).
        blocks: First visit and first arrival of every block, and the block.
        columns: The visits.
    """

    dialect: ClassVar[Dialect]
    comments: ClassVar[Comments]

    def __init__(self, machine: Any, numbering: Numbering) -> None:
        """Sort what was found."""
        self.machine, self.numbering = machine, numbering
        keys = [(Point(context, at), k) for context, at, k in machine.keys]
        order = sorted(range(len(keys)), key=keys.__getitem__)
        self.runs: list[Any] = [machine.visits[k] for k in order]
        self.counts = np.array([len(one.rows) for one in self.runs], np.int64)
        start = np.cumsum(self.counts) - self.counts
        self.last = np.empty(len(order), np.int64)
        self.last[order] = start + self.counts - 1
        parts = [one.arrivals for one in self.runs]
        self.found: list[Any] = [one for some in parts for one in some]
        several = np.array([len(some) for some in parts], np.int64)
        base = np.cumsum(several) - several
        self.owner: Indices = np.repeat(base.astype(np.int32), self.counts)
        first = np.array([one.rows[0] for one in self.runs], np.int32)
        self.row: Indices = np.repeat(first, self.counts)
        self.begin = np.repeat(start, several)
        self.blocks = list[tuple[int, int, MoveBlock]]()
        for k, one in enumerate(self.runs):
            if isinstance(one, MoveBlock):
                own, at = slice(start[k], start[k] + len(one.rows)), int(base[k])
                self.blocks.append((int(start[k]), at, one))
                self.row[own], self.owner[own] = one.rows, at + one.group
                examples = np.unique(one.group, return_index=True)[1]
                self.begin[at : at + len(examples)] += examples

    # What a language says.

    @abstractmethod
    def arrive(self, v: Any) -> Arrival:
        """Say what an arrival is carried out with."""

    @abstractmethod
    def list_moves(self) -> Sequence[Indices]:
        """Return the rows of the moves of every file that is followed."""

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
        several = [aux, *(one.aux for _, _, one in self.blocks if one.aux is not None)]
        used = [~np.isnan(one).all(axis=0) for one in several if len(one)]
        return int(np.flatnonzero(np.any(used, axis=0)).max(initial=-1)) + 1

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
        for begin, _, block in self.blocks:
            self._fill_block(block, begin)
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
        for number, text in enumerate(self.numbering.texts):
            mine = c.file == number
            c.line[mine] = text.begin_line[self.row[mine]]
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

    def _fill_block(self, block: MoveBlock, begin: int) -> None:
        """Fill the moves of a block that arrivals of others stand for.

        Args:
            block: The block.
            begin: Its first visit.
        """
        c = self.columns
        pairs = zip(block.examples, block.members, strict=True)
        for example, own in (pair for pair in pairs if len(pair[1]) > 1):
            visit, goal = begin + own, example.goal
            for column in (c.meaning, c.shared, c.config, c.config_given, c.taught):
                column[visit] = column[visit[0]]
            if goal.writes[0] >= 0:
                self._fill_numbers(block, visit, own, goal.writes)
            c.aux[visit] = c.aux[visit[0]]
            if block.aux is not None:
                c.aux[visit] = block.aux[own][:, : c.aux.shape[1]]
            if block.names is not None and goal.name:
                c.name[visit] = c.names.of(block.names.take(own))

    def _fill_numbers(
        self, block: MoveBlock, visit: Ints, own: Ints, slots: Sequence[int]
    ) -> None:
        """Fill numbers of targets, and where they stand, column by column.

        Args:
            block: The block.
            visit: The visits, (m,).
            own: Which of its moves they are, (m,).
            slots: The numbers of the target that they are like, -1 for none.
        """
        c, behind = self.columns, block.offset[own]
        file = self.numbering.file_of(slots[0])
        value, first = self.numbering.texts[file].value, self.numbering.first[file]
        for column, slot in enumerate(slots):
            if slot < 0:
                c.values[visit, column] = c.values[visit[0], column]
                continue
            c.slots[visit, column] = at = slot + behind
            if len(value):
                c.values[visit, column] = value[at - first]
            elif block.values is not None:
                c.values[visit, column] = block.values[own, column]

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
        every = map(self.origins_of, self.runs)
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
        for v in self.runs:
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
        found, behind = dict[int, str](), np.cumsum(self.counts).tolist()
        for v, end in zip(self.runs if any(ids) else (), behind, strict=False):
            own, begin = {} if v.via else ids[v.scope.file], end - len(v.rows)
            found |= {begin + k: own[r] for k, r in enumerate(v.rows) if r in own}
        return found


class TaskCollector(Collector):
    """Makes visits of what the machine of a task has found."""

    machine: TaskMachine
    found: list[FoundVisit]

    def __init__(self, machine: Any) -> None:
        """Sort what was found."""
        super().__init__(machine, machine.task.numbering)

    def list_moves(self) -> Sequence[Indices]:
        """Return the moves of the files of the task."""
        return [file.moves for file in self.machine.task.files]

    def complete(self) -> None:
        """Fill splines, shifts and taught points, see `Collector.complete`."""
        super().complete()
        c, found = self.columns, self.found
        first, self.visit_of = np.unique(c.slots[:, 0], return_index=True)
        self.places: Ints = first.astype(np.int64)
        self.followed = self._find_followed()
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
        """Find it by the first numbers of targets, see `Collector.find_uses`."""
        pinned = self._find_pinned([*_goals_beside(self.machine)])
        self._hold_for_taught(pinned)
        known = np.append(literal, -1)
        own = ((int(known[self._visit_at(at)]), why) for at, why in pinned.items())
        texts = {number: why for number, why in own if number >= 0}
        return texts, known[np.maximum(self.followed, -1)][self.owner]

    def _visit_at(self, place: int) -> int:
        """Return the first visit whose target begins with a number, -1 for none."""
        at = (
            int(np.searchsorted(self.places, place)) if place >= 0 else len(self.places)
        )
        known = at < len(self.places) and self.places[at] == place
        return int(self.visit_of[at]) if known else -1

    def _find_followed(self) -> Ints:
        """Find the visits that computed targets move along with, (g,), -1 for none.

        Where a shift can make up for all, the point need be no move's own. Targets do
        not move along with a point that stays.
        """
        follows = np.full(len(self.found), -1, dtype=np.int64)
        for k, v in enumerate(self.found):
            if v.goal.slots[0] < 0 <= v.goal.follows[0]:
                none = -1 if v.goal.is_rewritten_by_shift else _NO_LITERAL
                known = v.goal.target == visits.Meaning.POSE and not v.goal.stays
                at = self._visit_at(v.goal.point) if known else -1
                follows[k] = none if known and at < 0 else at
        return follows

    def _find_pinned(self, other: Sequence[tuple[FoundGoal, str]]) -> dict[int, str]:
        """Say why numbers that are written must stay, by the first of each target.

        Args:
            other: Where moves go that run beside, and why those numbers stay.
        """
        found, pinned = self.found, dict[int, str]()
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
        uncertain = _find_uncertain({*elements}, self.machine.task.uses.copies)
        copied = uncertain.keys() - elements.keys()
        seen = set[int]()
        for goal in self._list_goals(bool(stays or uncertain)):
            if goal.writes[0] not in seen:
                by = goal.shift if goal.is_rewritten_by_shift else None
                own = elements.get(array_of(goal.name), "") if by is None else by.pins
                _hold(pinned, goal.writes[0], stays.get(goal.writes[0], "") or own)
                seen.add(goal.writes[0])
        for goal in self._list_goals(bool(uncertain)):
            unknown = {goal.name, array_of(goal.name)} & copied
            unknown |= goal.names & uncertain.keys()
            if unknown:
                for place in (goal.point, goal.writes[0]):
                    _hold(pinned, place, uncertain[min(unknown)])
            _hold(pinned, goal.point, goal.pins)
            for place in goal.holds:
                _hold(pinned, place, UNKNOWN_POINT)
        return pinned

    def _list_goals(self, by_name: bool) -> Iterator[FoundGoal]:
        """Yield where moves go, those of blocks one by one where that may count.

        Args:
            by_name: Names of points decide what must stay.
        """
        many = {at + k: (block, own) for _, at, block in self.blocks
                for k, own in enumerate(block.members) if len(own) > 1}  # fmt: skip
        for k, v in enumerate(self.found):
            if k not in many or not (by_name or v.goal.pins):
                yield v.goal
                continue
            block, own = many[k]
            for at, offset in zip(
                own.tolist(), block.offset[own].tolist(), strict=True
            ):
                name = v.goal.name if block.names is None else block.names[at]
                yield v.goal.behind(offset, name)

    def _hold_for_taught(self, pinned: dict[int, str]) -> None:
        """Hold the points of targets that are computed and marked as taught."""
        lines = self.machine.task.taught_lines
        for v in self.found if any(lines) else ():
            file = v.scope.file
            if v.goal.slots[0] >= 0 or v.goal.is_rewritten_by_shift:
                continue
            if not lines[file].isdisjoint(self.machine.texts[file].lines(v.row)):
                _hold(pinned, v.goal.point, TAUGHT_SHIFT)

    def _find_taught(self) -> list[bool]:
        """Tell which go to taught points, or to targets shifted from one, (g,)."""
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


def _hold(pinned: dict[int, str], place: int, why: str) -> None:
    """Note why a target must stay, by its first number; what is noted first counts."""
    if why and place >= 0:
        pinned.setdefault(place, why)


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
