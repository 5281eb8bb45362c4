"""What the analysis knows of a value, and what operators make of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from postproc.diagnostics import Code
from postproc.language.analysis.values import (
    COMPARISONS,
    WrittenNumber,
    apply_operator,
)
from postproc.robot.pose import inverse, pose_from_record, record_from_pose

FARTHEST = 1e6  # [mm] and [deg]: beyond, rounding would hide what is added
COMPONENTS = {"x": 0, "y": 1, "z": 2, "a": 3, "e": 4, "r": 5}


UNKNOWN = WrittenNumber(math.nan)  # no other NaN is a value: it equals itself alone


@dataclass(frozen=True, slots=True)
class Nothing:
    """A value that the program text does not tell, and why.

    Attributes:
        why: Ends a message.
        of: Numbers (by their index in the job) of positions that it may be.
        code: What kind of reason that is for a target.
    """

    why: str
    of: frozenset[int] = frozenset()
    code: Code = Code.RUNTIME_VALUE

    def __eq__(self, other: object) -> bool:
        """Unknown is unknown, whatever the reason."""
        return isinstance(other, Nothing) and self.of == other.of

    def __hash__(self) -> int:
        """Hash like every other unknown."""
        return hash(Nothing)


def points_of(arm: int) -> str:
    """Say why the points of another arm are not known."""
    return f"it is a point of arm {arm}, not of ours"


@dataclass(frozen=True, slots=True)
class Vector:
    """A VECTOR, [mm] where it is a place, NaN where unknown."""

    numbers: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Position:
    """A POSITION, XTNDPOS or JOINTPOS.

    Attributes:
        joints: The numbers are joint angles [deg], not x, y, z [mm], a, e, r [deg].
        parts: Six numbers.
        config: Configuration string, None where none was written.
        aux: (axis, value) of auxiliary axes, NaN where unknown; None where all are.
        name: Variable or array element, "" for an inline literal.
        taught: Marked as taught with the robot.
        shared: Another program may read it too.
        derived: Why the numbers cannot be edited, "" where they can.
    """

    joints: bool = False
    parts: tuple[WrittenNumber, ...] = (UNKNOWN,) * 6
    config: str | None = None
    aux: tuple[tuple[int, float], ...] | None = ()
    name: str = ""
    taught: bool = False
    shared: bool = False
    derived: str = ""

    @property
    def numbers(self) -> tuple[float, ...]:
        """The values of the six numbers."""
        return tuple([one.value for one in self.parts])

    @property
    def slots(self) -> tuple[int, ...]:
        """Where they are written."""
        return tuple([one.slot for one in self.parts])

    @property
    def complete(self) -> bool:
        """Tell whether all six numbers are known."""
        return not any(map(math.isnan, self.numbers))

    @property
    def editable(self) -> bool:
        """Tell whether every number stands in a text by itself."""
        alone = all(one.slot >= 0 and not one.along for one in self.parts)
        return alone and not self.derived

    def with_component(self, at: int, new: WrittenNumber) -> Position:
        """Return a copy with one component replaced."""
        return replace(self, parts=(*self.parts[:at], new, *self.parts[at + 1 :]))

    def with_aux(self, axis: int, value: float) -> Position:
        """Return a copy with one auxiliary axis set."""
        if self.aux is None:
            return self
        rest = tuple(entry for entry in self.aux if entry[0] != axis)
        return replace(self, aux=tuple(sorted((*rest, (axis, value)))))


Component = int | str | tuple[str, int] | tuple[()] | None
"""Which part of a position: of its six numbers, ``pos``, or (``aux``, i) of an axis.

() is the whole value, None a part that only the run tells.
"""


@dataclass(frozen=True, slots=True)
class Location:
    """Where a reference leads: a key and the component of the value there.

    A parameter that stands for the caller's variables holds where these are.

    Attributes:
        keys: Keys it may mean.
        exact: It means the one key, not some element of it.
        component: The part of the value there that is meant.
    """

    keys: frozenset[str]
    exact: bool
    component: Component = ()

    @property
    def key(self) -> str:
        """Return the one key."""
        return next(iter(self.keys))

    @property
    def number(self) -> int:
        """Which of the six numbers of a position is meant, -1 for anything else."""
        return self.component if isinstance(self.component, int) else -1


Value = float | bool | str | Position | Vector | Location | Nothing


def number_in(found: Value) -> float:
    """Return a number, NaN where there is none."""
    return found if isinstance(found, float) and math.isfinite(found) else math.nan


def join(a: Value, b: Value) -> Value:
    """Return what holds when one of two values holds."""
    if a is b or (type(a) is type(b) and a == b):
        return a
    if isinstance(a, Nothing):
        return add_unknown(a, b)
    if isinstance(b, Nothing):
        return add_unknown(b, a)
    if isinstance(a, Location) and isinstance(b, Location):
        return Location(a.keys | b.keys, False)
    if isinstance(a, Position) and isinstance(b, Position):
        if (a.joints, a.parts, a.config) == (b.joints, b.parts, b.config):
            return _mix(a, b)
    return add_unknown(Nothing("it may hold different values here"), a, b)


def may_be(value: Value | None) -> frozenset[int]:
    """Return the numbers of the positions that a value is, or may be."""
    if isinstance(value, Nothing):
        return value.of
    if isinstance(value, Position):
        return frozenset(slot for slot in value.slots if slot >= 0)
    return frozenset()


def add_unknown(unknown: Nothing, *others: Value | None) -> Nothing:
    """Return an unknown value that may be others too."""
    of = unknown.of
    for other in map(may_be, others):
        if not other <= of:
            of = of | other if of else other
    return unknown if of is unknown.of else replace(unknown, of=of)


def join_components(a: Value, b: Value) -> Value:
    """Return what holds when one of two values holds, of positions each number."""
    if not (isinstance(a, Position) and isinstance(b, Position)):
        return join(a, b)
    if (a.joints, a.config) != (b.joints, b.config):
        return join(a, b)
    pairs = zip(a.parts, b.parts, strict=True)
    parts = tuple([one if one == other else UNKNOWN for one, other in pairs])
    if all(math.isnan(one.value) for one in parts):
        return join(a, b)
    return _mix(replace(a, parts=parts), b)


def _mix(a: Position, b: Position) -> Position:
    """Return a position with all that is said beside the numbers of two."""
    return replace(
        a,
        aux=a.aux if a.aux == b.aux else None,
        name=a.name if a.name == b.name else min(a.name, b.name),
        taught=a.taught or b.taught,
        shared=a.shared or b.shared,
        derived=a.derived or b.derived,
    )


def compose_frames(a: Position, b: Position) -> Value:
    """Return the composition a : b of two frames."""
    if a.joints or b.joints or not (a.complete and b.complete):
        return Nothing("a frame in `:` is not known")
    pose = pose_from_record(_array(a)) @ pose_from_record(_array(b))
    why, taught = "it is composed of two frames (`:`)", a.taught or b.taught
    return _derive_position(pose, b.config, why, b.aux, taught)


def invert_frame(a: Position) -> Value:
    """Return the inverse frame (POS_INV)."""
    if a.joints or not a.complete:
        return Nothing("the argument of POS_INV is not known")
    pose = inverse(pose_from_record(_array(a)))
    return _derive_position(pose, a.config, "it is POS_INV", (), a.taught)


def shift_position(a: Position, by: Vector) -> Value:
    """Return a position moved along its reference frame's axes (POS_SHIFT)."""
    if a.joints or not a.complete or any(map(math.isnan, by.numbers)):
        return add_unknown(Nothing("an argument of POS_SHIFT is not known"), a)
    moved = [
        WrittenNumber(one.value + d, one.slot, True)
        for one, d in zip(a.parts, by.numbers, strict=False)
    ]
    if max(abs(one.value) for one in moved) > FARTHEST:
        return add_unknown(Nothing("POS_SHIFT takes it out of any reach"), a)
    why = "it is shifted by the program (POS_SHIFT)"
    return replace(a, parts=(*moved, *a.parts[3:]), derived=why)


def _array(position: Position) -> np.ndarray:
    return np.array(position.numbers)


def _derive_position(
    pose: np.ndarray,
    config: str | None,
    why: str,
    aux: tuple[tuple[int, float], ...] | None,
    taught: bool,
) -> Position:
    parts = tuple(map(WrittenNumber, record_from_pose(pose).tolist()))
    return Position(False, parts, config=config, aux=aux, derived=why, taught=taught)


# Operators on values as far as they are known.

RUN_TIME = Nothing("it is known only at run time")

_LOGICAL = ("AND", "OR", "NOT")
_NO_RESULT = Nothing("the arithmetic has no result")


def part_of(held: Value, component: Component) -> Value:
    """Return a component of a position or vector."""
    if not isinstance(held, Position | Vector):
        return held if isinstance(held, Nothing) else RUN_TIME
    number = math.nan
    match component:
        case "pos" if isinstance(held, Position):
            return replace(held, aux=())
        case ("aux", axis) if isinstance(held, Position) and held.aux is not None:
            number = dict(held.aux).get(axis, math.nan)
        case int(at) if at < len(held.numbers):
            number = held.numbers[at]
    return RUN_TIME if math.isnan(number) else number


def operate(sign: str, *parts: Value) -> Value:
    """Return what an operator makes of its operands."""
    vectors = [one.numbers for one in parts if isinstance(one, Vector)]
    match sign, parts:
        case ":", (Position() as a, Position() as b):
            return compose_frames(a, b)
        case "+" | "-", _ if len(vectors) == len(parts):
            x, y, z = (apply_operator(sign, one) for one in zip(*vectors, strict=True))
            return RUN_TIME if math.isnan(x + y + z) else Vector((x, y, z))
        case _, (str(), str()) if sign in COMPARISONS:
            return COMPARISONS[sign](*parts)  # type: ignore[arg-type]
    compares = sign in COMPARISONS
    truths = sign in _LOGICAL or (compares and isinstance(parts[0], bool))
    kind = bool if truths else float
    numbers = [float(one) if type(one) is kind else math.nan for one in parts]
    found = apply_operator(sign, numbers)
    if not math.isnan(found):
        return bool(found) if truths or compares else found
    if sign in ("/", "DIV", "MOD") and not any(map(math.isnan, numbers)):
        return _NO_RESULT
    return next((v for v in parts if isinstance(v, Nothing)), RUN_TIME)
