"""What moves are carried out with, as a table: many visits share few conditions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from postproc.arrays import Bools, Floats, Indices, Interned, Ints, is_one_value, slim
from postproc.language import visits
from postproc.language.shifts import Pose, flat
from postproc.robot.pose import pose_from_record

NO_LOAD: tuple[float, ...] = (math.nan,) * 4  # one object: NaN differs from itself


def compose_poses(first: Pose, second: Pose) -> Pose:
    """Compose two poses."""
    one, other = np.array([first, second]).reshape(2, 4, 4)
    return flat(one @ other)


def cell_pose(record: Sequence[float] | None) -> Pose:
    """Take a position record [mm, deg] over from the cell."""
    return flat(pose_from_record(np.array(record, float))) if record else ()


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
        remote: The tool stands still, and the arm holds the part.
        care: Whether branch and turn are checked, and turns may be far.
        nearest_turn: Joints go to the nearest turn, whatever the flags say.
        law: How the tool turns on the way.
        wrist: On a line the wrist turns joint by joint.
        zone: How it is passed.
        speed: Along the path [m/s], NaN where not known.
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
    remote: bool = False
    care: tuple[visits.Switch, visits.Switch, visits.Switch] = (
        visits.Switch.UNSET,
    ) * 3
    nearest_turn: bool = False
    law: visits.OrientationLaw = visits.OrientationLaw.UNSET
    wrist: bool = False
    zone: Zone = Zone()
    speed: float = math.nan
    turning: float = math.nan
    override: float = 1.0
    load: tuple[float, ...] = NO_LOAD
    weaves: bool = False


@dataclass(frozen=True)
class VisitMotion:
    """What a visit itself says of the motion: see `MotionColumns`, (n,) each."""

    kind: Indices
    via: Bools
    fly: Bools
    arc_angle: Floats
    block: Ints
    curved: Bools


class ConditionColumns:
    """Writes the columns that say what n visits are carried out with."""

    def __init__(self, table: Interned[Conditions], rows: Indices) -> None:
        """Take the distinct conditions, and those of each visit, (n,)."""
        self._held, self._rows = [*table], rows
        self._used = np.flatnonzero(np.bincount(rows, minlength=len(self._held)))

    def frame(self) -> visits.FrameColumns:
        """Return the frames, each of them once."""
        poses = Interned[tuple[Pose, bool]]()
        index = np.array([_number(poses, c) for c in self._held], np.int32)
        tool, base, uframe = index.reshape(-1, 3).T
        return visits.FrameColumns(
            tool=self._spread(tool),
            base=self._spread(base),
            uframe=self._spread(uframe),
            poses=np.array([pose for pose, _ in poses], float).reshape(-1, 4, 4),
            taught=np.array([taught for _, taught in poses], bool),
            tool_remote=self._each(lambda c: c.remote, bool),
        )

    def motion(self, own: VisitMotion) -> visits.MotionColumns:
        """Return how the arm moves."""
        loads = Interned[tuple[float, ...]]([NO_LOAD])
        care = np.array([c.care for c in self._held], np.int8).reshape(-1, 3)
        return visits.MotionColumns(
            **{name: slim(column) for name, column in vars(own).items()},
            nearest_turn=self._each(lambda c: c.nearest_turn, bool),
            care=self._spread(care),
            wrist_joint=self._each(lambda c: c.wrist, bool),
            orientation_law=self._each(lambda c: c.law, np.int8),
            weaves=self._each(lambda c: c.weaves, bool),
            load=self._each(lambda c: loads[c.load], np.int32),
            loads=np.array([*loads], float),
        )

    def zone(self) -> visits.ZoneColumns:
        """Return how targets are passed."""
        return visits.ZoneColumns(
            size_mm=self._each(lambda c: c.zone.size_mm, float),
            overlap_percent=self._each(lambda c: c.zone.overlap_percent, float),
            blend=self._each(lambda c: c.zone.blend, np.int8),
            rule=self._each(lambda c: c.zone.rule, np.int8),
        )

    def speed(self) -> visits.SpeedColumns:
        """Return how fast the arm moves."""
        return visits.SpeedColumns(
            linear=self._each(lambda c: c.speed, float),
            turning=self._each(lambda c: c.turning, float),
            override=self._each(lambda c: c.override, float),
        )

    def _each(self, said: Callable[[Conditions], Any], dtype: DTypeLike) -> Any:
        """Return what is said of the conditions of every visit, (n,)."""
        return self._spread(np.array([said(c) for c in self._held], dtype))

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
