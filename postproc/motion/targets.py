"""What a plan is made from: where every move goes, in the arm's base frame."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from enum import IntEnum
from functools import cached_property

import numpy as np

from postproc.arrays import Bools, Floats, Ints, read_only, slim, take_rows
from postproc.diagnostics import NO_REASON, Code, Reason


class Fly(IntEnum):
    """How a fly point is rounded."""

    OVERLAP = 0  # two moves overlap in time ($FLY_TYPE FLY_NORM)
    FROM = 1  # the zone begins at a distance (FLY_CART with FLY_FROM or nothing said)
    WITHIN = 2  # the path passes within a distance (FLY_TOL)
    EXACT = 3  # the path passes through the point (FLY_PASS, negative $FLY_DIST)
    UNKNOWN = 4  # the arm stops there, or passes it in a way that is not known


class TargetKind(IntEnum):
    """What a target tells."""

    POSE = 0  # the TCP's pose in the base frame
    JOINTS = 1  # the joint angles
    TOOL_STEP = 2  # `tcp` is a motion in the tool frame of where the arm is
    BASE_STEP = 3  # `tcp` is a turn and a shift of the TCP along the base frame's axes
    JOINT_STEP = 4  # `joints` are added to where the arm is
    UNKNOWN = 5  # the arm goes where nobody knows
    TOWARDS = 6  # `tcp` is a pose that the arm goes `distance` towards on a line
    PARTIAL_POSE = 7  # `tcp` is axes and places along them; what is NaN there stays
    PARTIAL_JOINTS = 8  # `joints`; what is NaN there stays


OF_THE_FLOW = ("from_nowhere", "one_after_another")  # what moving targets leaves as is


@dataclass(frozen=True)
class Targets:
    """n moves in program order (structure of arrays), SI units.

    A CIRCULAR move makes two: the point on the way (`via`), then the end.

    Attributes:
        move: `Motion`, (n,).
        kind: `TargetKind`, (n,).
        via: True at the point on the way of an arc, (n,).
        tcp: Wanted TCP pose in the base frame, a step, or axes of it and places along
            them, (n, 4, 4); else NaN.
        distance: Of TOWARDS, (n,) [m]; else NaN.
        joints: Controller joint angles, or a step, (n, 6) [rad]; else NaN.
        tool: TCP in the flange frame, (n, 4, 4); NaN where not known.
        slot: Branch 4 W + 2 S + E of the configuration string, (n,); -1 without one.
        turns: Turns T1, T2, T3 of axes 4, 6 and 3 in the string, (n, 3); NaN where not
            written.
        nearest_turn: The turn nearest to where the arm is, whatever the string says.
        fly: The arm does not stop here, (n,).
        rounding: `Fly`, (n,), for Cartesian moves; other corners overlap or are exact.
        fly_distance: Of FROM and WITHIN, (n,) [m].
        overlap: Part of the braking time that the next move overlaps, (n,), 0 to 1.
        linear_speed: Programmed TCP speed [m/s], (n,); NaN where not known.
        rotary_speed: Programmed speed of reorientation [rad/s], (n,); NaN likewise.
        override: Product of the speed overrides, (n,) in (0, 1].
        wrist_joint: The wrist axes are interpolated instead of the orientation, (n,).
        block: Equal for the points of one curve, (n,), -1 beside curves.
        curved: The way to it is bent so that a curve goes on smoothly, (n,).
        along: The tool turns on the way in a way that is not known, as along an arc,
            (n,).
        past_start: A point of an arc that goes all around, and ends between its start
            and the point on its way, (n,).
        stops: There the controller stops, or may, because of flags that the path
            contradicts: who goes on begins anywhere, (n,).
        pred_start: Predecessors of move v are pred[pred_start[v] : pred_start[v + 1]].
        pred: Predecessors; negative for a place that is not known.
    """

    move: Ints
    kind: Ints
    via: Bools
    tcp: Floats
    distance: Floats
    joints: Floats
    tool: Floats
    slot: Ints
    turns: Floats
    nearest_turn: Bools
    fly: Bools
    rounding: Ints
    fly_distance: Floats
    overlap: Floats
    linear_speed: Floats
    rotary_speed: Floats
    override: Floats
    wrist_joint: Bools
    block: Ints
    curved: Bools
    along: Bools
    past_start: Bools
    stops: Bools
    pred_start: Ints
    pred: Ints

    def __post_init__(self) -> None:
        read_only(self)

    def __len__(self) -> int:
        """Return the number of moves."""
        return len(self.move)

    def slim(self) -> Targets:
        """Return the same, columns with one value throughout as that value alone."""
        own = [f.name for f in fields(self)[:-2] if f.name != "tcp"]
        return replace(self, **{name: slim(getattr(self, name)) for name in own})

    def part(self, rows: Ints, pred_start: Ints, pred: Ints) -> Targets:
        """Return some of the moves, with predecessors among themselves.

        Args:
            rows: Which moves, (m,).
            pred_start: As in the class, (m + 1,).
            pred: Their predecessors, counted among the rows.
        """
        own = {
            f.name: take_rows(getattr(self, f.name), rows) for f in fields(self)[:-2]
        }
        return Targets(**own, pred_start=pred_start, pred=pred)

    @cached_property
    def from_nowhere(self) -> Bools:
        """Which are reached from unknown places alone, (n,)."""
        known = np.append(0, np.cumsum(self.pred >= 0))
        return np.asarray(known[self.pred_start[1:]] == known[self.pred_start[:-1]])

    @cached_property
    def one_after_another(self) -> Bools:
        """Which have the one before as the only predecessor, alone, (n,)."""
        n = len(self)
        single = np.flatnonzero(np.diff(self.pred_start) == 1)
        out = np.zeros(n, dtype=bool)
        out[single] = self.pred[self.pred_start[single]] == single - 1
        out[:1] = False
        ways = np.bincount(self.pred[self.pred >= 0], minlength=n)
        out[1:] &= ways[:-1] == 1
        return out

    def move_to(self, rows: Ints, tcp: Floats, joints: Floats) -> Targets:
        """Return a copy of which some targets lie elsewhere.

        Args:
            rows: Which, (m,).
            tcp: As in the class, (m, 4, 4).
            joints: As in the class, (m, 6).
        """
        poses, angles = np.array(self.tcp), self.joints
        poses[rows] = tcp
        if not np.array_equal(joints, take_rows(angles, rows), equal_nan=True):
            angles = np.array(angles)
            angles[rows] = joints
        moved = replace(self, tcp=poses, joints=angles)
        vars(moved).update({k: v for k, v in vars(self).items() if k in OF_THE_FLOW})
        return moved


# Why a planned move must not be compensated.

REACHED = NO_REASON
NO_TARGET = Reason(Code.RUNTIME_VALUE, "where this move goes is not known")
OUT_OF_REACH = Reason(
    Code.OUT_OF_REACH, "out of reach: check the target, its tool and its frames"
)
NO_BRANCH = Reason(
    Code.CONFIGURATION_UNKNOWN,
    "no solution for the configuration string: check its flags",
)
NO_START = Reason(
    Code.CONFIGURATION_UNKNOWN,
    "the branch is not known: the target has no configuration flags, and the place "
    "before it is not known. Write a joint target before it",
)
PATH_REACH = Reason(
    Code.SINGULAR_PATH,
    "the path to it leaves the reach: add a point between, or use JOINT",
)
PATH_JUMP = Reason(
    Code.SINGULAR_PATH,
    "the path to it passes through a singularity: lead it round, or use JOINT",
)
NO_CIRCLE = Reason(
    Code.ARC_UNDETERMINED,
    "the three points of the arc lie on one line, or two of them are one: move VIA, "
    "or use LINEAR",
)
ARC_END = Reason(Code.ARC_UNDETERMINED, "where the arc through it ends is not known")
AMBIGUOUS = Reason(
    Code.CONFIGURATION_UNKNOWN, "its predecessors lead to different joint angles"
)
OTHER_BRANCH = Reason(
    Code.CONFIGURATION_UNKNOWN,
    "the path to it arrives on another branch or turn than its joint angles",
)
LIMITS = tuple(
    Reason(
        Code.TARGET_BEYOND_LIMIT,
        f"axis {j} would be beyond its limit: check the target and its turns",
    )
    for j in range(1, 7)
)
PATH_LIMITS = tuple(
    Reason(
        Code.TARGET_BEYOND_LIMIT,
        f"axis {j} would be beyond its limit on the way to it: lead the path elsewhere",
    )
    for j in range(1, 7)
)
WRIST = Reason(
    Code.SINGULAR_WRIST,
    "at the wrist singularity: turn the tool, or lower wrist_deg in the cell",
)

REASONS = (
    REACHED, NO_TARGET, OUT_OF_REACH, NO_BRANCH, NO_START, PATH_REACH, PATH_JUMP,
    NO_CIRCLE, ARC_END, AMBIGUOUS, OTHER_BRANCH, *LIMITS, *PATH_LIMITS, WRIST,
)  # fmt: skip
CODE = {reason: number for number, reason in enumerate(REASONS)}

# Where the controller stops with an error: where the arm stands then nobody knows.
_STRANDS = (
    OUT_OF_REACH, NO_BRANCH, PATH_REACH, PATH_JUMP, NO_CIRCLE, OTHER_BRANCH, *LIMITS,
    *PATH_LIMITS,
)  # fmt: skip
STRANDS = np.isin(np.arange(len(REASONS)), [CODE[reason] for reason in _STRANDS])
