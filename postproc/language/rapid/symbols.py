"""All modules of a task: what its names mean, and which data never change."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from postproc.language import ir
from postproc.language.analysis.assigned_points import (
    AssignedPoint,
    FunctionBody,
    NamesUsed,
    Place,
    PointPart,
    Scope,
    TaskSymbols,
    is_point,
    source_of,
)
from postproc.language.analysis.control_flow import HeadedRows
from postproc.language.analysis.functions import ALIKE, apply_function
from postproc.language.ir import is_odd
from postproc.language.rapid import syntax as said
from postproc.language.rapid.files import RapidFileName
from postproc.language.rapid.instructions import (
    ANSWERS,
    BUILT_IN_FUNCTIONS,
    BY_STRING,
    MOTIONS,
    READING,
)
from postproc.language.rapid.pose_encoding import COMMENTS, shift_point
from postproc.language.rapid.program import Datum, RapidFile
from postproc.language.rapid.targets import (
    RECORDS,
    Layout,
    operands_of,
    spell_components,
)

TARGETS = ("robtarget", "jointtarget")
FOLLOWED = (*RECORDS, "num")  # types of data whose assignments are followed
SHIFTS = ("offs", "reltool")  # functions whose first argument is a target
CONSTANTS = {"true": 1.0, "false": 0.0, "pi": 3.141592653589793}


@dataclass(frozen=True)
class WrittenNumber:
    """A number of a record: its value, and where it is written.

    Attributes:
        value: Its value.
        file, slot: Where it stands; slot -1 where it is computed.
    """

    value: float
    file: int = -1
    slot: int = -1


Nested = WrittenNumber | str | tuple["Nested", ...]


@dataclass
class RapidTask(TaskSymbols):
    """The modules of a task.

    Attributes:
        files: Its files, the one with the main routine first.
        taught: Lower-case names of data that were taught with the arm, by the cell.
        others: Tasks that run at the same time.
    """

    files: Sequence[RapidFile]
    taught: Collection[str] = frozenset()
    others: Sequence[RapidTask] = ()
    _moved: dict[tuple[int, int], bool] = field(default_factory=dict)
    _local: dict[tuple[int, str, str], dict[str, Datum]] = field(default_factory=dict)
    _twice: set[tuple[int, str, str, str]] = field(default_factory=set)
    _global: dict[str, list[tuple[int, Datum]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Index data by the scopes that declare them."""
        for number, file in enumerate(self.files):
            for datum in file.data:
                place = number, datum.module, datum.routine
                own = self._local.setdefault(place, {})
                if datum.declared.name in own:
                    self._twice.add((*place, datum.declared.name))
                own[datum.declared.name] = datum
                if not datum.routine and datum.declared.scope != "local":
                    known = self._global.setdefault(datum.declared.name, [])
                    known.append((number, datum))

    @cached_property
    def routines(self) -> Mapping[str, list[tuple[int, str, HeadedRows]]]:
        """Routines by name: file, module and place of each."""
        found: dict[str, list[tuple[int, str, HeadedRows]]] = defaultdict(list)
        for number, file in enumerate(self.files):
            for scope in file.routines:
                around = (m for m in file.modules if m.first < scope.first < m.last)
                module = next((m.head.name for m in around), "")
                found[scope.head.name].append((number, module, scope))
        return found

    @cached_property
    def taught_lines(self) -> list[frozenset[int]]:
        """Lines of every file that a comment marks as taught."""
        return [COMMENTS.list_taught(file.text.source) for file in self.files]

    def is_taught(self, name: str, found: Nested | None) -> bool:
        """Tell whether data were taught, by the cell or a comment on their line.

        Args:
            name: Of the data, with an index where it has one; "" for numbers in a move.
            found: What they hold.
        """
        if name.split("{")[0].strip().lower() in self.taught:
            return True
        one = found
        while isinstance(one, tuple) and one:
            one = next((part for part in one if isinstance(part, tuple)), one[0])
        if not isinstance(one, WrittenNumber) or one.slot < 0:
            return False
        text, lines = self.files[one.file].text, self.taught_lines[one.file]
        return not lines.isdisjoint(text.lines(text.row_of(one.slot)))

    def routine(self, name: str, here: Scope) -> tuple[int, str, HeadedRows] | None:
        """Find the routine that a name means, None where it is not sure."""
        known = self.routines.get(name, [])
        own = [one for one in known if one[:2] == (here.file, here.module)]
        if own:
            return own[0] if len(own) == 1 else None
        shared = [one for one in known if not getattr(one[2].head, "local", False)]
        return shared[0] if len(shared) == 1 else None

    def datum(self, name: str, here: Scope) -> tuple[int, Datum] | None:
        """Find the data that a name means, None where nothing sure is known."""
        if name in here.parameters:
            return None
        for routine in (here.routine, ""):
            place = here.file, here.module, routine
            found = self._local.get(place, {}).get(name)
            if found is not None:
                return None if (*place, name) in self._twice else (here.file, found)
        shared = self._global.get(name, [])
        return shared[0] if len(shared) == 1 else None

    def constant(self, name: str, here: Scope) -> tuple[int, Datum] | None:
        """Find data that hold what they were declared with for as long as it runs."""
        found = self.datum(name, here)
        if found is None or found[1].declared.value is None:
            return None
        if name in self.loop_variables:  # it may hide the data
            return None
        changed = name in self.written or bool(BY_STRING & self.find_calls)
        changed = changed and found[1].declared.kind != "const"
        return None if changed or self.is_changed_beside(*found) else found

    # What other tasks do: global persistents of one name are the same data.

    def is_changed_beside(self, file: int, datum: Datum) -> bool:
        """Return True if another task may change data, or begin with other values."""
        key = file, datum.row
        if key not in self._moved:
            self._moved[key] = _is_shared(datum)  # while it is worked out
            own = self._first_value(file, datum)
            self._moved[key] = _is_shared(datum) and any(
                other.may_set(datum.declared.name, own) for other in self.others
            )
        return self._moved[key]

    def is_used_beside(self, name: str, here: Scope) -> bool:
        """Return True if another task has the data that a name means, too."""
        found = self.datum(name, here)
        if found is None or not _is_shared(found[1]):
            return False
        return any(name in other.persistents | other.strange for other in self.others)

    def may_set(self, name: str, value: Nested | None) -> bool:
        """Return True if a persistent may come to hold another value by this task."""
        if name in self.changes:
            return True
        shared = (one for one in self._global.get(name, ()) if _is_shared(one[1]))
        found = (self._first_value(*one) for one in shared)
        return any(one is None or one != value for one in found)

    @cached_property
    def persistents(self) -> frozenset[str]:
        """Names of data that tasks share with others that declare them too."""
        data = (one for found in self._global.values() for _, one in found)
        return frozenset(one.declared.name for one in data if _is_shared(one))

    @cached_property
    def strange(self) -> frozenset[str]:
        """Names that it takes or changes and does not declare: shared modules do."""
        return (self.written | self.read | self._odd_words) - self.declared

    @cached_property
    def changes(self) -> frozenset[str]:
        """Names of data of several tasks that this one may change."""
        by_name = self.persistents if BY_STRING & self.find_calls else frozenset()
        written = self.written | self._odd_words
        return by_name | (written & (self.persistents | self.strange))

    @cached_property
    def _odd_words(self) -> frozenset[str]:
        """Words of what is not understood: each may name what is set there."""
        return self._words_but(())

    def _words_but(self, beginnings: Collection[str]) -> frozenset[str]:
        """Return words of what is not understood, and does not begin with some."""
        texts = (file.text for file in self.files)
        found = (one.words(one.where(_is_odd), beginnings) for one in texts)
        return frozenset().union(*found)

    def _first_value(self, file: int, datum: Datum) -> Nested | None:
        """Return what data hold at first, without where it is written."""
        there = Scope(file, datum.module, datum.routine)
        return _bare(self.record(datum.declared.value, datum.row, there))

    @cached_property
    def find_calls(self) -> frozenset[str]:
        """Names of all instructions."""
        found = (inside(one) for file in self.files for one in file.text.said.said)
        return frozenset(o.name for o in found if isinstance(o, ir.Instruction))

    @cached_property
    def loop_variables(self) -> frozenset[str]:
        """Names of all variables of loops."""
        found = (one for file in self.files for one in file.text.said.said)
        return frozenset(o.name for o in found if isinstance(o, ir.ForLoop))

    @cached_property
    def written(self) -> frozenset[str]:
        """Names of data that something may change."""
        return frozenset(self.uses.written | self.uses.changed)

    @cached_property
    def read(self) -> frozenset[str]:
        """Names of data that something but the destination of a move takes."""
        return frozenset(self.uses.read)

    def locate(self, data: ir.DataObject, row: int, here: Scope) -> PointPart | None:
        """Find the point that only assignments change, see `TaskSymbols.locate`."""
        name, steps = data.name, data.steps
        found = self.datum(name, here)
        if found is None or found[1].declared.type not in FOLLOWED:
            return None
        if name in self.uses.changed or BY_STRING & self.find_calls:
            return None
        file, datum = found
        if datum.declared.kind == "const" or self.is_used_beside(name, here):
            return None
        index: tuple[int, ...] | None = ()
        if datum.declared.dimensions:
            index = self._find_element(file, datum, steps[:1], row, here)
            steps = steps[1:]
        component = ".".join(step for step in steps if isinstance(step, str))
        if not spell_components(datum.declared.type, component):
            index = None
        place = file, datum.module, datum.routine, name
        return PointPart(place, index, component)

    def _find_element(
        self, file: int, datum: Datum, steps: Sequence[str | ir.ElementStep],
        row: int, here: Scope,
    ) -> tuple[int, ...] | None:  # fmt: skip
        """Return the index of an element, None where it is not known, or no element."""
        there = Scope(file, datum.module, datum.routine)
        sizes = [
            self.number(one, datum.row, there) for one in datum.declared.dimensions
        ]
        found = [at for step in steps for at in self._indices(step, row, here)]
        if len(found) != len(sizes):
            return None
        inside = all(0 <= at < n for at, n in zip(found, sizes, strict=True))
        return tuple(at + 1 for at in found) if inside else None

    def evaluate_components(
        self, part: PointPart, value: ir.Operand, row: int, here: Scope
    ) -> list[tuple[str, float | None]]:
        """Return what an assignment gives to components, see `TaskSymbols`."""
        file, module, routine, name = part.place
        declared = self._local[file, module, routine][name].declared
        names = spell_components(declared.type, part.component)
        found = [*_leaves(self.record(value, row, here))]
        if len(found) != len(names):
            return [(one, None) for one in names]
        return [
            (one, at.value if isinstance(at, WrittenNumber) else None)
            for one, at in zip(names, found, strict=True)
        ]

    def open_function(
        self, call: ir.FunctionCall, row: int, here: Scope
    ) -> FunctionBody | None:
        """Return the statements of a function, see `TaskSymbols.open_function`."""
        found = self.routine(call.name, here)
        if found is None or getattr(found[2].head, "kind", "") != "func":
            return None
        file, module, routine = found
        scope = self.bind(
            self.scope_of(file, module, routine), routine, call, row, here
        )
        text = self.files[file].text
        rows = range(routine.first + 1, routine.last)
        every = ((k, text.statement(k)) for k in rows)
        body = [(k, o) for k, o in every if not isinstance(o, said.DataDeclaration)]
        return FunctionBody(scope, body)

    @cached_property
    def declared(self) -> frozenset[str]:
        """Names of all data."""
        return frozenset(d.declared.name for file in self.files for d in file.data)

    @cached_property
    def twins(self) -> frozenset[str]:
        """Names of points beside which the controller keeps their originals."""
        pairs = {name for name in self.declared if f"o_{name}" in self.declared}
        return frozenset(pairs | {f"o_{name}" for name in pairs})

    @cached_property
    def uses(self) -> _NamesUsed:
        """The names that statements change and take."""
        uses = _NamesUsed(own=self.routines)
        for file in self.files:
            for statement in file.text.said:
                uses.note(statement)
        uses.changed |= self._words_but(_READING_MOVES)  # a move sets nothing
        uses.read |= self._odd_words
        alone = self._alone
        uses.read |= {one for target, one in uses.copies if target not in alone}
        uses.pass_on()
        return uses

    @property
    def _alone(self) -> frozenset[str]:
        """Names of data that hold what they are given for this run alone.

        Parameters may stand for any data.
        """
        data = (one.declared for file in self.files for one in file.data)
        kept = {one.name for one in data if one.kind == "pers"}
        heads = (parameters_of(r) for own in self.routines.values() for *_, r in own)
        kept.update(one.name for parameters in heads for one in parameters)
        return self.declared - kept

    def scope_of(self, number: int, module: str, routine: HeadedRows) -> Scope:
        """Return where the statements of a routine stand."""
        given = frozenset(one.name for one in parameters_of(routine))
        return Scope(number, module, routine.head.name, given)

    # What routines are called with.

    def bind(
        self, scope: Scope, routine: HeadedRows,
        call: ir.Instruction | ir.FunctionCall, row: int, there: Scope,
    ) -> Scope:  # fmt: skip
        """Add what a routine is called with to where its statements stand.

        A parameter that something may change has no value that is known.

        Args:
            scope: Where the statements of the routine stand.
            routine: The routine.
            call: The call.
            row: Its row.
            there: Where it stands.
        """
        if BY_STRING & self.find_calls:
            return scope
        pairs = match_arguments(parameters_of(routine), call.arguments) or ()
        given = tuple(
            (parameter.name, argument.value, row, there)
            for parameter, argument in pairs
            if argument.value is not None and parameter.name not in self.written
        )
        return replace(scope, given=given)

    def behind(
        self, operand: ir.Operand | None, row: int, here: Scope
    ) -> tuple[ir.Operand | None, int, Scope]:
        """Return what stands behind a parameter or a call of a function, and its place.

        That is the operand itself where it is neither, or not known.
        """
        for _ in range(DEEPEST):
            for _, given, at, there in self.find_given(operand, here):
                operand, row, here = given, at, there
            if not isinstance(operand, ir.FunctionCall):
                break
            returned = self.find_returned(operand, row, here)
            if returned is None:
                break
            operand, row, here = returned
        return operand, row, here

    def find_given(
        self, operand: ir.Operand | None, here: Scope
    ) -> Iterator[tuple[str, ir.Operand, int, Scope]]:
        """Yield the parameters that an operand stands for, as in `Scope.given`."""
        while isinstance(operand, ir.DataObject) and not operand.steps:
            if operand.name in dict(here.loops):
                return
            found = (one for one in here.given if one[0] == operand.name)
            given = next(found, None)
            if given is None:
                return
            yield given
            _, operand, _, here = given

    # Values.

    def number(self, operand: ir.Operand | None, row: int, here: Scope) -> float:
        """Evaluate a number, NaN where it is not known before the program runs."""
        match operand:
            case ir.Num(slot=slot):
                text = self.files[here.file].text
                return _finite(float(text.value[int(text.first[row]) + slot]))
            case ir.Operation(operator=operator, operands=operands):
                parts = [self.number(one, row, here) for one in operands]
                return _finite(_compute(operator, parts))
            case ir.DataObject(name=name, steps=()):
                loops = dict(here.loops)
                if name in loops:
                    return loops[name]
                other, at, there = self.behind(operand, row, here)
                if other is not operand:
                    return self.number(other, at, there)
                held = self.find_held(operand, row, here)
                if held is not None:
                    return _number_in(self.evaluate_held(held))
                found = self.constant(name, here)
                if found is None:
                    return CONSTANTS.get(name, float("nan"))
                return self._number_of_declaration(*found)
            case ir.DataObject():
                return _number_in(self._data_object(operand, row, here, 0))
            case ir.FunctionCall(name=name, arguments=arguments):
                other, at, there = self.behind(operand, row, here)
                if other is not operand:
                    return self.number(other, at, there)
                return self._compute(name, arguments, row, here)
            case _:
                return float("nan")

    def _compute(
        self, name: str, arguments: Sequence[ir.Argument], row: int, here: Scope
    ) -> float:
        """Return what a built-in function of one number gives, else NaN."""
        if name in self.routines or name not in ALIKE or len(arguments) != 1:
            return math.nan
        return apply_function(name, self.number(arguments[0].value, row, here))

    def _number_of_declaration(self, file: int, datum: Datum) -> float:
        if datum.declared.dimensions:
            return float("nan")
        there = Scope(file, datum.module, datum.routine)
        value = datum.declared.value
        if isinstance(value, ir.DataObject) and value.name == datum.declared.name:
            return float("nan")
        return self.number(value, datum.row, there)

    def record(
        self, operand: ir.Operand | None, row: int, here: Scope, depth: int = 0
    ) -> Nested | None:
        """Evaluate a record or array, None where it is not known."""
        if isinstance(operand, ir.DataObject | ir.FunctionCall):
            operand, row, here = self.behind(operand, row, here)
        match operand:
            case ir.Composite(items=items):
                parts = [self.record(one, row, here, depth) for one in items]
                known = tuple(part for part in parts if part is not None)
                return known if len(known) == len(parts) else None
            case ir.StringLiteral(text=text):
                return text
            case ir.Num(slot=slot):
                file = self.files[here.file].text
                at = int(file.first[row]) + slot
                value = _finite(float(file.value[at]))
                return WrittenNumber(value, here.file, at) if value == value else None
            case ir.DataObject(name=name) if name not in CONSTANTS:
                return self._data_object(operand, row, here, depth)
            case ir.FunctionCall(name=name, arguments=arguments) if (
                name in SHIFTS and name not in self.routines
            ):
                return self._evaluate_shift(name, arguments, row, here, depth)
            case _:
                value = self.number(operand, row, here)
                return None if value != value else WrittenNumber(value)

    def _data_object(
        self, data: ir.DataObject, row: int, here: Scope, depth: int
    ) -> Nested | None:
        """Evaluate data, or a part of them."""
        loops, name = dict(here.loops), data.name
        if name in loops and not data.steps:
            return WrittenNumber(loops[name])
        if depth > DEEPEST:
            return None
        value, steps, type_ = self._whole(data, row, here, depth + 1)
        layout = RECORDS.get(type_, {})
        for step in steps:
            if isinstance(step, str):
                indices = [[*layout].index(step)] if step in layout else []
                layout = layout.get(step, {})
            else:
                indices = self._indices(step, row, here)
            for index in indices or [-1]:
                if not isinstance(value, tuple) or not 0 <= index < len(value):
                    return None
                value = value[index]
        return value

    def _whole(
        self, data: ir.DataObject, row: int, here: Scope, depth: int
    ) -> tuple[Nested | None, Sequence[str | ir.ElementStep], str]:
        """Return what data, or an element, hold; then further steps, and their type."""
        count = next((k for k, s in enumerate(data.steps) if isinstance(s, str)), None)
        whole = data if count is None else replace(data, steps=data.steps[:count])
        held = self.find_held(whole, row, here)
        if held is not None:
            return self.evaluate_held(held, depth), data.steps[len(whole.steps) :], (
                self._type_of(held.place))  # fmt: skip
        found = self.constant(data.name, here)
        if found is None:
            return None, (), ""
        file, datum = found
        there = Scope(file, datum.module, datum.routine)
        value = self.record(datum.declared.value, datum.row, there, depth)
        return value, data.steps, datum.declared.type

    def _type_of(self, place: Place) -> str:
        """Return the type of data by their place."""
        return self._local[place[:3]][place[3]].declared.type

    def evaluate_held(self, held: AssignedPoint, depth: int = 0) -> Nested | None:
        """Evaluate what assignments gave to a point, None where it is not known."""
        base = None
        if held.operand is not None:
            base = self.record(held.operand, held.row, held.scope, depth)
        if not held.components:
            return base
        names = spell_components(type_ := self._type_of(held.place), "")
        own = [*_leaves(base)]
        found = dict(zip(names, own, strict=True)) if len(own) == len(names) else {}
        for one in held.components:
            found.pop(one.name, None)
            if one.value is not None:
                found[one.name] = WrittenNumber(one.value)
        if len(found) < len(names):
            return None
        return _build(found, RECORDS.get(type_, {}))

    def read_shift(
        self, arguments: Sequence[ir.Argument], row: int, here: Scope
    ) -> tuple[list[float], list[float]] | None:
        """Return how far Offs or RelTool shift [mm], and turn about x, y, z [deg].

        None where the arguments are others; NaN where numbers are not known.
        """
        placed = [one.value for one in arguments if not one.name]
        turns = {one.name: one.value for one in arguments if one.name}
        if len(placed) != 4:
            return None
        angles = [
            self.number(turns[axis], row, here) if axis in turns else 0.0
            for axis in ("rx", "ry", "rz")
        ]
        return [self.number(one, row, here) for one in placed[1:]], angles

    def _evaluate_shift(
        self, name: str, arguments: Sequence[ir.Argument], row: int, here: Scope,
        depth: int,
    ) -> Nested | None:  # fmt: skip
        """Evaluate Offs or RelTool."""
        by = self.read_shift(arguments, row, here)
        if by is None or depth > DEEPEST or any(map(math.isnan, [*by[0], *by[1]])):
            return None
        base = self.record(arguments[0].value, row, here, depth + 1)
        own = [one.value for one in _leaves(base) if isinstance(one, WrittenNumber)]
        if not isinstance(base, tuple) or len(base) != 4 or len(own) != 17:
            return None
        new = shift_point(np.array(own[:11]), name, *by)
        place, turn = (tuple(map(WrittenNumber, new[k])) for k in _PLACE_AND_TURN)
        return (place, turn, *base[2:])

    def _indices(self, step: str | ir.ElementStep, row: int, here: Scope) -> list[int]:
        """Return the indices from 0 of an element, nothing where they are not known."""
        if isinstance(step, str):
            return []
        values = [self.number(one, row, here) for one in step.subscripts]
        whole = [v for v in values if v == v and v == int(v)]
        return [int(v) - 1 for v in whole] if len(whole) == len(values) else []


_PLACE_AND_TURN = slice(3), slice(3, 7)
DEEPEST = 20  # names that stand for names


def other_tasks(files: Sequence[RapidFile]) -> list[RapidTask]:
    """Group the files of tasks that run beside a program, by the names of files."""
    tasks: dict[str, list[RapidFile]] = {}
    for file in files:
        task = RapidFileName(file.text.source.name).task_beside
        tasks.setdefault(task, []).append(file)
    return [RapidTask(own) for own in tasks.values()]


_READING_MOVES = frozenset(name for name, one in MOTIONS.items() if one.given < 0)


def _is_odd(one: ir.SourceStatement) -> bool:
    """Return True if a statement, or what a condition leads to, is odd."""
    return is_odd(inside(one))


def _is_shared(datum: Datum) -> bool:
    """Return True if data are those of every task that declares them likewise."""
    declared = datum.declared
    return declared.kind == "pers" and not (declared.scope or datum.routine)


def _bare(found: Nested | None) -> Nested | None:
    """Return values without where they are written."""
    if isinstance(found, tuple):
        parts = [_bare(one) for one in found]
        return tuple(one for one in parts if one is not None)
    return WrittenNumber(found.value) if isinstance(found, WrittenNumber) else found


def parameters_of(routine: HeadedRows) -> tuple[said.RoutineParameter, ...]:
    """Return the parameters of a routine."""
    head = routine.head
    return head.parameters if isinstance(head, said.RoutineHead) else ()


def match_arguments(
    parameters: Sequence[said.RoutineParameter], arguments: Sequence[ir.Argument]
) -> list[tuple[said.RoutineParameter, ir.Argument]] | None:
    """Pair parameters with arguments; None where the call does not fit."""
    placed = [one for one in arguments if not one.name]
    required = [one for one in parameters if not one.optional]
    optional = {one.name: one for one in parameters if one.optional}
    named = [one for one in arguments if one.name]
    if len(placed) != len(required) or any(a.name not in optional for a in named):
        return None
    pairs = [(optional[a.name], a) for a in named if not a.passed_on]
    return [*zip(required, placed, strict=True), *pairs]


def _finite(value: float) -> float:
    """Return a number, NaN for one that is too large for any."""
    return value if math.isfinite(value) else math.nan


def _compute(operator: str, parts: Sequence[float]) -> float:
    """Compute what an operator gives, NaN where that is no number."""
    match operator, parts:
        case "-", [a]:
            return -a
        case "+", [a]:
            return a
        case "+", [a, b]:
            return a + b
        case "-", [a, b]:
            return a - b
        case "*", [a, b]:
            return a * b
        case "/", [a, b] if b:
            return a / b
    return float("nan")


# What statements take and change.


@dataclass
class _NamesUsed(NamesUsed):
    """Names that statements may change, and those that they take.

    Attributes:
        own: Routines of the task by name: what else has their names is hidden.
        passed: Data and the parameter that they are given to, and whether the routine
            may change them through it.
        parts: Names of which moves go to elements or components.
    """

    own: Mapping[str, Sequence[tuple[int, str, HeadedRows]]] = field(kw_only=True)
    passed: set[tuple[str, str, bool]] = field(default_factory=set)
    parts: set[str] = field(default_factory=set)

    def pass_on(self) -> None:
        """Note of data what is noted of the parameters that they are given to.

        Which of the points in them a move takes is not followed.
        """
        self.read |= self.parts & {parameter for _, parameter, _ in self.passed}
        before = -1
        while before != len(self.changed) + len(self.read):
            before = len(self.changed) + len(self.read)
            for name, parameter, by_reference in self.passed:
                written = parameter in self.written | self.changed
                if written or parameter in self.read:
                    self.read.add(name)
                if written and by_reference:
                    self.changed.add(name)
            super().pass_on()

    def note(self, one: ir.SourceStatement) -> None:
        """Note the names that a statement may change, and those that it takes."""
        match one:
            case said.DataDeclaration(value=value, dimensions=dimensions):
                for operand in (value, *dimensions):
                    self._operand(operand)
            case ir.Assignment(target=target, value=value):
                self.written.add(target.name)
                self._note_assignment(target, value)
            case ir.Branch(values=values):
                for operand in values:
                    self._operand(operand)
            case said.CompactIf(condition=condition, statement=inside):
                self._operand(condition)
                self.note(inside)
            case ir.ForLoop(name=name, first=first, last=last, step=step):
                self.changed.add(name)
                for operand in (first, last, step):
                    self._operand(operand)
            case ir.Leave(value=value):
                self._operand(value)
            case said.ConnectTrap(interrupt=interrupt):
                self.changed.add(interrupt.name)
            case ir.Instruction(name=name, arguments=arguments):
                self._call(name, arguments)
            case said.LateCall(arguments=arguments):
                self._arguments(arguments)

    def _note_assignment(self, target: ir.DataObject, value: ir.Operand) -> None:
        """Note what an assignment takes: a point that moves go to by another name."""
        source = source_of(value)
        self._steps(target.steps)
        if source is None or not (is_point(target) and is_point(source)):
            self._operand(value)
            return
        self._steps(source.steps)
        if value is source:
            self.copies.add((target.name, source.name))
        elif isinstance(value, ir.FunctionCall) and self._shifts(value):
            self.copies.add((target.name, source.name))
            self._destination(value)
        else:
            self._operand(value)

    def _shifts(self, value: ir.Operand | None) -> bool:
        """Return True if a value is a point, or one that functions only shift."""
        while isinstance(value, ir.FunctionCall):
            if value.name not in SHIFTS or value.name in self.own:
                return False
            value = value.arguments[0].value if value.arguments else None
        return isinstance(value, ir.DataObject)

    def _call(self, name: str, arguments: Sequence[ir.Argument]) -> None:
        pairs = self._fitting(name, arguments)
        if pairs is not None:
            for parameter, argument in pairs:
                self._give(parameter, argument.value)
            return
        signature = None if name in self.own else MOTIONS.get(name)
        if signature is not None:
            ends, given = (
                signature.operands(arguments),
                signature.find_written(arguments),
            )
            for argument in arguments:
                if any(argument.value is end for end in ends):
                    self._destination(argument.value)
                elif argument.value is given:
                    self._arguments([argument])
                else:
                    self._operand(argument.value)
        elif name in READING and name not in self.own:
            for argument in arguments:
                self._read(argument)
        else:
            self._arguments(arguments)

    def _read(self, argument: ir.Argument) -> None:
        """Note an argument that is only read, unless it is an option that answers."""
        if argument.name in ANSWERS:
            self._arguments([argument])
        else:
            self._operand(argument.value)

    def _fitting(
        self, name: str, arguments: Sequence[ir.Argument]
    ) -> list[tuple[said.RoutineParameter, ir.Argument]] | None:
        """Pair the arguments of a call of the only routine of a name, else None.

        A local one need not be what is called.
        """
        found = self.own.get(name, ())
        if len(found) != 1 or any(one.passed_on for one in arguments):
            return None
        if getattr(found[0][2].head, "local", False):
            return None
        return match_arguments(parameters_of(found[0][2]), arguments)

    def _give(
        self, parameter: said.RoutineParameter, operand: ir.Operand | None
    ) -> None:
        """Note what a routine of the task is called with."""
        if isinstance(operand, ir.DataObject):
            by_reference = parameter.by_reference
            self.passed.add((operand.name, parameter.name, by_reference))
            self._steps(operand.steps)
        else:
            self._operand(operand)

    def _destination(self, operand: ir.Operand | None) -> None:
        """Note what the destination of a move takes besides the point itself."""
        match operand:
            case ir.DataObject(name=name, steps=steps):
                self.parts |= {name} if steps else set()
                self._steps(steps)
            case ir.FunctionCall(name=name, arguments=arguments) if (
                name in SHIFTS and name not in self.own
            ):
                if arguments:  # the point that is shifted
                    self._destination(arguments[0].value)
                for argument in arguments[1:]:
                    self._operand(argument.value)
            case _:
                self._operand(operand)

    def _steps(self, steps: Sequence[str | ir.ElementStep]) -> None:
        for step in steps:
            if isinstance(step, ir.ElementStep):
                for subscript in step.subscripts:
                    self._operand(subscript)

    def _arguments(self, arguments: Sequence[ir.Argument]) -> None:
        """Note arguments that a routine may change."""
        for argument in arguments:
            if isinstance(argument.value, ir.DataObject):
                self.changed.add(argument.value.name)
            self._operand(argument.value)

    def _operand(self, operand: ir.Operand | None) -> None:
        match operand:
            case ir.DataObject(name=name, steps=steps):
                self.read.add(name)
                self._steps(steps)
            case ir.Composite(items=items) | ir.Operation(operands=items):
                for item in items:
                    self._operand(item)
            case ir.FunctionCall(name=name, arguments=arguments):
                if name in BUILT_IN_FUNCTIONS and name not in self.own:
                    for argument in arguments:
                        self._read(argument)
                else:
                    self._arguments(arguments)


def inside(one: ir.SourceStatement) -> ir.SourceStatement:
    """Return the statement behind a condition, the statement itself without one."""
    while isinstance(one, said.CompactIf):
        one = one.statement
    return one


def functions_in(one: ir.SourceStatement) -> Iterator[str]:
    """Yield the names of the functions that a statement calls."""
    match one:
        case ir.Branch(values=values):
            operands: Sequence[ir.Operand | None] = values
        case said.CompactIf(condition=condition, statement=inside):
            operands = (condition, *operands_of(inside))
        case ir.ForLoop(first=first, last=last, step=step):
            operands = (first, last, step)
        case ir.Leave(value=value):
            operands = (value,)
        case ir.Assignment(target=target, value=value):
            operands = (target, value)
        case _:
            operands = operands_of(one)
    for part in ir.walk(*operands):
        if isinstance(part, ir.FunctionCall):
            yield part.name


def _number_in(found: Nested | None) -> float:
    """Return a number, NaN where there is none."""
    return found.value if isinstance(found, WrittenNumber) else math.nan


def _leaves(found: Nested | None) -> Iterator[WrittenNumber | str]:
    """Yield the values of a record in their order."""
    if isinstance(found, tuple):
        for one in found:
            yield from _leaves(one)
    elif found is not None:
        yield found


def _build(
    found: Mapping[str, WrittenNumber | str], layout: Layout, prefix: str = ""
) -> Nested:
    """Put the values of a record together; those of other data are their only one."""
    if not layout:
        return found[prefix.rstrip(".")]
    return tuple(
        _build(found, inside, f"{prefix}{name}.") for name, inside in layout.items()
    )
