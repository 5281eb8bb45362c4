"""Visits: every arrival at a target, and the literals that hold the numbers.

What a language hands to everything else; nothing after it knows how a program is spelt.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Floats, Ints, read_only

START = -1  # predecessor: wherever the arm stands when the program starts
NO_VALUE = "it has no value in the program or its variable file"  # ends a reason
NO_TARGET = "the move holds no target of its own"  # begins such a visit's reason
ELSEWHERE = -2  # predecessor: a place that the program text does not tell


class Meaning(IntEnum):
    """What the six numbers of a visit mean."""

    POSE = 0  # x, y, z [mm], a, e, r [deg] of the tool in the user frame
    JOINTS = 1  # controller joint angles [deg]
    HOME = 2  # $HOME: the numbers are in the cell file
    CALIBRATION = 3  # $CAL_SYS
    RELATIVE_TOOL = 4  # x, y, z [mm] from where the arm is, in the tool frame
    RELATIVE_BASE = 5  # .. in the base frame
    RELATIVE_UFRAME = 6  # .. in the user frame
    AWAY = 7  # x: distance [mm] back along the tool's approach vector
    NEAR = 8  # numbers of the pose as POSE, `distance_mm` short of it along approach
    ABOUT = 9  # x, y, z: axis, a: angle [deg], e: frame (4, 5 or 6 as above)
    BY = 10  # joint increments [deg]
    FOR = 11  # numbers of the pose as POSE, gone towards for `distance_mm`
    UNKNOWN = 99  # the arm moves, the program text does not tell where to


class Switch(IntEnum):
    """A setting that is TRUE or FALSE, as far as the program tells."""

    UNSET = 0
    ON = 1
    OFF = 2
    UNKNOWN = 3  # it is set, to what only the run tells


class FlyType(IntEnum):
    """$FLY_TYPE."""

    UNSET = 0
    FLY_NORM = 1
    FLY_CART = 2


class OrntType(IntEnum):
    """$ORNT_TYPE: how the tool turns on its way along a line or an arc."""

    UNSET = 0
    RS_WORLD = 1
    RS_TRAJ = 2
    EUL_WORLD = 3
    RPY_WORLD = 4
    WRIST_JNT = 5
    UNKNOWN = 6  # it is set, to what only the run tells


class FlyTrajectory(IntEnum):
    """$FLY_TRAJ."""

    UNSET = 0
    FLY_AUTO = 1
    FLY_PASS = 2
    FLY_TOL = 3
    FLY_FROM = 4


def slim(column: NDArray[Any]) -> NDArray[Any]:
    """Keep a column that holds one value throughout as that value alone.

    >>> slim(np.zeros(1000)).strides
    (0,)
    """
    if not len(column):
        return column
    first = column[0]
    same = column == first
    if column.dtype.kind == "f":
        same |= np.isnan(column) & np.isnan(first)
    return np.broadcast_to(first, column.shape) if same.all() else column


@dataclass(frozen=True)
class Literals:
    """m places in the text that hold the numbers of a target.

    Attributes:
        file: Index into `Visits.files`, (m,).
        line: 1-based line of the first number, (m,).
        start, end: Byte offsets of each number in its file, (m, 6); -1 where the
            component is not written as a number.
        joints: True where the numbers are joint angles, (m,).
        name: Variable or array element, or "" for an inline literal; m strings.
        shared: True where another program may read it too (exported), (m,).
        taught: True where the point was taught with the robot, (m,).
        pinned: What else depends on the numbers, so that they must stay as they are, or
            ""; m strings.
    """

    file: Ints
    line: Ints
    start: Ints
    end: Ints
    joints: Bools
    name: tuple[str, ...]
    shared: Bools
    taught: Bools
    pinned: tuple[str, ...]

    def __len__(self) -> int:
        """Return the number of literals."""
        return len(self.file)

    @cached_property
    def pins(self) -> dict[str, Ints]:
        """The literals (k,) by what pins them; free ones are not there."""
        found: dict[str, list[int]] = {}
        for row, why in enumerate(self.pinned):
            if why:
                found.setdefault(why, []).append(row)
        return {why: np.array(found[why]) for why in sorted(found)}


@dataclass(frozen=True)
class Visits:
    """n arrivals in program order (structure of arrays).

    A CIRCULAR move makes two visits: its VIA point (`via` True), then its end, whose
    predecessor is the VIA visit. Moves that hold no target are visits too, because they
    turn the joints; their `literal` is -1.

    Attributes:
        files: Names of the files; index 0 is the program itself.
        file, line: Where the move statement stands, (n,), line 1-based.
        motion: `Motion`, (n,).
        target: `Meaning`, (n,).
        via: True at the VIA point of an arc, (n,).
        values: The six numbers, (n, 6), NaN where not known.
        distance_mm: For NEAR and FOR, (n,).
        aux: Auxiliary axis values, (n, k), NaN where there is none.
        config: Index into `configs`, (n,).
        configs: Configuration strings verbatim; "" where none was written.
        config_given: True where a configuration string was written, (n,).
        literal: Index into `literals`, (n,), -1 where no number may be edited.
        follows: Literal that a computed target moves along with (its numbers are those
            of the literal plus constants), (n,), -1 where there is none.
        name: Index into `names`, (n,); names[0] is "" (inline literal).
        tool, base, uframe: Index into `frames`, (n,), -1 where not known.
        frames: Position records (k, 6) [mm, deg].
        frame_taught: True where the text marks the frame as taught, (k,).
        tool_remote: $TOOL_RMT is TRUE: the arm holds the part, (n,).
        nearest_turn: $JNT_MTURN is FALSE, (n,).
        care: $CNFG_CARE, $TURN_CARE and $JNT_MTURN as `Switch`, (n, 3).
        fly: True for MOVEFLY, (n,).
        fly_dist_mm: $FLY_DIST, (n,), NaN where unset; negative: off.
        fly_per: $FLY_PER [%], (n,), NaN where unset.
        fly_type, fly_traj: `FlyType` and `FlyTrajectory`, (n,).
        lin_spd: $LIN_SPD [m/s], (n,), NaN where unset.
        rot_spd: $ROT_SPD [rad/s], (n,), NaN where unset.
        override: Product of the speed overrides that hold, (n,) in (0, 1].
        wrist_joint: $ORNT_TYPE is WRIST_JNT, (n,).
        ornt_type: `OrntType`, (n,).
        reason: Index into `reasons`, (n,); 0 means that the visit may be compensated.
        reasons: Why a visit is display only; reasons[0] is "".
        pred_start: Offsets into `pred`, (n + 1,).
        pred: Predecessor visits; START or ELSEWHERE where it is no visit.
        measure_id: Ids of `-- MEASURE <id>` comments, n strings or "" where none.
        literals: The places in the text.
    """

    files: tuple[str, ...]
    file: Ints
    line: Ints
    motion: Ints
    target: Ints
    via: Bools
    values: Floats
    distance_mm: Floats
    aux: Floats
    config: Ints
    configs: tuple[str, ...]
    config_given: Bools
    literal: Ints
    follows: Ints
    name: Ints
    names: tuple[str, ...]
    tool: Ints
    base: Ints
    uframe: Ints
    frames: Floats
    frame_taught: Bools
    tool_remote: Bools
    nearest_turn: Bools
    care: Ints
    fly: Bools
    fly_dist_mm: Floats
    fly_per: Floats
    fly_type: Ints
    fly_traj: Ints
    lin_spd: Floats
    rot_spd: Floats
    override: Floats
    wrist_joint: Bools
    ornt_type: Ints
    reason: Ints
    reasons: tuple[str, ...]
    pred_start: Ints
    pred: Ints
    measure_id: tuple[str, ...]
    literals: Literals

    def __post_init__(self) -> None:
        read_only(self)

    def __len__(self) -> int:
        """Return the number of visits."""
        return len(self.line)

    def predecessors(self, visit: int) -> Ints:
        """Return the possible predecessors of a visit."""
        return self.pred[self.pred_start[visit] : self.pred_start[visit + 1]]

    @cached_property
    def before(self) -> Ints:
        """The only visit that leads to each, (n,), -1 where none or several do."""
        if len(self) == 0:
            return np.empty(0, dtype=np.int64)
        single = np.diff(self.pred_start) == 1
        first = self.pred[np.minimum(self.pred_start[:-1], len(self.pred) - 1)]
        return np.where(single & (first >= 0), first, -1)

    @cached_property
    def run_mates(self) -> Ints:
        """The visit before in the same fly run, (n,), -1 where there is none."""
        before = self.before
        return np.where((before >= 0) & self.fly[before], before, -1)


def line_ranges(lines: Ints | Sequence[int]) -> str:
    """Name every one of some lines, ascending, those that follow each other as one.

    >>> line_ranges([2, 5, 6, 7, 7, 9])
    '2, 5-7, 9'
    """
    found = np.unique(np.asarray(lines, dtype=np.int64))
    first = np.flatnonzero(np.diff(found, prepend=-1) != 1)
    last = np.append(first[1:], len(found)) - 1
    pairs = zip(found[first].tolist(), found[last].tolist(), strict=True)
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in pairs)


# What a user's program can contain is no exception: it is collected and reported.


@dataclass(frozen=True, order=True)
class Diagnostic:
    """One finding about a program.

    Attributes:
        file: File name the line belongs to.
        line: 1-based line.
        code: Short stable name, for instance ``unknown-statement``.
        message: What was found, what it means and what the user can do.
    """

    file: str
    line: int
    code: str
    message: str


def told_once(found: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Join findings that say the same of the same line, and say how often.

    A line that is reached several times, in a routine or a loop, gives one for every
    visit.

    >>> told_once([Diagnostic("a.pdl", 1, "x", "odd")] * 3)[0].message
    'odd (3 times)'
    """
    return tuple(
        one if times == 1 else replace(one, message=f"{one.message} ({times} times)")
        for one, times in Counter(found).items()
    )
