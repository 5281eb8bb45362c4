"""Where the numbers of a program put the flange, worked out anew."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from postproc.arrays import Bools, Floats, Ints
from postproc.language.visits import Meaning, OrientationLaw, Switch, Visits
from postproc.robot.trajectory import Motion
from postproc.verify.opinion import ArmFacts, Claim

JOINTS = (Meaning.JOINTS, Meaning.HOME, Meaning.CALIBRATION)
POSES = (Meaning.POSE, Meaning.NEAR)


@dataclass(frozen=True)
class WrittenGoals:
    """What the n visits of a program ask for, NaN where it is not said so.

    Attributes:
        tool: TCP in the flange frame, (n, 4, 4) [m].
        tcp: TCP in the arm's base frame, (n, 4, 4) [m].
        joints: Joint angles, (n, 6) [rad].
    """

    tool: Floats
    tcp: Floats
    joints: Floats


def goals_of(claim: Claim, facts: ArmFacts) -> WrittenGoals:
    """Work out base^-1 . uframe . pose, and the written joint angles."""
    v = claim.visits
    frames = np.concatenate(
        [v.frame.poses.reshape(-1, 4, 4), np.full((1, 4, 4), np.nan)]
    )
    tcp = np.full((len(v), 4, 4), np.nan)
    known = ~np.isnan(frames[v.frame.base]).any((1, 2)) & np.isin(
        v.target.meaning, POSES
    )
    known &= np.isnan(v.motion.arc_angle)
    known &= ~(v.motion.via & (v.motion.orientation_law == OrientationLaw.START_TO_END))
    rows = np.flatnonzero(known & ~np.isnan(v.target.values[:, :6]).any(axis=1))
    user = np.linalg.inv(frames[v.frame.base[rows]]) @ frames[v.frame.uframe[rows]]
    tcp[rows] = user @ _poses(v)[rows] @ _shift(v)[rows]
    return WrittenGoals(frames[v.frame.tool], tcp, _joints(v, facts))


def _poses(v: Visits) -> Floats:
    """Read the numbers of poses: position, then Euler angles or a quaternion."""
    T = np.tile(np.eye(4), (len(v), 1, 1))
    T[:, :3, 3] = v.target.values[:, :3] / 1e3
    T[:, :3, :3] = _rotations(v)
    return T


def _rotations(v: Visits) -> Floats:
    """Read orientations as the language spells them, NaN for none, (n, 3, 3)."""
    out = np.full((len(v), 3, 3), np.nan)
    width = 4 if "q1" in v.dialect.heads else 3
    numbers = v.target.values[:, 3 : 3 + width]
    rows = ~np.isnan(numbers).any(axis=1) & np.isin(v.target.meaning, POSES)
    if width == 4:
        rows &= np.linalg.norm(numbers, axis=1) > 0
    if not rows.any():
        return out
    if width == 4:
        turned = Rotation.from_quat(numbers[rows], scalar_first=True)
    else:
        axes = "ZYX" if "A" in v.dialect.heads else "ZYZ"
        turned = Rotation.from_euler(axes, numbers[rows], degrees=True)
    out[rows] = turned.as_matrix().reshape(-1, 3, 3)
    return out


def _shift(v: Visits) -> Floats:
    """Step back along the tool's z axis for targets that are to be neared."""
    T = np.tile(np.eye(4), (len(v), 1, 1))
    near = v.target.meaning == Meaning.NEAR
    T[near, 2, 3] = -v.target.distance_mm[near] / 1e3
    return T


def _joints(v: Visits, facts: ArmFacts) -> Floats:
    """Read joint angles, home and calibration pose from the cell where it is there."""
    out = np.full((len(v), 6), np.nan)
    rows = np.isin(v.target.meaning, JOINTS)
    out[rows] = np.deg2rad(v.target.values[rows, :6])
    for meaning, q in ((JOINTS[1], facts.home), (JOINTS[2], facts.calibration)):
        if q is not None:
            out[(v.target.meaning == meaning) & np.isnan(out).any(axis=1)] = q
    return out


def branches_of_flags(v: Visits) -> Ints:
    """Return the branches 4 W + 2 S + E that flags of JOINT moves name, (n,), or -1.

    On a line the flags may be overruled, and so may those that nothing checks.
    """
    slot, _ = v.dialect.flags(v.target.config, v.target.configs, v.target.values)
    return np.where(_find_checked(v), slot, -1)


def turns_of_flags(v: Visits) -> Floats:
    """Return the turns of axes 4, 6 and 3 that such flags name, (n, 3), or NaN.

    An angle is within half a turn of them.
    """
    _, turns = v.dialect.flags(v.target.config, v.target.configs, v.target.values)
    named = _find_checked(v) & ~v.motion.nearest_turn
    return np.where(named[:, None], turns, np.nan)


def _find_checked(v: Visits) -> Bools:
    """Tell where flags hold, (n,)."""
    checked = ~np.isin(v.motion.care, (Switch.OFF, Switch.UNKNOWN)).any(axis=1)
    asked = (
        v.target.config_given
        & np.isin(v.target.meaning, POSES)
        & (v.motion.kind == Motion.JOINT)
    )
    return np.asarray(asked & checked)
