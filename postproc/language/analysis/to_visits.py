"""From the arrivals that a `TaskMachine` has found to `Visits`."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import (
    Callable,
    Collection,
    Hashable,
    Iterator,
    Mapping,
    Sequence,
    Set,
)
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from postproc.arrays import Floats, Indices, Ints
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language import visits
from postproc.language.analysis.call_context import Point
from postproc.language.analysis.conditions import Conditions, Zone
from postproc.language.analysis.found_visits import (
    FoundGoal,
    FoundVisit,
    array_of,
    whole_name,
)
from postproc.language.analysis.move_runs import within
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
from postproc.language.text.comment_directives import MEASURE
from postproc.language.text.statement_table import StatementText

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
    """

    conditions: Conditions
    reasons: Sequence[Reason]
    flagged: bool


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


def visits_of(
    machine: TaskMachine, dialect: Dialect, arrive: Callable[[Any], Arrival]
) -> visits.Visits:
    """Put the arrivals into the order of the program, as columns.

    Args:
        machine: It has followed all ways.
        dialect: What the numbers mean.
        arrive: Says what an arrival is carried out with.
    """
    keys = [(Point(context, at), k) for context, at, k in machine.keys]
    order = sorted(range(len(keys)), key=keys.__getitem__)
    found: list[FoundVisit] = [machine.visits[k] for k in order]
    runs = _Runs.of(found)
    numbering = Numbering.of([(text.source, text.numbers) for text in machine.texts])
    written = _Written.of(found)
    followed = _find_followed(found, written)
    columns = _fill(found, runs, numbering, machine, dialect.width)
    _fill_conditions(columns, [arrive(v) for v in found], followed, machine, runs)
    columns.taught = np.array(_find_taught(found, machine), bool)[runs.owner]
    columns.measured = _read_measure_ids(found, machine)
    literals, literal = find_literals(columns, numbering)
    columns.slots = columns.slots[:0].copy()  # the others need the room
    own = np.append(literal[runs.begin[written.example]], -1)  # each one's first
    other = [*_goals_beside(machine)]
    pinned = _find_pinned(found, written, other, machine.task.uses.copies)
    _hold_for_taught(pinned, found, written.index, machine)
    return to_visits(
        columns,
        [text.source.name for text in machine.texts],
        _graph(machine, order, runs),
        _pin(literals, literal, pinned, written, runs),
        literal,
        own[np.maximum(followed, -1)][runs.owner],
        dialect,
    )


@dataclass(frozen=True)
class _Runs:
    """Visits that were found as one.

    Attributes:
        counts: How many each found one stands for, (r,).
        begin: The first of them, (r,).
        owner: The found one of each visit, (n,).
        inside: Its place there, (n,).
    """

    counts: Ints
    begin: Ints
    owner: Indices
    inside: Indices

    @classmethod
    def of(cls, found: Sequence[FoundVisit]) -> _Runs:
        """Count the visits that found ones stand for."""
        counts = np.array([v.count for v in found], np.int64)
        return cls(counts, np.cumsum(counts) - counts, *within(counts))


@dataclass(frozen=True)
class _Written:
    """The m numbers that moves may have written anew, each once.

    Attributes:
        index: Of each, by its file and first number there.
        example: The first found visit that goes there, (m,).
    """

    index: dict[tuple[int, int], int]
    example: Ints

    @classmethod
    def of(cls, found: Sequence[FoundVisit]) -> _Written:
        """List what moves write."""
        first = dict[tuple[int, int], int]()
        for k, v in enumerate(found):
            file, slots = v.goal.writes
            if slots[0] >= 0:
                first.setdefault((file, slots[0]), k)
        index = {place: k for k, place in enumerate(first)}
        return cls(index, np.array([*first.values()], np.int64))


def _fill(
    found: Sequence[FoundVisit],
    runs: _Runs,
    numbering: Numbering,
    machine: TaskMachine,
    width: int,
) -> VisitColumns:
    """Fill where moves stand and where they go."""
    aux = _aux(found)
    n, owner = len(runs.owner), runs.owner
    c = VisitColumns(n, width, aux.shape[1], len(numbering))
    c.file[:] = np.array([v.scope.file for v in found], np.int64)[owner]
    row = np.array([v.row for v in found], np.int32)[owner] + runs.inside
    for number, text in enumerate(machine.texts):
        mine = c.file == number
        c.line[mine] = text.begin_line[row[mine]]
    c.motion[:] = np.array([v.motion for v in found], np.int64)[owner]
    c.target[:] = np.array([v.goal.target for v in found], np.int64)[owner]
    c.via[:] = np.array([v.via for v in found], bool)[owner]
    c.arc_angle = np.array([v.arc_angle for v in found], float)[owner]
    c.block = np.append(runs.begin, -1)[_blocks(found)].astype(np.int32)[owner]
    c.curved = np.array([v.curved for v in found], bool)[owner]
    c.aux[:] = aux[owner]
    c.name[:] = c.names.of([v.goal.name for v in found])[owner]
    shifts = [
        v.goal.shift if v.goal.target == visits.Meaning.POSE else None for v in found
    ]
    own = [-1 if one is None else c.shifts[one.shift] for one in shifts]
    c.shift = np.array(own, np.int64)[owner]
    shared = [v.goal.shared and not v.goal.is_rewritten_by_shift for v in found]
    c.shared[:] = np.array(shared, bool)[owner]
    if n:
        c.values[:] = np.array([v.goal.values for v in found], float)[owner]
    _fill_numbers(c, found, runs, numbering, machine)
    return c


def _fill_numbers(
    columns: VisitColumns,
    found: Sequence[FoundVisit],
    runs: _Runs,
    numbering: Numbering,
    machine: TaskMachine,
) -> None:
    """Fill which numbers are those of a target; of runs also what they are."""
    for k, v in enumerate(found):
        file, slots = v.goal.writes
        if slots[0] < 0:
            continue
        rows = slice(runs.begin[k], runs.begin[k] + v.count)
        own = np.array(slots)
        is_written, base = own >= 0, int(numbering.first[file])
        if v.count == 1:
            columns.slots[rows.start, is_written] = own[is_written] + base
            continue
        text = machine.texts[file]
        stride = int(text.first[v.row + 1] - text.first[v.row])  # of a statement
        steps = stride * np.arange(v.count)
        for column in np.flatnonzero(is_written).tolist():  # one by one: short of room
            places = own[column] + steps
            columns.slots[rows, column] = places + base
            columns.values[rows, column] = text.value[places]


def _fill_conditions(
    columns: VisitColumns,
    arrivals: Sequence[Arrival],
    followed: Ints,
    machine: TaskMachine,
    runs: _Runs,
) -> None:
    """Fill what moves are carried out with, and why they must stay."""
    c, owner = columns, runs.owner
    c.condition[:] = c.conditions.of([one.conditions for one in arrivals])[owner]
    flies = [one.conditions.zone.blend != visits.Blend.UNSET for one in arrivals]
    c.fly[:] = np.array(flies, bool)[owner]
    c.config_given[:] = np.array([one.flagged for one in arrivals], bool)[owner]
    reasons = [
        TOO_COMPLEX if machine.exhausted else next(filter(None, one.reasons), NO_REASON)
        for one in arrivals
    ]
    for k in np.flatnonzero(followed == _NO_LITERAL).tolist():
        reasons[k] = reasons[k] or ONLY_SHIFTED
    c.reason[:] = c.reasons.of(reasons)[owner]


def _read_measure_ids(
    found: Sequence[FoundVisit], machine: TaskMachine
) -> dict[int, str]:
    """Return the ids that comments give to visits."""
    ids: dict[tuple[int, int], str] = {}
    for number, file in enumerate(machine.task.files):
        text, rows = file.text, file.moves
        marks = [*machine.task.comments.marks(text.source, MEASURE)]
        last = text.source.lines_of(text.end[rows]) if marks else rows
        for line, mark in marks:
            at = int(np.searchsorted(last, line))
            if at < len(rows):
                ids.setdefault((number, int(rows[at])), mark)
    if not ids:
        return {}
    each = ((v, k) for v in found for k in range(v.count))
    own = ("" if v.via else ids.get((v.scope.file, v.row + k), "") for v, k in each)
    return {visit: mark for visit, mark in enumerate(own) if mark}


def _blocks(found: Sequence[FoundVisit]) -> Ints:
    """Return the first visit of the curve of each, -1 where it is on none."""
    first: dict[Hashable, int] = {}
    own = [-1 if v.block is None else first.setdefault(v.block, k)
           for k, v in enumerate(found)]  # fmt: skip
    return np.array(own, np.int64)


def _aux(found: Sequence[FoundVisit]) -> Floats:
    """External axes that have a value, (n, k): up to the last that is used."""
    aux = np.array([v.goal.aux for v in found], float).reshape(len(found), 6)
    used = np.flatnonzero(~np.isnan(aux).all(axis=0))
    return aux[:, : int(used.max(initial=-1)) + 1]


def _graph(machine: TaskMachine, order: Sequence[int], runs: _Runs) -> visits.Graph:
    """Translate origins to visits in program order: they end a run."""
    last = dict(zip(order, (runs.begin + runs.counts - 1).tolist(), strict=True))
    origins = [
        sorted(last[p] if p >= 0 else p for p in machine.visits[k].origins)
        for k in order
    ]
    return chain_visits(runs.counts, origins)


# Which numbers must stay, and which targets move along with others.

_NO_LITERAL = -2  # follows numbers that are no literal
MOST_NUMBERS = 17  # of a target
UNKNOWN_POINT = "its move shifts a point, too, whose numbers are not known or computed"
TAUGHT_SHIFT = "a target that is computed from it is marked as taught"
ANY_ELEMENT = "a move goes to an element of {} that only the run tells"
ANY_VALUE = "a move goes to {} where only the run tells what it holds"
BESIDE = (
    "the move in line {} of {} goes there too: how it is reached there is not followed"
)


def _pin(
    literals: visits.Literals,
    literal: Indices,
    pinned: Sequence[str],
    written: _Written,
    runs: _Runs,
) -> visits.Literals:
    """Say of literals why they must stay; what pins a run's first pins all of it."""
    texts = dict[int, str]()
    for k, why in zip(written.example.tolist(), pinned, strict=True):
        if why:
            own = literal[runs.begin[k] : runs.begin[k] + runs.counts[k]]
            texts |= dict.fromkeys(own[own >= 0].tolist(), why)
    return replace(literals, pinned=visits.texts_of(len(literals), texts))


def _find_followed(found: Sequence[FoundVisit], written: _Written) -> Ints:
    """Find what computed targets move along with, (r,), -1 for none.

    Where a shift can make up for all, the point need be no move's own. Targets do not
    move along with a point that stays.
    """
    follows = np.full(len(found), -1, dtype=np.int64)
    for k, v in enumerate(found):
        if v.goal.slots[0] < 0 <= v.goal.follows[0]:
            none = -1 if v.goal.is_rewritten_by_shift else _NO_LITERAL
            known = v.goal.target == visits.Meaning.POSE and not v.goal.stays
            follows[k] = written.index.get(v.goal.point, none) if known else -1
    return follows


def _find_pinned(
    found: Sequence[FoundVisit],
    written: _Written,
    other: Sequence[tuple[FoundGoal, str]],
    copies: Set[tuple[str, str]],
) -> list[str]:
    """Say why numbers that are written must stay, "" where they need not.

    Args:
        found: The visits.
        written: What their moves write.
        other: Where moves go that run beside, and why those numbers stay.
        copies: Points and what they are copied from.
    """
    index = written.index
    goals = [(v.goal, ANY_ELEMENT.format(v.goal.name)) for v in found]
    # Of moves to an element of an array that is not known.
    elements = {goal.name: why for goal, why in (*goals, *other)
                if goal.name and max(goal.slots[0], goal.follows[0]) < 0
                and not array_of(goal.name)}  # fmt: skip
    elements |= {
        name: ANY_VALUE.format(name) for v in found for name in v.goal.doubtful
    }
    stays = {goal.point: why for goal, why in other}
    stays |= {(f, slots[0]): why for g, why in other for f, slots in [g.writes]}
    pinned = []
    for v in (found[k] for k in written.example.tolist()):
        file, slots = v.goal.writes
        by = v.goal.shift if v.goal.is_rewritten_by_shift else None
        own = elements.get(array_of(v.goal.name), "") if by is None else by.pins
        pinned.append(stays.get((file, slots[0]), "") or own)
    uncertain = _find_uncertain({*elements}, copies)
    copied = uncertain - elements.keys()
    for v in found:
        unknown = {v.goal.name} & copied
        for point in v.goal.given:
            unknown |= point.names & uncertain
        if unknown:
            place = v.goal.writes[0], v.goal.writes[1][0]
            for at in {index.get(v.goal.point, -1), index.get(place, -1)} - {-1}:
                pinned[at] = pinned[at] or ANY_VALUE.format(min(unknown))
        at = index.get(v.goal.point, -1)
        if at >= 0:
            pinned[at] = pinned[at] or v.goal.pins
        for shift in {index.get(place, -1) for place in v.goal.holds} - {-1}:
            pinned[shift] = pinned[shift] or UNKNOWN_POINT
    return pinned


def _find_uncertain(names: set[str], copies: Set[tuple[str, str]]) -> set[str]:
    """Add what points are made from that moves go to where they are not known.

    >>> sorted(_find_uncertain({"q"}, {("q", "p1"), ("p1", "p0"), ("r", "p2")}))
    ['p0', 'p1', 'q']
    """
    found = set[str]()
    while names - found:
        found |= names
        names = {source for target, source in copies if target in found}
    return found


def _hold_for_taught(
    pinned: list[str],
    found: Sequence[FoundVisit],
    index: Mapping[tuple[int, int], int],
    machine: TaskMachine,
) -> None:
    """Hold the points of targets that are computed and marked as taught, in place."""
    lines = machine.task.taught_lines
    if not any(lines):
        return
    for v in found:
        at, file = index.get(v.goal.point, -1), v.scope.file
        if at < 0 or v.goal.slots[0] >= 0 or v.goal.is_rewritten_by_shift:
            continue
        if not lines[file].isdisjoint(machine.texts[file].lines(v.row)):
            pinned[at] = pinned[at] or TAUGHT_SHIFT


def _goals_beside(machine: TaskMachine) -> Iterator[tuple[FoundGoal, str]]:
    """Yield where moves go that run in ways that are not followed, and say so."""
    files = machine.task.files  # and no others: of those beside the task nothing moves
    for file, row in sorted({*machine.rows_beside()}):
        if file >= len(files) or not files[file].is_move(row):
            continue
        text = machine.texts[file]
        why = BESIDE.format(text.line(row), text.source.name)
        for goal in machine.goals_of(file, row):
            yield goal, why


def _find_taught(found: Sequence[FoundVisit], machine: TaskMachine) -> list[bool]:
    """Tell which visits go to taught points, or to targets shifted from one, (r,)."""
    lines = machine.task.taught_lines
    if not (any(lines) or machine.start.taught):
        return [False] * len(found)
    places = [{(v.goal.writes[0], v.goal.writes[1][0]), v.goal.point} for v in found]
    written = {place for some in places for place in some if place[1] >= 0}
    marked = _find_marked(written, machine)
    return [
        whole_name(v.goal.name).strip().lower() in machine.start.taught
        or not marked.isdisjoint(some)
        for v, some in zip(found, places, strict=True)
    ]


def _find_marked(
    places: Collection[tuple[int, int]], machine: TaskMachine
) -> set[tuple[int, int]]:
    """Find the targets, by file and first number, that a comment marks as taught.

    It speaks of those whose numbers stand on its line; where none do, of all in its
    statement.
    """
    found = set[tuple[int, int]]()
    for file, lines in enumerate(machine.task.taught_lines):
        text = machine.texts[file]
        own = sorted(slot for at, slot in places if at == file) if lines else []
        rows = {slot: text.row_of(slot) for slot in own}
        for line in lines:
            there = _on_line(own, rows, text, line)
            near = (slot for slot in own if line in text.lines(rows[slot]))
            found |= {(file, slot) for slot in there or near}
    return found


def _on_line(
    own: Sequence[int], rows: Mapping[int, int], text: StatementText[Any], line: int
) -> set[int]:
    """Return the targets, by their first numbers, with numbers on a line."""
    starts = text.source.line_starts
    begin, end = (*starts[line - 1 : line + 1].tolist(), len(text.source.data))[:2]
    first, last = np.searchsorted(text.numbers.start, [begin, end]).tolist()
    found = set[int]()
    for slot in range(first, last):
        at = bisect_right(own, slot) - 1
        if at >= 0 and slot - own[at] < MOST_NUMBERS:
            found |= {own[at]} if text.row_of(slot) == rows[own[at]] else set()
    return found
