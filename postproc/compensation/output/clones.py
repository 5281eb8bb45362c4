"""Points of their own for moves that cannot share one, and the proof that they fit."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.compensation.outcome import Status
from postproc.compensation.output.equivalence import equivalent
from postproc.compensation.program import ParsedProgram, read_program
from postproc.compensation.solver.decisions import Proposal
from postproc.diagnostics import Code
from postproc.language.language import Cloner, NamedPoint
from postproc.language.languages import language_of
from postproc.language.text.source import CloneError, Edit, Source, apply
from postproc.language.visits import Diagnostic, Visits
from postproc.robot.cell import Cell

# Which moves can go on sharing a point, and which need one of their own.

Box = Mapping[int, tuple[Floats, Floats]]


@dataclass(frozen=True)
class MoveSlot:
    """One place in a move statement that names where to go.

    Attributes:
        file, line: Where the statement stands.
        via: It is the VIA point of an arc.
    """

    file: int
    line: int
    via: bool


@dataclass(frozen=True)
class SlotArrivals:
    """All arrivals at one stop.

    Attributes:
        stop: Where.
        variable: What it can be separated from by another name, "" for nothing.
        changes: The changes that the arrivals need, one row each [mm], by literal.
        usable: Every arrival can be corrected.
    """

    stop: MoveSlot
    variable: str
    changes: Mapping[int, Floats]
    usable: bool

    def box(self) -> Box:
        """Return the bounds of the changes at every literal."""
        return {k: (c.min(axis=0), c.max(axis=0)) for k, c in self.changes.items()}

    def agree(self, agree_mm: float) -> bool:
        """Tell whether the arrivals at this one stop agree."""
        return _size(self.box()) <= agree_mm


@dataclass
class SharedPoint:
    """Stops that can share one point.

    Attributes:
        variable: Its name, "" where stops of several variables share the literal.
        stops: The stops.
        bounds: Bounds of the changes at every literal.
    """

    variable: str
    stops: list[MoveSlot] = field(default_factory=list)
    bounds: dict[int, tuple[Floats, Floats]] = field(default_factory=dict)

    def take(self, arrivals: SlotArrivals, agree_mm: float) -> bool:
        """Take in a stop that agrees with those at hand; tell whether it does."""
        box = _union(self.bounds, arrivals.box())
        if _size(box) > agree_mm:
            return False
        self.bounds = box
        self.stops.append(arrivals.stop)
        return True


def group_arrivals(
    members: Sequence[SlotArrivals], stays: bool, agree_mm: float
) -> tuple[SharedPoint, ...]:
    """Divide the stops that share literals into groups whose arrivals agree.

    The first group keeps the original: it holds what cannot be separated from it, and
    where something needs the original as it is, nobody else.

    Args:
        members: All stops at some literals, in program order.
        stays: The literals must keep their values.
        agree_mm: Largest distance of changes that agree.

    Returns:
        The group that keeps the original, then those that need a point of their own.
    """
    original = SharedPoint("")
    free: list[SlotArrivals] = []
    for member in members:
        if member.variable and member.usable and member.agree(agree_mm):
            free.append(member)
        elif not (member.usable and original.take(member, agree_mm)):
            stays = True
            original.stops.append(member.stop)
    groups: list[SharedPoint] = []
    for member in free:
        mine = [g for g in groups if g.variable == member.variable]
        choices = mine if stays else [original, *mine]
        if not any(group.take(member, agree_mm) for group in choices):
            group = SharedPoint(member.variable)
            group.take(member, agree_mm)
            groups.append(group)
    return (original, *groups)


def _union(a: Box, b: Box) -> dict[int, tuple[Floats, Floats]]:
    box = dict(a)
    for key, (low, high) in b.items():
        if key in box:
            low, high = np.minimum(low, box[key][0]), np.maximum(high, box[key][1])
        box[key] = (low, high)
    return box


def _size(box: Box) -> float:
    return max(
        (float(np.linalg.norm(high - low)) for low, high in box.values()), default=0.0
    )


def unite_overlapping(sets: Iterable[frozenset[int]]) -> list[frozenset[int]]:
    """Unite the sets that overlap, in order of their smallest members.

    >>> [sorted(s) for s in unite_overlapping([frozenset({1, 2}), frozenset({3}),
    ...                                frozenset({2, 5})])]
    [[1, 2, 5], [3]]
    """
    owner: dict[int, frozenset[int]] = {}
    for one in sets:
        whole = one.union(*(owner[k] for k in one if k in owner))
        owner |= dict.fromkeys(whole, whole)
    return sorted({*owner.values()}, key=min)


# The lines of visits as they were before something was cloned.


def with_lines_of(
    before: ParsedProgram, after: ParsedProgram, edits: Sequence[Sequence[Edit]]
) -> Visits | None:
    """Give the visits of a program with clones the lines that they had before.

    Args:
        before: The program.
        after: The program with clones, which is equivalent.
        edits: The edits between them, file by file.

    Returns:
        The visits; None where a line is not that of the visit before.
    """
    v, w = before.visits, after.visits
    if _origin(before.sources, after.sources, edits, w) != v.place.line.tolist():
        return None
    has = np.flatnonzero(v.target.literal >= 0)
    line = np.zeros(len(w.literals), dtype=np.int64)
    line[w.target.literal[has]] = v.literals.line[v.target.literal[has]]
    own = _with_reasons_of(v, w.with_columns(line=v.place.line))
    pinned = _pins_of(v, w, has)
    return replace(own, literals=replace(w.literals, line=line, pinned=pinned))


def _with_reasons_of(before: Visits, after: Visits) -> Visits:
    """Give visits that still keep their numbers for a reason its text of before.

    A text may name a line.
    """
    codes = [np.array([one.code for one in v.reasons]) for v in (before, after)]
    same = codes[0][before.reason] == codes[1][after.reason]
    still = same & (before.reason > 0) & (after.reason > 0)
    reason = np.where(still, len(after.reasons) + before.reason, after.reason)
    reasons = (*after.reasons, *before.reasons)
    return replace(after, reason=reason, reasons=reasons)


def _pins_of(before: Visits, after: Visits, rows: Ints) -> tuple[str, ...]:
    """Return why literals are pinned, in the words of before, for rows with one."""
    pinned = list(after.literals.pinned)
    for old, new in zip(
        before.target.literal[rows].tolist(),
        after.target.literal[rows].tolist(),
        strict=True,
    ):
        pinned[new] = pinned[new] and (before.literals.pinned[old] or pinned[new])
    return tuple(pinned)


def _origin(
    before: Sequence[Source],
    after: Sequence[Source],
    edits: Sequence[Sequence[Edit]],
    visits: Visits,
) -> list[int]:
    """Give the lines of visits as they were before the edits."""
    lines = np.array(visits.place.line)
    for file, (old, new, own) in enumerate(zip(before, after, edits, strict=True)):
        mine = visits.place.file == file
        start = new.line_starts[visits.place.line[mine] - 1]
        shift = np.zeros(len(start), dtype=np.int64)
        moved = 0
        for (begin, end), text in sorted(own, key=lambda edit: edit.span):
            behind = start >= begin + moved + len(text)
            moved += len(text) - (end - begin)
            shift[behind] = moved
        lines[mine] = old.lines_of(start - shift)
    return [int(line) for line in lines]


# Cloning what moves disagree on, group by group, and the proof that it fits.

FOLLOWED = "computed targets move along with the point, and keep it"
STAYING = "clones would have to keep their numbers, too: nothing is cloned"
NOTHING = np.zeros(0, dtype=np.int64)  # no literal gets new numbers


def give_own_points(
    reading: ParsedProgram, proposal: Proposal, cell: Cell
) -> ParsedProgram:
    """Clone variables for moves whose arrivals at them disagree.

    Returns:
        The program with clones, proven to make the same moves to the same values, its
        lines counted as before; or as it was, where nothing can be cloned. What was
        cloned, and what was not, is among the diagnostics.
    """
    work = _CloneWork.of(reading, proposal)
    for literals in _list_disputed(work):
        work.separate(literals, cell.limits.conflict_mm)
    notes = (*reading.diagnostics, *work.notes)
    if not work.edits:
        return replace(reading, diagnostics=notes)
    cloned = tuple(
        tuple(edit for file, edit in work.edits if file == number)
        for number in range(len(reading.sources))
    )
    sources = tuple(
        Source(source.name, apply(source.data, edits))
        for source, edits in zip(reading.sources, cloned, strict=True)
    )
    again = read_program({s.name: s.data for s in sources}, cell)
    v = reading.visits
    problem = equivalent(v, again.visits, NOTHING, v.target.values, work.names)
    visits = None if problem else with_lines_of(reading, again, cloned)
    if visits is not None:  # no other program knows the points of clones
        shared = np.array(visits.literals.shared)
        shared[visits.target.literal[list(work.names)]] = False
        visits = replace(visits, literals=replace(visits.literals, shared=shared))
    if visits is None or _stay(visits, list(work.names)):
        text = "clones would change what the program does: nothing is cloned"
        text = text if visits is None else STAYING
        found = Diagnostic(reading.sources[0].name, 1, Code.NOT_CLONED, text)
        return replace(reading, diagnostics=(*reading.diagnostics, found))
    return ParsedProgram(
        again.texts, visits, notes, cloned, reading.sources, missed=reading.missed,
        untouched=reading.untouched,
    )  # fmt: skip


def _stay(visits: Visits, rows: Sequence[int]) -> bool:
    """Return True if points of visits must keep their numbers."""
    return any(visits.literals.pinned[k] for k in visits.target.literal[rows].tolist())


def _stops(visits: Visits) -> dict[MoveSlot, Ints]:
    """Group visits by the places that name where to go."""
    rows: dict[MoveSlot, list[int]] = {}
    columns = (
        visits.place.file.tolist(),
        visits.place.line.tolist(),
        visits.motion.via.tolist(),
    )
    for row, place in enumerate(zip(*columns, strict=True)):
        rows.setdefault(MoveSlot(*place), []).append(row)
    return {stop: np.array(found) for stop, found in rows.items()}


def _list_disputed(work: _CloneWork) -> list[frozenset[int]]:
    """List the literals that arrivals disagree on, with all that share their moves."""
    visits = work.reading.visits
    conflict = work.proposal.decisions.status == Status.CONFLICT
    disputed = set(
        visits.target.literal[conflict & (visits.target.literal >= 0)].tolist()
    )
    found = (visits.target.literal[rows] for rows in work.stops.values())
    sets = [frozenset(literal[literal >= 0].tolist()) for literal in found]
    together = unite_overlapping(s for s in sets if len(s) > 1)
    joined = frozenset().union(*together)
    together += [frozenset({row}) for row in disputed - joined]
    return sorted((s for s in together if not disputed.isdisjoint(s)), key=min)


@dataclass
class _CloneWork:
    """The edits of a job, clone by clone.

    Attributes:
        reading: The program.
        proposal: What its arrivals need.
        cloner: Its files, to clone variables in them.
        stops: The visits at every place that names where to go.
        stops_at: The places that go to each literal.
        edits: Edits with the index of their file.
        names: The clone that every separated visit goes to.
        notes: What was cloned, and what was not.
    """

    reading: ParsedProgram
    proposal: Proposal
    cloner: Cloner
    stops: dict[MoveSlot, Ints]
    stops_at: dict[int, set[MoveSlot]]
    edits: list[tuple[int, Edit]] = field(default_factory=list)
    names: dict[int, str] = field(default_factory=dict)
    notes: list[Diagnostic] = field(default_factory=list)

    @classmethod
    def of(cls, reading: ParsedProgram, proposal: Proposal) -> _CloneWork:
        """Parse the files of a program."""
        sources = reading.sources
        cloner = language_of(sources[0].name).cloner(sources)
        visits = reading.visits
        stops, at = _stops(visits), defaultdict(set)
        for stop, rows in stops.items():
            for literal in visits.target.literal[rows].tolist():
                at[literal].add(stop)
        return cls(reading, proposal, cloner, stops, at)

    def separate(self, literals: frozenset[int], agree_mm: float) -> None:
        """Give the moves to some literals points of their own where they need them."""
        named: dict[MoveSlot, NamedPoint] = {}
        members = list(self._members(literals, named, agree_mm))
        stays = not literals.isdisjoint(self.proposal.fixed.tolist())
        original, *others = group_arrivals(members, stays, agree_mm)
        visits = self.reading.visits
        moving = visits.target.follows[
            visits.target.literal < 0
        ]  # others have numbers of their own
        followed = not literals.isdisjoint(moving.tolist())
        if followed and not original.stops:
            place = members[0].stop
            self._note(place.file, place.line, Code.NOT_CLONED, FOLLOWED)
            return
        for group in others:
            self._clone([named[stop] for stop in group.stops], group)

    def _members(
        self,
        literals: frozenset[int],
        named: dict[MoveSlot, NamedPoint],
        agree_mm: float,
    ) -> Iterator[SlotArrivals]:
        """Yield all stops at some literals; also say which variable each names."""
        visits = self.reading.visits
        stops = {stop for literal in literals for stop in self.stops_at[literal]}
        for stop in sorted(stops, key=lambda stop: int(self.stops[stop][0])):
            rows = self.stops[stop]
            usable = bool(self.proposal.usable[rows].all())
            name = visits.target_name(rows[0])
            changes = {
                literal: self.proposal.change_mm[
                    rows[visits.target.literal[rows] == literal]
                ]
                for literal in np.unique(visits.target.literal[rows]).tolist()
            }
            found = SlotArrivals(stop, "", changes, usable)
            try:
                one = self.cloner.target(stop.file, stop.line, stop.via, name)
                if usable and not found.agree(agree_mm):
                    raise CloneError("this one move arrives in ways that disagree")
            except CloneError as problem:
                if usable:
                    self._note(stop.file, stop.line, Code.NOT_CLONED, str(problem))
            else:
                named[stop] = one
                found = replace(found, variable=one.key)
            yield found

    def _clone(self, named: list[NamedPoint], group: SharedPoint) -> None:
        """Clone one variable, or say why not."""
        visits, variable = self.reading.visits, named[0]
        file = group.stops[0].file
        declared = self.cloner.find_declaration(variable)
        lines = ", ".join(str(stop.line) for stop in group.stops)
        try:
            rows = sorted(group.bounds)
            name, edits = self.cloner.clone(visits.literals, named, rows)
            self.edits += edits
        except CloneError as problem:
            text = f"{variable.name} keeps its moves (lines {lines}): {problem}"
            self._note(file, declared, Code.NOT_CLONED, text)
            return
        text = f"{variable.name}: the moves of lines {lines} go to {name} now"
        self._note(file, declared, Code.CLONED, text)
        for row in np.concatenate([self.stops[stop] for stop in group.stops]).tolist():
            _, bracket, index = visits.target_name(row).partition("[")
            self.names[row] = f"{name}{bracket}{index}"

    def _note(self, file: int, line: int, code: Code, text: str) -> None:
        name = self.reading.sources[file].name
        self.notes.append(Diagnostic(name, line, code, text))
