"""What moves are carried out with: many visits share few conditions."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from operator import attrgetter
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Indices, Interned, is_one_value, slim
from postproc.diagnostics import NO_REASON, Reason
from postproc.language import visits
from postproc.language.shifts import Pose, flat
from postproc.robot.pose import pose_from_record

_DTYPES: Mapping[Any, Any] = {"Floats": float, "Bools": bool, "Ints": np.int8}
P = TypeVar("P", bound=visits.VisitPart)
M = TypeVar("M", bound="ModalState")
NO_LOAD: tuple[float, ...] = (math.nan,) * 4  # one object: NaN differs from itself


def compose_poses(first: Pose, second: Pose) -> Pose:
    """Compose two poses."""
    one, other = np.array([first, second]).reshape(2, 4, 4)
    return flat(one @ other)


def cell_pose(record: Sequence[float] | None) -> Pose:
    """Take a position record [mm, deg] over from the cell."""
    return flat(pose_from_record(np.array(record, float))) if record else ()


@dataclass(frozen=True)
class TaskFrame:
    """A tool, or a base, as a program sets it.

    Attributes:
        pose: Where it is; empty where that is not known.
        why: Why targets with it cannot be compensated.
        taught: It was taught with the arm, and contains its error.
        remote: It is one of a tool that stands still, or of a part that the arm holds;
            controllers may differ in which of the two frames they take for it then.
        load: Of a tool: mass [kg] and its centre in the flange frame [mm]; empty where
            it states none, or none that is known.
    """

    pose: Pose
    why: Reason = NO_REASON
    taught: bool = False
    remote: bool = False
    load: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Zone:
    """How a target is passed without a stop: see `ZoneColumns`."""

    size_mm: float = math.nan
    overlap_percent: float = math.nan
    blend: int = visits.Blend.UNSET
    rule: int = visits.ZoneRule.UNSET


@dataclass(frozen=True, slots=True)
class Conditions:
    """What an arrival is carried out with, in neutral terms.

    Attributes:
        tool, base, uframe: Frames.
        taught: Which of them were taught with the arm, and contain its error.
        tool_remote: The tool stands still, and the arm holds the part.
        care: Whether branch and turn are checked, and turns may be far.
        nearest_turn: Joints go to the nearest turn, whatever the flags say.
        orientation_law: How the tool turns on the way.
        wrist_joint: On a line the wrist turns joint by joint.
        zone: How it is passed.
        linear: Speed along the path [m/s], NaN where not known.
        turning: Speed of turning [rad/s], likewise.
        override: Share of the programmed speed.
        load: What the program states that the arm carries: mass [kg] and its centre in
            the flange frame [m], NaN for what it does not state.
        weaves: The tool weaves on the way, or may.
    """

    tool: Pose = ()
    base: Pose = ()
    uframe: Pose = ()
    taught: tuple[bool, bool, bool] = (False, False, False)
    tool_remote: bool = False
    care: tuple[visits.Switch, visits.Switch, visits.Switch] = (
        visits.Switch.UNSET,
    ) * 3
    nearest_turn: bool = False
    orientation_law: visits.OrientationLaw = visits.OrientationLaw.UNSET
    wrist_joint: bool = False
    zone: Zone = Zone()
    linear: float = math.nan
    turning: float = math.nan
    override: float = 1.0
    load: tuple[float, ...] = NO_LOAD
    weaves: bool = False


class ConditionColumns:
    """Writes the columns that say what n visits are carried out with.

    Those of a name that conditions have are what these say.
    """

    def __init__(self, table: Interned[Conditions], rows: Indices) -> None:
        """Take the distinct conditions, and those of each visit, (n,)."""
        self._held, self._rows = [*table], rows
        self._used = np.flatnonzero(np.bincount(rows, minlength=len(self._held)))

    def part(self, part: type[P], inside: str = "", /, **other: Any) -> P:
        """Return a part of visits.

        Args:
            part: The part.
            inside: What of conditions holds its columns, with a dot.
            other: Columns and tables that conditions do not say.
        """
        own = {f.name: _DTYPES[f.type] for f in fields(part) if f.name not in other}
        for name, dtype in own.items():
            said = map(attrgetter(inside + name), self._held)
            other[name] = self._spread(np.array([*said], dtype))
        return part(**other)

    def frame(self) -> visits.FrameColumns:
        """Return the frames, each of them once."""
        poses = Interned[tuple[Pose, bool]]()
        index = np.array([_number(poses, c) for c in self._held], np.int32)
        columns = zip(("tool", "base", "uframe"), index.reshape(-1, 3).T, strict=True)
        return self.part(
            visits.FrameColumns,
            "",
            **{name: self._spread(column) for name, column in columns},
            poses=np.array([pose for pose, _ in poses], float).reshape(-1, 4, 4),
            taught=np.array([taught for _, taught in poses], bool),
        )

    def motion(self, **own: Any) -> visits.MotionColumns:
        """Return how the arm moves, with the columns that visits say themselves."""
        loads = Interned[tuple[float, ...]]([NO_LOAD])
        index = np.array([loads[c.load] for c in self._held], np.int32)
        care = np.array([c.care for c in self._held], np.int8).reshape(-1, 3)
        own |= {"load": self._spread(index), "care": self._spread(care)}
        return self.part(visits.MotionColumns, loads=np.array([*loads], float), **own)

    def _spread(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return a column of conditions; those that are used often say one value."""
        own = slim(values[self._used])
        if len(own) and (len(own) == 1 or is_one_value(own)):
            return np.broadcast_to(own[0], (len(self._rows), *values.shape[1:]))
        return values[self._rows]


def _number(poses: Interned[tuple[Pose, bool]], held: Conditions) -> list[int]:
    """Number the frames of conditions, -1 for those that are not known."""
    frames = zip((held.tool, held.base, held.uframe), held.taught, strict=True)
    return [poses[pose, taught] if pose else -1 for pose, taught in frames]


@dataclass(frozen=True, kw_only=True)
class ModalState(ABC):
    """What holds until another statement changes it; a language adds its own.

    Attributes:
        collected: Names of sets that grow where ways meet, and are never forgotten.
        blocked: Why no target can be compensated; more than one reason.
    """

    collected: ClassVar[tuple[str, ...]] = ("blocked",)
    blocked: frozenset[Reason] = frozenset()

    @abstractmethod
    def unknown_state(self: M) -> M:
        """Return it where nothing is known."""

    def with_(self: M, **changed: Any) -> M:
        """Return it with other values; itself where they are no others."""
        same = all(getattr(self, name) is value for name, value in changed.items())
        return self if same else replace(self, **changed)

    def join(self: M, other: M) -> M:
        """Keep what is the same on another way here."""
        lost = self.unknown_state()
        found = {
            f.name: getattr(lost, f.name)
            for f in fields(self)
            if getattr(self, f.name) != getattr(other, f.name)
        }
        for name in self.collected:
            found[name] = getattr(self, name) | getattr(other, name)
        return replace(self, **found)

    def forget(self: M) -> M:
        """Forget all but why targets cannot be compensated."""
        kept = {name: getattr(self, name) for name in self.collected}
        return replace(self.unknown_state(), **kept)
