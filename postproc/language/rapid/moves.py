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
from postproc.language.analysis.assigned_points import (
    NO_POINTS,
    AssignedPoint,
    Points,
    Scope,
)
from postproc.language.analysis.to_visits import (
    IDENTITY,
    FoundGoal,
    FoundShift,
    FoundVisit,
    Pose,
    compose_poses,
    explain_components,
    explain_disagreement,
    flat,
    hold_numbers,
    not_reached,
    spell_element,
)
from postproc.language.analysis.values import Value, WrittenNumber
from postproc.language.rapid.instructions import POINT, Signature
from postproc.language.rapid.modal_state import EMPTY_HAND, Modes
from postproc.language.rapid.pose_encoding import (
    RAPID_DIALECT,
    WIDTH,
    shift_point,
)
from postproc.language.rapid.symbols import SHIFTS, RapidTask
from postproc.language.shifts import Shift, ShiftKind
from postproc.language.visits import Meaning
from postproc.robot.trajectory import Motion

UNUSED = 1e8  # values of external axes from here on (9E9) say that there is none
NOTHING = (np.nan,) * WIDTH
NO_SLOTS = (-1,) * WIDTH
_ZONE = re.compile(r"z(\d+)$")
_SPEED = re.compile(r"v(\d+)$")
_STEM = re.compile(
    r"^(move|trigg|arcmove|arc|spotm|spot|paint|disp|cap|search|calib|nut)"
)
SHORTEST = 0.5  # length of what counts as a quaternion
Z0 = 0.3  # [mm]
PLACEHOLDER = 0.01  # [kg] masses up to here, as of tool0, state nothing
UNKNOWN_ZONE = -1.0
RUN_TIME = "it is known only when the program runs"
AT_RUN_TIME = Reason(
    Code.RUNTIME_VALUE, "the target is known only when the program runs"
)
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
_COMPUTED = Reason(Code.COMPUTED_TARGET, "the target is computed from other data")
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
_SYSTEM = "it stands in a system module, which is read and not rewritten"


@dataclass(frozen=True)
class FrameOfMove:
    """A tool or a work object.

    Attributes:
        pose: Where it is, the rows of (4, 4) [m] one after the other; empty where that
            is not known.
        held: Robhold: the arm holds it.
        why: Why targets with it cannot be compensated.
        taught: It was taught with the arm, and contains its error.
        load: Of a tool: mass [kg] and its centre in the flange frame [mm]; empty where
            the numbers are a placeholder, or not known.
    """

    pose: Pose
    held: bool
    why: Reason = NO_REASON
    taught: bool = False
    load: tuple[float, ...] = ()


@dataclass
class RapidVisit(FoundVisit):
    r"""One arrival, as it is found.

    Attributes:
        tool, wobj: Its frames.
        total: What ``\TLoad`` says that the arm carries in all, as `FrameOfMove.load`.
        zone_mm: Size of its zone, NaN where it stops.
        speed: Along the path [m/s], NaN where not known.
    """

    tool: FrameOfMove = field(kw_only=True)
    wobj: FrameOfMove = field(kw_only=True)
    zone_mm: float = field(kw_only=True)
    speed: float = field(kw_only=True)
    total: tuple[float, ...] = field(kw_only=True, default=())

    def forget_conditions(self) -> None:
        """Forget tool, work object, zone and speed."""
        why = explain_disagreement(Code.FRAME_UNKNOWN, self.taken)
        self.tool, self.wobj = FrameOfMove((), True, why), FrameOfMove((), False, why)
        self.zone_mm, self.speed, self.total = UNKNOWN_ZONE, np.nan, ()


@dataclass
class Goals:
    """Reads the arguments of moves; frames by name are read once."""

    task: RapidTask
    _frames: dict[tuple[object, ...], FrameOfMove] = field(default_factory=dict)
    _known: dict[
        tuple[int, Scope],
        tuple[ir.Instruction, tuple[FrameOfMove, FrameOfMove, float, float]],
    ] = field(default_factory=dict)
    _slots: dict[int, tuple[ir.Composite, list[int]]] = field(default_factory=dict)

    def visits(
        self,
        one: ir.Instruction,
        signature: Signature,
        row: int,
        scope: Scope,
        modes: Modes,
        points: Points = NO_POINTS,
    ) -> Iterator[RapidVisit]:
        """Read the visits of a move: the point of an arc, and its end."""
        ends = signature.operands(one.arguments)
        watched = points.watch()
        there = replace(scope, points=watched)
        tool, wobj, zone, speed = self._conditions(one, ends, row, there)
        motion = _motion(one.name, signature)
        why = _SEARCH if one.name.startswith("search") else _STAYS
        why = NO_REASON if signature.reaches else why
        why = next((_LEFT_BY[a.name] for a in one.arguments if a.name in _LEFT_BY), why)
        total, untold = self._total(one, row, there)
        why = why or untold
        if signature.via >= 0:
            goal = self._read_end(ends[1], signature, row, scope, points)
            yield RapidVisit(
                scope, row, motion, True, goal, modes, why=why,
                tool=tool, wobj=wobj, zone_mm=zone, speed=speed, total=total,
                taken=watched.given,
            )  # fmt: skip
        goal = self._read_end(ends[0], signature, row, scope, points)
        if not signature.reaches:
            goal = not_reached(goal, why)
        yield RapidVisit(
            scope, row, motion, False, goal, modes, why=why,
            tool=tool, wobj=wobj, zone_mm=zone, speed=speed, total=total,
                taken=watched.given,
        )  # fmt: skip

    def load(
        self, operand: ir.Operand | None, row: int, scope: Scope
    ) -> tuple[float, ...]:
        """Read mass [kg] and centre [mm] of loaddata, empty where they are not known.

        ``load0`` and other loads up to a hundredth of a kilogram are no load.
        """
        operand, row, scope = self.task.behind(operand, row, scope)
        if isinstance(operand, ir.DataObject) and operand.name == "load0":
            if not operand.steps and "load0" not in self.task.declared:
                return EMPTY_HAND
        found = load_of(self.task.value(operand, row, scope))
        return EMPTY_HAND if found and found[0] <= PLACEHOLDER else found

    def _total(
        self, one: ir.Instruction, row: int, scope: Scope
    ) -> tuple[tuple[float, ...], Reason]:
        r"""Read ``\TLoad``: all that the arm carries, and why that is not known."""
        given = [argument for argument in one.arguments if argument.name == "tload"]
        if not given:
            return (), NO_REASON
        found = self.load(given[0].value, row, scope)
        if not found or given[0].passed_on:
            return (), _LOAD_UNKNOWN
        return (() if found == EMPTY_HAND else found), NO_REASON

    def _conditions(
        self,
        one: ir.Instruction,
        ends: Sequence[ir.Operand | None],
        row: int,
        scope: Scope,
    ) -> tuple[FrameOfMove, FrameOfMove, float, float]:
        """Read tool, work object, zone [mm] and speed [m/s] of a move.

        Moves of one form that only name them have the same.
        """
        others = [a.value for a in one.arguments if all(a.value is not e for e in ends)]
        named = all(
            value is None or (isinstance(value, ir.DataObject) and not value.steps)
            for value in others
        ) and not any(self._is_assigned(value) for value in others)
        key = id(one), replace(scope, points=NO_POINTS)
        if named and key in self._known:
            return self._known[key][1]
        arguments = _Arguments(self.task, one.arguments, row, scope)
        zone = np.nan if one.name in AT_A_STOP else arguments.zone()
        operand = arguments.option("wobj")
        wobj = WORLD if operand is None else self._frame("wobj", operand, arguments)
        found = self._tool(arguments), wobj, zone, arguments.speed()
        if named:
            self._known[key] = one, found  # it keeps its id from being used again
        return found

    def _read_end(
        self, operand: ir.Operand | None, signature: Signature, row: int,
        scope: Scope, points: Points,
    ) -> FoundGoal:  # fmt: skip
        """Read a destination, and note what it takes of assigned points."""
        watched = points.watch()
        there = replace(scope, points=watched)
        goal = self.goal(operand, signature, row, there)
        return replace(goal, given=watched.given) if watched.given else goal

    def _read_held(self, held: AssignedPoint, signature: Signature) -> FoundGoal:
        """Read the destination that assignments gave to a point."""
        found = FoundGoal(Meaning.UNKNOWN, NOTHING)
        if held.operand is not None:
            found = self.goal(held.operand, signature, held.row, held.scope)
        why = [self._explain_pinned(p[-1], Scope(*p[:3])) for p in held.chain]
        pins = next(filter(None, (found.pins, *why)), "")
        name = spell_element(held, "{}")
        if held.components:
            return self._set_components(held, found, signature.joints, pins)
        shift = found.shift
        if shift is not None:
            shift = replace(shift, pins=shift.pins or pins)
        return replace(found, name=name, pins=pins, shift=shift)

    def _set_components(
        self, held: AssignedPoint, base: FoundGoal, joints: bool, pins: str
    ) -> FoundGoal:
        """Read a point of which components have been set by themselves."""
        name = spell_element(held, "{}")
        found = _numbers(self.task.evaluate_held(held), joints)
        why = explain_components(held, name, self.task.files, found is not None)
        if found is None:
            return hold_numbers(base, name, why, pins)
        values = [one.value for one in found[0]]
        values += [0.0] * (WIDTH - len(values))
        if not (joints or _is_unit(values[3:7])):
            return hold_numbers(base, name, _NO_QUATERNION, pins)
        meaning = Meaning.JOINTS if joints else Meaning.POSE
        return hold_numbers(base, name, why, pins, meaning, tuple(values), found[1])

    def goal(
        self,
        operand: ir.Operand | None,
        signature: Signature,
        row: int,
        scope: Scope,
    ) -> FoundGoal:
        """Read a destination, also of an assigned point.

        Numbers of system modules are to stay.
        """
        held = self.task.find_held(operand, row, scope)
        if held is not None:
            return self._read_held(held, signature)
        found = self._goal(operand, signature, row, scope)
        if found.pins or found.file < 0 or not self.task.files[found.file].is_system:
            return found
        return replace(found, pins=_SYSTEM)

    def _goal(
        self,
        operand: ir.Operand | None,
        signature: Signature,
        row: int,
        scope: Scope,
    ) -> FoundGoal:
        passed = [*self.task.find_given(operand, scope)]
        if passed:  # given to a routine, which may read it
            _, operand, row, scope = passed[-1]
        match operand:
            case ir.Composite() | ir.DataObject():
                found = self._point(operand, signature.joints, row, scope)
                names = sorted({name for name, *_ in passed})
                why = [self._explain_pinned(one, scope) for one in names]
                return replace(found, pins=next(filter(None, why), found.pins))
            case ir.FunctionCall(name=name, arguments=arguments) if (
                name in SHIFTS
                and name not in self.task.routines
                and not signature.joints
            ):
                shifted = self._read_shifted(name, arguments, row, scope)
                if not passed or shifted.shift is None:
                    return shifted
                # Its numbers stay.
                held, turned = shifted.shift.shift, "it is shifted and turned"
                pins = shifted.pins or (turned if any(held.numbers[3:]) else "")
                return replace(shifted, shift=FoundShift(held), pins=pins)
            case ir.FunctionCall():
                return self._read_returned(operand, signature, row, scope)
            case _:
                return FoundGoal(Meaning.UNKNOWN, NOTHING, why=AT_RUN_TIME)

    def _read_returned(
        self, call: ir.FunctionCall, signature: Signature, row: int, scope: Scope
    ) -> FoundGoal:
        """Read what a function of the task returns: its numbers stay."""
        returned = self.task.find_returned(call, row, scope)
        if returned is None:
            return FoundGoal(Meaning.UNKNOWN, NOTHING, why=AT_RUN_TIME)
        operand, at, there = returned
        found = self.goal(operand, signature, at, there)
        text = f"the function {call.name} returns the target"
        why = found.why or Reason(Code.COMPUTED_TARGET, text)
        return hold_numbers(
            found, "", why, found.pins or text, found.target, found.values, found.aux
        )

    def _point(
        self,
        operand: ir.Composite | ir.DataObject,
        joints: bool,
        row: int,
        scope: Scope,
    ) -> FoundGoal:
        """Read a point that is written or named."""
        name = operand.name if isinstance(operand, ir.DataObject) else ""
        if isinstance(operand, ir.Composite):
            plain = self._read_written(operand, joints, row, scope)
            if plain is not None:
                return plain
        found = _numbers(self.task.value(operand, row, scope), joints)
        if found is None:
            why = self._explain_unknown(name, scope) if name else AT_RUN_TIME
            return FoundGoal(Meaning.UNKNOWN, NOTHING, name=name, why=why)
        shown = name + self._element(operand, row, scope)
        main, aux = found
        file, slots = self._own_places(main, operand, row, scope)
        values = [number.value for number in main]
        values += [0.0] * (WIDTH - len(values))
        known = joints or _is_unit(values[3:7])
        why = NO_REASON if known else _NO_QUATERNION
        return FoundGoal(
            Meaning.JOINTS if joints else Meaning.POSE,
            tuple(values),
            file,
            slots,
            name=shown,
            aux=aux,
            why=why or (NO_REASON if file >= 0 else _COMPUTED),
            pins=self._explain_pinned(name, scope),
        )

    def _own_places(
        self,
        numbers: Sequence[WrittenNumber],
        operand: ir.Composite | ir.DataObject,
        row: int,
        scope: Scope,
    ) -> tuple[int, tuple[int, ...]]:
        """Find where numbers stand, nowhere if not all in the point's own statement.

        Other data that a point is built from may serve other points and sums too.
        """
        file, slots = _places(numbers)
        holder = scope.file
        if isinstance(operand, ir.DataObject):
            found = self.task.constant(operand.name, scope)
            holder, row = (found[0], found[1].row) if found else (-1, -1)
        if file < 0 or file != holder:
            return -1, NO_SLOTS
        first, behind = self.task.files[file].text.first[row : row + 2].tolist()
        own = all(first <= one.slot < behind for one in numbers)
        return (file, slots) if own else (-1, NO_SLOTS)

    def _read_written(
        self, operand: ir.Composite, joints: bool, row: int, scope: Scope
    ) -> FoundGoal | None:
        """Read a point whose numbers all stand in the move, None for others."""
        if id(operand) not in self._slots:
            self._slots[id(operand)] = operand, _plain_slots(operand)
        slots = self._slots[id(operand)][1]
        if len(slots) != (12 if joints else 17):
            return None
        text = self.task.files[scope.file].text
        first = int(text.first[row])
        places = [first + slot for slot in slots]
        values = text.value[places].tolist()
        count = len(slots) - 6
        main = values[:count] + [0.0] * (WIDTH - count)
        if not np.isfinite(values).all() or not (joints or _is_unit(main[3:7])):
            return None
        aux = tuple(np.nan if abs(v) > UNUSED else v for v in values[count:])
        at = tuple(places[:count] + [-1] * (WIDTH - count))
        target = Meaning.JOINTS if joints else Meaning.POSE
        return FoundGoal(target, tuple(main), scope.file, at, aux=aux)

    def _element(self, operand: ir.Operand, row: int, scope: Scope) -> str:
        """Spell which element of an array is meant, "" where it is none."""
        steps = operand.steps if isinstance(operand, ir.DataObject) else ()
        spelt = []
        for step in steps:
            if isinstance(step, str):
                spelt.append(f".{step}")
            else:
                at = (self.task.number(one, row, scope) for one in step.subscripts)
                spelt.append("{" + ",".join(f"{k:g}" for k in at) + "}")
        return "".join(spelt)

    def _explain_unknown(self, name: str, scope: Scope) -> Reason:
        """Say why a name stands for no known point."""
        found, code = self.task.datum(name, scope), Code.RUNTIME_VALUE
        if found is None:
            code = Code.UNDECLARED_VARIABLE
            text = "is declared in none of the given files, or more than once"
        elif found[1].value is None and name not in self.task.written:
            text = "has no value in the given files: teach it first"
            code = Code.NO_VALUE
        elif self.task.is_changed_beside(*found):
            code = Code.BESIDE_PROGRAM
            text = f"may be changed by another task at any time: {RUN_TIME}"
        elif self.task.constant(name, scope) is None:
            text = f"may be changed by the program: {RUN_TIME}"
        else:
            text = f"has an element or value that is not known: {RUN_TIME}"
        return Reason(code, f"{name} {text}")

    def _explain_pinned(self, name: str, scope: Scope) -> str:
        """Say why a point must keep its numbers."""
        if not name:
            return ""
        if name in self.task.twins:
            return (
                f"{name} stands beside its original (o_): the controller limits how "
                "far apart they may be"
            )
        if "getdataval" in self.task.find_calls:
            return f"GetDataVal may take {name} by a name in a string"
        if self.task.is_used_beside(name, scope):
            return f"{name} is data of another task too, which has its numbers as well"
        if name in self.task.read:
            return f"{name} is used otherwise than as a destination too"
        found = self.task.datum(name, scope)
        if found and found[1].kind == "pers" and name in self.task.written:
            return f"{name} is persistent: it keeps what it is given beyond this run"
        return ""

    def _read_shifted(
        self, name: str, arguments: Sequence[ir.Argument], row: int, scope: Scope
    ) -> FoundGoal:
        """Read Offs and RelTool: the point is moved along, the shift stays."""
        by = self.task.read_shift(arguments, row, scope)
        if by is None:
            return FoundGoal(Meaning.UNKNOWN, NOTHING, why=AT_RUN_TIME)
        (shift, angles), turns = by, {one.name: one.value for one in arguments}
        placed = [one.value for one in arguments if not one.name]
        base = self.goal(placed[0], POINT, row, scope)
        at = int(self.task.files[scope.file].text.first[row])
        x = placed[1]
        own = {(scope.file, at + x.slot)} if isinstance(x, ir.Num) else set()
        holds = base.holds | own
        if base.target != Meaning.POSE or np.isnan([*shift, *angles]).any():
            pins = base.pins or f"{name} shifts it by what {RUN_TIME}"
            return FoundGoal(
                Meaning.UNKNOWN, NOTHING, base.file, follows=base.origin,
                name=base.name, why=base.why or AT_RUN_TIME, pins=pins,
                stays=base.stays, holds=holds,
            )  # fmt: skip
        values = shift_point(np.array(base.values), name, shift, angles)
        turned = any(angles)
        if base.stays:
            return replace(base, values=values, holds=holds)
        kind = ShiftKind.AXES if name == "offs" else ShiftKind.OWN
        found = self._place_shift(
            Shift(kind, (*shift, *angles), base.values), base, [*placed[1:], *(
                turns.get(axis) for axis in ("rx", "ry", "rz")
            )], row, scope,
        )  # fmt: skip
        fixed = found.slots[0] < 0
        pins = base.pins or (f"{name} turns it" if turned and fixed else "")
        return FoundGoal(
            Meaning.POSE, values, base.file, NO_SLOTS, base.origin, base.name, base.aux,
            base.why, pins, shift=found, holds=holds if fixed else base.holds,
        )  # fmt: skip

    def _place_shift(
        self,
        shift: Shift,
        base: FoundGoal,
        numbers: Sequence[ir.Operand | None],
        row: int,
        scope: Scope,
    ) -> FoundShift:
        """Say where the numbers of a shift stand, nowhere where they must stay."""
        if base.shift is not None:
            shift = shift.around(base.shift.shift, RAPID_DIALECT)
        first = int(self.task.files[scope.file].text.first[row])
        slots = [first + n.slot if isinstance(n, ir.Num) else -1 for n in numbers]
        # x, y, z, and all angles that are there, must be written as numbers.
        written = all(isinstance(one, ir.Num) for one in numbers[:3])
        written &= all(one is None or isinstance(one, ir.Num) for one in numbers)
        if base.why or base.origin[0] < 0 or not written:
            return FoundShift(shift)
        rest = (-1,) * (WIDTH - len(slots))
        pins = _SYSTEM if self.task.files[scope.file].is_system else ""
        return FoundShift(shift, scope.file, (*slots, *rest), pins)

    # Tools and work objects.

    def _is_assigned(self, operand: ir.Operand | None) -> bool:
        """Return True if the program may give data another value on its way."""
        return isinstance(operand, ir.DataObject) and operand.name in self.task.written

    def _tool(self, arguments: _Arguments) -> FrameOfMove:
        operand = arguments.of_type("tooldata")
        if operand is None:
            return FrameOfMove((), True, _NO_TOOL)
        return self._frame("tool", operand, arguments)

    def _frame(
        self, kind: str, operand: ir.Operand, arguments: _Arguments
    ) -> FrameOfMove:
        """Read a tool or a work object, by name once for each place it may mean."""
        found, row, scope = self.task.behind(operand, arguments.row, arguments.scope)
        operand = operand if found is None else found
        arguments = replace(arguments, row=row, scope=scope)
        if isinstance(operand, ir.DataObject) and not operand.steps:
            if operand.name == f"{kind}0" and arguments.is_built_in(operand.name):
                return FLANGE if kind == "tool" else WORLD
            key = kind, operand.name, scope.file, scope.module, scope.routine
            if self._is_assigned(operand):
                return self._read_frame(kind, operand, arguments)
            if key not in self._frames:
                self._frames[key] = self._read_frame(kind, operand, arguments)
            return self._frames[key]
        return self._read_frame(kind, operand, arguments)

    def _read_frame(
        self, kind: str, operand: ir.Operand, arguments: _Arguments
    ) -> FrameOfMove:
        name = operand.name if isinstance(operand, ir.DataObject) else f"the {kind}"
        found = self.task.value(operand, arguments.row, arguments.scope)
        read = _tool_of(found) if kind == "tool" else _wobj_of(found)
        if read is None:
            why = self._explain_unknown(name, arguments.scope)
            return FrameOfMove((), kind == "tool", why)
        return replace(read, taught=self.task.is_taught(name, found))


WORLD = FrameOfMove(IDENTITY, False)
FLANGE = FrameOfMove(IDENTITY, True)


@dataclass
class _Arguments:
    """The arguments of a move.

    Attributes:
        task: The modules.
        arguments: All of them.
        row, scope: Where the move stands.
    """

    task: RapidTask
    arguments: Sequence[ir.Argument]
    row: int
    scope: Scope

    def option(self, name: str) -> ir.Operand | None:
        r"""Return the value of ``\name:=value``, None where it is not there."""
        found = (one for one in self.arguments if one.name == name)
        return next((one.value for one in found), None)

    def of_type(self, type_: str) -> ir.Operand | None:
        """Return the only argument by place that is data of a type."""
        found = [
            one.value
            for one in self.arguments
            if not one.name and self._type(one.value) == type_
        ]
        return found[0] if len(found) == 1 else None

    def _type(self, operand: ir.Operand | None) -> str:
        operand, _, scope = self.task.behind(operand, self.row, self.scope)
        if not isinstance(operand, ir.DataObject):
            return ""
        found = self.task.datum(operand.name, scope)
        if found is not None:
            return found[1].type
        if operand.name == "tool0":
            return "tooldata"
        if operand.name == "fine" or _ZONE.match(operand.name):
            return "zonedata"
        return "speeddata" if _SPEED.match(operand.name) else ""

    def _find_argument(self, type_: str) -> tuple[ir.DataObject | None, _Arguments]:
        """Return the only argument of a type, and the arguments where it stands."""
        found = self.task.behind(self.of_type(type_), self.row, self.scope)
        named = found[0] if isinstance(found[0], ir.DataObject) else None
        return named, replace(self, row=found[1], scope=found[2])

    def is_built_in(self, name: str) -> bool:
        """Tell whether a name is the controller's: no data, no parameter has it."""
        hidden = name in self.task.declared or name in self.scope.parameters
        return not hidden

    def _stops(self) -> bool:
        operand, _ = self._find_argument("zonedata")
        return operand is not None and operand.name == "fine"

    def zone(self) -> float:
        """Return the size of the zone [mm], NaN for a stop, -1 where not known."""
        if any(one.name == "inpos" for one in self.arguments):
            return np.nan  # stop-point data stand instead of the zone
        size = self.option("z")
        if size is not None:
            if self._stops():
                return UNKNOWN_ZONE
            own = self.task.number(size, self.row, self.scope)
            return own if own >= 0.0 else UNKNOWN_ZONE
        operand, there = self._find_argument("zonedata")
        if operand is None:
            return UNKNOWN_ZONE
        if operand.name == "fine":
            return np.nan
        usual = _ZONE.match(operand.name)
        if usual and there.is_built_in(operand.name):
            return float(usual[1]) or Z0
        found = self.task.value(operand, there.row, there.scope)
        if isinstance(found, tuple) and len(found) >= 2:
            stops, tcp = found[:2]
            if isinstance(stops, WrittenNumber) and isinstance(tcp, WrittenNumber):
                return np.nan if stops.value else tcp.value
        return UNKNOWN_ZONE

    def speed(self) -> float:
        """Return the speed along a path [m/s], NaN where it is not known."""
        own = self.option("v")
        if own is not None:
            return self.task.number(own, self.row, self.scope) / 1000.0
        operand, there = self._find_argument("speeddata")
        if operand is None:
            return np.nan
        usual = _SPEED.match(operand.name)
        if usual and there.is_built_in(operand.name):
            return float(usual[1]) / 1000.0
        found = self.task.value(operand, there.row, there.scope)
        if isinstance(found, tuple) and found and isinstance(found[0], WrittenNumber):
            return found[0].value / 1000.0
        return np.nan


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


def are_targets(numbers: Floats) -> Bools:
    """Tell which x, y, z, q1 to q4, (m, 7), are a place and a rotation, (m,)."""
    turned: Bools = (numbers[:, 3:] ** 2).sum(axis=1) > SHORTEST**2
    return turned & all_in_rows(np.isfinite(numbers))


def own_numbers(one: ir.Instruction) -> list[int] | None:
    """Return which numbers of ``MoveL [[..], ..], ..`` are its place and rotation.

    None for other instructions, and where anything else is more than a name or number.
    """
    if one.name != "movel" or not one.arguments:
        return None
    to, *others = (argument.value for argument in one.arguments)
    simple = (
        value is None
        or isinstance(value, ir.Num)
        or (isinstance(value, ir.DataObject) and not value.steps)
        for value in others
    )
    if not isinstance(to, ir.Composite) or not all(simple):
        return None
    slots = _plain_slots(to)
    return slots[:7] if len(slots) == 17 else None


_COUNTS = (3, 4, 4, 6), (6, 6)  # numbers of a robtarget and of a jointtarget


def _plain_slots(operand: ir.Composite) -> list[int]:
    """Return the slots of ``[[1, 2, ..], ..]`` of a target, nothing for all else."""
    parts = [part.items for part in operand.items if isinstance(part, ir.Composite)]
    if tuple(map(len, parts)) not in _COUNTS or len(parts) != len(operand.items):
        return []
    leaves = [leaf for part in parts for leaf in part]
    slots = [leaf.slot for leaf in leaves if isinstance(leaf, ir.Num)]
    return slots if len(slots) == len(leaves) else []


def _numbers(
    found: Value | None, joints: bool
) -> tuple[list[WrittenNumber], tuple[float, ...]] | None:
    """Take a robtarget or jointtarget apart: its numbers, and the external axes."""
    counts = (6, 6) if joints else (3, 4, 4, 6)
    if not isinstance(found, tuple) or len(found) != len(counts):
        return None
    parts: list[list[WrittenNumber]] = []
    for part, count in zip(found, counts, strict=True):
        if not isinstance(part, tuple) or len(part) != count:
            return None
        own = [one for one in part if isinstance(one, WrittenNumber)]
        if len(own) != count or any(one.value != one.value for one in own):
            return None
        parts.append(own)
    last = (one.value for one in parts[-1])
    outside = tuple(np.nan if abs(value) > UNUSED else value for value in last)
    return [one for part in parts[:-1] for one in part], outside


def _places(numbers: Sequence[WrittenNumber]) -> tuple[int, tuple[int, ...]]:
    """Return the file of numbers and their places, -1 where one is computed."""
    files = {one.file if one.slot >= 0 else -1 for one in numbers}
    if len(files) != 1 or -1 in files:
        return -1, NO_SLOTS
    slots = [one.slot for one in numbers]
    return files.pop(), tuple(slots + [-1] * (WIDTH - len(slots)))


def _pose_numbers(found: Value | None) -> list[float] | None:
    """Return the seven numbers of a pose, None where it is none."""
    if not isinstance(found, tuple) or len(found) != 2:
        return None
    numbers = [
        one.value
        for part in found
        if isinstance(part, tuple)
        for one in part
        if isinstance(one, WrittenNumber)
    ]
    return numbers if len(numbers) == 7 and _is_unit(numbers[3:]) else None


def pose_of(found: Value | None) -> tuple[float, ...]:
    """Return the seven numbers of a pose, nothing where it is none."""
    return tuple(_pose_numbers(found) or ())


def pose_of_numbers(numbers: Sequence[float]) -> Pose:
    """Convert the seven numbers of a pose; see `FrameOfMove.pose`."""
    return flat(RAPID_DIALECT.poses(np.array([*numbers, 0.0, 0.0, 0.0, 0.0])[None]))


def _tool_of(found: Value | None) -> FrameOfMove | None:
    """Read ``[robhold, [[x,y,z],[q1..q4]], [load]]``."""
    if not isinstance(found, tuple) or len(found) < 2:
        return None
    held, pose = found[0], _pose_numbers(found[1])
    if pose is None or not isinstance(held, WrittenNumber):
        return None
    load = load_of(found[2]) if len(found) > 2 else ()
    stated = load if load and load[0] > PLACEHOLDER else ()
    return FrameOfMove(pose_of_numbers(pose), bool(held.value), load=stated)


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


def _wobj_of(found: Value | None) -> FrameOfMove | None:
    """Read ``[robhold, ufprog, "ufmec", [uframe], [oframe]]``."""
    if not isinstance(found, tuple) or len(found) != 5:
        return None
    held, fixed, unit = found[:3]
    user, object_ = _pose_numbers(found[3]), _pose_numbers(found[4])
    if user is None or object_ is None or not isinstance(held, WrittenNumber):
        return None
    why = NO_REASON
    if (isinstance(unit, str) and unit.strip('"')) or not (
        isinstance(fixed, WrittenNumber) and fixed.value
    ):
        why = _CARRIED
    pose = compose_poses(pose_of_numbers(user), pose_of_numbers(object_))
    return FrameOfMove(pose, bool(held.value), why)
