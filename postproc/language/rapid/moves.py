"""What a move of RAPID says: destination, tool, work object, zone and speed."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from postproc.arrays import Bools, Floats, all_in_rows
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language import ir
from postproc.language.analysis import goals
from postproc.language.analysis.assigned_points import Scope
from postproc.language.analysis.conditions import TaskFrame, compose_poses
from postproc.language.analysis.found_goals import (
    FoundGoal,
    FoundVisit,
    not_reached,
)
from postproc.language.analysis.move_blocks import TargetSlots
from postproc.language.analysis.shared_changes import describe_changes
from postproc.language.analysis.values import (
    Value,
    WrittenNumber,
    list_leaves,
    number_in,
)
from postproc.language.rapid.instructions import MOTIONS, Signature
from postproc.language.rapid.modal_state import EMPTY_HAND, Modes
from postproc.language.rapid.pose_encoding import RAPID_DIALECT, WIDTH
from postproc.language.rapid.symbols import COUNTS, SHIFTS, RapidTask
from postproc.language.shifts import IDENTITY, Pose, Shift, flat
from postproc.language.visits import Meaning
from postproc.robot.trajectory import Motion

UNUSED = 1e8  # values of external axes from here on (9E9) say that there is none
_STEM = re.compile(
    r"^(move|trigg|arcmove|arc|spotm|spot|paint|disp|cap|search|calib|nut)"
)
SHORTEST = 0.5  # length of what counts as a quaternion
PLACEHOLDER = 0.01  # [kg] masses up to here, as of tool0, state nothing
UNKNOWN_ZONE = -1.0
# Options whose moves are left.
_LEFT_BY = {
    "id": Reason(Code.COORDINATED_ARMS, "it moves together with another arm (\\ID)"),
    "corr": Reason(Code.SENSOR_GUIDED, "a sensor may correct the path (\\Corr)"),
    "track": Reason(Code.SENSOR_GUIDED, "a sensor may correct the path (\\Track)"),
}
AT_A_STOP = (
    "spotl",
    "spotj",
    "spotml",
    "spotmj",
    "calibl",
    "calibj",
)  # they weld standing still
_LOAD_UNKNOWN = Reason(Code.LOAD_UNKNOWN, "the load that \\TLoad names is not known")
_NO_QUATERNION = Reason(
    Code.UNREADABLE_NUMBER, "the four numbers of its orientation are no quaternion"
)
_NO_TOOL = Reason(
    Code.FRAME_UNKNOWN, "its tool is declared in no given file: give the file that does"
)
_SEARCH = Reason(Code.ENDS_ELSEWHERE, "a search ends at a place that is not known")
_STAYS = Reason(
    Code.ENDS_ELSEWHERE, "only external axes move: the arm stays where it is"
)
_CARRIED = Reason(
    Code.CONVEYOR, "its work object is moved by a mechanical unit (ufmec, ufprog)"
)


@dataclass
class RapidVisit(FoundVisit):
    r"""One arrival, as it is found.

    Attributes:
        tool, wobj: Its frames.
        total: What ``\TLoad`` says that the arm carries in all, as `TaskFrame.load`.
        zone_mm: Size of its zone, NaN where it stops.
        speed: Along the path [m/s], NaN where not known.
    """

    tool: TaskFrame = field(kw_only=True)
    wobj: TaskFrame = field(kw_only=True)
    zone_mm: float = field(kw_only=True)
    speed: float = field(kw_only=True)
    total: tuple[float, ...] = field(kw_only=True, default=())


WORLD = TaskFrame(IDENTITY)


@dataclass(frozen=True)
class RapidGoal(goals.GoalReader):
    """Reads where moves lead; frames by name are read once."""

    task: RapidTask
    dialect = RAPID_DIALECT
    brackets = "{}"
    places = ("trans.x", "trans.y", "trans.z")
    system = "it stands in a system module, which is read and not rewritten"

    # Moves.

    def visits(
        self, one: ir.Instruction, scope: Scope, modes: Modes
    ) -> Iterator[RapidVisit]:
        """Read the visits of a move, see `GoalReader.visits`."""
        signature = MOTIONS[one.name]
        ends = signature.operands(one.arguments)
        tool, wobj, zone, speed = self._conditions(one, ends)
        motion = _motion(one.name, signature)
        why = _SEARCH if one.name.startswith("search") else _STAYS
        why = NO_REASON if signature.reaches else why
        why = next((_LEFT_BY[a.name] for a in one.arguments if a.name in _LEFT_BY), why)
        total, untold = self._total(one)
        why = why or untold
        for via in (True, False) if signature.via >= 0 else (False,):
            goal = self.goal(ends[via])
            if goal.target == (Meaning.POSE if signature.joints else Meaning.JOINTS):
                goal = self.unknown(goals.AT_RUN_TIME, goal.name)
            if not (via or signature.reaches):
                goal = not_reached(goal, why)
            yield RapidVisit(
                scope, motion, via, goal, modes, why=why,
                tool=tool, wobj=wobj, zone_mm=zone, speed=speed, total=total,
            )  # fmt: skip

    def load(self, operand: ir.Operand | None) -> tuple[float, ...]:
        """Read mass [kg] and centre [mm] of loaddata, empty where they are not known.

        ``load0`` and other loads up to a hundredth of a kilogram are no load.
        """
        found = load_of(self.task.value(operand, self.here))
        return EMPTY_HAND if found and found[0] <= PLACEHOLDER else found

    def _total(self, one: ir.Instruction) -> tuple[tuple[float, ...], Reason]:
        r"""Read ``\TLoad``: all that the arm carries, and why that is not known."""
        given = [argument for argument in one.arguments if argument.name == "tload"]
        if not given:
            return (), NO_REASON
        found = self.load(given[0].value)
        if not found or given[0].passed_on:
            return (), _LOAD_UNKNOWN
        return (() if found == EMPTY_HAND else found), NO_REASON

    def _conditions(
        self, one: ir.Instruction, ends: Sequence[ir.Operand | None]
    ) -> tuple[TaskFrame, TaskFrame, float, float]:
        """Read tool, work object, zone [mm] and speed [m/s] of a move.

        Moves that only name them, and name the same, have the same.
        """
        own = [a for a in one.arguments if all(a.value is not e for e in ends)]
        named = all(a.value is None or self._is_fixed(a.value) for a in own)
        stops, scope, known = one.name in AT_A_STOP, self.here, self.task.conditions
        key = stops, *own, *scope.place, scope.loops, scope.given
        if named and key in known:
            return known[key]
        zone = np.nan if stops else self._zone(one.arguments)
        operand = _find_option(one.arguments, "wobj")
        wobj = WORLD if operand is None else self._frame("wobj", operand)
        operand = self._find_argument(one.arguments, "tooldata")
        tool = TaskFrame((), _NO_TOOL)
        if operand is not None:
            tool = self._frame("tool", operand)
        found = tool, wobj, zone, self._speed(one.arguments)
        if named:
            known[key] = found
        return found

    # Tools and work objects.

    def _frame(self, kind: str, operand: ir.Operand) -> TaskFrame:
        """Read a tool or a work object, by name once for each place it may mean."""
        named, scope = self.task.behind(operand, self.here)
        key, fixed = (kind, named, *scope.place), self._is_fixed(named)
        if fixed and key in self.task.frames:
            return self.task.frames[key]
        name = named.name if isinstance(named, ir.DataObject) else f"the {kind}"
        found = self.task.value(named, scope)
        read = _tool_of(found) if kind == "tool" else _wobj_of(found)
        if read is None:
            why = self.at(scope).explain_unknown(name)
            if why.code is Code.RUNTIME_VALUE:
                why = replace(why, code=Code.FRAME_UNKNOWN)
            read = TaskFrame((), why)
        else:
            taught = self.task.holds_taught(named, found, scope)
            read = replace(read, taught=taught)
        if fixed:
            self.task.frames[key] = read
        return read

    def _is_fixed(self, operand: ir.Operand | None) -> bool:
        """Return True if an operand is data by name that nothing changes."""
        match operand:
            case ir.DataObject(name=name, steps=()):
                return name not in self.task.written
        return False

    # Zones and speeds.

    def _find_argument(
        self, arguments: Sequence[ir.Argument], type_: str
    ) -> ir.Operand | None:
        """Return the only argument by place that is data of a type."""
        placed = (one.value for one in arguments if not one.name)
        found = [one for one in placed if self._type(one) == type_]
        return found[0] if len(found) == 1 else None

    def _type(self, operand: ir.Operand | None) -> str:
        operand, scope = self.task.behind(operand, self.here)
        if not isinstance(operand, ir.DataObject):
            return ""
        found = self.task.datum(operand.name, scope)
        given = self.task.controller_data(operand.name) or (None, "")
        return given[1] if found is None else found[1].type

    def _numbers(self, arguments: Sequence[ir.Argument], type_: str) -> list[float]:
        """Return the first two numbers of the only argument of a type, NaN for none."""
        found = self.task.value(self._find_argument(arguments, type_), self.here)
        return [number_in(one) for one in (*list_leaves(found), None, None)][:2]

    def _zone(self, arguments: Sequence[ir.Argument]) -> float:
        """Return the size of the zone [mm], NaN for a stop, -1 where not known."""
        if any(one.name == "inpos" for one in arguments):
            return np.nan  # stop-point data stand instead of the zone
        size = _find_option(arguments, "z")
        stops, tcp = self._numbers(arguments, "zonedata")
        if size is not None:
            own = self.task.number(size, self.here)
            return own if own >= 0.0 and stops != 1.0 else UNKNOWN_ZONE
        if np.isnan(stops + tcp):
            return UNKNOWN_ZONE
        return np.nan if stops else tcp

    def _speed(self, arguments: Sequence[ir.Argument]) -> float:
        """Return the speed along a path [m/s], NaN where it is not known."""
        own = _find_option(arguments, "v")
        if own is not None:
            return self.task.number(own, self.here) / 1000.0
        return self._numbers(arguments, "speeddata")[0] / 1000.0

    # Points.

    def read_value(self, value: Value | None) -> FoundGoal | None:
        """Take a robtarget or jointtarget apart."""
        if not isinstance(value, tuple):
            return None
        parts = [[*list_leaves(part)] for part in value]
        own = [[x for x in part if isinstance(x, WrittenNumber)] for part in parts]
        if own != parts or tuple(map(len, own)) not in COUNTS:
            return None
        numbers = [one for part in own[:-1] for one in part]
        slots = goals.list_slots(numbers, WIDTH)
        goal = self._goal_of([x.value for x in numbers], [x.value for x in own[-1]])
        why = goal.why or (NO_REASON if slots[0] >= 0 else goals.COMPUTED)
        return replace(goal, slots=slots, why=why)

    def _goal_of(self, numbers: list[float], outside: list[float]) -> FoundGoal:
        """Return where numbers and external axes lead."""
        values = numbers + [0.0] * (WIDTH - len(numbers))
        joints = len(numbers) < WIDTH
        known = joints or _is_unit(values[3:7])
        return FoundGoal(
            Meaning.JOINTS if joints else Meaning.POSE, tuple(values),
            aux=tuple(np.nan if abs(value) > UNUSED else value for value in outside),
            why=NO_REASON if known else _NO_QUATERNION,
        )  # fmt: skip

    def goal_of(
        self,
        target: TargetSlots,
        numbers: Sequence[float | None],
        outside: Sequence[float | None],
    ) -> FoundGoal:
        """Return where numbers lead, see `GoalReader.goal_of`."""
        own, axes = ([x for x in some if x is not None] for some in (numbers, outside))
        return self._goal_of(own, axes)

    @staticmethod
    def are_sound(target: TargetSlots, numbers: Floats) -> Bools:
        """Tell which targets are joint angles, or a place and a rotation."""
        known = all_in_rows(np.isfinite(numbers[:, np.array(target.slots) >= 0]))
        turned: Bools = (numbers[:, 3:7] ** 2).sum(axis=1) > SHORTEST**2
        return known if target.joints else known & turned

    def read_special(self, operand: ir.Operand | None) -> FoundGoal | None:
        """Read Offs and RelTool: the point is moved along."""
        if not isinstance(operand, ir.FunctionCall) or operand.name not in SHIFTS:
            return None
        if operand.name in self.task.routines:
            return None
        name, arguments = operand.name, operand.arguments
        by = self.task.read_shift(arguments, self.here)
        if by is None:
            return self.unknown(goals.AT_RUN_TIME)
        turns = {one.name: one.value for one in arguments}
        placed = [one.value for one in arguments if not one.name]
        base = self.goal(placed[0])
        written = [*placed[1:], *(turns.get(axis) for axis in ("rx", "ry", "rz"))]
        first = int(self.task.files[self.here.file].text.first[self.here.row])
        first += self.task.numbering.first[self.here.file]
        slots = [first + n.slot if isinstance(n, ir.Num) else -1 for n in written]
        own = frozenset(slots[:1] if slots[0] >= 0 else [])
        shifts, turned = f"{name} shifts it by what", f"{name} turns it"
        if base.target != Meaning.POSE or np.isnan(by).any():
            return self.apply_shift(base, goals.ReadShift(own=own, shifts=shifts))
        shift = Shift(SHIFTS[name], by, base.values)
        # x, y, z, and all angles that are there, must be written as numbers.
        given = [*written[:3], *(one for one in written[3:] if one is not None)]
        if not all(isinstance(one, ir.Num) for one in given):
            slots = [-1] * len(slots)
        return self.apply_shift(base, goals.ReadShift(
            shift, (*slots, *(-1,) * (WIDTH - len(slots))), own,
            shifts=shifts, turned=turned,
        ))  # fmt: skip

    def explain_unknown(self, name: str) -> Reason:
        """Say why a name stands for no known point."""
        found, code = self.task.datum(name, self.here), Code.RUNTIME_VALUE
        if name in self.here.parameters:
            text = f"is a parameter: {goals.RUN_TIME} which point it stands for"
        elif found is None:
            code = Code.UNDECLARED_VARIABLE
            text = "is declared in none of the given files, or more than once"
        elif found[1].value is None and name not in self.task.written:
            text = "has no value in the given files: teach it first"
            code = Code.NO_VALUE
        elif self.task.is_changed_beside(*found):
            code = Code.BESIDE_PROGRAM
            text = f"may be changed by another task at any time: {goals.RUN_TIME}"
        elif others := self.task.changed_elsewhere.get(name):
            text = describe_changes(others)
        elif self.task.constant(name, self.here) is None:
            text = f"may be changed by the program: {goals.RUN_TIME}"
        else:
            text = f"has an element or value that is not known: {goals.RUN_TIME}"
        return Reason(code, f"{name} {text}")

    def explain_pinned(self, name: str, slot: int) -> str:
        """Say why a point must keep its numbers."""
        if name in self.task.twins:
            return (
                f"{name} stands beside its original (o_): the controller limits how "
                "far apart they may be"
            )
        if "getdataval" in self.task.find_calls:
            return f"GetDataVal may take {name} by a name in a string"
        if self.task.is_used_beside(name, self.here):
            return f"{name} is data of another task too, which has its numbers as well"
        if name in self.task.read:
            return f"{name} is used otherwise than as a destination too"
        found = self.task.datum(name, self.here)
        if found and found[1].kind == "pers" and name in self.task.written:
            return f"{name} is persistent: it keeps what it is given beyond this run"
        return ""


def _find_option(arguments: Sequence[ir.Argument], name: str) -> ir.Operand | None:
    r"""Return the value of ``\name:=value``, None where it is not there."""
    return next((one.value for one in arguments if one.name == name), None)


@cache
def _motion(name: str, signature: Signature) -> Motion:
    """Tell how an instruction moves, by its signature and the end of its name."""
    if signature.via >= 0:
        return Motion.CIRCULAR
    if signature.joints:
        return Motion.JOINT
    stem = _STEM.sub("", name)
    return Motion.JOINT if stem.startswith("j") else Motion.LINEAR


def _is_unit(q: Sequence[float]) -> bool:
    """Tell whether four numbers say a rotation."""
    return sum(c * c for c in q) > SHORTEST**2


def pose_of(found: Value | None) -> tuple[float, ...]:
    """Return the seven numbers of a pose, nothing where it is none."""
    if not isinstance(found, tuple) or len(found) != 2:
        return ()
    parts = (part for part in found if isinstance(part, tuple))
    leaves = (one for part in parts for one in part)
    numbers = tuple(one.value for one in leaves if isinstance(one, WrittenNumber))
    return numbers if len(numbers) == 7 and _is_unit(numbers[3:]) else ()


def pose_of_numbers(numbers: Sequence[float]) -> Pose:
    """Convert the seven numbers of a pose; see `TaskFrame.pose`."""
    return flat(RAPID_DIALECT.poses(np.array([*numbers, 0.0, 0.0, 0.0, 0.0])[None]))


def _tool_of(found: Value | None) -> TaskFrame | None:
    """Read ``[robhold, [[x,y,z],[q1..q4]], [load]]``."""
    if not isinstance(found, tuple) or len(found) < 2:
        return None
    held, pose = found[0], pose_of(found[1])
    if not pose or not isinstance(held, WrittenNumber):
        return None
    load = load_of(found[2]) if len(found) > 2 else ()
    stated = load if load and load[0] > PLACEHOLDER else ()
    return TaskFrame(pose_of_numbers(pose), remote=not held.value, load=stated)


def load_of(found: Value | None) -> tuple[float, ...]:
    """Return mass [kg] and centre [mm] of ``[mass, [x,y,z], ..]``, else nothing."""
    if not isinstance(found, tuple) or len(found) < 2:
        return ()
    mass, centre = found[:2]
    if not isinstance(mass, WrittenNumber) or not isinstance(centre, tuple):
        return ()
    at = [one.value for one in centre if isinstance(one, WrittenNumber)]
    known = len(at) == 3 and mass.value >= 0.0
    return (mass.value, *at) if known else ()


def _wobj_of(found: Value | None) -> TaskFrame | None:
    """Read ``[robhold, ufprog, "ufmec", [uframe], [oframe]]``."""
    if not isinstance(found, tuple) or len(found) != 5:
        return None
    held, fixed, unit = found[:3]
    user, object_ = pose_of(found[3]), pose_of(found[4])
    if not (user and object_) or not isinstance(held, WrittenNumber):
        return None
    why = NO_REASON
    if (isinstance(unit, str) and unit.strip('"')) or not (
        isinstance(fixed, WrittenNumber) and fixed.value
    ):
        why = _CARRIED
    pose = compose_poses(pose_of_numbers(user), pose_of_numbers(object_))
    return TaskFrame(pose, why, remote=bool(held.value))
