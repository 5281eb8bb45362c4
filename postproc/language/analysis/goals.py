"""Where moves go: points that are written, named, assigned, returned or shifted."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from operator import itemgetter
from typing import Any, ClassVar, TypeVar

from postproc.arrays import Bools, Floats
from postproc.diagnostics import Code, Reason
from postproc.language import ir
from postproc.language.analysis.assigned_points import AssignedPoint, Scope
from postproc.language.analysis.found_goals import FoundGoal, FoundShift, hold_numbers
from postproc.language.analysis.move_blocks import TargetSlots
from postproc.language.analysis.symbols import TaskSymbols
from postproc.language.analysis.values import Value, WrittenNumber
from postproc.language.pose_encoding import Dialect
from postproc.language.shifts import NUMBERS, Shift, ShiftKind
from postproc.language.visits import Meaning

MOST_NAMED, MOST_PARTS = 3, 6  # lines or data, components, in a reason
RUN_TIME = "it is known only when the program runs"
AT_RUN_TIME = Reason(
    Code.RUNTIME_VALUE, "the target is known only when the program runs"
)
COMPUTED = Reason(Code.COMPUTED_TARGET, "the target is computed from other data")
_GIVEN = Reason(
    Code.COMPUTED_TARGET,
    "the target is an element of an array that its routine is called with",
)
_OF_NUMBERS = (None, Code.PARTIAL_TARGET, Code.COMPUTED_TARGET)
G = TypeVar("G", bound="GoalReader")


@dataclass(frozen=True)
class ReadShift:
    """How a move shifts a point, as far as that is known.

    Attributes:
        by: What by, None where that is not known.
        slots: Its numbers among those of the job, w as of a target; -1 where they stay.
        own: First number of a shift that stands in the move itself.
        aux: External axes of the shifted point, None where they are those of the point.
        shifts, turned: What messages say that it does: shift by what .., turn.
    """

    by: Shift | None = None
    slots: tuple[int, ...] = (-1,)
    own: frozenset[int] = frozenset()
    aux: tuple[float, ...] | None = None
    shifts: str = ""
    turned: str = ""


@dataclass(frozen=True)
class GoalReader(ABC):
    """Reads where moves lead.

    Attributes:
        task: What names mean.
        here: Where the move stands.
        dialect: What numbers of targets mean.
        brackets: Around the index of an element.
        places: Components of a place, as they are spelt behind a point.
        shout: Names are upper case in messages.
        system: Why numbers of files that are not rewritten must stay.
        outlives: Why those stay that data of no routine are given, "" if they need not.
        told_apart: Numbers of targets, by their place, that tell moves apart which are
            read at once.
    """

    task: TaskSymbols[Any]
    here: Scope
    dialect: ClassVar[Dialect]
    brackets: ClassVar[str]
    places: ClassVar[Sequence[str]]
    shout: ClassVar[bool] = False
    system: ClassVar[str]
    outlives: ClassVar[str] = ""
    told_apart: ClassVar[Sequence[int]] = ()

    # What a language says.

    @abstractmethod
    def visits(self, one: Any, scope: Scope, modes: Any) -> Iterator[Any]:
        """Read the visits of a move: the point of an arc, and its end.

        Args:
            one: The move.
            scope: As `here`, without what points hold.
            modes: What holds there.
        """

    @abstractmethod
    def read_value(self, value: Value | None) -> FoundGoal | None:
        """Read a point that is known, None where it is none that can be gone to."""

    @abstractmethod
    def explain_unknown(self, name: str) -> Reason:
        """Say why a name stands for no known point."""

    @abstractmethod
    def explain_pinned(self, name: str, slot: int) -> str:
        """Say why a point must keep its numbers, "" where it need not.

        Args:
            name: Of the point.
            slot: Its first number, -1 where none is written.
        """

    @abstractmethod
    def goal_of(
        self,
        target: TargetSlots,
        numbers: Sequence[float | None],
        outside: Sequence[float | None],
    ) -> FoundGoal:
        """Return where numbers lead, without where they stand.

        Args:
            target: Which of them are written.
            numbers: Of the target, w, None for what is not written.
            outside: Of external axes, likewise.
        """

    @staticmethod
    @abstractmethod
    def are_sound(target: TargetSlots, numbers: Floats) -> Bools:
        """Tell which numbers, (m, w), are those of a target, (m,)."""

    def read_special(self, operand: ir.Operand | None) -> FoundGoal | None:
        """Read what only this language can go to, None for all else."""
        return None

    def is_followed_whole(self, held: AssignedPoint, value: Value | None) -> bool:
        """Return True if all that a move needs of an assigned point is known."""
        return True

    # Ends.

    @property
    def nothing(self) -> tuple[float, ...]:
        """The numbers of a target that is not known."""
        return (math.nan,) * self.dialect.width

    def unknown(self, why: Reason, name: str = "") -> FoundGoal:
        """Return a destination that is not known."""
        return FoundGoal(Meaning.UNKNOWN, self.nothing, name=name, why=why)

    def at(self: G, here: Scope) -> G:
        """Return what reads operands that stand elsewhere."""
        return replace(self, here=here)

    def goal(self, operand: ir.Operand | None) -> FoundGoal:
        """Read a destination."""
        return self.read_special(operand) or self.plain_goal(operand)

    def plain_goal(self, operand: ir.Operand | None) -> FoundGoal:
        """Read a destination that every language has."""
        held = self.task.find_held(operand, self.here)
        if held is not None:
            return self._read_held(held)
        found = self._read(operand)
        if found.pins or not self.is_of_system(found.point):
            return found
        return replace(found, pins=self.system)

    def _read(self, operand: ir.Operand | None) -> FoundGoal:
        """Read a destination that is no assigned point."""
        passed = [*self.task.find_given(operand, self.here)]
        if not passed:
            if isinstance(operand, ir.FunctionCall):
                return self._read_returned(operand)
            return self.read_point(operand)
        _, operand, here = passed[-1]  # given to a routine, which may read it
        found = self.at(here).goal(operand)
        why = (self.explain_pinned(name, -1) for name in sorted({p[0] for p in passed}))
        pins = next(filter(None, why), found.pins)
        if found.shift is None:
            return replace(found, pins=pins)
        held = found.shift.shift  # its numbers stay
        turned = "it is shifted and turned" if held.turns else ""
        return replace(found, shift=FoundShift(held), pins=found.pins or turned)

    def _read_returned(self, call: ir.FunctionCall) -> FoundGoal:
        """Read what a function of the task returns: its numbers stay."""
        returned = self.task.find_returned(call, self.here)
        if returned is None:
            return self.unknown(AT_RUN_TIME)
        operand, here = returned
        found = self.at(here).goal(operand)
        name = call.name.upper() if self.shout else call.name
        text = f"the function {name} returns the target"
        why = found.why or Reason(Code.COMPUTED_TARGET, text)
        return hold_numbers(
            found, "", why, found.pins or text, found.target, found.values, found.aux
        )

    # Points.

    def read_point(self, operand: ir.Operand | None) -> FoundGoal:
        """Read a point that is written or named."""
        return self._read_written(operand) or self._read_any(operand)

    def _read_written(self, operand: ir.Operand | None) -> FoundGoal | None:
        """Read a point all of whose numbers stand in one statement, None for others."""
        file, row, written, name = self.here.file, self.here.row, operand, ""
        if isinstance(operand, ir.DataObject) and not operand.steps:
            found = self.task.constant(operand.name, self.here)
            if found is None:
                return None
            file, row, written = found[0], found[1].row, found[1].value
            name = operand.name
        target = self.task.slots_of(written)
        if target is None:
            return None
        text, begin = self.task.files[file].text, self.task.numbering.first[file]
        first = int(text.first[row])
        numbers, outside = (
            [float(text.value[first + at]) if at >= 0 else None for at in some]
            for some in (target.slots, target.aux)
        )
        if not all(x is None or math.isfinite(x) for x in (*numbers, *outside)):
            return None
        goal = self.goal_of(target, numbers, outside)
        begin += first
        slots = tuple([begin + at if at >= 0 else -1 for at in target.slots])
        goal = replace(goal, slots=slots, follows=(-1,) * len(slots))
        return self.name_goal(goal, name) if name else goal

    def _read_any(self, operand: ir.Operand | None) -> FoundGoal:
        """Read a point that is computed, or a part of other data."""
        name = operand.name if isinstance(operand, ir.DataObject) else ""
        goal = self.read_value(self.task.value(operand, self.here))
        if goal is None:
            why = self.explain_unknown(name) if name else AT_RUN_TIME
            return self.unknown(why, name)
        partial = goal.why.code is Code.PARTIAL_TARGET  # the rest may stand elsewhere
        if goal.target == Meaning.UNKNOWN or (name and partial):
            return self.unknown(goal.why, name)
        if not (name or goal.slots[0] >= 0):
            return goal
        if goal.slots[0] >= 0 and not self._is_own(goal, operand):
            why = _GIVEN if name in self.here.parameters else COMPUTED
            goal = replace(goal, slots=(-1,) * len(goal.slots), why=goal.why or why)
        return self.name_goal(goal, name, self._spell_steps(operand)) if name else goal

    def name_goal(self, goal: FoundGoal, name: str, steps: str = "") -> FoundGoal:
        """Return the goal of a move that names data, and elements of them."""
        declared = self.task.datum(name, self.here)
        shared = declared is not None and self.task.is_exported(declared[1])
        pins = self.explain_pinned(name, goal.point)
        return replace(goal, name=name + steps, pins=pins, shared=shared)

    def _is_own(self, goal: FoundGoal, operand: ir.Operand | None) -> bool:
        """Return True if all numbers of a point stand in its own statement.

        Other data that it is built from may serve other points and sums too.
        """
        file, row = self.here.file, self.here.row
        if isinstance(operand, ir.DataObject):
            index = next(filter(None, map(self._index, operand.steps)), ())
            found = self.task.constant(operand.name, self.here, index)
            found = found or self.task.constant(operand.name, self.here)
            file, row = (found[0], found[1].row) if found else (-1, -1)
        if file < 0:
            return False
        first, behind = self.task.files[file].text.first[row : row + 2].tolist()
        begin = self.task.numbering.first[file]
        own = range(begin + first, begin + behind)
        return all(slot in own for slot in goal.slots if slot >= 0)

    def is_of_system(self, slot: int) -> bool:
        """Return True if a number stands in a file that is read and not rewritten."""
        return (
            slot >= 0 and self.task.files[self.task.numbering.file_of(slot)].is_system
        )

    def _index(self, step: str | ir.ElementStep) -> tuple[int, ...] | None:
        return self.task.index(step, self.here)

    def _spell_steps(self, operand: ir.Operand | None) -> str:
        """Spell which element or component is meant, "" where it is the whole."""
        steps = operand.steps if isinstance(operand, ir.DataObject) else ()
        spelt = ""
        for step in steps:
            inside = self.spell_index(self._index(step) or ())
            spelt += f".{step}" if isinstance(step, str) else inside
        return spelt

    @classmethod
    def spell_index(cls, index: tuple[int, ...]) -> str:
        """Spell the index of an element."""
        return f"{cls.brackets[0]}{','.join(map(str, index))}{cls.brackets[1]}"

    # What assignments gave.

    def _read_held(self, held: AssignedPoint) -> FoundGoal:
        """Read the destination that assignments gave to a point."""
        name = held.name + (self.spell_index(held.index) if held.index else "")
        goal = held.goal or self.unknown(AT_RUN_TIME)
        goal = replace(goal, names=goal.names | held.names)
        why = []
        for place in held.chain:
            where = self.at(Scope(*place[:3], row=self.here.row))
            why.append(where.explain_pinned(place[-1], goal.point))
        of_all = (place[-1] for place in held.chain if self.outlives and not place[2])
        why += [f"{one} {self.outlives}" for one in of_all]
        pins = next(filter(None, (goal.pins, *why)), "")
        if held.components:
            return self._set_components(held, goal, name, pins)
        if goal.why.code is Code.PARTIAL_TARGET:  # the others are what they were before
            goal = self.unknown(goal.why)
        shift = goal.shift
        if shift is not None:
            shift = replace(shift, pins=shift.pins or pins)
        doubtful = goal.doubtful
        if goal.target == Meaning.UNKNOWN and held.goal is not None:
            doubtful |= held.names
        return replace(goal, name=name, pins=pins, shift=shift, doubtful=doubtful)

    def _set_components(
        self, held: AssignedPoint, base: FoundGoal, name: str, pins: str
    ) -> FoundGoal:
        """Read a point of which components have been set by themselves."""
        if (by := self._read_added(held, base)) is not None:
            return self.apply_shift(replace(base, name=name, pins=pins), by)
        value = self.task.evaluate_held(held)
        found = self.read_value(value) or self.unknown(AT_RUN_TIME)
        partial = found.why.code is Code.PARTIAL_TARGET
        known = found.target != Meaning.UNKNOWN and not partial
        known = known and self.is_followed_whole(held, value)
        why = self._explain_components(held, name, known)
        own = found.why.code not in (*_OF_NUMBERS, Code.RUNTIME_VALUE)
        if held.goal is not None and own:
            why = found.why
        if not known:
            return hold_numbers(base, name, why, pins)
        return hold_numbers(
            base, name, why, pins, found.target, found.values, found.aux
        )

    def _read_added(self, held: AssignedPoint, base: FoundGoal) -> ReadShift | None:
        """Read what is added to the place of a point, None where more is set."""
        numbers = [0.0] * NUMBERS
        for one in held.components:
            if one.name not in self.places or not one.along or one.value is None:
                return None
            at = self.places.index(one.name)
            numbers[at] = one.value - base.values[at]
        if base.target != Meaning.POSE:
            return None
        kept = {base.writes[0]} if base.is_rewritten_by_shift else set[int]()
        shift = Shift(ShiftKind.AXES, tuple(numbers), base.values)
        return ReadShift(shift, own=frozenset(kept))

    def _explain_components(
        self, held: AssignedPoint, name: str, known: bool
    ) -> Reason:
        """Say which components are set by themselves, and where.

        Args:
            held: The point.
            name: As it is spelt.
            known: All of its numbers are known.
        """
        late = [one for one in held.components if one.value is None]
        meant, files = late or held.components, self.task.files
        lines = sorted(
            {(one.file, files[one.file].text.line(one.row)) for one in meant}
        )
        places = []
        for file, rows in groupby(lines, itemgetter(0)):
            own = [str(line) for _, line in rows][:MOST_NAMED]
            where = f"line{'s' * (len(own) > 1)} {', '.join(own)}"
            places.append(f"{where} of {files[file].text.source.name}")
        parts = ", ".join(one.name for one in meant[:MOST_PARTS])
        more = len(meant) - MOST_PARTS
        parts += f" and {more} more" if more > 0 else ""
        text = f"{name}: {parts} set in {', '.join(places)}"
        if late:
            text = f"{text} to what is known only when the program runs"
        elif not known:
            text = f"{text}; its other numbers are known only when the program runs"
        return Reason(Code.COMPUTED_TARGET if known else Code.RUNTIME_VALUE, text)

    # Shifts: the point is moved along.

    def apply_shift(self, base: FoundGoal, by: ReadShift) -> FoundGoal:
        """Return where a move goes that shifts a point.

        Args:
            base: The point.
            by: How it is shifted.
        """
        holds = base.holds | by.own
        if base.target != Meaning.POSE or by.by is None:
            pins = base.pins or f"{by.shifts} {RUN_TIME}"
            return FoundGoal(
                Meaning.UNKNOWN, self.nothing, follows=base.origin,
                name=base.name, why=base.why or AT_RUN_TIME, pins=pins,
                stays=base.stays, holds=holds, names=base.names,
            )  # fmt: skip
        aux = base.aux if by.aux is None else by.aux
        values = by.by.apply(self.dialect)
        if base.stays:
            why, kept = base.why or COMPUTED, replace(base, holds=holds)
            return hold_numbers(
                kept, base.name, why, base.pins, base.target, values, aux
            )
        found = FoundShift(by.by)
        if base.shift is not None:
            found = FoundShift(by.by.around(base.shift.shift, self.dialect))
        if not base.why and base.origin[0] >= 0 and by.slots[0] >= 0:
            pins = self.system if self.is_of_system(by.slots[0]) else ""
            found = FoundShift(found.shift, by.slots, pins)
        fixed = found.slots[0] < 0
        pins = base.pins or (by.turned if by.by.turns and fixed else "")
        return FoundGoal(
            Meaning.POSE, values, (-1,) * len(values), base.origin,
            base.name, aux, base.why, pins, base.shared, found,
            holds=holds if fixed else base.holds, names=base.names,
        )  # fmt: skip


def list_slots(numbers: Sequence[WrittenNumber], width: int) -> tuple[int, ...]:
    """Return where numbers stand, -1 where one of them is computed.

    Args:
        numbers: The numbers.
        width: How many places there are.
    """
    slots = tuple(one.slot for one in numbers)
    if min(slots, default=-1) < 0:
        return (-1,) * width
    return slots + (-1,) * (width - len(slots))
