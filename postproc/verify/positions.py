"""Targets judged by Pinocchio: place, branch, singularity, swing, gravity, limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import monotonic

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.robot.arm_file import ArmFile
from postproc.verify.goals import WrittenGoals, branches_of_flags, turns_of_flags
from postproc.verify.opinion import ArmFacts, Claim, OpinionRow, compare, worst_of
from postproc.verify.pinocchio_arm import PinocchioArm

POSITION_MM, TURN_RAD, JOINT_RAD = 1e-3, 1e-5, 1e-6
SINGULAR = 1e-6  # of a Jacobian in m and rad
TORQUE = 0.01  # [N m]
OFTEN = 256  # visits, after which the clock is looked at
BORDER = 1e-4  # of a bit of the branch: nearer to its border it may be either
HALF_RAD = 1e-4  # an angle may be half a turn from its turns, and rounded
TURNING = [3, 5, 2]  # axes whose turns flags name
MM = 1e-3

NO_LINKS = "the arm file has no [links]"
NO_FORM = "the arm has no closed form: its branches have no names"

OTHER_VISITS = "points were put on the ways: source and output have other visits"
LIMIT_TEXT = "beyond a joint limit by correction"

LoadedArms = Mapping[tuple[float, ...], PinocchioArm]
"""The arm with every load: mass [kg] and centre [m]."""


@dataclass(frozen=True)
class Posture:
    """The arm at the n visits of a claim, as Pinocchio places it.

    Attributes:
        flange: (n, 4, 4) [m], NaN where no joint angles are claimed.
        points: Origins of the joints and of the flange, (n, 7, 3) [m].
        axes: Axes of the joints, (n, 6, 3).
        singular: Smallest singular value of the Jacobian, (n,).
        late: Visits for which there was no time, (n,).
    """

    flange: Floats
    points: Floats
    axes: Floats
    singular: Floats
    late: Bools


def posture_of(arm: PinocchioArm, q: Floats, until: float = np.inf) -> Posture:
    """Place the arm for joint angles (n, 6) [rad], until a time of the clock."""
    n = len(q)
    flange, points = np.full((n, 4, 4), np.nan), np.full((n, 7, 3), np.nan)
    J, late = np.full((n, 6, 6), np.nan), np.zeros(n, dtype=bool)
    rows = np.flatnonzero(~np.isnan(q).any(axis=1))
    for k, i in enumerate(rows.tolist()):
        if k % OFTEN == 0 and monotonic() > until:
            late[rows[k:]] = True
            break
        flange[i], points[i, :6], J[i] = arm.place(q[i])
    points[:, 6] = flange[:, :3, 3]
    singular = np.full(n, np.nan)
    done = rows[~late[rows]]
    moved = at_the_flange(J[done], points[done, 6]) @ arm.mix
    singular[done] = np.linalg.svd(moved, compute_uv=False)[:, -1]
    return Posture(flange, points, J[:, 3:].swapaxes(1, 2), singular, late)


def at_the_flange(J: Floats, flange: Floats) -> Floats:
    """Move Jacobians (n, 6, 6) from the base's origin to points (n, 3) [m]."""
    out = np.array(J)
    out[:, :3] += np.cross(J[:, 3:], flange[:, :, None], axis=1)
    return out


def misses(
    claim: Claim, goals: WrittenGoals, at: Posture
) -> tuple[Floats, Floats, Floats]:
    """Return how far claimed joint angles are from what is written.

    Returns:
        Of poses [m] and [rad], of joint targets [rad], (n,) each; NaN elsewhere.
    """
    tcp = at.flange @ goals.tool
    place = np.linalg.norm(tcp[:, :3, 3] - goals.tcp[:, :3, 3], axis=1)
    apart = np.linalg.norm(tcp[:, :3, :3] - goals.tcp[:, :3, :3], axis=(1, 2))
    turn = 2 * np.arcsin(np.minimum(apart / np.sqrt(8), 1.0))
    return place, turn, np.abs(claim.q - goals.joints).max(axis=1)


def confirm_angles(claim: Claim, goals: WrittenGoals, at: Posture) -> Floats:
    """Return the joint angles that are where the text says, (n, 6), NaN elsewhere."""
    place, turn, joints = misses(claim, goals, at)
    there = (place / MM <= POSITION_MM) & (turn <= TURN_RAD) | (joints <= JOINT_RAD)
    return np.where(there[:, None], claim.q, np.nan)


def judge_positions(
    claim: Claim,
    goals: WrittenGoals,
    at: Posture,
    arms: LoadedArms,
) -> list[OpinionRow]:
    """Compare targets, branches, singular values and torques of one program."""
    place, turn, joints = misses(claim, goals, at)
    poses = np.asarray(np.isnan(goals.joints).any(axis=1))
    named, late = claim.label, at.late
    rows = [
        compare(f"{named}: place", "mm", POSITION_MM, claim, place / MM, late, ~poses),
        compare(f"{named}: orientation", "rad", TURN_RAD, claim, turn, late, ~poses),
        compare(
            f"{named}: joint targets", "rad", JOINT_RAD, claim, joints, late, poses
        ),
    ]
    off = np.abs(at.singular - claim.singular)
    rows.append(compare(f"{named}: singular value", "", SINGULAR, claim, off, late))
    what = f"{named}: gravity torque"
    if len(claim.torque) < len(claim):
        lost = {NO_LINKS: len(claim)}
        rows.append(worst_of(what, "N m", TORQUE, claim, [], lost))
    else:
        off = np.full(len(claim), np.nan)
        for i in np.flatnonzero(~np.isnan(claim.q).any(axis=1) & ~late).tolist():
            arm = arms[tuple(claim.payload[i].tolist())]
            off[i] = np.abs(arm.torque(claim.q[i]) - claim.torque[i]).max()
        rows.append(compare(what, "N m", TORQUE, claim, off, late))
    return rows


def judge_branches(claim: Claim, file: ArmFile, at: Posture) -> list[OpinionRow]:
    """Compare branches and turns with what the planner and the text name."""
    rows = [_turns(claim, at)]
    if file.opw is None:
        what, lost = f"{claim.label}: branch, planner", {NO_FORM: len(claim)}
        return [*rows, worst_of(what, "", 0.0, claim, [], lost)]
    bits, sure = branch_bits(at, file)
    written = branches_of_flags(claim.visits)
    for what, slot in (("planner", claim.slot), ("flags", written)):
        named = (slot[:, None] >> np.array([2, 1, 0])) & 1
        other = ((bits != named) & sure).any(axis=1).astype(float)
        other[(slot < 0) | np.isnan(at.singular)] = np.nan
        text = f"{claim.label}: branch, {what}"
        rows.append(compare(text, "", 0.0, claim, other, at.late, slot < 0))
    return rows


def _turns(claim: Claim, at: Posture) -> OpinionRow:
    """Say how far angles are from the turns that flags of JOINT moves name."""
    turns = turns_of_flags(claim.visits)
    beyond = np.abs(claim.q[:, TURNING] - 2 * np.pi * turns) - np.pi
    unnamed = np.asarray(np.isnan(turns).all(axis=1))
    off = np.where(np.isnan(turns), 0.0, np.maximum(beyond, 0.0)).max(axis=1)
    off[unnamed] = np.nan
    what = f"{claim.label}: turns, flags"
    return compare(what, "rad", HALF_RAD, claim, off, at.late, unnamed)


def branch_bits(at: Posture, file: ArmFile) -> tuple[Ints, Bools]:
    """Tell the bits W, S, E of branches by where the joints are.

    W: on which side of the forearm's line the flange is; S: the wrist centre behind
    axis 1; E: the side of the upper arm on which the forearm is bent.

    Returns:
        The bits, and which of them are beyond a border, (n, 3) each.
    """
    assert file.opw is not None
    way = np.where(file.opw.flip_axes, -1.0, 1.0)
    origin, axis = at.points, at.axes
    shoulder, elbow, wrist = origin[:, 1], origin[:, 2], origin[:, 4]
    across = way[1] * axis[:, 1]
    ahead = np.cross(across, [0.0, 0.0, 1.0])
    fore = _unit(wrist - elbow - _along(wrist - elbow, across))
    roll = axis[:, 3] * np.sign(np.sum(axis[:, 3] * fore, axis=1))[:, None]
    hand, bend = _unit(origin[:, 6] - wrist), _unit(elbow - shoulder)
    heights = np.stack(
        [
            np.sum(np.cross(roll, hand) * axis[:, 4] * way[4], axis=1),
            np.sum((wrist - origin[:, 0]) * ahead, axis=1),
            np.sum(np.cross(bend, fore) * across, axis=1),
        ],
        axis=1,
    )
    return (heights < 0).astype(np.int64), np.abs(heights) > BORDER


def _along(vector: Floats, unit: Floats) -> Floats:
    """Return the part of vectors (n, 3) along unit vectors (n, 3)."""
    return np.asarray(np.sum(vector * unit, axis=1)[:, None] * unit)


def _unit(vector: Floats) -> Floats:
    """Scale vectors (n, 3) to length 1."""
    return np.asarray(vector / np.linalg.norm(vector, axis=1)[:, None])


def judge_motion(
    source: Claim, output: Claim, facts: ArmFacts, before: Posture, after: Posture
) -> list[OpinionRow]:
    """Judge how far a correction swings elbow and wrist centre, and joint limits."""
    own = output.own
    moved = np.linalg.norm(after.points[own] - before.points, axis=2) / MM
    late = before.late | after.late[own]
    limits = ((2, "elbow", facts.elbow), (4, "wrist centre", facts.wrist_centre))
    rows = [
        compare(f"swing of the {name}", "mm", most / MM, source, moved[:, k], late)
        for k, name, most in limits
    ]
    beyond = _beyond(output.q[own], facts.file) - _beyond(source.q, facts.file)
    over = np.maximum(beyond, 0.0)
    return [*rows, compare(LIMIT_TEXT, "rad", JOINT_RAD, source, over, late)]


def motion_not_judged(source: Claim, facts: ArmFacts) -> list[OpinionRow]:
    """Count the targets of a program of which source and output have other visits."""
    lost = {OTHER_VISITS: len(source)}
    bounds = (("swing of the elbow", "mm", facts.elbow / MM),
              ("swing of the wrist centre", "mm", facts.wrist_centre / MM),
              (LIMIT_TEXT, "rad", JOINT_RAD))  # fmt: skip
    return [
        worst_of(what, unit, bound, source, [], lost) for what, unit, bound in bounds
    ]


def _beyond(q: Floats, file: ArmFile) -> Floats:
    """Return how far joints (n, 6) [rad] are beyond their limits, (n,) [rad]."""
    low, high = np.deg2rad(file.joints.lower_deg), np.deg2rad(file.joints.upper_deg)
    return np.asarray(np.maximum(np.maximum(low - q, q - high), 0.0).max(axis=1))
