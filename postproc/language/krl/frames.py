"""Frames of KRL: ``$TOOL``, ``$BASE``, entries of ``TOOL_DATA``, products."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language import ir
from postproc.language.analysis.assigned_points import Scope
from postproc.language.analysis.conditions import TaskFrame, compose_poses
from postproc.language.analysis.symbols import whole
from postproc.language.analysis.values import (
    KnownRecord,
    Value,
    WrittenNumber,
    is_written,
    list_slots_in,
)
from postproc.language.krl import pose_encoding, symbols
from postproc.language.krl.symbols import CONFIG, KrlTask
from postproc.language.shifts import IDENTITY, Pose, flat

ZERO = TaskFrame(IDENTITY)
SAME = 1e-9  # [m] and in rotation matrices: the frame of the cell


def no_frame(text: str, code: Code = Code.FRAME_UNKNOWN) -> TaskFrame:
    """Return a frame that is not known, and why."""
    return TaskFrame((), Reason(code, text))


NUMBERS = {"$tool": "tool_no", "$base": "base_no"}  # in FDAT
TABLES = {"$tool": "tool_data", "$base": "base_data"}
_NUMBERED = {*TABLES.values()}
_WHICH = "which entry of {} it takes is known only when the program runs"
_CHAINED = "its base moves with another axis or arm ({})"
_MAY_BE_ON = (
    "{} may be TRUE here: BAS links {} to its {} then. Set it to FALSE, or call "
    "BAS(#INITMOV,0), on every way here"
)
_CORRECTED = "{} is linked to its {}, and its value is not known here"
_DOUBLE = "the program declares a {} of its own: BAS takes that of the controller"


@dataclass(frozen=True)
class FrameReader:
    """Reads frames where a statement stands.

    Attributes:
        task: The files of the job.
        here: The statement.
        tool, base: What ``$TOOL`` and ``$BASE`` are there.
        store: What the program has set before.
    """

    task: KrlTask
    here: Scope
    tool: TaskFrame
    base: TaskFrame
    store: Mapping[str, object] = field(default_factory=dict)

    def frame(self, operand: ir.Operand) -> TaskFrame:
        """Read a frame."""
        match operand:
            case ir.DataObject(name="$nullframe" | "$world", steps=()):
                return ZERO
            case ir.DataObject(name="$tool", steps=()):
                return self.tool
            case ir.DataObject(name="$base", steps=()):
                return self.base
            case ir.DataObject(
                name="tool_data" | "base_data" as table,
                steps=(ir.ElementStep() as step,),
            ):
                number = self.task.index(step, self.here)
                if number is None or len(number) != 1:
                    return no_frame(_WHICH.format(table.upper()))
                return self.entry(table, number[0])
            case ir.Operation(operator=":", operands=(first, second)):
                return self._product(self.frame(first), self.frame(second))
            case ir.FunctionCall(name=name, arguments=arguments):
                return self._call(name, [one.value for one in arguments])
            case _:
                return self._record(operand)

    def _call(self, name: str, arguments: Sequence[ir.Operand | None]) -> TaskFrame:
        """Read a frame that one of the functions of modern inline forms gives."""
        first = arguments[0] if arguments else None
        value = self.task.value(first, self.here)
        match name:
            case "stool2" if isinstance(value, KnownRecord):
                found = self.read_numbered("$tool", value.number("tool_no"))
                still = value.get("ipo_frame") != "#base"
                return replace(found, remote=still) if still else found
            case "stool":
                return self.read_numbered("$tool", self.task.number(first, self.here))
            case "sbase":
                return self.read_numbered("$base", self.task.number(first, self.here))
            case "ek" | "lk" | "ey" | "eb" | "eb_abs":
                return no_frame(_CHAINED.format(name.upper()), Code.EXTERNAL_AXES)
        return no_frame(f"what {name.upper()} gives is not known")

    def read_numbered(self, name: str, number: float) -> TaskFrame:
        """Return the tool or the base that BAS sets for a number; 0 is none."""
        entry, table = whole(number), TABLES[name]
        if entry is None:
            return no_frame(f"the number of its {name.upper()} is not known")
        if not self.task.is_global(table, self.here):
            return no_frame(_DOUBLE.format(table.upper()))
        found = ZERO if entry <= 0 else self.entry(table, entry)
        first, second = (
            self._correction(name, *pair) for pair in symbols.CORRECTIONS[name]
        )
        return self._product(self._product(first, found), second)

    def _correction(self, name: str, frame: str, switch: str) -> TaskFrame:
        """Return a frame that BAS links to an entry, no shift where it does not."""
        on = self._read_held(switch, switch)
        if on is None:
            on = self.task.initial_switch(switch)
        found = self._read_held(frame, frame)
        if on is False or (on == symbols.PERHAPS and found == ZERO):
            return ZERO
        shown = name.upper()
        if on is not True:
            return no_frame(_MAY_BE_ON.format(switch.upper(), frame.upper(), shown))
        if isinstance(found, TaskFrame):
            return found
        return no_frame(_CORRECTED.format(frame.upper(), shown))

    def entry(self, table: str, number: int) -> TaskFrame:
        """Read an entry of TOOL_DATA or BASE_DATA."""
        shown = f"{table.upper()}[{number}]"
        if number <= 0:
            return no_frame(f"{shown} is no frame that is known")
        if table == "base_data" and self._is_chained(number):
            chain = _CHAINED.format(f"MACHINE_FRAME_DAT[{number}]")
            return no_frame(chain, Code.EXTERNAL_AXES)
        held = self._read_held(table, symbols.entry_name(table, number))
        if isinstance(held, TaskFrame) and self.task.is_global(table, self.here):
            return held
        found = self.task.datum(table, self.here, (number,))
        if found is not None and self.task.is_steady(table, (number,)):
            frame = self._read_first(table, number, (found[0], found[1].row))
            if frame.pose:
                return frame
        return TaskFrame((), self._unknown(shown, table, (number,)))

    def _read_first(self, table: str, number: int, at: tuple[int, int]) -> TaskFrame:
        """Read what an entry holds at first, once; no pose where that is not known.

        Args:
            table: The table.
            number: .. and the entry.
            at: File and row that give its value.
        """
        if at not in self.task.first_frames:
            pose = pose_of(self.task.entry(table, number, self.here))
            taught = self.task.is_taught(table, *at)
            frame = self._make(pose, taught) if pose else TaskFrame(())
            self.task.first_frames[at] = frame
        return self.task.first_frames[at]

    def _read_held(self, name: str, key: str) -> object | None:
        """Return what the program has set, unless something beside it may change it."""
        return None if name in self.task.beside else self.store.get(key)

    def _is_chained(self, number: int) -> bool:
        """Tell whether a base hangs on an external axis, or may be hung on one."""
        if "machine_frame_dat" in self.task.written:
            return True
        if self.task.datum("machine_frame_dat", self.here, (number,)) is None:
            return False
        value = self.task.entry("machine_frame_dat", number, self.here)
        free = isinstance(value, KnownRecord) and value.number("mach_def_index") == 0.0
        return not free

    def _unknown(self, shown: str, name: str, index: tuple[int, ...] = ()) -> Reason:
        code, text = self.task.explain_unknown(name, self.here, index)
        where = f" ({CONFIG}.dat)" if code is Code.UNDECLARED_VARIABLE else ""
        return Reason(code, f"{shown} {text}{where}")

    def _record(self, operand: ir.Operand) -> TaskFrame:
        """Read a frame that is written or named."""
        value = self.task.value(operand, self.here)
        pose = pose_of(value)
        name = operand.name if isinstance(operand, ir.DataObject) else ""
        if pose and (why := self._explain_entry(operand, value)):
            return TaskFrame((), why)
        if pose:
            taught = self.task.holds_taught(operand, value, self.here)
            return self._make(pose, taught)
        if name:
            return TaskFrame((), self._unknown(name.upper(), name))
        return no_frame("a frame is not written whole")

    def _make(self, pose: Pose, taught: bool) -> TaskFrame:
        """Return a frame; one of the cell may be taught that stands in its place."""
        apart = (np.abs(np.subtract(pose, one)).max() for one in self.task.taught_poses)
        return TaskFrame(pose, taught=taught or min(apart, default=1.0) <= SAME)

    def _explain_entry(self, operand: ir.Operand, value: Value | None) -> Reason:
        """Say why data are no known frame that are given an entry of a table.

        What is computed from one does not tell which one that was.
        """
        names = self.task.names_behind(operand, self.here)
        if not (
            is_written(value) or names.isdisjoint(_NUMBERED | {*self.task.routines})
        ):
            text = "a frame is computed from an entry of TOOL_DATA or BASE_DATA"
            return Reason(Code.FRAME_UNKNOWN, text)
        for file, one in self.task.elements("base_data") if names & _NUMBERED else ():
            own = self.task.value(one.value, self.task.scope_of_datum(file, one))
            shared = {*list_slots_in(own)} & {*list_slots_in(value)}
            if shared and self._is_chained(one.index[0]):
                chain = _CHAINED.format(f"MACHINE_FRAME_DAT[{one.index[0]}]")
                return Reason(Code.EXTERNAL_AXES, chain)
        return NO_REASON

    @staticmethod
    def _product(first: TaskFrame, second: TaskFrame) -> TaskFrame:
        if first.why or second.why or not (first.pose and second.pose):
            return TaskFrame((), first.why or second.why)
        if ZERO in (first, second):
            return second if first == ZERO else first
        return TaskFrame(
            compose_poses(first.pose, second.pose),
            taught=first.taught or second.taught,
            remote=first.remote or second.remote,
        )


def pose_of(value: object) -> Pose:
    """Convert the components of a frame, empty where it is none."""
    if not isinstance(value, KnownRecord):
        return ()
    numbers = [value.number(name) for name in pose_encoding.COMPONENTS[:6]]
    if any(map(math.isnan, numbers)):
        return ()
    return flat(pose_encoding.KRL_DIALECT.poses(np.array([*numbers, 0.0, 0.0])))


def six_numbers(frame: TaskFrame) -> list[float]:
    """Return X, Y, Z [mm] and A, B, C [deg] of a frame."""
    return pose_encoding.numbers_of(np.array(frame.pose).reshape(4, 4))


UPRIGHT = 1e-6  # cosine of B up to which A and C are not told apart


def set_component(
    held: object, name: str, value: float
) -> TaskFrame | KnownRecord | None:
    """Return a frame of which one component is set, a record where not all are known.

    Args:
        held: What it was, or which of its components are known; anything else: none.
        name: The component.
        value: Its number [mm, deg], NaN where only the run tells it.
    """
    fields = dict[str, Value]()
    if isinstance(held, TaskFrame) and held.pose:
        numbers = six_numbers(held)
        upright = abs(math.cos(math.radians(numbers[4]))) < UPRIGHT
        known = zip(pose_encoding.COMPONENTS[:6], numbers, strict=True)
        fields = {} if upright else {key: WrittenNumber(one) for key, one in known}
    elif isinstance(held, KnownRecord):
        fields = dict(held.fields)
    fields.pop(name, None)
    if name not in pose_encoding.COMPONENTS[:6]:
        return None
    if not math.isnan(value):
        fields[name] = WrittenNumber(value)
    record = KnownRecord(tuple(sorted(fields.items(), key=lambda one: one[0])))
    pose = pose_of(record)
    if not pose:
        return record
    frame = held if isinstance(held, TaskFrame) else ZERO
    return replace(frame, pose=pose)
