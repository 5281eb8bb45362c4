"""All modules of a task: what its names mean, and which data never change."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Collection, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain

from postproc.language import ir
from postproc.language.analysis.assigned_points import Scope
from postproc.language.analysis.conditions import TaskFrame
from postproc.language.analysis.declarations import Datum, TaskRoutine
from postproc.language.analysis.move_blocks import TargetSlots
from postproc.language.analysis.shared_changes import (
    SharedChange,
    collect_changes,
    list_shared_changes,
)
from postproc.language.analysis.symbols import DEEPEST, TaskSymbols
from postproc.language.analysis.uses import NamesUsed
from postproc.language.analysis.values import (
    Layout,
    Value,
    WrittenNumber,
    list_leaves,
    without_places,
)
from postproc.language.rapid import syntax as said
from postproc.language.rapid.files import RapidFileName
from postproc.language.rapid.instructions import (
    ANSWERS,
    BUILT_IN_FUNCTIONS,
    BY_NAME,
    BY_STRING,
    MOTIONS,
    READING,
    SYNCHRONOUS,
    read_controller_data,
)
from postproc.language.rapid.pose_encoding import COMMENTS, RAPID_DIALECT, WIDTH
from postproc.language.rapid.program import RapidFile, read_rapid
from postproc.language.shifts import Shift, ShiftKind
from postproc.language.text.source import Source, keep_short, parse_shared

_UNREAD = re.compile(rb'"[^"\n]*"|![^\n]*')
_BLANK = bytes(
    k if (chr(k).isalnum() and k < 128) or k == 95 else 32 for k in range(256)
)
"""Makes blanks of all that words are not made of."""
SHIFTS = {"offs": ShiftKind.AXES, "reltool": ShiftKind.OWN}
"""Functions whose first argument is a target."""


def _values(names: str) -> Layout:
    """Lay out components that are values."""
    return {name: {} for name in names.split()}


_AXES = _values("eax_a eax_b eax_c eax_d eax_e eax_f")
_POSE = {"trans": _values("x y z"), "rot": _values("q1 q2 q3 q4")}
_INERTIA = _values("ix iy iz")
_LOAD = {"mass": {}, "cog": _POSE["trans"], "aom": _POSE["rot"], **_INERTIA}
RECORDS: Mapping[str, Layout] = {
    "robtarget": {**_POSE, "robconf": _values("cf1 cf4 cf6 cfx"), "extax": _AXES},
    "jointtarget": {
        "robax": _values("rax_1 rax_2 rax_3 rax_4 rax_5 rax_6"), "extax": _AXES
    },
    "pose": _POSE,
    "loaddata": _LOAD,
    "tooldata": {"robhold": {}, "tframe": _POSE, "tload": _LOAD},
    "wobjdata": {**_values("robhold ufprog ufmec"), "uframe": _POSE, "oframe": _POSE},
    "speeddata": _values("v_tcp v_ori v_leax v_reax"),
    "zonedata": _values(
        "finep pzone_tcp pzone_ori pzone_eax zone_ori zone_leax zone_reax"
    ),
}  # fmt: skip
"""Components of data by type."""
COUNTS: tuple[tuple[int, ...], ...] = ((3, 4, 4, 6), (6, 6))
"""How many numbers stand in the parts of a robtarget, and of a jointtarget."""


@dataclass
class RapidTask(TaskSymbols[RapidFile]):
    """The modules of a task.

    Attributes:
        frames, conditions: Tools and work objects that have been read, by name; and
            with zones and speeds, by arguments.
    """

    comments = COMMENTS
    layouts = RECORDS
    followed = (*RECORDS, "num", "bool")
    targets = ("robtarget", "jointtarget")
    functions = "func"
    still_words = frozenset(name for name, one in MOTIONS.items() if one.given < 0)
    controller_data = staticmethod(read_controller_data)
    frames: dict[tuple[object, ...], TaskFrame] = field(default_factory=dict)
    conditions: dict[tuple[object, ...], tuple[TaskFrame, TaskFrame, float, float]] = (
        field(default_factory=dict)
    )
    _moved: dict[tuple[int, int], bool] = field(default_factory=dict)

    def new_uses(self) -> NamesUsed:
        """Return what knows instructions and functions by name."""
        return _RapidUses(self.routines, self.called_elsewhere)

    def shares(self, file: int, datum: Datum) -> bool:
        """Return True for all but LOCAL data."""
        return datum.scope != "local"

    def outlives(self, datum: Datum) -> bool:
        """Return True for persistents."""
        return datum.kind == "pers"

    def keeps(self, file: int, datum: Datum) -> bool:
        """Return True where neither this task nor another changes data."""
        name = datum.name
        if name in self.loop_variables:  # it may hide the data
            return False
        changed = name in self.written or self.sets_by_string
        changed = changed and datum.kind != "const"
        return not (changed or self.is_changed_beside(file, datum))

    def is_followed(self, name: str, datum: Datum, here: Scope) -> bool:
        """Leave constants, and what another task or a text may name."""
        return (
            super().is_followed(name, datum, here)
            and not self.sets_by_string
            and datum.kind != "const"
            and not self.is_used_beside(name, here)
        )

    def plain_end(self, one: ir.SourceStatement) -> ir.Operand | None:
        """Return where a plain move goes, see `TaskSymbols.plain_end`."""
        if not isinstance(one, ir.Instruction) or one.name in self.routines:
            return None
        signature = MOTIONS.get(one.name)
        if signature is None or signature.via >= 0 or not signature.reaches:
            return None
        to, _ = signature.operands(one.arguments)
        others = (a.value for a in one.arguments if a.value is not to)
        simple = (
            value is None
            or isinstance(value, ir.Num)
            or (isinstance(value, ir.DataObject) and not value.steps)
            for value in others
        )
        passed_on = any(argument.passed_on for argument in one.arguments)
        return to if all(simple) and not passed_on else None

    def read_slots(self, operand: ir.Operand) -> TargetSlots | None:
        """Return the numbers of ``[[1, 2, ..], ..]``, see `TaskSymbols.read_slots`."""
        items = operand.items if isinstance(operand, ir.Composite) else ()
        parts = [part.items for part in items if isinstance(part, ir.Composite)]
        if tuple(map(len, parts)) not in COUNTS or len(parts) != len(items):
            return None
        leaves = [leaf for part in parts for leaf in part]
        slots = [leaf.slot for leaf in leaves if isinstance(leaf, ir.Num)]
        if len(slots) < len(leaves):
            return None
        numbers, outside = tuple(slots[:-6]), tuple(slots[-6:])
        filled = (*numbers, *(-1,) * (WIDTH - len(numbers)))
        return TargetSlots(filled, outside, joints=len(numbers) < WIDTH)

    def note_odd(self, uses: NamesUsed) -> None:
        """Note words of what is not understood; but a move sets nothing."""
        uses.changed |= self.words_of_odd(self.still_words)
        uses.written |= self.changed_elsewhere.keys()
        uses.read |= self.odd_words

    def bind(
        self, routine: TaskRoutine, call: ir.Instruction | ir.FunctionCall, there: Scope
    ) -> Scope | None:
        """Add no argument where data are changed by their names in texts."""
        bound = super().bind(routine, call, there)
        return self.scope_of(routine) if self.sets_by_string and bound else bound

    # What other modules do of the same task, or what ran before it.

    def is_exported(self, datum: Datum) -> bool:
        """Return True for data of all modules that a module beside names."""
        own = datum.scope == "local" or bool(datum.routine)
        return not own and datum.name in self._named_elsewhere

    @cached_property
    def _named_elsewhere(self) -> frozenset[str]:
        """Names in modules beside that these do not declare."""
        others = (one for one in self.files_beside if not _task_of(one))
        names = (list_names(one.text.source) for one in others)
        return frozenset[str]().union(*names)

    @cached_property
    def changed_elsewhere(self) -> Mapping[str, Sequence[SharedChange]]:
        """What other modules change of the data that they share, by name."""
        data = ((k, one) for k, file in enumerate(self.files) for one in file.data)
        shared = {
            one.name for k, one in data
            if one.kind != "const" and not one.routine and self.shares(k, one)
        }  # fmt: skip
        others = (one for one in self.files_beside if not _task_of(one))
        changes = chain.from_iterable(list_changes(one.text.source) for one in others)
        every = (
            replace(one, name=name)
            for one in changes
            for name in ([one.name] if one.name else shared)
        )
        return collect_changes(every, shared, self.start)

    # What other tasks do: global persistents of one name are the same data.

    @cached_property
    def others(self) -> Sequence[RapidTask]:
        """The tasks that run at the same time, by the names of their files."""
        tasks = defaultdict[str, list[RapidFile]](list)
        for file in filter(_task_of, self.files_beside):
            tasks[_task_of(file)].append(file)
        return [RapidTask(own) for own in tasks.values()]

    def is_changed_beside(self, file: int, datum: Datum) -> bool:
        """Return True if another task may change data, or begin with other values."""
        key = file, datum.row
        if key not in self._moved:
            self._moved[key] = _is_shared(datum)  # while it is worked out
            own = self._first_value(file, datum) if self._moved[key] else None
            self._moved[key] = _is_shared(datum) and any(
                other.may_set(datum.name, own) for other in self.others
            )
        return self._moved[key]

    def is_used_beside(self, name: str, here: Scope) -> bool:
        """Return True if another task has the data that a name means, too."""
        found = self.datum(name, here)
        if found is None or not _is_shared(found[1]):
            return False
        return any(name in other.persistents | other.strange for other in self.others)

    def may_set(self, name: str, value: Value | None) -> bool:
        """Return True if a persistent may come to hold another value by this task."""
        if name in self.changes:
            return True
        data = ((k, one) for k, file in enumerate(self.files) for one in file.data)
        own = (one for one in data if one[1].name == name and _is_shared(one[1]))
        first = (self._first_value(*one) for one in own)
        return any(one is None or one != value for one in first)

    def _first_value(self, file: int, datum: Datum) -> Value | None:
        """Return what data hold at first, without where it is written."""
        there = self.scope_of_datum(file, datum)
        return without_places(self.value(datum.value, there))

    @cached_property
    def persistents(self) -> frozenset[str]:
        """Names of data that tasks share with others that declare them too."""
        return frozenset(one.name for one in self.every_datum if _is_shared(one))

    @cached_property
    def strange(self) -> frozenset[str]:
        """Names that it takes or changes and does not declare: shared modules do."""
        return (self.written | self.read | self.odd_words) - self.declared

    @cached_property
    def changes(self) -> frozenset[str]:
        """Names of data of several tasks that this one may change."""
        by_name = self.persistents if self.sets_by_string else frozenset()
        written = self.written | self.odd_words
        return by_name | (written & (self.persistents | self.strange))

    # What only its words tell.

    @cached_property
    def sets_by_string(self) -> bool:
        """Whether an instruction sets data that it is given the names of in texts."""
        return any(self.changes_by_string)

    @property
    def changes_by_string(self) -> Iterator[SharedChange]:
        """Where those stand."""
        for text in (file.text for file in self.files):
            for row in text.of_kind(_sets_by_string):
                yield SharedChange("", (), text.source.name, text.line(row))

    @cached_property
    def calls_by_text(self) -> bool:
        """Whether a procedure is called by a name in a text."""
        found = (ir.inside(one) for file in self.files for one in file.text.said.said)
        late = any(isinstance(one, said.LateCall) for one in found)
        return late or bool({BY_NAME, *SYNCHRONOUS} & self.find_calls)

    @cached_property
    def find_calls(self) -> frozenset[str]:
        """Names of all instructions."""
        found = (ir.inside(one) for file in self.files for one in file.text.said.said)
        return frozenset(o.name for o in found if isinstance(o, ir.Instruction))

    @cached_property
    def twins(self) -> frozenset[str]:
        """Names of points beside which the controller keeps their originals."""
        pairs = {name for name in self.declared if f"o_{name}" in self.declared}
        return frozenset(pairs | {f"o_{name}" for name in pairs})

    # Positions that are added, Offs and RelTool.

    def operate(self, operator: str, parts: Sequence[Value | None]) -> Value | None:
        """Add and subtract positions, too."""
        if operator not in ("+", "-") or len(parts) != 2:
            return super().operate(operator, parts)
        both = [part for part in parts if isinstance(part, tuple)]
        if len(both) < 2 or any(len(part) != 3 for part in both):
            return super().operate(operator, parts)
        found = [
            super(RapidTask, self).operate(operator, two)
            for two in zip(*both, strict=True)
        ]
        known = tuple(one for one in found if one is not None)
        return known if len(known) == 3 else None

    def apply(self, call: ir.FunctionCall, here: Scope, depth: int) -> Value | None:
        """Evaluate Offs and RelTool, too."""
        if call.name not in SHIFTS:
            return super().apply(call, here, depth)
        by = self.read_shift(call.arguments, here)
        if by is None or depth > DEEPEST or any(map(math.isnan, by)):
            return None
        base = self.value(call.arguments[0].value, here, depth + 1)
        own = [one.value for one in list_leaves(base) if isinstance(one, WrittenNumber)]
        if not isinstance(base, tuple) or len(base) != 4 or len(own) != 17:
            return None
        shift = Shift(SHIFTS[call.name], by, tuple(own[:11]))
        new = shift.apply(RAPID_DIALECT)
        place, turn = (tuple(map(WrittenNumber, new[k])) for k in _PLACE_AND_TURN)
        return (place, turn, *base[2:])

    def read_shift(
        self, arguments: Sequence[ir.Argument], here: Scope
    ) -> tuple[float, ...] | None:
        """Return how far Offs or RelTool shift [mm], then turn about x, y, z [deg].

        None where the arguments are others; NaN where numbers are not known.
        """
        placed = [one.value for one in arguments if not one.name]
        turns = {one.name: one.value for one in arguments if one.name}
        if len(placed) != 4:
            return None
        angles = [
            self.number(turns[axis], here) if axis in turns else 0.0
            for axis in ("rx", "ry", "rz")
        ]
        return (*(self.number(one, here) for one in placed[1:]), *angles)


_PLACE_AND_TURN = slice(3), slice(3, 7)


def _sets_by_string(one: ir.SourceStatement) -> bool:
    """Return True if a statement sets data by a name in a text."""
    one = ir.inside(one)
    return isinstance(one, ir.Instruction) and one.name in BY_STRING


def _task_of(file: RapidFile) -> str:
    """Return the task that a file belongs to which runs beside, "" for none."""
    return RapidFileName(file.text.source.name).task_beside


def _is_shared(datum: Datum) -> bool:
    """Return True if data are those of every task that declares them likewise."""
    return datum.kind == "pers" and not (datum.scope or datum.routine)


@dataclass
class _RapidUses(NamesUsed):
    """Names that statements of RAPID may change, and those that they take."""

    def note(self, one: ir.SourceStatement) -> None:
        """Note what is connected, and what an unknown procedure gets, as changed."""
        match as_assignment(one, self.own) or one:
            case said.ConnectTrap(interrupt=interrupt):
                self.changed.add(interrupt.name)
            case said.LateCall(arguments=arguments):
                self.note_call("", arguments)
            case plain:
                super().note(plain)

    def list_changed(
        self, name: str, arguments: Sequence[ir.Argument]
    ) -> Sequence[ir.Argument]:
        """Return what a search writes, and the options that others answer in."""
        if name in MOTIONS:
            given = MOTIONS[name].find_written(arguments)
            return [one for one in arguments if one.value is given is not None]
        if name in READING or name in BUILT_IN_FUNCTIONS:
            return [one for one in arguments if one.name in ANSWERS]
        return arguments

    def list_ends(
        self, name: str, arguments: Sequence[ir.Argument]
    ) -> Collection[ir.Operand | None]:
        """Return the destination of a move, and the point of an arc."""
        return MOTIONS[name].operands(arguments) if name in MOTIONS else ()

    def split_shift(
        self, operand: ir.Operand
    ) -> tuple[ir.Operand | None, Sequence[ir.Operand | None]] | None:
        """Take Offs and RelTool apart."""
        if not isinstance(operand, ir.FunctionCall) or operand.name not in SHIFTS:
            return None
        if operand.name in self.own:
            return None
        point, *others = operand.values or (None,)
        return point, others


def as_assignment(
    one: ir.SourceStatement, routines: Container[str]
) -> ir.Assignment | None:
    """Return what Incr, Decr, Add and Clear say as an assignment, None for all else.

    Args:
        one: The statement.
        routines: Names of routines of the task, which hide them.
    """
    if not isinstance(one, ir.Instruction) or one.name in routines:
        return None
    match one.name, one.values:
        case "incr" | "decr" | "clear" as name, (ir.DataObject() as target,):
            return ir.Assignment(target, ir.Operation(name.upper(), (target,)))
        case "add", (ir.DataObject() as target, ir.Operand() as by):
            return ir.Assignment(target, ir.Operation("+", (target, by)))
    return None


@keep_short
def list_changes(source: Source) -> tuple[SharedChange, ...]:
    """List what a module changes of others' data, without a name of any of them."""
    task = RapidTask([parse_shared(read_rapid, source)])
    return (*task.changes_by_string, *list_shared_changes(task))


@keep_short
def list_names(source: Source) -> frozenset[str]:
    """List the words of a module that are no names of data which it declares."""
    file = parse_shared(read_rapid, source)
    return find_words(source.data) - {one.name for one in file.data if not one.routine}


def find_words(text: bytes) -> frozenset[str]:
    """Find the words of a module, in lower case, but for comments and strings."""
    words = _UNREAD.sub(b" ", text).translate(_BLANK).lower()
    return frozenset(words.decode("ascii").split())
