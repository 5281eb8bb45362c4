"""Points of their own for moves that cannot share one, and the proof that they fit."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from postproc.arrays import Ints
from postproc.language.pdl2.clones import Named, clone, free_name, named_at
from postproc.language.pdl2.program import Program, parse
from postproc.language.source import CloneError, Edit, Source, apply
from postproc.language.visits import Diagnostic, Visits
from postproc.planning import VARIABLES, Reading, read_program
from postproc.proposal import Proposal
from postproc.report import Status
from postproc.robot.cell import Cell
from postproc.same import same_moves
from postproc.sharing import Arrivals, Group, Stop, connected, regroup

_WORD = re.compile(rb"[A-Za-z_]\w*")


def give_own_points(reading: Reading, proposal: Proposal, cell: Cell) -> Reading:
    """Clone variables for moves whose arrivals at them disagree.

    Returns:
        The program with clones, proven to make the same moves to the same values, its
        lines counted as before; or as it was, where nothing can be cloned. What was
        cloned, and what was not, is among the diagnostics.
    """
    work = _Work.of(reading, proposal)
    for literals in _disputed(work):
        work.separate(literals, cell.limits.agree_mm)
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
    visits = same_moves(reading, again, cloned, work.names)
    if visits is None:
        text = "clones would change what the program does: nothing is cloned"
        found = Diagnostic(reading.sources[0].name, 1, "not-cloned", text)
        return replace(reading, diagnostics=(*reading.diagnostics, found))
    return Reading(again.texts, visits, notes, cloned, reading.sources)


def _stops(visits: Visits) -> dict[Stop, Ints]:
    """Group visits by the places that name where to go."""
    rows: dict[Stop, list[int]] = {}
    columns = (visits.file.tolist(), visits.line.tolist(), visits.via.tolist())
    for row, place in enumerate(zip(*columns, strict=True)):
        rows.setdefault(Stop(*place), []).append(row)
    return {stop: np.array(found) for stop, found in rows.items()}


def _disputed(work: _Work) -> list[frozenset[int]]:
    """List the literals that arrivals disagree on, with all that share their moves."""
    visits = work.reading.visits
    unsafe = work.proposal.decisions.status == Status.UNSAFE
    disputed = set(visits.literal[unsafe & (visits.literal >= 0)].tolist())
    found = (visits.literal[rows] for rows in work.stops.values())
    sets = [frozenset(literal[literal >= 0].tolist()) for literal in found]
    together = connected(s for s in sets if len(s) > 1)
    joined = frozenset().union(*together)
    together += [frozenset({row}) for row in disputed - joined]
    return sorted((s for s in together if not disputed.isdisjoint(s)), key=min)


@dataclass
class _Work:
    """The edits of a job, clone by clone.

    Attributes:
        reading: The program.
        proposal: What its arrivals need.
        programs: Its program files, parsed.
        values: Its variable file, or None.
        taken: All words of its files, in lower case.
        stops: The visits at every place that names where to go.
        stops_at: The places that go to each literal.
        edits: Edits with the index of their file.
        names: The clone that every separated visit goes to.
        notes: What was cloned, and what was not.
    """

    reading: Reading
    proposal: Proposal
    programs: list[Program]
    values: Source | None
    taken: set[str]
    stops: dict[Stop, Ints]
    stops_at: dict[int, set[Stop]]
    edits: list[tuple[int, Edit]] = field(default_factory=list)
    names: dict[int, str] = field(default_factory=dict)
    notes: list[Diagnostic] = field(default_factory=list)

    @classmethod
    def of(cls, reading: Reading, proposal: Proposal) -> _Work:
        """Parse the files of a program."""
        sources = reading.sources
        own = [s for s in sources if not s.name.lower().endswith(VARIABLES)]
        values = next((s for s in sources if s not in own), None)
        taken = {
            word.decode("ascii").lower()
            for source in sources
            for word in _WORD.findall(source.data)
        }
        programs, visits = [parse(s) for s in own], reading.visits
        stops, at = _stops(visits), defaultdict(set)
        for stop, rows in stops.items():
            for literal in visits.literal[rows].tolist():
                at[literal].add(stop)
        return cls(reading, proposal, programs, values, taken, stops, at)

    def separate(self, literals: frozenset[int], agree_mm: float) -> None:
        """Give the moves to some literals points of their own where they need them."""
        named: dict[Stop, Named] = {}
        members = list(self._members(literals, named, agree_mm))
        stays = not literals.isdisjoint(self.proposal.fixed.tolist())
        for group in regroup(members, stays, agree_mm)[1:]:
            self._clone([named[stop] for stop in group.stops], group)

    def _members(
        self, literals: frozenset[int], named: dict[Stop, Named], agree_mm: float
    ) -> Iterator[Arrivals]:
        """Yield all stops at some literals; also say which variable each names."""
        visits = self.reading.visits
        stops = {stop for literal in literals for stop in self.stops_at[literal]}
        for stop in sorted(stops, key=lambda stop: int(self.stops[stop][0])):
            rows = self.stops[stop]
            usable = bool(self.proposal.usable[rows].all())
            name = visits.names[visits.name[rows[0]]]
            changes = {
                literal: self.proposal.change_mm[rows[visits.literal[rows] == literal]]
                for literal in np.unique(visits.literal[rows]).tolist()
            }
            found = Arrivals(stop, "", changes, usable)
            try:
                one = named_at(self.programs, stop.file, stop.line, stop.via, name)
                if usable and not found.agree(agree_mm):
                    raise CloneError("this one move arrives in ways that disagree")
            except CloneError as problem:
                if usable:
                    self._note(stop.file, stop.line, "not-cloned", str(problem))
            else:
                named[stop] = one
                found = replace(found, variable=one.key)
            yield found

    def _clone(self, named: list[Named], group: Group) -> None:
        """Clone one variable, or say why not."""
        visits, variable = self.reading.visits, named[0].variable
        file = group.stops[0].file
        declared = int(self.programs[file].lines.line[variable.row])
        lines = ", ".join(str(stop.line) for stop in group.stops)
        try:
            name = free_name(variable.name, self.taken)
            self.edits += clone(
                self.programs,
                self.values,
                visits.literals,
                named,
                sorted(group.bounds),
                name,
            )
        except CloneError as problem:
            text = f"{variable.name} keeps its moves (lines {lines}): {problem}"
            self._note(file, declared, "not-cloned", text)
            return
        text = f"{variable.name}: the moves of lines {lines} go to {name} now"
        self._note(file, declared, "cloned", text)
        rows = np.concatenate([self.stops[stop] for stop in group.stops])
        self.names |= dict.fromkeys(rows.tolist(), name)

    def _note(self, file: int, line: int, code: str, text: str) -> None:
        name = self.reading.sources[file].name
        self.notes.append(Diagnostic(name, line, code, text))
