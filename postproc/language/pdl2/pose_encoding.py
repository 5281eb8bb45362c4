"""What the six numbers and the configuration string of a PDL2 target mean."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.language.pose_encoding import Dialect, Terms
from postproc.language.text.comment_directives import Comments
from postproc.robot.pose import angles_near, pose_from_record, rotation_from_zyz

MM_DECIMALS, DEGREE_DECIMALS, JOINT_DECIMALS = 3, 4, 5
COMMENTS = Comments("--", "'")
FLAG = re.compile(r"([SEW])|T([123])\s*:\s*([+-]?\d+)", re.IGNORECASE)

_STOPS = (
    "${} is TRUE, and the path arrives on another {} than the configuration string "
    "says: the controller stops here"
)
_MAY_STOP = (
    "${} is not known here, and the path arrives on another {} than the configuration "
    "string says"
)
TERMS = Terms(
    tool="$TOOL",
    base="$BASE",
    uframe="$UFRAME",
    tool_remote="$TOOL_RMT: the arm holds the part",
    blend=(
        "$FLY_TYPE FLY_NORM",
        "$FLY_PER {:g}",
        "$FLY_DIST {:g}",
        "$FLY_TRAJ FLY_FROM",
    ),
    corner="as $FLY_TYPE, $FLY_DIST and $FLY_PER say: it is corrected for where the "
    "path passes; to hit it, stop there (MOVE)",
    branch_stops=_STOPS.format("CNFG_CARE", "branch"),
    branch_may_stop=_MAY_STOP.format("CNFG_CARE", "branch"),
    turn_stops=_STOPS.format("TURN_CARE", "turn"),
    turn_may_stop=_MAY_STOP.format("TURN_CARE", "turn"),
    branch="the configuration string names another branch than the arm is on: whether "
    "it counts is uncertain with $CNFG_CARE {}",
    nearest="the configuration string names another turn than the nearest: which of "
    "the two counts is uncertain with $TURN_CARE {} and $JNT_MTURN {}",
    wrist="the configuration string names another branch or turn than the nearest: "
    "whether a line with $ORNT_TYPE WRIST_JNT leads there is uncertain",
    overruled="the path arrives on another branch or turn than the configuration "
    "string names: the string is kept, the path decides",
    law_unknown="$ORNT_TYPE is not known here, and with it how the tool turns along "
    "the path",
    angles="with $ORNT_TYPE {} it is uncertain how the tool turns along the path: use "
    "RS_WORLD, or turn it in smaller steps",
    arc="with $ORNT_TYPE {} it is uncertain how the tool turns along this arc: use "
    "RS_WORLD",
    laws=("", "RS_WORLD", "RS_TRAJ", "EUL_WORLD", "RPY_WORLD", "WRIST_JNT", ""),
)


@dataclass(frozen=True)
class SixNumbers(Dialect):
    """x, y, z [mm] and Euler angles a, e, r [deg], or six joint angles [deg]."""

    terms: Terms = TERMS
    heads: tuple[str, ...] = tuple("123456")  # of poses and joint angles alike
    pose_decimals: tuple[int, ...] = (MM_DECIMALS,) * 3 + (DEGREE_DECIMALS,) * 3
    joint_decimals: tuple[int, ...] = (JOINT_DECIMALS,) * 6

    def poses(self, values: Floats) -> Floats:
        """Return the poses (k, 4, 4) [m] that numbers (k, 6) say."""
        return pose_from_record(values)

    def rotations(self, written: Floats) -> Floats:
        """Return the rotations of Euler angles (k, 3) [deg]."""
        return rotation_from_zyz(written)

    def orientations(self, R: Floats, near: Floats) -> Floats:
        """Return the Euler angles of rotations next to others, (k, 3) [deg]."""
        return angles_near(near, R)

    def flags(
        self, config: Ints, configs: tuple[str, ...], values: Floats
    ) -> tuple[Ints, Floats]:
        """Read configuration strings, see `Dialect.flags`."""
        slots, turns = configurations(configs)
        return slots[config], turns[config]

    def flag_words(self, config: str, values: Floats) -> str:
        """Return the configuration string, which says them so."""
        return config


PDL2_DIALECT = SixNumbers()


def configurations(configs: tuple[str, ...]) -> tuple[Ints, Floats]:
    """Read configuration strings.

    Returns:
        Slots 4 W + 2 S + E, (k,), and turns T1, T2, T3, (k, 3), NaN where not written.

    >>> slot, turns = configurations(("S W T1:0 T2:-1",))
    >>> int(slot[0]), turns[0].tolist()
    (6, [0.0, -1.0, nan])
    """
    slots = np.zeros(len(configs), dtype=np.int64)
    turns = np.full((len(configs), 3), np.nan)
    for k, text in enumerate(configs):
        for flag, axis, turn in FLAG.findall(text):
            if flag:
                slots[k] |= {"W": 4, "S": 2, "E": 1}[flag.upper()]
            else:
                turns[k, int(axis) - 1] = int(turn)
    return slots, turns
