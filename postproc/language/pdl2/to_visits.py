"""From the records of the analysis to `Visits`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from itertools import chain
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import (
    Bools,
    Indices,
    Ints,
    any_in_rows,
    chunks,
    isin_sorted,
    map_chunks,
    release_memory,
    slim,
    spans,
)
from postproc.diagnostics import Code, Reason
from postproc.language.analysis.call_context import Point
from postproc.language.pdl2.abstract_state import MANY
from postproc.language.pdl2.columns import Collector, SettingColumns, VisitColumns
from postproc.language.pdl2.job import World
from postproc.language.pdl2.machine import Key, Machine, MoveRun
from postproc.language.pdl2.pose_encoding import PDL2_DIALECT
from postproc.language.text.source import NumberSpans, Source
from postproc.language.text.symbol_column import NameColumn
from postproc.language.visits import (
    ELSEWHERE,
    FrameColumns,
    Graph,
    Literals,
    Meaning,
    MotionColumns,
    NumberPlaces,
    PlaceColumns,
    SpeedColumns,
    TargetColumns,
    VisitPart,
    Visits,
    ZoneColumns,
    ZoneRule,
    texts_of,
)

Part = TypeVar("Part", bound=VisitPart)

# Which numbers of which file belong to which target.


class SlotColumns(Protocol):
    """What is needed of the visits' columns."""

    slots: Indices
    target: Indices
    name: Indices
    taught: Bools
    shared: Bools


@dataclass(frozen=True)
class Numbering:
    """All numbers of all files of a job.

    Attributes:
        sources: The files.
        first: Index of each file's first number, and how many there are, (f + 1,).
        numbers: Where every file's numbers stand.
    """

    sources: tuple[Source, ...]
    first: Indices
    numbers: tuple[NumberSpans, ...]

    @staticmethod
    def of(world: World) -> Numbering:
        """Number the files of a job as its slots are."""
        texts = [program.lines for program in world.programs()]
        if world.variables is not None:
            texts.append(world.variables.lines)
        sources, numbers = zip(*((t.source, t.numbers) for t in texts), strict=True)
        first = [world.slot_base[source.name] for source in sources]
        first.append(sum(map(len, numbers)))
        return Numbering(sources, np.array(first, dtype=np.int64), numbers)

    def __len__(self) -> int:
        """Return how many numbers there are."""
        return int(self.first[-1])

    def file(self, slots: Indices) -> Indices:
        """Return the file of every number."""
        found: Ints = np.searchsorted(self.first[1:], slots, side="right")
        return found.astype(np.int32)

    def places(self, slots: Indices, file: Indices) -> NumberPlaces:
        """Tell where the numbers of targets stand.

        Args:
            slots: Six numbers of each target, (m, 6).
            file: The file of each, (m,).
        """
        rows = max(len(slots), 1)
        return NumberPlaces.join(
            map_chunks(lambda k: self._of(slots[k], file[k]), rows)
        )

    def _of(self, slots: Indices, file: Indices) -> NumberPlaces:
        start, end = np.zeros((2, *slots.shape), dtype=np.int32)
        for number in np.unique(file).tolist():
            mine = file == number
            own = slots[mine] - self.first[number]
            numbers = self.numbers[number]
            start[mine], end[mine] = numbers.starts(own), numbers.ends(own)
        return NumberPlaces.of(start, end)

    def apart(self, slots: Indices) -> Bools:
        """Tell which targets have their numbers in more than one file, (k,).

        Args:
            slots: Six numbers of each target, (k, 6).
        """
        found = np.zeros(len(slots), dtype=bool)
        for k in chunks(len(slots) if len(self.sources) > 1 else 0):
            file = self.file(slots[k])
            found[k] = any_in_rows(file != file[:, :1])
        return found


def find_literals(
    columns: SlotColumns, numbering: Numbering, names: NameColumn
) -> tuple[Literals, Indices]:
    """Find the distinct literals; also return the literal of every visit.

    Visits whose numbers partly belong to another target, or to another file, get none
    (-1).
    """
    literal = np.full(len(columns.slots), -1, dtype=np.int32)
    rows = np.flatnonzero(columns.slots[:, 0] >= 0)
    span = len(rows) > 0 and rows[-1] - rows[0] == len(rows) - 1  # a view, no copy
    slots = columns.slots[rows[0] : rows[-1] + 1] if span else columns.slots[rows]
    numbers = slots.ravel()
    if bool((numbers[1:] > numbers[:-1]).all()) and not numbering.apart(slots).any():
        literal[rows] = np.arange(len(rows), dtype=np.int32)
        return _literals(columns, numbering, names, slots, rows, literal), literal
    _, example, inverse = np.unique(slots[:, 0], return_index=True, return_inverse=True)
    distinct = slots[example]
    mixed = np.zeros(len(distinct), dtype=bool)
    mixed[inverse[(slots != distinct[inverse]).any(axis=1)]] = True
    mixed |= any_in_rows(np.bincount(distinct.ravel())[distinct] > 1)
    mixed |= numbering.apart(distinct)
    kept = np.flatnonzero(~mixed)
    index = np.full(len(distinct), -1, dtype=np.int32)
    index[kept] = np.arange(len(kept))
    literal[rows] = index[inverse]
    first = rows[example[kept]]
    return _literals(columns, numbering, names, distinct[kept], first, literal), literal


def _literals(
    columns: SlotColumns,
    numbering: Numbering,
    names: NameColumn,
    slots: Indices,
    visit: Indices,
    literal: Indices,
) -> Literals:
    file = numbering.file(slots[:, 0])
    places = numbering.places(slots, file)
    line = np.zeros(len(slots), dtype=np.int32)
    for i, source in enumerate(numbering.sources):
        mine = file == i
        first = places.first[mine]
        line[mine] = source.lines_of(first)
    own, unnamed = columns.name[visit].astype(np.int64), texts_of(len(slots), {})
    return Literals(
        file=slim(file),
        line=line,
        places=places,
        joints=columns.target[visit] == Meaning.JOINTS,
        name=names.take(own) if own.any() else unnamed,
        shared=slim(_any(columns.shared, literal, len(slots))),
        taught=slim(_any(columns.taught, literal, len(slots))),
        pinned=texts_of(len(slots), {}),
    )


def _any(flags: Bools, literal: Indices, m: int) -> Bools:
    """Tell for each literal whether any of its visits is flagged."""
    found = np.zeros(m, dtype=bool)
    found[literal[flags & (literal >= 0)]] = True
    return found


# What else depends on the numbers of a target than the moves that go to it.

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


# All of it: visits in program order.

MOST_AXES = 12  # auxiliary axes that are told


TOO_COMPLEX = Reason(Code.TOO_COMPLEX, "the program is too complex to be followed")
TORN = Reason(
    Code.NUMBERS_NOT_OWN, "a number of the target belongs to another target too"
)
APART = Reason(
    Code.NUMBERS_NOT_OWN,
    "some of its numbers stand in the program, others in another file: write them in "
    "one",
)


def collect(machine: Machine) -> Visits:
    """Put the visits in program order and make arrays of them."""
    ordered = sorted(
        machine.arrivals.items(),
        key=lambda item: (Point(item[0][0], item[0][1]), item[0][2]),
    )
    runs, world = [run for _, run in ordered], machine.world
    offsets = np.concatenate([[0], np.cumsum([len(run) for run in runs])])
    offsets = offsets.astype(np.int64)
    numbering = Numbering.of(world)
    collector = _collect_visits(machine, runs, offsets, len(numbering))
    c = collector.columns
    release_memory(len(c.line))
    literals, literal = find_literals(c, numbering, collector.names)
    literals, follows = find_uses(literals, c.slots, c.bases, literal, world.pinned)
    _mark_torn(collector, numbering, literal)
    numbers = _number_visits(machine, ordered, offsets)
    settings = collector.settings.columns(c.setting)
    n = len(c.line)
    visits = Visits(
        files=tuple(world.files),
        place=PlaceColumns(slim(c.file), slim(c.line), texts_of(n, c.measured)),
        target=_target(collector, literal, follows),
        frame=_select(FrameColumns, settings),
        motion=_select(
            MotionColumns,
            settings,
            kind=slim(c.motion),
            via=slim(c.via),
            fly=slim(c.fly),
            arc_angle=slim(np.full(n, np.nan)),
            block=slim(np.full(n, -1)),
            curved=slim(np.zeros(n, dtype=bool)),
        ),
        zone=_select(ZoneColumns, settings),
        speed=_select(SpeedColumns, settings),
        graph=_graph(machine, ordered, offsets, numbers),
        reason=slim(c.reason),
        reasons=tuple(collector.reasons),
        literals=literals,
        dialect=PDL2_DIALECT,
    )
    return _mark_pauses(visits, machine, numbers)


def _target(collector: Collector, literal: Indices, follows: Indices) -> TargetColumns:
    c = collector.columns
    return TargetColumns(
        meaning=slim(c.target),
        values=c.values,
        distance_mm=slim(c.distance_mm),
        aux=slim(c.aux),
        config=slim(c.config),
        configs=tuple(collector.configs),
        config_given=slim(c.config_given),
        literal=literal,
        follows=slim(follows),
        name=slim(c.name),
        names=collector.names,
        shift=slim(np.full(len(c.line), -1)),
    )


def _select(part: type[Part], settings: Mapping[str, Any], **own: NDArray[Any]) -> Part:
    """Make a part of visits of columns of settings, and of its own."""
    names = {f.name for f in fields(part)} - {*own}
    return part(**own, **{name: settings[name] for name in names})


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
    world = machine.world
    columns = VisitColumns(int(offsets[-1]), _most_axes(runs, world), numbers)
    settings = SettingColumns()
    collector = Collector(machine, columns, settings)
    collector.fill(zip(offsets.tolist(), runs, strict=False))
    if machine.exhausted:
        columns.reason[:] = collector.reasons[TOO_COMPLEX]
    collector.names.settle()
    return collector


def _mark_torn(collector: Collector, numbering: Numbering, literal: Indices) -> None:
    """Give a reason to targets whose numbers are no literal of their own."""
    c = collector.columns
    torn = (literal < 0) & (c.slots[:, 0] >= 0) & (c.reason == 0)
    if not torn.any():
        return
    apart = torn & numbering.apart(c.slots)
    c.reason[torn] = collector.reasons[TORN]
    if apart.any():
        c.reason[apart] = collector.reasons[APART]


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


def _number_visits(
    machine: Machine, ordered: list[tuple[Key, MoveRun]], offsets: Ints
) -> Indices:
    """Return the visit of every id."""
    ids = np.array([machine.ids[key] for key, _ in ordered], dtype=np.int64)
    visit = np.full(machine.next_id, -1, dtype=np.int32)
    visit[spans(ids, np.diff(offsets))] = np.arange(offsets[-1], dtype=np.int32)
    return visit


def _graph(
    machine: Machine,
    ordered: list[tuple[Key, MoveRun]],
    offsets: Ints,
    visit: Indices,
) -> Graph:
    """Translate predecessor ids to visits, in CSR form."""
    n, first = int(offsets[-1]), offsets[:-1]
    origins = []
    for _, run in ordered:  # the visits that its first move may come from
        found = {int(visit[p]) if p >= 0 else p for p in run.predecessors - {MANY}}
        if MANY in run.predecessors or id(run.place.body) in machine.recursive:
            found.add(ELSEWHERE)
        origins.append(sorted(found))
    counts = np.ones(n, dtype=np.int32)
    counts[first] = [len(own) for own in origins]
    start = np.append(np.int32(0), np.cumsum(counts, dtype=np.int32))
    pred = np.repeat(np.arange(-1, n - 1, dtype=np.int32), counts)
    pred[spans(start[first], counts[first])] = [*chain.from_iterable(origins)]
    return Graph(start, pred)
