"""Which names the statements of a task change and take."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import NamedTuple

from postproc.language import ir
from postproc.language.analysis.assigned_points import (
    find_added,
    is_point,
    source_of,
)
from postproc.language.analysis.declarations import TaskRoutine


def match_arguments(
    parameters: Sequence[ir.RoutineParameter], arguments: Sequence[ir.Argument]
) -> list[tuple[ir.RoutineParameter, ir.Argument]] | None:
    """Pair parameters with arguments; None where the call does not fit."""
    placed = [one for one in arguments if not one.name]
    required = [one for one in parameters if not one.optional]
    optional = {one.name: one for one in parameters if one.optional}
    named = [one for one in arguments if one.name]
    if len(placed) != len(required) or any(a.name not in optional for a in named):
        return None
    pairs = [(optional[a.name], a) for a in named if not a.passed_on]
    return [*zip(required, placed, strict=True), *pairs]


class PassedData(NamedTuple):
    """Data that a routine of the task is called with.

    Attributes:
        name: Of the data.
        parameter: What they are there.
        by_reference: The routine may change them through it.
        whole: They are named whole: whatever the routine does to them is followed.
    """

    name: str
    parameter: str
    by_reference: bool
    whole: bool


@dataclass
class NamesUsed:
    """Names that statements may change, and those that they take.

    Attributes:
        own: Routines of the task by name: what else has their names is hidden.
        elsewhere: Names of local ones that other modules mean something else by.
        written: Those that assignments change; what takes a value does not read them.
        changed: Those that may be changed otherwise.
        read: Those that something but the destination of a move takes.
        copies: Points that are assigned, and those that they are made from.
        targets: What may be changed, as it is written.
        passed: Data that routines are called with.
        parts: Names of which moves go to elements or components.
    """

    own: Mapping[str, Sequence[TaskRoutine]]
    elsewhere: Collection[str] = ()
    written: set[str] = field(default_factory=set)
    changed: set[str] = field(default_factory=set)
    read: set[str] = field(default_factory=set)
    copies: set[tuple[str, str]] = field(default_factory=set)
    targets: list[ir.DataObject] = field(default_factory=list)
    passed: set[PassedData] = field(default_factory=set)
    parts: set[str] = field(default_factory=set)

    # What a language says.

    def list_changed(
        self, name: str, arguments: Sequence[ir.Argument]
    ) -> Sequence[ir.Argument]:
        """Return the arguments that what is no routine of the task may change."""
        return arguments

    def list_ends(
        self, name: str, arguments: Sequence[ir.Argument]
    ) -> Collection[ir.Operand | None]:
        """Return the destinations among the arguments of an instruction."""
        return ()

    def split_shift(
        self, operand: ir.Operand
    ) -> tuple[ir.Operand | None, Sequence[ir.Operand | None]] | None:
        """Return the point that a value shifts and what by, None for all else."""
        return None

    # What statements do.

    def note(self, one: ir.SourceStatement) -> None:
        """Note the names that a statement may change, and those that it takes."""
        match one:
            case ir.Assignment(target=target, value=value):
                self.written.add(target.name)
                self.targets.append(target)
                self._note_assignment(target, value)
            case ir.Instruction(name=name, arguments=arguments):
                self._note_instruction(name, arguments)
            case ir.ForLoop(name=name):
                self.changed.add(name)
                self.take_in(one)
            case _:
                self.take_in(one)

    def take_in(self, one: ir.Node) -> None:
        """Note what the parts of a statement or a value take and change."""
        for part in one.children():
            match part:
                case ir.SourceStatement():
                    self.note(part)
                case ir.Operand():
                    self.take(part)
                case _:
                    self.take_in(part)

    def take(self, operand: ir.Operand | None) -> None:
        """Note what a value takes, and what its functions may change."""
        match operand:
            case ir.DataObject(name=name):
                self.read.add(name)
                self._take_subscripts(operand)
            case ir.FunctionCall(name=name, arguments=arguments):
                self.note_call(name, arguments)
            case ir.Operand():
                self.take_in(operand)

    def take_destination(self, operand: ir.Operand | None) -> None:
        """Note what the destination of a move takes besides the point itself."""
        shift = None if operand is None else self.split_shift(operand)
        if shift is not None:
            self.take_destination(shift[0])
            for one in shift[1]:
                self.take(one)
        elif isinstance(operand, ir.DataObject):
            self.parts |= {operand.name} if operand.steps else set()
            self._take_subscripts(operand)
        else:
            self.take(operand)

    def note_call(self, name: str, arguments: Sequence[ir.Argument]) -> None:
        """Note arguments: what is called may change them, unless it is known not to."""
        changed = self.list_changed(name, arguments)
        if name in self.own:
            pairs = self._pair(name, arguments)
            by_reference = [
                one for parameter, one in pairs or () if parameter.by_reference
            ]
            changed = arguments if pairs is None else by_reference
        for argument in changed:
            if isinstance(argument.value, ir.DataObject):
                self.changed.add(argument.value.name)
                self.targets.append(argument.value)
        ends = () if name in self.own else self.list_ends(name, arguments)
        for argument in arguments:
            if any(argument.value is end for end in ends):
                self.take_destination(argument.value)
            else:
                self.take(argument.value)

    def _pair(
        self, name: str, arguments: Sequence[ir.Argument]
    ) -> list[tuple[ir.RoutineParameter, ir.Argument]] | None:
        """Pair arguments with parameters, None where it is not sure what is called."""
        found = self.own.get(name, ())
        if len(found) != 1 or name in self.elsewhere:
            return None
        if any(one.passed_on for one in arguments):
            return None
        return match_arguments(found[0].rows.head.parameters, arguments)

    def _note_instruction(self, name: str, arguments: Sequence[ir.Argument]) -> None:
        """Note what an instruction, or a routine of the task, is given."""
        pairs = self._pair(name, arguments)
        if pairs is None:
            self.note_call(name, arguments)
            return
        for parameter, argument in pairs:
            if isinstance(argument.value, ir.DataObject):
                name, whole = argument.value.name, not argument.value.steps
                given = name, parameter.name, parameter.by_reference, whole
                self.passed.add(PassedData(*given))
                self.targets += [argument.value] if parameter.by_reference else []
                self._take_subscripts(argument.value)
            else:
                self.take(argument.value)

    def _note_assignment(self, target: ir.DataObject, value: ir.Operand) -> None:
        """Note what an assignment takes: a point that moves go to by another name.

        What is added to a component of a point shifts it.
        """
        source, added = source_of(value), find_added(target, value)
        self._take_subscripts(target)
        if added:
            for one in added:
                self.take(one)
        elif source is None or not (is_point(target) and is_point(source)):
            self.take(value)
        elif value is source:
            self._take_subscripts(source)
            self.copies.add((target.name, source.name))
        elif self._is_shifted(value):
            self.copies.add((target.name, source.name))
            self.take_destination(value)
        else:
            self.take(value)

    def _is_shifted(self, value: ir.Operand | None) -> bool:
        """Return True if functions do nothing but shift a point."""
        while isinstance(value, ir.FunctionCall):
            shift = self.split_shift(value)
            if shift is None:
                return False
            value = shift[0]
        return isinstance(value, ir.DataObject)

    def _take_subscripts(self, data: ir.DataObject) -> None:
        for step in data.steps:
            if isinstance(step, ir.ElementStep):
                self.take_in(step)

    # What follows from that.

    def add_passed(self, changed: Set[str]) -> frozenset[str]:
        """Add data to names that change, which routines change by their parameters."""
        found, before = frozenset(changed), -1
        while before != len(found):
            before = len(found)
            found |= {
                one.name for one in self.passed
                if one.by_reference and one.parameter in found
            }  # fmt: skip
        return found

    def pass_on(self) -> None:
        """Note of data what is noted of what is made from them, or of parameters.

        Which of the points in a parameter a move takes is not followed.
        """
        self.read |= self.parts & {one.parameter for one in self.passed}
        before = -1
        while before != len(self.changed) + len(self.written) + len(self.read):
            before = len(self.changed) + len(self.written) + len(self.read)
            for name, parameter, by_reference, whole in self.passed:
                written = parameter in self.written | self.changed
                if written or parameter in self.read:
                    self.read.add(name)
                if written and by_reference:
                    (self.written if whole else self.changed).add(name)
                if parameter in self.changed and by_reference:
                    self.changed.add(name)
            self.read |= {one for target, one in self.copies if target in self.read}
