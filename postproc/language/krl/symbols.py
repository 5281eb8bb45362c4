"""All files of a KRL job: what its names mean, and which data never change."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from itertools import chain
from pathlib import Path

import numpy as np

from postproc.arrays import Ints
from postproc.diagnostics import Code
from postproc.language import ir
from postproc.language.analysis.assigned_points import Scope
from postproc.language.analysis.call_graph import reach
from postproc.language.analysis.conditions import TaskFrame, cell_pose
from postproc.language.analysis.declarations import Datum
from postproc.language.analysis.move_blocks import TargetSlots
from postproc.language.analysis.shared_changes import (
    OutsideCall,
    SharedChange,
    collect_changes,
    describe_changes,
    list_outside_calls,
    list_shared_changes,
)
from postproc.language.analysis.symbols import (
    FreeName,
    TaskSymbols,
    holds_odd,
    whole,
)
from postproc.language.analysis.uses import NamesUsed
from postproc.language.analysis.values import KnownRecord, Layout, Value, WrittenNumber
from postproc.language.krl import syntax as said
from postproc.language.krl.imports import list_imports
from postproc.language.krl.inline_forms import COPIES, find_alike, sets_alone
from postproc.language.krl.pose_encoding import COMMENTS, COMPONENTS, KRL_DIALECT
from postproc.language.krl.program import KrlFile, read_krl
from postproc.language.shifts import Pose, Shift, ShiftKind
from postproc.language.text.source import Source, keep_short, parse_shared
from postproc.language.text.symbol_column import read_names
from postproc.language.text.templates import name_index

CONFIG = "$config"
ANY: tuple[int, ...] = ()  # an element whose index is not known
POSITIONS = ("pos", "e6pos")  # types
AXES = tuple(f"a{k}" for k in range(1, 7))
OUTSIDE = tuple(f"e{k}" for k in range(1, 7))
FIELDS: Mapping[str, Layout] = {
    type_: {name: {} for name in names}
    for type_, names in {
        "frame": COMPONENTS[:6],
        "pos": COMPONENTS,
        "e6pos": (*COMPONENTS, *OUTSIDE),
        "axis": AXES,
        "e6axis": (*AXES, *OUTSIDE),
    }.items()
}
"""Components of points by type."""
WHOLE_NUMBERS = COMPONENTS[6:]
ACTUAL = "_act"
"""Ends names of data that programs set before each of their moves."""

# What a program sets on its way: entries of tables, corrections, switches.

TABLES = ("tool_data", "base_data", "load_data")
"""Arrays that $TOOL, $BASE and $LOAD are read from."""
CORRECTIONS: Mapping[str, tuple[tuple[str, str], tuple[str, str]]] = {
    "$tool": (("tool_corr_w", "tool_corr_w_on"), ("tool_corr", "tool_corr_on")),
    "$base": (("base_corr", "base_corr_on"), ("m_base_corr", "m_bas_cor_on")),
}
"""Frames that BAS links to an entry, in front of it and behind it, and their switches.

``BAS(#TOOL, n)`` sets ``TOOL_CORR_W : TOOL_DATA[n] : TOOL_CORR``, each correction where
its switch is TRUE; likewise the base, ``FRAMES``, ``STOOL2`` and ``SBASE``.
"""
_PAIRS = [pair for both in CORRECTIONS.values() for pair in both]
CORRECTION_FRAMES = frozenset(frame for frame, _ in _PAIRS)
SWITCHES = frozenset(switch for _, switch in _PAIRS)
PERHAPS = "perhaps"
"""Value of a switch that is on or off by the release of the controller."""
HELD = frozenset(TABLES) | CORRECTION_FRAMES | SWITCHES
"""Names of data that hold until the program sets them again."""

STILL, WRITING = said.NAMES["still"], said.NAMES["writing"]
FUNCTIONS = said.NAMES["function"]
# Routines of packages that are known neither to move the arm nor to set frames.

AHEAD = "ahead"
ASSUMED = (
    "is not in the available files: it is on the list of routines known neither to "
    "move the arm nor to set frames (docs/routines.md). If it does, say so under "
    "[routines] in the cell file, or set assume_motion"
)


@cache
def package_routines() -> Mapping[str, str]:
    """Return the shipped list: lower-case names, and what stands behind them.

    >>> package_routines()["set_cd_params"], package_routines()["h50"]
    ('ahead', '')
    """
    return read_names(Path(__file__).with_name("still_routines.txt"))


KEEPING = ((STILL - WRITING) | FUNCTIONS | package_routines().keys()) | {"bas"}
"""Routines that change nothing of what they get."""


def entry_name(table: str, number: int) -> str:
    """Name an entry of a table.

    >>> entry_name("base_data", 2)
    'base_data[2]'
    """
    return f"{table}[{number}]"


@dataclass
class KrlTask(TaskSymbols[KrlFile]):
    """The files of a job, the source first.

    Attributes:
        first_frames: Entries of tables as they are at first, by file and row.
    """

    first_frames: dict[tuple[int, int], TaskFrame] = field(default_factory=dict)
    comments = COMMENTS
    layouts = FIELDS
    followed = (*FIELDS, "int", "real", "bool")
    targets = (*FIELDS,)
    functions = "deffct"
    by_name = True
    uncertain = ("/",)  # whole numbers divide otherwise than others
    apart = True
    still_words = said.NAMES["move"]

    def new_uses(self) -> NamesUsed:
        """Return what knows moves and routines by name."""
        return _KrlUses(self.routines, self.called_elsewhere, points=self._points)

    def shares(self, file: int, datum: Datum) -> bool:
        """Return True for GLOBAL data, those of ``$config.dat``, and imported ones."""
        return datum.module == CONFIG or self.is_exported(datum)

    def is_exported(self, datum: Datum) -> bool:
        """Return True for GLOBAL data, and those that other programs import."""
        if not self._imported:
            return super().is_exported(datum)
        imported = (datum.module, datum.name) in self._imported
        return imported or super().is_exported(datum)

    @cached_property
    def _imported(self) -> frozenset[tuple[str, str]]:
        """Lists and names of data that other programs import."""
        found = list_imports(_sources(self.files_beside))
        return frozenset((one.module, one.original) for one in found)

    @cached_property
    def changed_elsewhere(self) -> Mapping[str, Sequence[SharedChange]]:
        """What other programs change of the data that all share, by name."""
        own = (list_changes(*sources) for sources in self._others)
        changes = [*chain.from_iterable(own)]
        data = ((k, one) for k, file in enumerate(self.files) for one in file.data)
        known = (one.name for k, one in data if changes and self.shares(k, one))
        shared = HELD.union(known)
        return collect_changes(changes, shared, self.start)

    @cached_property
    def outside_calls(self) -> Mapping[str, OutsideCall]:
        """Calls by other programs of routines that they know, the first of each."""
        known = {
            one.rows.head.name for one in self.every_routine if not one.rows.head.local
        }
        calls = chain.from_iterable(list_calls(*own) for own in self._others)
        return {one.name: one for one in calls if one.name in known}

    @cached_property
    def outside_modes(self) -> frozenset[str]:
        """Modes that any program may leave otherwise than a program begins."""
        every = _sources((*self.files, *self.files_beside))
        found = (find_modes(one) for one in every)
        return frozenset[str]().union(*found)

    @cached_property
    def _others(self) -> Sequence[Sequence[Source]]:
        """Other programs, each with its data list."""
        found = defaultdict[str, list[Source]](list)
        for file in self.files_beside:
            found[file.name].append(file.text.source)
        return [*found.values()]

    def name_for_others(self, name: str) -> str:
        """Leave what programs set before each of their moves, see `TaskSymbols`."""
        own = name.startswith("$") or name.endswith(ACTUAL)
        return "" if own else self._own_imports.get(name, name)

    @cached_property
    def _own_imports(self) -> Mapping[str, str]:
        """Names in other lists of what is imported."""
        return {one.name: one.original for one in list_imports(_sources(self.files))}

    def outlives(self, datum: Datum) -> bool:
        """Return True for data of a list."""
        return not datum.routine

    def keeps(self, file: int, datum: Datum) -> bool:
        """Return True where no statement changes data, of an array the element."""
        changed = datum.name.startswith("$") or datum.name in self.written
        return not changed or self.is_steady(datum.name, datum.index)

    def is_followed(self, name: str, datum: Datum, here: Scope) -> bool:
        """Leave variables of the system, and of loops."""
        own = not (name.startswith("$") or name in self.loop_variables)
        return own and super().is_followed(name, datum, here)

    def fits(self, type_: str, component: str, value: float) -> bool:
        """Leave what is rounded to a whole number."""
        return not (type_ == "int" or component in WHOLE_NUMBERS) or (
            whole(value) is not None
        )

    def spell(self, type_: str, component: str) -> list[str]:
        """Spell a place: that is what an unknown value leaves unknown."""
        if component:
            return [component] if component in FIELDS.get(type_, {}) else []
        return [*COMPONENTS[:6]] if type_ in FIELDS else [""]

    def unit(self, file: int) -> int:
        """Return the source that a data list belongs to."""
        return self._units[file]

    @cached_property
    def _units(self) -> Sequence[int]:
        by_kind = sorted(enumerate(self.files), key=lambda one: not one[1].routines)
        first = {file.name: number for number, file in reversed(by_kind)}
        return [first[file.name] for file in self.files]

    def explain_unknown(
        self, name: str, here: Scope, index: tuple[int, ...] = ()
    ) -> tuple[Code, str]:
        """Say why a name stands for no known value; the text goes behind the name.

        Args:
            name: The name.
            here: Where it stands.
            index: Of an element.
        """
        code = Code.RUNTIME_VALUE
        if name in here.parameters:
            return code, "is a parameter: what is given for it is not followed"
        if self.place(name, here) is None:
            text = "is declared in none of the given files, or in several of them"
            return Code.UNDECLARED_VARIABLE, text
        if others := self.changed_elsewhere.get(name):
            return code, describe_changes(others, index)
        if name in self.written:
            text = "may be changed by the program: it is known only when that runs"
            return code, text
        return Code.NO_VALUE, "has no value that is known before the program runs"

    @cached_property
    def odd_words(self) -> frozenset[str]:
        """Words of what is not understood: each may name what is set there.

        A move sets nothing; and tables are given their first values in lists.
        """
        found = set[str]()
        for file in (f for f in self.files if not f.is_submit):
            words = file.text.words(file.text.of_kind(holds_odd), self.still_words)
            found |= words if file.routines else words.difference(TABLES)
        return frozenset(found)

    def is_global(self, name: str, here: Scope) -> bool:
        """Return True if a name means data that all programs share."""
        if name in here.parameters:
            return False
        place = self.place(name, here)
        return place is None or place[1] == CONFIG

    def entry(self, table: str, number: int, here: Scope) -> Value | None:
        """Return what an entry of a table holds at first, None where not known."""
        found = self.datum(table, here, (number,))
        if found is None:
            return None
        return self.value(found[1].value, self.scope_of_datum(*found))

    @cached_property
    def taught_poses(self) -> Sequence[Pose]:
        """Frames of the cell that were taught."""
        return [cell_pose(record) for record in self.start.taught_records]

    def elements(self, array: str) -> Iterator[tuple[int, Datum]]:
        """Yield the elements of an array that are given values, and their files."""
        pairs = ((k, one) for k, file in enumerate(self.files) for one in file.data)
        return (pair for pair in pairs if pair[1].name == array and pair[1].index)

    def is_steady(self, array: str, index: tuple[int, ...]) -> bool:
        """Return True if no statement of the files may change an element."""
        written = self._elements_written.get(array, {ANY})
        return bool(index) and written.isdisjoint({index, ANY})

    @cached_property
    def _elements_written(self) -> Mapping[str, set[tuple[int, ...]]]:
        """Collect the elements that statements may change, of arrays by name."""
        arrays = {*TABLES, *(one.name for one in self.every_datum if one.index)}
        found: dict[str, set[tuple[int, ...]]] = {name: set() for name in arrays}
        for name in (self.odd_words | self.called_beside) & arrays:
            found[name].add(ANY)
        for name in arrays & self.changed_elsewhere.keys():
            found[name] |= {one.index or ANY for one in self.changed_elsewhere[name]}
        for number, file in enumerate(self.files):
            there = Scope(number, "", "")
            for row in file.text.of_kind(lambda one: self._may_change(one, arrays)):
                for target in self.list_changes(file.text.statement(row)):
                    given = not (file.routines or _is_of_part(target))
                    if target.name in arrays and not given:
                        routine = self.routine_around(number, row)
                        here = self.scope_of(routine) if routine else there
                        found[target.name].add(self.index_of(target, here.at(row)))
        return found

    def _may_change(self, one: ir.SourceStatement, arrays: Collection[str]) -> bool:
        """Return True if a statement whose numbered names are open may change some."""
        names = [target.name for target in self.list_changes(one)]
        return any(name in arrays or name_index(name) >= 0 for name in names)

    def initial_switch(self, name: str) -> bool | None:
        """Return a switch that the program has not set so far, None if not known.

        A switch that no file sets is FALSE, unless a list declares it TRUE: what ran
        before may have left it so.
        """
        return None if name in self._switched_on | self.written else False

    @cached_property
    def _switched_on(self) -> frozenset[str]:
        """Switches that a list gives another value than FALSE at first."""
        given = (one for one in self.every_datum if one.name in SWITCHES and one.value)
        return frozenset(one.name for one in given if not is_word(one.value, "false"))

    @cached_property
    def beside(self) -> frozenset[str]:
        """Names of data that submit programs may change at any time."""
        return frozenset().union(*(part.written for part in self._beside))

    @cached_property
    def called_beside(self) -> frozenset[str]:
        """Names that submit programs call, and words of what is not understood."""
        return frozenset().union(*(part.called for part in self._beside))

    @cached_property
    def _beside(self) -> list[_Beside]:
        """Read submit programs, and the routines of the files that they call."""
        found = list[_Beside]()
        for file in (one for one in self.files if one.is_submit):
            own = (datum.name for datum in file.data if datum.scope != "global")
            found.append(self._read_beside(file, range(len(file.text)), {*own}))

        def read(name: str) -> Iterator[str]:
            for number, _, rows in self.routines.get(name, ()):
                file, inside = self.files[number], range(rows.first + 1, rows.last)
                own = {d.name for d in file.data if d.routine == rows.head.name}
                found.append(self._read_beside(file, inside, own))
                yield from found[-1].called

        called = (name for part in [*found] for name in part.called)
        for _ in reach(called, read, str):
            pass
        return found

    def _read_beside(self, file: KrlFile, rows: range, own: Collection[str]) -> _Beside:
        """Read statements that run beside the program.

        Args:
            file: Their file.
            rows: The statements.
            own: Names of data that nothing else knows.
        """
        uses, statements = self.new_uses(), [*map(file.text.statement, rows)]
        for one in statements:
            uses.note(one)
        odd = file.text.words(file.text.where(holds_odd, rows.start, rows.stop))
        called = odd | ir.names_called(*statements)
        handed = {data.name for data in uses.targets}
        written = (handed | uses.written | uses.changed | odd).difference(own)
        return _Beside(frozenset(written), frozenset(uses.read.difference(own)), called)

    def values_of(self, one: ir.SourceStatement) -> list[ir.Node]:
        """List the values that a statement takes when it runs, with all in them.

        An interrupt or a trigger takes them at another time.
        """
        match one:
            case said.InterruptDeclared() | said.InterruptSwitched():
                return []
            case said.PathTrigger(values=values):
                return ir.walk(*values)
            case said.KrlMove(settings=settings) | said.SplineBlock(settings=settings):
                own = (x for x in one.children() if isinstance(x, ir.Operand))
                return ir.walk(*own, *(setting.value for setting in settings))
        return ir.walk(one)

    def plain_end(self, one: ir.SourceStatement) -> ir.Operand | None:
        """Return where a plain move goes, see `TaskSymbols.plain_end`."""
        if not isinstance(one, said.KrlMove):
            return None
        if not all(sets_alone(setting, self.routines) for setting in one.settings):
            return None
        plain = one.word in ("ptp", "lin", "sptp", "slin") and one.via is None
        return one.to if plain and one.angle is None else None

    def free_names(self, one: ir.SourceStatement) -> list[FreeName]:
        """Add data that a move sets something to for itself alone."""
        found = super().free_names(one)
        if isinstance(one, said.KrlMove) and self.plain_end(one) is not None:
            data = ir.data_in(*(setting.value for setting in one.settings))
            places = (name_index(part.name) for part in data)
            found += [FreeName(at, read=True) for at in places if at >= 0]
        return found

    def find_alike(self, file: int) -> Ints:
        """Find the names of inline forms' data that hold the same."""
        own = [one for k, one in enumerate(self.files) if self._units[k] == file]
        return find_alike(self.files[file], own, self.written)

    def read_slots(self, operand: ir.Operand) -> TargetSlots | None:
        """Return the numbers of an aggregate, see `TaskSymbols.read_slots`."""
        fields = operand.fields if isinstance(operand, said.KrlAggregate) else ()
        slots = {f.name: f.value.slot for f in fields if isinstance(f.value, ir.Num)}
        outside = tuple(slots.get(name, -1) for name in OUTSIDE)
        for names, needed in ((COMPONENTS, COMPONENTS[:6]), (AXES, AXES)):
            own = slots.keys() <= {*names, *OUTSIDE}
            if own and slots.keys() >= {*needed} and len(slots) == len(fields):
                found = [slots.get(name, -1) for name in names]
                found += [-1] * (len(COMPONENTS) - len(found))
                return TargetSlots(tuple(found), outside, joints=names is AXES)
        return None

    def note_in(self, uses: NamesUsed, file: KrlFile, one: ir.SourceStatement) -> None:
        """Note a statement; what a data list assigns is the first value of data."""
        if file.routines or not isinstance(one, ir.Assignment):
            uses.note(one)
            return
        uses.take(one.value)
        if _is_of_part(one.target):
            uses.written.add(one.target.name)

    def note_odd(self, uses: NamesUsed) -> None:
        """Note what submit programs and what is not understood may do."""
        uses.changed |= self.beside | self.odd_words
        uses.written |= self.changed_elsewhere.keys()
        uses.read |= self.beside.union(*(part.read for part in self._beside))
        uses.read |= self.words_of_odd()

    @cached_property
    def copies_are_points(self) -> bool:
        """Whether a program has points or numbers of the names that forms set."""
        own = (one for one in self.every_datum if one.name in COPIES)
        return any(one.type in self.followed for one in own)

    @cached_property
    def _points(self) -> frozenset[str]:
        """Names of data that are positions."""
        points = (one for one in self.every_datum if one.type in POSITIONS)
        return frozenset(one.name for one in points)

    # Values.

    def build(self, operand: ir.Operand, here: Scope, depth: int) -> Value | None:
        """Evaluate words and aggregates.

        What a component is that is written twice is not known.
        """
        match operand:
            case said.EnumValue(name=name):
                return name
            case said.KrlAggregate(fields=fields):
                times = Counter(f.name for f in fields)
                once = fields
                if len(times) < len(fields):
                    once = tuple(f for f in fields if times[f.name] == 1)
                pairs = [(f.name, self.value(f.value, here, depth)) for f in once]
                known = tuple((name, one) for name, one in pairs if one is not None)
                return KnownRecord(known, len(known) == len(fields))
        return None

    def operate(self, operator: str, parts: Sequence[Value | None]) -> Value | None:
        """Link frames, too."""
        return _link(parts) if operator == ":" else super().operate(operator, parts)


def _link(parts: Sequence[Value | None]) -> KnownRecord | None:
    """Link two frames: what stands on the right tells what comes out."""
    records = [part for part in parts if isinstance(part, KnownRecord) and part.whole]
    numbers = [[one.number(name) for name in COMPONENTS[:6]] for one in records]
    if len(records) != 2 or np.isnan(numbers).any():
        return None
    first, second = numbers
    both = Shift(ShiftKind.OWN, tuple(second), (*first, 0.0, 0.0)).apply(KRL_DIALECT)
    place = zip(COMPONENTS[:6], both, strict=False)
    fields = dict(records[1].fields) | {key: WrittenNumber(one) for key, one in place}
    return KnownRecord(tuple(fields.items()))


@dataclass(frozen=True)
class _Beside:
    """What a submit program, or a routine that one calls, does beside the program.

    Attributes:
        written, read: Names of data that it may change, and those that it takes.
        called: Names of routines that it may call.
    """

    written: frozenset[str]
    read: frozenset[str]
    called: frozenset[str]


@dataclass
class _KrlUses(NamesUsed):
    """Names that statements of KRL may change, and those that they take.

    Attributes:
        points: Names of positions.
    """

    points: Collection[str] = ()

    def note(self, one: ir.SourceStatement) -> None:
        """Note where moves go; what holds for them alone changes nothing."""
        match one:
            case said.KrlMove(word=word, to=to, via=via, angle=angle):
                note = self.take if word.endswith("_rel") else self.take_destination
                for end in (to, via):
                    note(end)
                self.take(angle)
            case said.SplineBlock():
                pass
            case ir.ForLoop(name=name):
                self.targets.append(ir.DataObject(name))
                super().note(one)
            case _:
                super().note(one)
        if isinstance(one, said.KrlMove | said.SplineBlock):
            for setting in one.settings:
                self.take(setting.value)

    def list_changed(
        self, name: str, arguments: Sequence[ir.Argument]
    ) -> Sequence[ir.Argument]:
        """Return all, but of what is known to change nothing that it gets."""
        return () if name in KEEPING else arguments

    def split_shift(
        self, operand: ir.Operand
    ) -> tuple[ir.Operand | None, Sequence[ir.Operand | None]] | None:
        """Take ``point : {..}`` or ``{..} : point`` apart."""
        if not isinstance(operand, ir.Operation) or operand.operator != ":":
            return None
        first, second = operand.operands
        behind = isinstance(first, ir.DataObject) and first.name in self.points
        return (first, [second]) if behind else (second, [first])


def _is_of_part(target: ir.DataObject) -> bool:
    """Return True if a component is meant: a list that sets one is not followed."""
    return any(isinstance(step, str) for step in target.steps)


def is_word(operand: ir.Operand | None, word: str) -> bool:
    """Return True if an operand is a word such as TRUE."""
    return operand == ir.DataObject(word)


@keep_short
def list_changes(*sources: Source) -> tuple[SharedChange, ...]:
    """List what a program with its data list changes of what all share."""
    files = [parse_shared(read_krl, one) for one in sources]
    return tuple(list_shared_changes(KrlTask(files)))


@keep_short
def list_calls(*sources: Source) -> tuple[OutsideCall, ...]:
    """List the routines that a program calls and does not hold."""
    files = [parse_shared(read_krl, one) for one in sources]
    return tuple(list_outside_calls(KrlTask(files)))


_MODE = re.compile(
    rb"\b(?:(?P<orientation>ORI_TYPE?)|(?P<interpolation>IPO_MODE|IPO_FRAME))"
    rb"[ \t]*(?:=[ \t]*|[ \t](?=#))(?!#?(?:VAR|BASE|SIPO_MODE|SORI_TYP)\b)",
    re.IGNORECASE,
)


@keep_short
def find_modes(source: Source) -> frozenset[str]:
    """Name the modes that a program, or its list, sets to others than at its begin."""
    found = _MODE.finditer(source.data)
    return frozenset(one.lastgroup or "" for one in found)


def _sources(files: Sequence[KrlFile]) -> list[Source]:
    return [one.text.source for one in files]
