"""All files of one job: names, initial values, and the place of every number."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from postproc.arrays import Bools, Ints, release_memory
from postproc.diagnostics import Code
from postproc.files import base_name
from postproc.language import ir
from postproc.language.analysis.control_flow import ControlFlow
from postproc.language.analysis.shared_changes import SharedChange
from postproc.language.analysis.values import WrittenNumber
from postproc.language.analysis.visit_columns import Numbering
from postproc.language.language import Start
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.abstract_state import (
    NEVER_SET,
    GivenValues,
    root_of,
    wholes,
)
from postproc.language.pdl2.entries import NO_ENTRIES, Entries
from postproc.language.pdl2.pose_encoding import COMMENTS
from postproc.language.pdl2.program import (
    Body,
    Program,
    Variable,
    Variables,
    recover_block,
)
from postproc.language.pdl2.values import Nothing, Position, Value
from postproc.language.pdl2.variable_file import VariableFile as ValueFile
from postproc.language.text.symbol_column import NameColumn
from postproc.language.visits import Diagnostic


@dataclass
class InitialValues:
    """Values by key; points of a variable file are made when they are asked for.

    Attributes:
        other: Values that are no points of the variable file.
        asked: Keys of others that the program takes as they are when it starts.
        unset: Keys that no file gives a value, and what else they may begin with.
        prefix: What keys of the program's own variables begin with, before their names.
        entries: The entries of the variable file.
        base: Global index of the file's first number.
        own: Which rows of `entries` are points of such variables.
        shared: Another program may read it too, by row of `entries`.
        taught: Marked as taught where it is declared, likewise.
        used: The program takes it as it is in the file, likewise.
    """

    other: dict[str, Value] = field(default_factory=dict)
    asked: set[str] = field(default_factory=set)
    unset: dict[str, Value] = field(default_factory=dict)
    prefix: str = "\0"  # of no key
    entries: Entries = NO_ENTRIES
    base: int = 0
    own: Bools = field(default_factory=lambda: np.empty(0, bool))
    shared: Bools = field(default_factory=lambda: np.empty(0, bool))
    taught: Bools = field(default_factory=lambda: np.empty(0, bool))
    used: Bools = field(default_factory=lambda: np.empty(0, bool))

    def point(self, key: str) -> int:
        """Return the row of a point that the variable file tells, -1 for all else."""
        if key.startswith(self.prefix):
            row = self.entries.row.get(key[len(self.prefix) :], -1)
            if row >= 0 and self.own[row]:
                return row
        return -1

    def rows(self, prefix: str, names: NameColumn) -> Ints:
        """Return the rows of points of a program's own variables, (m,), -1 for others.

        Args:
            prefix: What the keys of its variables begin with.
            names: Names of its variables, in lower case.
        """
        if prefix != self.prefix:
            return np.full(len(names), -1)
        rows = self.entries.row.find(names)
        rows[rows >= 0] = np.where(self.own[rows[rows >= 0]], rows[rows >= 0], -1)
        return rows

    def position(self, row: int) -> Position:
        """Return the value of a point of the variable file."""
        entries, layout = self.entries, self.entries.layout_of(row)
        places = entries.slots[row].tolist()
        slots = [self.base + slot if slot >= 0 else -1 for slot in places]
        parts = tuple(map(WrittenNumber, entries.numbers_of(row), slots))
        return Position(
            layout.kind == "JNTP", parts, layout.config, entries.aux_of(row),
            entries.name[row], bool(self.taught[row]), bool(self.shared[row]),
        )  # fmt: skip

    def find(self, key: str) -> Value | None:
        """Return what a key holds, None where it holds nothing."""
        row = self.point(key)
        if row >= 0:
            self.used[row] = True
            return self.position(row)
        self.asked.add(key)
        return self.other.get(key, self.unset.get(key))

    def is_asked(self, key: str) -> bool:
        """Tell whether the program takes what a key holds when it starts."""
        row = self.point(key)
        return bool(self.used[row]) if row >= 0 else key in self.asked

    def change(self, key: str, value: Value) -> None:
        """Let a key hold a value, whatever the variable file says."""
        if key not in self:
            self.unset[key] = value
            return
        row = self.point(key)
        if row >= 0:
            self.own[row] = False
            self.asked.add(key)
        self.other[key] = value

    def __contains__(self, key: str) -> bool:
        """Tell whether a key holds anything."""
        return self.point(key) >= 0 or key in self.other

    def __setitem__(self, key: str, value: Value) -> None:
        """Let a key hold a value, unless the variable file says another."""
        self.other[key] = value

    def parts(self) -> Iterator[str]:
        """Go through the keys, but for most of those that are no parts of others."""
        if self.entries.parts or any(c in self.prefix for c in "[."):
            rows = self.entries.row.items()
            yield from (self.prefix + name for name, row in rows if self.own[row])
        yield from (key for key in self.other if self.point(key) < 0)


@dataclass(frozen=True)
class Place:
    """Where a statement stands.

    Attributes:
        program, body: Its program and its body.
        file: Index of the program among the files of the job.
        offset, first: Job-wide index of the first row of the program, and of its first
            number.
    """

    program: Program
    body: Body
    file: int
    offset: int
    first: int

    @property
    def flow(self) -> ControlFlow:
        """The blocks of the body."""
        return self.body.flow

    def statement(self, row: int) -> ir.SourceStatement:
        """Return what a row says; of what is not understood, which block it opens."""
        return recover_block(self.program.lines.statement(row))

    def list_moves(self) -> Iterator[tuple[int, ast.Move]]:
        """Yield the moves of the body, with their rows."""
        for row in range(self.body.first + 1, self.body.last):
            one = ast.action(self.program.lines.statement(row))
            if isinstance(one, ast.Move):
                yield row, one


@dataclass
class World:
    """The programs of a job and what was found about them.

    Attributes:
        main: The program that is compensated.
        others: Other programs, by lower-case program and file name.
        start: What the cell says.
        beside: Programs that run at other times, or beside, and change variables.
        initial: What variables hold before the program assigns them, by key.
        changing: Exported variables, by key, that another program may write at any
            time: numbers, texts and switches, and positions that one at hand writes.
        imported: Positions of other programs, by key, whose file values may be old.
        changed_elsewhere: Variables, by key, that programs beside these change.
        volatile: Names of variables and settings (with ``$``) that condition handlers
            may change at any time.
        taught_lines: Lines marked ``-- TAUGHT``, by file name.
        diagnostics: What was found; a message is kept once.
        loose: Variables, by key, that are used where it is not known what they hold,
            and how.
        pinned: Numbers (by their index in the job) that say more than where a move
            goes, and what else they are used for: they must stay as they are.
    """

    main: Program
    others: Mapping[str, Program]
    start: Start
    variables: ValueFile | None
    beside: Sequence[Program] = ()
    initial: InitialValues = field(default_factory=InitialValues)
    diagnostics: dict[Diagnostic, None] = field(default_factory=dict)
    loose: dict[str, str] = field(default_factory=dict)
    pinned: dict[int, str] = field(default_factory=dict)
    taught_lines: dict[str, frozenset[int]] = field(default_factory=dict)
    reached: dict[int, object] = field(default_factory=dict)
    changing: frozenset[str] = frozenset()
    imported: frozenset[str] = frozenset()
    changed_elsewhere: Mapping[str, Sequence[SharedChange]] = field(
        default_factory=dict
    )
    volatile: frozenset[str] = frozenset()
    _said: set[tuple[str, str]] = field(default_factory=set)
    _kept: set[frozenset[int]] = field(default_factory=set)
    _later: tuple[int, dict[str, list[str]]] | None = None

    def __post_init__(self) -> None:
        for program in self.programs():
            source = program.lines.source
            self.taught_lines[source.name] = COMMENTS.list_taught(source)
            self.diagnostics |= dict.fromkeys(program.diagnostics)

    @cached_property
    def numbering(self) -> Numbering:
        """The statements and numbers of all files, the variable file the last."""
        others = [] if self.variables is None else [self.variables.lines]
        programs = (*self.programs(), *self.beside)
        return Numbering([*(one.lines for one in programs), *others])

    @property
    def arm(self) -> int:
        """Return the number of our arm."""
        return self.start.arm

    def settle(self) -> None:
        """Let go of what finds names by the million, and of what is free by now."""
        for program in self.programs():
            program.variables.settle()
        if self.variables is not None:
            self.variables.entries.row.names.settle()
        release_memory(sum(len(program.lines) for program in self.programs()))

    def programs(self) -> list[Program]:
        """Return the programs, the main one first, each once."""
        found = {id(self.main): self.main}
        for program in self.others.values():
            found.setdefault(id(program), program)
        return list(found.values())

    def places(self) -> list[Place]:
        """Return where the statements of every body stand."""
        every = (
            (program, body) for program in self.programs() for body in program.bodies
        )
        return [self.place(program, body) for program, body in every]

    def place(self, program: Program, body: Body) -> Place:
        """Return where the statements of a body stand."""
        rows, first = self.numbering.rows, self.numbering.first
        at = self.numbering.names.index(program.lines.source.name)
        return Place(program, body, at, rows[at], first[at])

    def report(self, program: Program, row: int, code: Code, message: str) -> None:
        """Collect a finding at a logical line."""
        lines = program.lines
        line = lines.line(row) if 0 <= row < len(lines) else 1
        self.diagnostics[Diagnostic(lines.source.name, line, code, message)] = None

    def report_once(
        self, program: Program, row: int, code: Code, what: str, message: str
    ) -> None:
        """Collect a finding about something the first time only."""
        if (code, what) not in self._said:
            self._said.add((code, what))
            self.report(program, row, code, message)

    def pin(self, value: Value, why: str) -> None:
        """Keep the numbers of a position because something else depends on them."""
        if isinstance(value, Position):
            for slot in value.slots:
                self.pin_number(slot, why)
        elif isinstance(value, Nothing) and value.of not in self._kept:
            self._kept.add(value.of)
            for slot in value.of:
                self.pin_number(slot, why)

    def pin_number(self, slot: int, why: str) -> None:
        """Keep a number, by its index in the job, -1 for none."""
        if slot >= 0:
            self.pinned.setdefault(slot, why)

    def is_listed(self, name: str) -> bool:
        """Tell whether the cell file says that a point was taught."""
        taught, name = self.start.taught, name.lower()
        return bool(taught) and (name in taught or base_variable(name) in taught)

    @cached_property
    def _first(self) -> Mapping[str, list[str]]:
        return _by_whole(self.initial.parts())

    def first_parts(self, key: str) -> list[str]:
        """Return the elements and fields that a key has when the job starts."""
        return self._first.get(key, [])

    def later_parts(self, key: str) -> list[str]:
        """Return those that it has only where an earlier run has given it them."""
        unset = self.initial.unset
        if not unset:
            return []
        if self._later is None or self._later[0] != len(unset):
            self._later = len(unset), _by_whole(unset)
        return self._later[1].get(key, [])

    def loosen(self, key: str, why: str) -> None:
        """Note that some part of a variable is used, which only the run tells."""
        self.loose.setdefault(root_of(key), why)

    def pin_loose(self, given: GivenValues) -> None:
        """Keep the numbers of all that a loose variable holds at some time.

        Args:
            given: What variables are given at any time.
        """
        for root, why in self.loose.items():
            for key in (root, *self.first_parts(root)):
                self.pin(self.initial.find(key) or NEVER_SET, why)
        for key in given:
            if why := self.loose.get(root_of(key), ""):
                self.pin(Nothing(why, given.numbers(key)), why)

    def find_declaration(self, place: Place, name: str) -> Variable | None:
        """Return the declaration that a name means."""
        return place.body.variables.get(name) or place.program.variables.get(name)

    def root(self, place: Place, name: str) -> str:
        """Return the key of a variable: its routine's own, or its program's."""
        program, body = place.program, place.body
        if name in body.own_names:
            return f"{program.name}:{body.name}/{name}"
        declared = program.variables.get(name)
        if declared is not None and declared.exported:
            return f"{declared.exported}/{name}"
        return f"{program.name}/{name}"

    def declarations(self) -> Iterator[tuple[Place, Variables]]:
        """Yield every body, with what its program declares that is new there.

        What a body does not hide means what it means in the first one.
        """
        for program in self.programs():
            for body in program.bodies:
                seen, first = program.variables, program.bodies[0]
                if body is not first:
                    seen = seen.some(first.own_names | body.own_names)
                yield self.place(program, body), seen

    def spell(self, key: str) -> str:
        """Return how a variable is written where it is declared first.

        Elements, and what is not declared, are written as in the variable file.
        """
        root = base_variable(key)
        declared, rest = self._find_declared(root), key[len(root) :]
        name = declared.name if declared else root.rpartition("/")[2]
        if self.variables is None or self.main.main is None or (declared and not rest):
            return name + rest
        place, entries = self.place(self.main, self.main.main), self.variables.entries
        row = entries.row.get(name.lower() + rest, -1)
        own = self.root(place, name.lower()) == root and key in self.initial
        return entries.name[row] if own and row >= 0 else name + rest

    def _find_declared(self, root: str) -> Variable | None:
        """Return the first declaration of a variable, by its key."""
        where, _, name = root.rpartition("/")
        file, _, routine = where.partition(":")
        for program in self.programs():
            own = program.routines.get(routine) if routine else program
            declared = own and own.variables.get(name)
            if declared and (declared.exported or program.name) == file:
                return declared
        return None

    def type_of(self, place: Place, name: str) -> ast.Type | None:
        """Return the declared type of a name."""
        declared = self.find_declaration(place, name)
        return declared.type if declared else None

    def other_arm(self, place: Place, name: str) -> int:
        """Return the arm whose points a variable holds, 0 where it is ours."""
        declared = self.find_declaration(place, name)
        return declared.arm if declared and declared.arm != self.arm else 0

    def is_function(self, place: Place, name: str) -> bool:
        """Tell whether a name by itself calls a routine."""
        program = place.program
        known = name in program.routines or name in program.outside
        return known and self.type_of(place, name) is None

    def find_routine(self, program: Program, name: str) -> Place | None:
        """Return the routine with a body that a name means, if the job holds it."""
        if name in program.routines:
            return self.place(program, program.routines[name])
        exporter = program.outside.get(name)
        files = [exporter] if exporter else map(base_name, program.imports)
        for file in files:
            other = self._file(file)
            if other is not None and name in other.routines:
                return self.place(other, other.routines[name])
        return None

    def find_program(self, program: Program, name: str) -> Place | None:
        """Return the main part of a program of the job; `program` calls it."""
        found = self._file(name)
        if found is None or found.main is None:
            return None
        return self.place(found, found.main)

    def _file(self, name: str) -> Program | None:
        """Return the program that a name or a file's name means."""
        own = {self.main.name, base_name(self.main.lines.source.name)}
        return self.others.get(name) or (self.main if name in own else None)


def _by_whole(parts: Iterable[str]) -> dict[str, list[str]]:
    """Return elements and fields by what they are parts of, at any depth."""
    found: dict[str, list[str]] = {}
    for part in parts:
        if "[" in part or "." in part:
            for whole in wholes(part):
                found.setdefault(whole, []).append(part)
    return found


def base_variable(name: str) -> str:
    """Return a variable's name without indices and fields, in lower case.

    >>> base_variable("Tab[3].place")
    'tab'
    """
    return root_of(name.lower())
