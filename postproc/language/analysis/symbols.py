"""What the names of a task mean: its data, routines, and values that are known."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from postproc.arrays import Ints
from postproc.language import ir
from postproc.language.analysis.assigned_points import (
    NO_POINTS,
    AssignedPoint,
    Component,
    Place,
    PointPart,
    Points,
    Scope,
    find_added,
    source_of,
)
from postproc.language.analysis.declarations import Datum, TaskFile, TaskRoutine
from postproc.language.analysis.move_blocks import TargetSlots
from postproc.language.analysis.uses import NamesUsed, match_arguments
from postproc.language.analysis.values import (
    ALIKE,
    KnownRecord,
    Layout,
    Value,
    WrittenNumber,
    apply_function,
    apply_operator,
    is_written,
    list_slots_in,
    number_in,
    put_together,
    spell_components,
    step_into,
    take_apart,
    without_places,
)
from postproc.language.analysis.visit_columns import Numbering
from postproc.language.language import Start
from postproc.language.text.comment_directives import Comments
from postproc.language.text.templates import Shapes, name_index, split_by

DEEPEST = 20  # names that stand for names
F = TypeVar("F", bound=TaskFile)


@dataclass(frozen=True)
class FreeName:
    """An open name of a form: what it is noted for, the same in every statement.

    Attributes:
        at: Which of the open names it is.
        read: Its data are read.
        target: What its data are copied to, whole; "" where they are not.
    """

    at: int
    read: bool = False
    target: str = ""

    @property
    def is_noted(self) -> bool:
        """Whether it is noted for anything."""
        return self.read or bool(self.target)

    def note(self, uses: NamesUsed, names: Iterable[str]) -> None:
        """Note what the statements of the form name there."""
        if self.read:
            uses.read.update(names)
        else:
            uses.copies.update((self.target, name) for name in names)


@dataclass
class TaskSymbols(ABC, Generic[F]):
    """What the names of a task mean, as far as ways through it ask.

    Attributes:
        files: Its files, the one that runs first.
        start: What the cell says.
        files_beside: Files of tasks that run at the same time.
        comments: How the language writes them.
        layouts: Components of data by type.
        followed: Types of data whose assignments are followed.
        targets: Those of them whose numbers a move may have written anew.
        functions: Kinds of routines that return values.
        by_name: Records hold their components by name, not by their order.
        uncertain: Operators whose result kinds of numbers, or controllers, decide.
        apart: Data may be declared in one place and get their first value elsewhere.
        still_words: What statements set nothing that begin with, understood or not.
        volatile: Names of data that may change at any time, by what runs beside.
        reader: Reads where moves lead, None where nothing is followed.
    """

    files: Sequence[F]
    start: Start = field(default_factory=Start)
    files_beside: Sequence[F] = ()
    comments: ClassVar[Comments]
    layouts: ClassVar[Mapping[str, Layout]]
    followed: ClassVar[Collection[str]]
    targets: ClassVar[Collection[str]]
    functions: ClassVar[str]
    by_name: ClassVar[bool] = False
    uncertain: ClassVar[Collection[str]] = ("DIV", "MOD")
    apart: ClassVar[bool] = False
    still_words: ClassVar[Collection[str]] = ()
    volatile: frozenset[str] = field(default=frozenset(), init=False)
    reader: type[Any] | None = field(default=None, init=False)
    _own: dict[Place, dict[tuple[int, ...], tuple[int, Datum]]] = field(
        default_factory=lambda: defaultdict(dict), init=False
    )
    _shared: dict[str, set[Place]] = field(
        default_factory=lambda: defaultdict(set), init=False
    )
    _doubled: set[Place] = field(default_factory=set, init=False)
    _names: dict[int, tuple[ir.Operand, frozenset[str]]] = field(
        default_factory=dict, init=False
    )
    _written: dict[int, tuple[ir.Operand, TargetSlots | None]] = field(
        default_factory=dict, init=False
    )
    _changes: dict[int, tuple[ir.SourceStatement, Sequence[ir.DataObject]]] = field(
        default_factory=dict, init=False
    )

    def __post_init__(self) -> None:
        """Index data by the scopes that declare them."""
        for number, file in enumerate(self.files):
            for datum in (*file.data, *self._list_parameters(file)):
                self._declare(number, datum)

    def _list_parameters(self, file: F) -> Iterator[Datum]:
        """Yield the parameters of routines that are data of their own."""
        for rows in file.routines:
            module, name = file.module_of(rows), rows.head.name
            for one in rows.head.parameters:
                if one.type and not one.by_reference:
                    yield Datum(one.name, one.type, rows.first, module, name)

    def _declare(self, number: int, datum: Datum) -> None:
        place = self.unit(number), datum.module, datum.routine, datum.name
        own = self._own[place]
        if datum.index in own and not self.apart:
            self._doubled.add(place)
        elif datum.index in own and own[datum.index][1].value is not None:
            if datum.value is None:
                return
            datum = replace(datum, value=None)  # which of the two holds?
        own[datum.index] = number, datum
        if not datum.routine and self.shares(number, datum):
            self._shared[datum.name].add(place)

    # What a language says.

    @abstractmethod
    def new_uses(self) -> NamesUsed:
        """Return what notes the names that statements change and take."""

    @abstractmethod
    def shares(self, file: int, datum: Datum) -> bool:
        """Return True if other modules know data of a module."""

    @abstractmethod
    def keeps(self, file: int, datum: Datum) -> bool:
        """Return True if data hold their first value for as long as the task runs."""

    @abstractmethod
    def outlives(self, datum: Datum) -> bool:
        """Return True if what data are given is there when the task runs again."""

    def is_exported(self, datum: Datum) -> bool:
        """Return True if other programs may go to a point, too."""
        return datum.scope == "global"

    def name_for_others(self, name: str) -> str:
        """Return what others call data that the task does not declare, "" if none do.

        Args:
            name: Of data of another program, as it is written.
        """
        return name

    def is_followed(self, name: str, datum: Datum, here: Scope) -> bool:
        """Return True if nothing but assignments on the way changes data."""
        return not (name in self.uses.changed or name in self.volatile)

    def fits(self, type_: str, component: str, value: float) -> bool:
        """Return True if data, or a component, hold a number as it is given."""
        return True

    def spell(self, type_: str, component: str) -> list[str]:
        """Return the values that data, or a part of them, hold, as they are spelt."""
        return spell_components(self.layouts.get(type_, {}), component)

    def unit(self, file: int) -> int:
        """Return the file that stands for all that a file shares its names with."""
        return file

    def controller_data(self, name: str) -> tuple[Value, str] | None:
        """Return what the controller gives a name, and its type; None for others."""
        truth = {"true": 1.0, "false": 0.0}.get(name)
        return None if truth is None else (WrittenNumber(truth), "")

    def apply(self, call: ir.FunctionCall, here: Scope, depth: int) -> Value | None:
        """Return what a function of the controller gives, None where not known."""
        if call.name not in ALIKE or len(call.arguments) != 1:
            return None
        number = self.number(call.arguments[0].value, here)
        return _make_number(apply_function(call.name, number))

    def operate(self, operator: str, parts: Sequence[Value | None]) -> Value | None:
        """Compute what an operator gives, None where that is not known."""
        if operator in self.uncertain:
            return None
        return _make_number(
            apply_operator(operator, [number_in(part) for part in parts])
        )

    def build(self, operand: ir.Operand, here: Scope, depth: int) -> Value | None:
        """Evaluate a value that only this language has, None where it is not known."""
        return None

    def values_of(self, one: ir.SourceStatement) -> list[ir.Node]:
        """List the values that a statement takes when it runs, with all in them."""
        return ir.walk(one)

    def free_names(self, one: ir.SourceStatement) -> list[FreeName]:
        """Return the open names of a form that are noted once for all its statements.

        Those are where a move goes, what is declared, what is copied whole, and what
        else a language adds.
        """
        if (copied := _find_copied(one)) is not None:
            return [copied]
        name, to = "", self.plain_end(one)
        if isinstance(one, ir.Declaration) and len(one.items) == 1:
            name = one.items[0].name
        elif isinstance(to, ir.DataObject) and not to.steps:
            name = to.name
        at = name_index(name)
        return [FreeName(at)] if at >= 0 else []

    def plain_end(self, one: Any) -> ir.Operand | None:
        """Return where a move goes that does nothing else, None for all other lines.

        But for data by name, and numbers, nothing stands in it that could differ.
        """
        return None

    def find_alike(self, file: int) -> Ints | None:
        """Find which names in a file are those of data that always hold the same.

        Returns:
            What stands for each name of its text, (n,), by their index; None: each
            stands for itself.
        """
        return None

    @abstractmethod
    def read_slots(self, operand: ir.Operand) -> TargetSlots | None:
        """Return the numbers of a written target, None for all other operands."""

    def slots_of(self, operand: ir.Operand | None) -> TargetSlots | None:
        """Read a value once for all statements of a form, see `read_slots`."""
        if operand is None:
            return None
        if id(operand) not in self._written:
            self._written[id(operand)] = operand, self.read_slots(operand)
        return self._written[id(operand)][1]

    def note_in(self, uses: NamesUsed, file: F, one: ir.SourceStatement) -> None:
        """Note what a statement of a file changes and takes."""
        uses.note(one)

    def note_odd(self, uses: NamesUsed) -> None:
        """Note what may be changed and taken by what is not understood, or beside."""
        uses.changed |= self.odd_words
        uses.read |= self.odd_words

    @property
    def calls_by_text(self) -> bool:
        """Whether routines are called whose names only the run tells."""
        return False

    # Names.

    @cached_property
    def routines(self) -> Mapping[str, list[TaskRoutine]]:
        """Routines by name."""
        found: dict[str, list[TaskRoutine]] = defaultdict(list)
        for number, file in enumerate(self.files):
            for rows in () if file.is_submit else file.routines:
                place = TaskRoutine(number, file.module_of(rows), rows)
                found[rows.head.name].append(place)
        return found

    @cached_property
    def every_routine(self) -> Sequence[TaskRoutine]:
        """All routines, by name as they come first."""
        return [one for own in self.routines.values() for one in own]

    @cached_property
    def every_datum(self) -> Sequence[Datum]:
        """All data that files declare."""
        return [datum for file in self.files for datum in file.data]

    @cached_property
    def routines_by_file(self) -> Mapping[int, list[TaskRoutine]]:
        """Routines by the file that they stand in."""
        found: dict[int, list[TaskRoutine]] = defaultdict(list)
        for one in self.every_routine:
            found[one.file].append(one)
        return found

    def routine(self, name: str, here: Scope) -> TaskRoutine | None:
        """Find the routine that a name means, None where it is not sure."""
        known = self.routines.get(name, [])
        own = [one for one in known if one[:2] == (here.file, here.module)]
        found = own or [one for one in known if not one.rows.head.local]
        return found[0] if len(found) == 1 else None

    def routine_around(self, file: int, row: int) -> TaskRoutine | None:
        """Return the routine that a statement stands in, None where it is in none."""
        around = (one for one in self.routines_by_file[file] if row in one.inside)
        return next(around, None)

    def scope_of(self, routine: TaskRoutine) -> Scope:
        """Return where the statements of a routine stand."""
        (file, module, _), head = routine, routine.rows.head
        place = self.unit(file), module, head.name
        named = frozenset(
            one.name for one in head.parameters
            if one.by_reference or (*place, one.name) not in self._own
        )  # fmt: skip
        return Scope(file, module, head.name, named)

    def scope_of_datum(self, file: int, datum: Datum) -> Scope:
        """Return where data are declared."""
        return Scope(file, datum.module, datum.routine, row=datum.row)

    def place(self, name: str, here: Scope) -> Place | None:
        """Find where the data are declared that a name means, None if not known."""
        if name in here.parameters:
            return None
        for routine in (here.routine, ""):
            place = self.unit(here.file), here.module, routine, name
            if place in self._own:
                return place
        shared = self._shared.get(name, ())
        return next(iter(shared)) if len(shared) == 1 else None

    def data_at(self, place: Place) -> Mapping[tuple[int, ...], tuple[int, Datum]]:
        """Return the file and the data that are declared in a place, by their index."""
        return self._own.get(place, {})

    def datum(
        self, name: str, here: Scope, index: tuple[int, ...] = ()
    ) -> tuple[int, Datum] | None:
        """Find the data, or an element, that a name means, None if not known."""
        place = self.place(name, here)
        if place is None or place in self._doubled:
            return None
        return self._own[place].get(index)

    def constant(
        self, name: str, here: Scope, index: tuple[int, ...] = ()
    ) -> tuple[int, Datum] | None:
        """Find data that hold what they were declared with for as long as it runs."""
        found = self.datum(name, here, index)
        if found is None or found[1].value is None or not self.keeps(*found):
            return None
        return found

    @cached_property
    def numbering(self) -> Numbering:
        """The statements and numbers of all files, those beside the task the last."""
        return Numbering([one.text for one in (*self.files, *self.files_beside)])

    @cached_property
    def declared(self) -> frozenset[str]:
        """Names of all data."""
        return frozenset(datum.name for datum in self.every_datum)

    @cached_property
    def loop_variables(self) -> frozenset[str]:
        """Names of all variables of loops."""
        texts = (file.text for file in self.files)
        rows = ((text, text.of_kind(_is_loop)) for text in texts)
        return frozenset(text.statement(k).name for text, own in rows for k in own)

    @cached_property
    def taught_lines(self) -> Sequence[frozenset[int]]:
        """Lines of every file that a comment marks as taught."""
        return [self.comments.list_taught(file.text.source) for file in self.files]

    def is_taught(self, name: str, file: int, row: int) -> bool:
        """Return True if data of a statement were taught, by the cell or a comment."""
        lines = self.files[file].text.lines(row)
        return name in self.start.taught or not self.taught_lines[file].isdisjoint(
            lines
        )

    def holds_taught(
        self, operand: ir.Operand | None, found: Value | None, here: Scope
    ) -> bool:
        """Return True if any data or number that a value is made from was taught.

        Args:
            operand: What holds the value.
            found: The value.
            here: Where it is taken.
        """
        names = self.names_behind(operand, here)
        declared = (self.datum(name, here) for name in names)
        rows = {(one[0], one[1].row) for one in declared if one is not None}
        slots = {*list_slots_in(found)}
        for slot in slots:
            file = self.numbering.file_of(slot)
            own = self.numbering.first[file]
            rows.add((file, self.files[file].text.row_of(slot - own)))
        listed = not names.isdisjoint(self.start.taught)
        listed |= not slots.isdisjoint(self.listed_slots)
        return listed or any(self.is_taught("", *one) for one in rows)

    @cached_property
    def listed_slots(self) -> frozenset[int]:
        """Numbers of data that the cell says were taught, where they are declared."""
        pairs = ((k, one) for k, file in enumerate(self.files) for one in file.data)
        found = (
            self.value(one.value, self.scope_of_datum(k, one))
            for k, one in pairs
            if one.name in self.start.taught
        )
        return frozenset(slot for value in found for slot in list_slots_in(value))

    # What statements change and take.

    @cached_property
    def uses(self) -> NamesUsed:
        """The names that statements change and take."""
        uses = self.new_uses()
        for number, file in enumerate(self.files):
            if not file.is_submit:
                self._note_live(uses, number)
        self.note_odd(uses)
        kept = {datum.name for datum in self.every_datum if self.outlives(datum)}
        for routine in self.every_routine:  # parameters may stand for any data
            kept.update(one.name for one in routine.rows.head.parameters)
        alone = self.declared - kept
        uses.read |= {one for target, one in uses.copies if target not in alone}
        uses.pass_on()
        return uses

    def _note_live(self, uses: NamesUsed, number: int) -> None:
        """Note what the statements of a file say, but for routines that are dead.

        Those are left out that declare what is written in numbers alone.
        """
        file = self.files[number]
        text, live = file.text, file.text.which(_names_data)
        for routine in self.routines_by_file[number] if self.dead else ():
            if routine.key in self.dead:
                live[routine.inside.start : routine.inside.stop] = False
        shapes = np.unique(text.shape[live])
        free = [self.free_names(one) for one in text.said.said]
        apart = [[one.at for one in some] for some in free]
        for k in text.said.distinct(shapes, apart).tolist():
            self.note_in(uses, file, text.said[k])
        for form, at in split_by(text.said.form[shapes]):
            _note_free(uses, text.shapes, shapes[at], free[form])

    @cached_property
    def dead(self) -> frozenset[tuple[int, int]]:
        """Keys of routines that nothing calls, and that nothing else may call.

        One that other files know counts as if it were called: by a program that is not
        at hand, or by the operator.
        """
        local = [one for one in self.every_routine if one.rows.head.local]
        if not local or self.calls_by_text:
            return frozenset()
        called = (ir.names_called(*file.text.said) for file in self.files)
        found = self.odd_words.union(*called)
        return frozenset(
            one.key for one in local
            if one.rows.head.name not in found and one.rows.head.kind != "trap"
        )  # fmt: skip

    @cached_property
    def called_elsewhere(self) -> frozenset[str]:
        """Names of local routines that may be called where others are meant by them."""
        local = [one for one in self.every_routine if one.rows.head.local]
        place = {one.rows.head.name: one.file for one in local}
        found = set[str]()
        for number, file in enumerate(self.files) if local else ():
            names = ir.names_called(*file.text.said) & {*place}
            several = len({one.module for one in self.routines_by_file[number]}) > 1
            found |= {name for name in names if several or place[name] != number}
        return frozenset(found)

    @cached_property
    def written(self) -> frozenset[str]:
        """Names of data that something may change."""
        return frozenset(self.uses.written | self.uses.changed)

    @cached_property
    def read(self) -> frozenset[str]:
        """Names of data that something but the destination of a move takes."""
        return frozenset(self.uses.read)

    @cached_property
    def odd_words(self) -> frozenset[str]:
        """Words of what is not understood: each may name what is set there."""
        return self.words_of_odd()

    def words_of_odd(self, but: Collection[str] = ()) -> frozenset[str]:
        """Return words of what is not understood, and does not begin with some."""
        texts = (file.text for file in self.files if not file.is_submit)
        found = (one.words(one.of_kind(holds_odd), but) for one in texts)
        return frozenset().union(*found)

    def list_changes(self, one: ir.SourceStatement) -> Sequence[ir.DataObject]:
        """Return the data that a statement may change, also what it does later."""
        if id(one) not in self._changes:
            uses = self.new_uses()
            uses.note(one)
            self._changes[id(one)] = one, uses.targets
        return self._changes[id(one)][1]

    # What routines are called with.

    def bind(
        self, routine: TaskRoutine, call: ir.Instruction | ir.FunctionCall, there: Scope
    ) -> Scope | None:
        """Return where the statements of a routine stand, and what it is called with.

        That are parameters that stand for other data, and those that hold what never
        changes; `hand_over` gives the others their values.

        Args:
            routine: The routine.
            call: The call.
            there: Where it stands.

        Returns:
            None where the call does not fit.
        """
        pairs = match_arguments(routine.rows.head.parameters, call.arguments)
        if pairs is None:
            return None
        given = tuple(
            (parameter.name, argument.value, there)
            for parameter, argument in pairs
            if argument.value is not None
            and (
                parameter.by_reference
                or self._is_fixed(parameter, argument.value, there)
            )
        )
        return replace(self.scope_of(routine), given=given)

    def _is_fixed(
        self, parameter: ir.RoutineParameter, value: ir.Operand, there: Scope
    ) -> bool:
        """Return True if a parameter is a copy of what never changes, nor does it."""
        names, changing = self.names_of(value), self.written | self.volatile
        called = (name for name in names if name in self.routines)
        return changing.isdisjoint(names | {parameter.name}) and all(
            self._is_closed(name, there) for name in called
        )

    def hand_over(
        self, points: Points, routine: TaskRoutine,
        call: ir.Instruction | ir.FunctionCall, there: Scope,
    ) -> Points:  # fmt: skip
        """Return what points hold where a routine begins that gets copies.

        Args:
            points: What they hold there without them.
            routine: The routine.
            call: The call.
            there: Where it stands.
        """
        pairs = match_arguments(routine.rows.head.parameters, call.arguments) or ()
        here = self.scope_of(routine).at(routine.rows.first)
        for parameter, argument in pairs:
            if parameter.by_reference or argument.value is None:
                continue
            part = self.locate(ir.DataObject(parameter.name), here)
            if part is None or part.index is None or argument.passed_on:
                continue
            if not self._is_fixed(parameter, argument.value, there):
                points = points.give(self._give_value(part, (), argument.value, there))
        return points

    def behind(
        self, operand: ir.Operand | None, here: Scope
    ) -> tuple[ir.Operand | None, Scope]:
        """Return what stands behind a parameter or a call of a function, and its place.

        That is the operand itself where it is neither, or not known.
        """
        for _ in range(DEEPEST):
            for _, given, there in self.find_given(operand, here):
                operand, here = given, there
            if not isinstance(operand, ir.FunctionCall):
                break
            returned = self.find_returned(operand, here)
            if returned is None:
                break
            operand, here = returned
        return operand, here

    def find_given(
        self, operand: ir.Operand | None, here: Scope
    ) -> Iterator[tuple[str, ir.Operand, Scope]]:
        """Yield the parameters that an operand stands for, as in `Scope.given`."""
        while isinstance(operand, ir.DataObject) and not operand.steps:
            if operand.name in dict(here.loops):
                return
            found = (one for one in here.given if one[0] == operand.name)
            given = next(found, None)
            if given is None:
                return
            name, operand, there = given
            here = replace(there, points=here.points)
            yield name, operand, here

    # Values.

    def number(self, operand: ir.Operand | None, here: Scope) -> float:
        """Evaluate a number, NaN where it is not known before the program runs."""
        return number_in(self.value(operand, here))

    def decide(self, operand: ir.Operand | None, here: Scope) -> float | str | None:
        """Evaluate what decides a way, None where more than the program decides it.

        It is written as a number, or the program has given its data values on the way.
        """
        if isinstance(operand, ir.Operation) and operand.operator in ("AND", "OR"):
            parts = [self.decide(one, here) for one in operand.operands]
            numbers = [one if isinstance(one, float) else math.nan for one in parts]
            truth = apply_operator(operand.operator, numbers)
            return None if math.isnan(truth) else truth
        names = frozenset() if operand is None else self.names_of(operand)
        given = [self._is_given(name, here) for name in names]
        if names and (None in given or not any(given)):
            return None
        found = self.value(operand, here)
        if isinstance(found, WrittenNumber):
            return found.value
        return found if isinstance(found, str) else None

    def _is_given(self, name: str, here: Scope) -> bool | None:
        """Tell whether a program gives data a value on the way; None: more than it."""
        if name in dict(here.loops):
            return True
        if self.find_held(ir.DataObject(name), here) is not None:
            return True
        for _, operand, there in self.find_given(ir.DataObject(name), here):
            inner = [self._is_given(one, there) for one in self.names_of(operand)]
            return None if None in inner else True
        if name in self.routines:
            return True if self._is_closed(name, here) else None
        place = self.place(name, here)
        found = self.datum(name, here)
        if found is None:
            fixed = name in ALIKE or self.controller_data(name) is not None
            return False if place is None and fixed else None
        return False if found[1].kind == "const" else None

    def _is_closed(self, name: str, here: Scope) -> bool:
        """Return True if a function names nothing but data of its own."""
        found = self.routine(name, here)
        if found is None:
            return False
        scope, text = self.scope_of(found), self.files[found.file].text
        said = [text.statement(row) for row in found.inside]
        places = (self.place(one.name, scope) for one in ir.data_in(*said))
        return all(place is not None and place[2] for place in places)

    def value(
        self, operand: ir.Operand | None, here: Scope, depth: int = 0
    ) -> Value | None:
        """Evaluate an operand, None where it is not known before the program runs."""
        if depth > DEEPEST:
            return None
        match operand:
            case ir.Num(slot=slot):
                text = self.files[here.file].text
                at = int(text.first[here.row]) + slot
                own = self.numbering.first[here.file] + at
                return _make_number(float(text.value[at]), own)
            case ir.StringLiteral(text=written):
                return written
            case ir.Composite(items=items):
                parts = [self.value(one, here, depth) for one in items]
                known = tuple(part for part in parts if part is not None)
                return known if len(known) == len(parts) else None
            case ir.Operation(operator=operator, operands=operands):
                parts = [self.value(one, here, depth) for one in operands]
                return self.operate(operator, parts)
            case ir.DataObject():
                return self._evaluate_data(operand, here, depth)
            case ir.FunctionCall(name=name):
                returned = self.find_returned(operand, here)
                if returned is not None:
                    return self.value(*returned, depth + 1)
                own = name in self.routines
                return None if own else self.apply(operand, here, depth)
            case None:
                return None
            case _:
                return self.build(operand, here, depth)

    def _evaluate_data(
        self, data: ir.DataObject, here: Scope, depth: int
    ) -> Value | None:
        """Evaluate data by name, and what the steps behind it lead to."""
        name, steps, loops = data.name, data.steps, dict(here.loops)
        if name in loops:
            return None if steps else WrittenNumber(loops[name])
        value, steps, type_ = self._evaluate_named(data, here, depth + 1)
        layout = self.layouts.get(type_, {})
        for step in steps:
            into = step if isinstance(step, str) else self.index(step, here)
            value, layout = step_into(value, into, layout)
        return value

    def _evaluate_named(
        self, data: ir.DataObject, here: Scope, depth: int
    ) -> tuple[Value | None, tuple[str | ir.ElementStep, ...], str]:
        """Return what data, or an element, hold; then further steps, and their type."""
        name, steps = data.name, data.steps
        whole = _without_components(data)
        held = self.find_held(whole, here)
        if held is not None:
            value = self.evaluate_held(held)
            return value, steps[len(whole.steps) :], self.type_of(held.place)
        for _, operand, there in self.find_given(ir.DataObject(name), here):
            return self.value(operand, there, depth + 1), steps, ""
        own = name in self.declared or name in here.parameters
        if not own and (given := self.controller_data(name)):
            return given[0], steps, given[1]
        found = None
        if self.apart and steps and isinstance(steps[0], ir.ElementStep):
            index = self.index(steps[0], here)
            found = index and self.constant(name, here, index)
            steps = steps[1:]
        else:
            found = self.constant(name, here)
        if not found:
            return None, (), ""
        file, datum = found
        there, written = self.scope_of_datum(file, datum), datum.value
        if datum.dimensions and steps and not isinstance(steps[0], str):
            index = self.index(steps[0], here)
            written = element_of(written, index) if index else None
            steps = steps[1:]
        return self.value(written, there, depth), steps, datum.type

    def index(self, step: ir.ElementStep | str, here: Scope) -> tuple[int, ...] | None:
        """Return the index of an element from 1, None where it is not known."""
        if isinstance(step, str):
            return None
        values = [whole(self.number(one, here)) for one in step.subscripts]
        known = tuple(k for k in values if k is not None)
        return known if len(known) == len(values) and known else None

    def index_of(self, target: ir.DataObject, here: Scope) -> tuple[int, ...]:
        """Return the index of an element that is changed, () where it is not known."""
        step = target.steps[0] if target.steps else ""
        if isinstance(step, str) or any(data.steps for data in ir.data_in(step)):
            return ()
        return self.index(step, here) or ()

    # What assignments give to data.

    def type_of(self, place: Place) -> str:
        """Return the type of data by their place."""
        return self._own[place][()][1].type

    def locate(self, data: ir.DataObject, here: Scope) -> PointPart | None:
        """Find the point that only assignments change, None for all other data."""
        name, there = data.name, here
        for _, operand, outer in self.find_given(ir.DataObject(name), here):
            if not isinstance(operand, ir.DataObject) or operand.steps:
                return None
            name, there = operand.name, outer
        place = self.place(name, there)
        found = None if place is None else self.datum(name, there)
        if place is None or found is None or found[1].type not in self.followed:
            return None
        file, datum = found
        if not self.is_followed(name, datum, there):
            return None
        steps = data.steps
        index: tuple[int, ...] | None = ()
        if datum.dimensions:
            index = self._find_element(file, datum, steps[:1], here)
            steps = steps[1:]
        component = ".".join(step for step in steps if isinstance(step, str))
        known = all(isinstance(step, str) for step in steps)
        known = known and bool(self.spell(datum.type, component))
        return PointPart(place, index if known else None, component)

    def _find_element(
        self, file: int, datum: Datum, steps: Sequence[str | ir.ElementStep],
        here: Scope,
    ) -> tuple[int, ...] | None:  # fmt: skip
        """Return the index of an element, None where it is not known, or no element."""
        there = self.scope_of_datum(file, datum)
        sizes = [self.number(one, there) for one in datum.dimensions]
        found = self.index(steps[0], here) if steps else None
        if found is None or len(found) != len(sizes):
            return None
        inside = all(1 <= at <= n for at, n in zip(found, sizes, strict=True))
        return found if inside else None

    def list_components(
        self, part: PointPart, found: Value | None
    ) -> Sequence[tuple[str, float | None]]:
        """Return the components that an assignment sets, and what it gives to them.

        Args:
            part: What is set.
            found: What it is given.
        """
        type_ = self.type_of(part.place)
        names = self.spell(type_, part.component)
        if isinstance(found, KnownRecord):
            fitting = found.whole and not part.component and type_ in self.layouts
            found = found if fitting else None
        fields, alone = take_apart(found, names), names == [part.component]
        known = {
            name: one.value for name, one in fields.items()
            if isinstance(one, WrittenNumber)
            and not (alone and not self.fits(type_, name, one.value))
        }  # fmt: skip
        own = (known or names) if self.by_name else (fields or names)
        return [(name, known.get(name)) for name in own]

    def evaluate_held(self, held: AssignedPoint) -> Value | None:
        """Evaluate what assignments gave to data, None where it is not known."""
        base, layout = held.base, self.layouts.get(self.type_of(held.place), {})
        if not held.components:
            return base
        names = spell_components(layout, "")
        fields = take_apart(base, names)
        for one in held.components:
            fields.pop(one.name, None)
            if one.value is not None:
                fields[one.name] = WrittenNumber(one.value)
        if self.by_name and layout:
            known = all(one.value is not None for one in held.components)
            given = held.goal is not None or base is not None
            known &= not given or (isinstance(base, KnownRecord) and base.whole)
            return KnownRecord(tuple(fields.items()), known)
        return put_together(fields, layout) if len(fields) >= len(names) else None

    def are_alike(self, one: AssignedPoint, other: AssignedPoint) -> bool:
        """Tell whether two assignments gave the same to data.

        To points they give the same numbers of the text: those may be written anew.
        """
        if self.type_of(one.place) not in self.targets:
            mine, theirs = map(without_places, map(self.evaluate_held, (one, other)))
            return mine is not None and mine == theirs
        if (one.copied, one.goal is None) != (other.copied, other.goal is None):
            return False
        parts = [
            [(c.name, c.value, c.along) for c in p.components] for p in (one, other)
        ]
        if parts[0] != parts[1] or any(value is None for _, value, _ in parts[0]):
            return False
        return one.base == other.base and (one.base is None or is_written(one.base))

    def names_of(self, operand: ir.Operand) -> frozenset[str]:
        """Return the names of all data and functions in an operand."""
        key = id(operand)
        if key not in self._names:
            named = ir.DataObject | ir.FunctionCall
            parts = (x for x in ir.walk(operand) if isinstance(x, named))
            self._names[key] = operand, frozenset(one.name for one in parts)
        return self._names[key][1]

    def names_behind(self, operand: ir.Operand | None, here: Scope) -> frozenset[str]:
        """Return the names in an operand, and of what its data were made from."""
        own = frozenset() if operand is None else self.names_of(operand)
        return own.union(*(held.names for held in self._list_held(operand, here)))

    def _list_held(
        self, operand: ir.Operand | None, here: Scope
    ) -> list[AssignedPoint]:
        """List what assignments gave to the data in an operand."""
        wholes = map(_without_components, ir.data_in(operand))
        return [held for one in wholes if (held := self.find_held(one, here))]

    def calls_routine(self, operand: ir.Operand) -> bool:
        """Return True if an operand calls a function of the task."""
        return not self.names_of(operand).isdisjoint(self.routines)

    def find_held(
        self, operand: ir.Operand | None, here: Scope
    ) -> AssignedPoint | None:
        """Return what assignments gave to the point that an operand names."""
        if not (here.points.routines and isinstance(operand, ir.DataObject)):
            return None
        part = self.locate(operand, here)
        if part is None or part.index is None or part.component:
            return None
        return here.points.held.get((part.place, part.index))

    def assign(self, points: Points, one: ir.Assignment, here: Scope) -> Points:
        """Return what points hold behind an assignment.

        Args:
            points: What they hold before it.
            one: The assignment.
            here: Where it stands.
        """
        part = self.locate(one.target, here)
        if part is None:
            return points
        if part.index is None:
            return points.forget(part.place)
        there = replace(here, points=points)
        along = bool(find_added(one.target, one.value))
        return points.give(self._give_value(part, part.index, one.value, there, along))

    def _give_value(
        self, part: PointPart, index: tuple[int, ...], value: ir.Operand, here: Scope,
        along: bool = False,
    ) -> AssignedPoint:  # fmt: skip
        """Return what a point holds that is given a value, or a component of it.

        Args:
            part: What is given the value.
            index: Of the element.
            value: The value.
            here: The assignment.
            along: It adds something to the component.
        """
        place, own = part.place, frozenset([part.place[-1]])
        known = None if part.component else self.find_held(value, here)
        if known is not None:
            return known.copy_to(place, index, own)
        inside = self._list_held(value, here)
        plain, names = replace(here, points=NO_POINTS), self.names_of(value)
        found, given = self.value(value, here), [one[0] for one in here.given]
        steady = not (inside or self.calls_routine(value)) and names.isdisjoint(given)
        steady = steady or not here.points.routines or found == self.value(value, plain)
        names = names.union(own, *(point.names for point in inside))
        if part.component:
            point = here.points.held.get((place, index)) or AssignedPoint(place, index)
        elif steady:
            point = self._give_whole(part, index, value, found, plain)
            return point.copy_to(place, index, names)
        else:
            source = source_of(value)
            known, base = self.find_held(source, here), self.value(source, plain)
            point = known or self._give_whole(part, index, source, base, plain)
            point = point.copy_to(place, index, own)
        parts = self.list_components(part, found)
        numbers = [Component(*one, here.file, here.row, along) for one in parts]
        return point.with_components(numbers, names)

    def _give_whole(
        self, part: PointPart, index: tuple[int, ...], value: ir.Operand | None,
        base: Value | None, here: Scope,
    ) -> AssignedPoint:  # fmt: skip
        """Return what a point holds that is given what no assignment changes.

        Args:
            part: The point.
            index: .. of an array.
            value: What it is given.
            base: .. and what that is.
            here: The assignment.
        """
        goal, type_ = None, self.type_of(part.place)
        if isinstance(base, WrittenNumber) and not self.fits(type_, "", base.value):
            base = None
        if value is not None and self.reader and type_ in self.targets:
            goal = self.reader(self, here).goal(value)
        return AssignedPoint(part.place, index, base, goal)

    def find_returned(
        self, call: ir.FunctionCall, here: Scope
    ) -> tuple[ir.Operand, Scope] | None:
        """Return what a function returns, and where that stands.

        None for functions that do more than to set points of their own, or call others.

        Args:
            call: The call.
            here: Where it stands.
        """
        found = self.routine(call.name, here)
        if found is None or found.rows.head.kind != self.functions:
            return None
        scope = self.bind(found, call, here)
        if scope is None:
            return None
        points = self.hand_over(here.points, found, call, here)
        own = self.unit(scope.file), scope.module, scope.routine
        for at in found.inside:
            one = self.files[found.file].text.statement(at)
            if isinstance(one, ir.Declaration):
                continue
            scope = replace(scope, points=points, row=at)
            if not isinstance(one, ir.Assignment | ir.Leave) or one.value is None:
                return None
            if self.calls_routine(one.value):
                return None
            if isinstance(one, ir.Leave):
                return (one.value, scope) if one.word == "return" else None
            part = self.locate(one.target, scope)
            if part is None or part.place[:3] != own:
                return None
            points = self.assign(points, one, scope)
        return None


def _without_components(data: ir.DataObject) -> ir.DataObject:
    """Return the data, or the element, that a component belongs to."""
    steps = data.steps
    count = next((k for k, s in enumerate(steps) if isinstance(s, str)), len(steps))
    return replace(data, steps=steps[:count]) if steps[count:] else data


def element_of(operand: ir.Operand | None, index: Sequence[int]) -> ir.Operand | None:
    """Return an element of an array that is written, None where it has no such."""
    for at in index:
        items = operand.items if isinstance(operand, ir.Composite) else ()
        operand = items[at - 1] if 0 < at <= len(items) else None
    return operand


LARGEST = 1 << 31  # whole number that counts or names anything


def whole(value: float) -> int | None:
    """Return a whole number, None where it is none.

    >>> whole(3.0), whole(2.5), whole(float("inf"))
    (3, None, None)
    """
    return int(value) if abs(value) < LARGEST and value == int(value) else None


def _names_data(one: ir.SourceStatement) -> bool:
    """Return True unless a statement declares data whose values name none."""
    values = ir.walk(one) if isinstance(one, ir.Declaration) else [ir.DataObject("")]
    return any(isinstance(part, ir.DataObject | ir.FunctionCall) for part in values)


def _find_copied(one: ir.SourceStatement) -> FreeName | None:
    """Return what is copied whole, to data whose name is not open; None for others."""
    match one:
        case ir.Assignment(
            target=ir.DataObject(name=target, steps=()),
            value=ir.DataObject(name=name, steps=()),
        ) if name_index(target) < 0 <= name_index(name):
            return FreeName(name_index(name), target=target)
    return None


def _note_free(
    uses: NamesUsed, shapes: Shapes, own: Ints, free: Sequence[FreeName]
) -> None:
    """Note what shapes of one form name where that is noted for all at once.

    Args:
        uses: What notes it.
        shapes: The shapes of a file.
        own: Those of the form, (m,).
        free: Where.
    """
    for one in (name for name in free if name.is_noted):
        used = np.unique(shapes.names_at(own)[:, one.at]).astype(np.int64)
        one.note(uses, shapes.names.take(used).lower())


def _is_loop(one: ir.SourceStatement) -> bool:
    return isinstance(one, ir.ForLoop)


def holds_odd(one: ir.SourceStatement) -> bool:
    """Return True if a statement, or what a condition leads to, is not understood."""
    if isinstance(one, ir.NotUnderstood):
        return True
    inside = (part for part in one.children() if isinstance(part, ir.SourceStatement))
    return any(map(holds_odd, inside))


def _make_number(value: float, slot: int = -1) -> WrittenNumber | None:
    """Return a number, None for one that is too large for any, or none."""
    return WrittenNumber(value, slot) if math.isfinite(value) else None
