"""Where a move of KRL goes: points, aggregates, products of frames, steps."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from postproc.arrays import Bools, Floats, all_in_rows
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language import ir
from postproc.language.analysis import goals
from postproc.language.analysis.assigned_points import NO_POINTS, AssignedPoint, Scope
from postproc.language.analysis.found_goals import (
    FoundGoal,
    FoundVisit,
    hold_numbers,
    not_reached,
)
from postproc.language.analysis.move_blocks import TargetSlots
from postproc.language.analysis.symbols import LARGEST, whole
from postproc.language.analysis.values import KnownRecord, Value, WrittenNumber
from postproc.language.krl import pose_encoding, symbols
from postproc.language.krl import syntax as said
from postproc.language.krl.frames import FrameReader, no_frame, six_numbers
from postproc.language.shifts import Shift, ShiftKind
from postproc.language.visits import Meaning
from postproc.robot.trajectory import Motion

NOTHING = (math.nan,) * pose_encoding.WIDTH
NO_SLOTS = (-1,) * pose_encoding.WIDTH
PLACE = pose_encoding.COMPONENTS[:6]


def no_target(text: str) -> Reason:
    """Return the reason of a move that holds no target of its own."""
    return Reason(Code.NO_TARGET, f"the move holds no target of its own: {text}")


HOME = ("xhome", "home", "$h_pos")  # that of the cell, where no file says more
HOMES = (*HOME, "xhome1", "xhome2", "xhome3", "xhome4", "xhome5", "$axis_home")
AT_HOME = no_target("it is a home position")
STAYS = no_target("it stays where it is")
PRESENT = ("$pos_act", "$axis_act")
BEFORE = ("$axis_act_meas", "$axis_int", "$pos_int")  # where it was, or nearly is
SPLINE = Reason(
    Code.ENDS_ELSEWHERE,
    "a point of a spline of joint moves: how the arm goes there is not known",
)
_SOUND_STATUS = pose_encoding.MEASURED  # values of S from here on may be odd
_ALONE = ("ptp", "lin", "circ", "sptp", "slin", "scirc")
# Words of moves that are known in no spline block, in one of paths, in one of joints.
_POINTS = {
    (False, False): _ALONE,
    (True, False): ("spl", "slin", "scirc"),
    (True, True): ("sptp",),
}
PARTIAL = Reason(
    Code.PARTIAL_TARGET,
    "the target does not state all of its numbers: the others stay those of the "
    "previous target. Write all of its numbers",
)
NO_STATUS = Reason(
    Code.CONFIGURATION_UNKNOWN,
    "a PTP without S and T: the controller chooses the configuration",
)
ACCURATE = Reason(
    Code.ACCURATE_POINT,
    "S says that it was taught with the controller's own accuracy model (bit 4)",
)
NOT_BY_JOINTS = Reason(
    Code.TRAJECTORY_UNKNOWN, "the target is joint angles, and the move to it is no PTP"
)
ODD_STATUS = Reason(Code.CONFIGURATION_UNKNOWN, "S or T is no valid number")
ANGLE = Reason(
    Code.ENDS_ELSEWHERE,
    f"CA ends the arc elsewhere than at its end point: {goals.RUN_TIME}",
)


@dataclass
class KrlVisit(FoundVisit):
    """One arrival, as it is found.

    Attributes:
        move: The move.
        begin: Row of the spline block that it stands in, -1 for none.
        inner: It is a point of a spline block, but not the last one.
    """

    move: said.KrlMove = field(kw_only=True)
    begin: int = -1
    inner: bool = False

    @property
    def by_spline_planner(self) -> bool:
        """Tell whether it is a move that the spline planner makes."""
        return self.move.word.startswith("s")

    @property
    def blends(self) -> bool:
        """Tell whether it is to be passed without stopping."""
        return any(word.startswith("c_") for word in self.move.words)


def _reach(goal: FoundGoal, by_joints: bool, alone: bool) -> FoundGoal:
    """Return where a move to a point leads, as far as that is followed.

    Missing numbers are those of axes, or of X, Y, Z on a line. Where the arm stands
    does not give missing ones of A, B, C, and a joint move needs S and T.

    Args:
        goal: The point.
        by_joints: The move is a PTP.
        alone: It stands in no spline block, and is no arc.
    """
    why, target = NO_REASON, goal.target
    in_axes = target == Meaning.HOME and not math.isnan(goal.values[0])
    in_axes |= target in (Meaning.JOINTS, Meaning.PARTIAL_JOINTS)
    if in_axes and not by_joints:
        why = NOT_BY_JOINTS
    elif target in (Meaning.PARTIAL_JOINTS, Meaning.PARTIAL_POSE):
        why = NO_REASON if alone and in_axes == by_joints else PARTIAL
    elif target == Meaning.POSE and by_joints:
        why = NO_STATUS if pose_encoding.NOT_WRITTEN in goal.values[6:] else why
        why = why or (ODD_STATUS if goal.why == ODD_STATUS else NO_REASON)
    if not why:
        return goal
    if goal.slots[0] >= 0 or goal.point < 0:
        return FoundGoal(Meaning.UNKNOWN, NOTHING, name=goal.name, why=why)
    pins = goal.pins or f"{goal.name} is shifted without S and T"
    return hold_numbers(goal, goal.name, why, pins)


def motion_of(word: str) -> Motion:
    """Tell how a word moves."""
    stem = word.removesuffix("_rel").lstrip("s")
    if stem == "circ":
        return Motion.CIRCULAR
    return Motion.JOINT if stem.startswith("ptp") else Motion.LINEAR


@dataclass(frozen=True)
class KrlGoal(goals.GoalReader):
    """Reads where moves lead."""

    task: symbols.KrlTask
    dialect = pose_encoding.KRL_DIALECT
    brackets = "[]"
    places = PLACE[:3]
    shout = True
    system = "it stands in a system file, which is read and not rewritten"
    outlives = "stands in a data list: it outlives the run"
    told_apart = (6, 7)  # S and T

    # Moves.

    def visits(self, one: said.KrlMove, scope: Scope, modes: Any) -> Iterator[KrlVisit]:
        """Read the visits of a move, see `GoalReader.visits`."""
        motion, kind = motion_of(one.word), one.word.removesuffix("_rel")
        block, given = self._block, dict[str, Any]()
        in_joints = False
        if block is not None:
            one, given = self._in_block(one, block)
            begin = self.task.files[scope.file].text.statement(block.start)
            in_joints = (
                isinstance(begin, said.SplineBlock) and begin.word == "ptp_spline"
            )
        if kind not in _POINTS[block is not None, in_joints]:
            goal = not_reached(self.at(scope)._read_end(one, one.to), SPLINE)
            yield KrlVisit(scope, motion, False, goal, modes, **given, move=one)
            return
        angle = math.radians(self.task.number(one.angle, scope))
        unknown = one.angle is not None and math.isnan(angle)
        why = ANGLE if unknown else NO_REASON
        if one.via is not None:
            goal = self._read_end(one, one.via)
            yield KrlVisit(scope, motion, True, goal, modes, why=why, **given, move=one)
        goal = self._read_end(one, one.to)
        if why:
            goal = not_reached(goal, ANGLE)
        yield KrlVisit(
            scope, motion, False, goal, modes,
            why=SPLINE if in_joints else NO_REASON,
            arc_angle=angle, curved=in_joints or kind == "spl", **given, move=one,
        )  # fmt: skip

    def _read_end(self, move: said.KrlMove, operand: ir.Operand | None) -> FoundGoal:
        """Read where a move goes: on from where the arm is, or to a point.

        On an arc or in a spline block the arm is where the arc or the block begins.
        """
        by_joints = motion_of(move.word) == Motion.JOINT
        if move.word.endswith("_rel"):
            return self._read_step(operand, move)
        alone = move.via is None and self._block is None
        if alone and isinstance(operand, ir.DataObject) and operand.name in PRESENT:
            step = Meaning.BY if by_joints else Meaning.RELATIVE_UFRAME
            nowhere = (0.0,) * pose_encoding.WIDTH
            return FoundGoal(step, nowhere, name=operand.name, why=STAYS)
        return _reach(self.goal(operand), by_joints, alone)

    @property
    def _block(self) -> range | None:
        """The rows of the spline block that the move stands in."""
        blocks, row = self.task.files[self.here.file].splines, self.here.row
        at = bisect_right(blocks, row, key=lambda rows: rows.start) - 1
        return blocks[at] if at >= 0 and row in blocks[at] else None

    def _in_block(
        self, move: said.KrlMove, rows: range
    ) -> tuple[said.KrlMove, dict[str, Any]]:
        """Blend the last move of a block as its end says; say what visits share."""
        here = replace(self.here, points=NO_POINTS)
        file = self.task.files[here.file]
        inner = here.row != file.moves[np.searchsorted(file.moves, rows.stop) - 1]
        end = file.text.statement(rows.stop)
        if isinstance(end, said.SplineBlock) and not inner:
            move = replace(move, words=(*move.words, *end.words))
        shared = {"block": here.at(rows.start), "begin": rows.start, "inner": inner}
        return move, shared

    # Points.

    def goal_of(
        self,
        target: TargetSlots,
        numbers: Sequence[float | None],
        outside: Sequence[float | None],
    ) -> FoundGoal:
        """Return where numbers lead, see `GoalReader.goal_of`."""
        place = [math.nan if x is None else x for x in numbers[:6]]
        aux = self._count_outside([math.nan if x is None else x for x in outside])
        if target.joints:
            return FoundGoal(Meaning.JOINTS, (*place, 0.0, 0.0), aux=aux)
        s, t = (pose_encoding.NOT_WRITTEN if x is None else x for x in numbers[6:])
        why = self._status(s, t)
        return FoundGoal(Meaning.POSE, (*place, s, t), aux=aux, why=why)

    @staticmethod
    def are_sound(target: TargetSlots, numbers: Floats) -> Bools:
        """Tell which targets are angles, or a place with S and T that say something."""
        found = all_in_rows(np.isfinite(numbers[:, np.array(target.slots) >= 0]))
        for column, slot in enumerate(target.slots[6:], start=6):
            flags = np.where(found, numbers[:, column], -1.0)
            if slot >= 0:
                found &= (flags >= 0.0) & (flags == np.floor(flags))
                found &= flags < (_SOUND_STATUS if column == 6 else LARGEST)
        return found

    def read_special(self, operand: ir.Operand | None) -> FoundGoal | None:
        """Read home positions, where the arm is, and products of frames."""
        match operand:
            case ir.DataObject(name=name) if name in (*PRESENT, *BEFORE):
                return self.unknown(no_target(goals.RUN_TIME), name)
            case ir.DataObject(name=name) if name in HOMES:
                return self._home(operand)
            case ir.Operation(operator=":", operands=(first, second)):
                return self._product(first, second)
        return None

    def read_value(self, value: Value | None) -> FoundGoal | None:
        """Read joint angles or a position."""
        if not isinstance(value, KnownRecord) or not value.whole:
            return None
        by_axes = not value.by_name.keys().isdisjoint(symbols.AXES)
        return self._axes(value) if by_axes else self._pose(value)

    def explain_unknown(self, name: str) -> Reason:
        """Say why a name stands for no known point."""
        code, text = self.task.explain_unknown(name, self.here)
        return Reason(code, f"{name} {text}")

    def explain_pinned(self, name: str, slot: int) -> str:
        """Say why a point must keep its numbers."""
        if self.is_of_system(slot):
            numbering = self.task.numbering
            place = numbering.names[numbering.file_of(slot)]
            return f"{name} stands in {place}, which all programs share"
        if name in self.task.read:
            return f"{name} is used otherwise than as a destination too"
        return ""

    def is_followed_whole(self, held: AssignedPoint, value: Value | None) -> bool:
        """Return True unless an external axis that the cell declares is missing."""
        fields = dict(value.fields) if isinstance(value, KnownRecord) else {}
        needed = {symbols.OUTSIDE[axis - 1] for axis in self.task.start.aux}
        return held.goal is not None or needed <= fields.keys()

    def _axes(self, found: KnownRecord) -> FoundGoal:
        """Read six joint angles."""
        numbers = _numbers(found, symbols.AXES)
        if numbers is None:
            return self._partial(found, symbols.AXES, Meaning.PARTIAL_JOINTS)
        slots = goals.list_slots(numbers, pose_encoding.WIDTH)
        values = [number.value for number in numbers]
        why = NO_REASON if slots[0] >= 0 else goals.COMPUTED
        return FoundGoal(
            Meaning.JOINTS, (*values, 0.0, 0.0), slots, NO_SLOTS,
            aux=self._outside(found), why=why,
        )  # fmt: skip

    def _pose(self, found: KnownRecord) -> FoundGoal:
        """Read X, Y, Z, A, B, C with S and T."""
        numbers = _numbers(found, PLACE)
        if numbers is None:
            return self._partial(found, PLACE[:3], Meaning.PARTIAL_POSE)
        flags = [found.get(name) for name in pose_encoding.COMPONENTS[6:]]
        written = [
            f if isinstance(f, WrittenNumber) else WrittenNumber(-1.0) for f in flags
        ]
        values = [one.value for one in (*numbers, *written)]
        slots = goals.list_slots(numbers, pose_encoding.WIDTH)
        file_of = self.task.numbering.file_of
        file = file_of(slots[0])
        own = tuple(one.slot if file_of(one.slot) == file else -1 for one in written)
        aux, why = self._outside(found), self._status(values[6], values[7])
        why = why or (NO_REASON if file >= 0 else goals.COMPUTED)
        return FoundGoal(
            Meaning.POSE, tuple(values), (*slots[:6], *own), NO_SLOTS, aux=aux, why=why
        )  # fmt: skip

    def _partial(
        self, found: KnownRecord, names: Sequence[str], meaning: Meaning
    ) -> FoundGoal:
        """Read numbers of which some are missing: they stay what they were before."""
        given = {key for key, _ in found.fields}
        if not (given & {*names} and given <= {*names, *symbols.OUTSIDE}):
            return self.unknown(PARTIAL)
        values = [found.number(name) for name in names]
        values += [math.nan] * (pose_encoding.WIDTH - len(values))
        return FoundGoal(meaning, tuple(values), aux=self._outside(found), why=PARTIAL)

    def _status(self, s: float, t: float) -> Reason:
        """Say what speaks against a position's S and T."""
        if any(
            f != pose_encoding.NOT_WRITTEN and (f < 0 or whole(f) is None)
            for f in (s, t)
        ):
            return ODD_STATUS
        if s >= pose_encoding.UNKNOWN_STATUS:
            return ODD_STATUS
        return ACCURATE if s > 0 and int(s) & pose_encoding.MEASURED else NO_REASON

    def _outside(self, found: KnownRecord) -> tuple[float, ...]:
        """Return the external axes that count, see `_count_outside`."""
        return self._count_outside([found.number(name) for name in symbols.OUTSIDE])

    def _count_outside(self, values: Sequence[float]) -> tuple[float, ...]:
        """Return external axes: those that the cell declares, or that are not 0."""
        return tuple(
            value if value != 0.0 or axis in self.task.start.aux else math.nan
            for axis, value in enumerate(values, start=1)
        )

    def _home(self, operand: ir.DataObject) -> FoundGoal:
        """Read a home position: it holds no target of a process."""
        name = operand.name
        stated = name in self.task.written or self.task.place(name, self.here)
        if name in HOME and not stated:
            return FoundGoal(Meaning.HOME, NOTHING, name=name)
        goal = self.plain_goal(operand)
        if goal.target == Meaning.JOINTS:
            return FoundGoal(Meaning.HOME, goal.values, name=name)
        return replace(goal, why=goal.why or AT_HOME)

    # Products of frames: the point is moved along.

    def _product(self, first: ir.Operand, second: ir.Operand) -> FoundGoal:
        """Read ``point : {..}`` (a shift in the point's own frame) or ``{..} : point``.

        What is on the right tells what comes out: a frame has no S and T.
        """
        behind = False
        if isinstance(first, ir.DataObject):
            found = self.task.datum(first.name, self.here)
            behind = found is not None and found[1].type in symbols.POSITIONS
        point, other = (first, second) if behind else (second, first)
        if not isinstance(point, ir.DataObject):
            return self.unknown(goals.AT_RUN_TIME)
        base, value = self.plain_goal(point), self.task.value(other, self.here)
        record = value if isinstance(value, KnownRecord) else KnownRecord(())
        numbers, file_of = _numbers(record, PLACE), self.task.numbering.file_of
        written = goals.list_slots(numbers or (), pose_encoding.WIDTH)
        here = self.here.file
        own = frozenset(written[:1] if file_of(written[0]) == here else ())
        shifts = f"{base.name} is shifted by what"
        frame = FrameReader(self.task, self.here, _NO, _NO).frame(other)
        if base.target != Meaning.POSE or not frame.pose:
            return self.apply_shift(base, goals.ReadShift(own=own, shifts=shifts))
        six = [n.value for n in numbers] if numbers else six_numbers(frame)
        kind = ShiftKind.OWN if behind else ShiftKind.FRAME
        by = Shift(kind, tuple(six), base.values, flagged=not behind)
        # Numbers of data may serve other moves and sums too: they stay.
        alone = isinstance(other, said.KrlAggregate) and numbers is not None
        alone = alone and {file_of(one.slot) for one in numbers or ()} == {here}
        base = replace(base, stays=base.stays or base.slots[0] < 0)
        aux = self._outside_of(base, record) if behind else base.aux
        return self.apply_shift(base, goals.ReadShift(
            by, written if alone else NO_SLOTS, own, aux, shifts,
            f"{base.name} is turned too",
        ))  # fmt: skip

    def _outside_of(self, base: FoundGoal, other: KnownRecord) -> tuple[float, ...]:
        """Return the external axes of ``point : other``: those that stand on the right.

        A frame says nothing of them: they stay where they are, wherever the point has
        them at 0. Where the point has them elsewhere it is left like the point itself.
        """
        pairs = zip(self._outside(other), base.aux, strict=True)
        return tuple(b if math.isnan(a) and b != 0.0 else a for a, b in pairs)

    # Steps.

    def _read_step(self, operand: ir.Operand | None, move: said.KrlMove) -> FoundGoal:
        """Read ``LIN_REL {X 10}``, ``PTP_REL {A1 5}``: a step from where the arm is."""
        by_joints = motion_of(move.word) == Motion.JOINT
        found = self.task.value(operand, self.here)
        if not isinstance(operand, said.KrlAggregate) or not isinstance(
            found, KnownRecord
        ):
            return self.unknown(goals.AT_RUN_TIME)
        if not found.whole:
            return self.unknown(goals.AT_RUN_TIME)
        names = {key for key, _ in found.fields}
        values = {name: found.number(name) for name in names - {"s", "t"}}
        if by_joints and names <= {*symbols.AXES, *symbols.OUTSIDE}:
            steps = tuple(values.get(name, 0.0) for name in symbols.AXES)
            return self._step_goal(Meaning.BY, (*steps, 0.0, 0.0), values)
        place = tuple(values.get(name, 0.0) for name in PLACE[:3])
        turned = any(values.get(name, 0.0) for name in PLACE[3:])
        if by_joints or turned or move.via is not None:
            return self.unknown(no_target("a step that is not followed"))
        tool = "#tool" in move.words
        meaning = Meaning.RELATIVE_TOOL if tool else Meaning.RELATIVE_UFRAME
        return self._step_goal(meaning, (*place, *(0.0,) * 5), values)

    def _step_goal(
        self, meaning: Meaning, values: tuple[float, ...], given: dict[str, float]
    ) -> FoundGoal:
        if any(given.get(name, 0.0) for name in symbols.OUTSIDE):
            return self.unknown(no_target("it moves an external axis"))
        why = no_target("it goes on from where the arm is")
        return FoundGoal(meaning, values, why=why)


_NO = no_frame(goals.RUN_TIME)


def _numbers(found: KnownRecord, names: Sequence[str]) -> list[WrittenNumber] | None:
    """Return some components, None where one is missing."""
    values = [found.get(name) for name in names]
    numbers = [value for value in values if isinstance(value, WrittenNumber)]
    return numbers if len(numbers) == len(names) else None
