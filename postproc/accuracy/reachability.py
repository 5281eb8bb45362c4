"""Which poses a survey may use: the tool free, the tracker in sight."""

from __future__ import annotations

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.model.kinematics import Batch
from postproc.robot.arm import Arm
from postproc.robot.state import make_states

LIMIT_MARGIN = np.deg2rad(5.0)  # every approach starts to the side of its pose
FLOOR, COLUMN = 0.15, 0.45  # [m] least height, least distance from axis 1 when low
SHOULDER = 1.0  # [m] height below which the column is in the way
FACING = np.cos(np.deg2rad(75.0))  # the beam must come from before the flange
CLEARANCE = 0.2  # [m] between the beam and the arm's links


def joint_box(arm: Arm) -> tuple[Floats, Floats]:
    """Give the joint ranges of a survey: the limits with a margin, half a turn at most.

    Returns:
        Lower and upper ends, (6,) [rad].
    """
    low = np.maximum(arm.lower + LIMIT_MARGIN, -np.pi + LIMIT_MARGIN)
    high = np.minimum(arm.upper - LIMIT_MARGIN, np.pi - LIMIT_MARGIN)
    shifted = high - low < np.minimum(arm.upper - arm.lower, 2 * np.pi) - 0.5
    low = np.where(shifted, np.maximum(arm.lower + LIMIT_MARGIN, high - 2 * np.pi), low)
    return low, high


def usable(arm: Arm, q: Floats, tool: Floats, tracker: Floats | None) -> Bools:
    """Tell which poses keep the tool free and the tracker in sight.

    Args:
        arm: The arm.
        q: Joint angles, (n, 6) [rad].
        tool: Probe points in the flange frame, (n, 3) [m].
        tracker: Tracker position in the base frame, (3,) [m], or None.
    """
    frames = arm.link_frames(q)
    tcp = Batch(arm, make_states(q, tool=tool)).walk.tcp
    aside = np.hypot(tcp[:, 0], tcp[:, 1])
    low = np.minimum(tcp[:, 2], frames[:, 6, 2, 3])
    free: Bools = (low > FLOOR) & ((aside > COLUMN) | (low > SHOULDER))
    if tracker is None:
        return free
    beam = tracker - tcp
    beam /= np.linalg.norm(beam, axis=1)[:, None]
    facing: Bools = np.einsum("ni,ni->n", frames[:, 6, :3, 2], beam) > FACING
    joints = frames[:, :6, :3, 3]  # the flange itself is next to the probe
    away = joints - tcp[:, None]
    along = np.maximum(np.einsum("nki,ni->nk", away, beam), 0.0)
    gap = np.linalg.norm(away - along[:, :, None] * beam[:, None], axis=2)
    clear: Bools = (gap[:, :5] > CLEARANCE).all(axis=1)
    return free & facing & clear
