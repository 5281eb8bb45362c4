"""An arm file judged by Pinocchio's own reading of the URDF that it was made from."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic

import numpy as np

from postproc.arrays import Floats
from postproc.exceptions import PostprocError
from postproc.robot.arm_file import ArmFile
from postproc.verify.opinion import Opinion, OpinionRow
from postproc.verify.pinocchio_arm import PinocchioUrdf, serial
from postproc.verify.positions import JOINT_RAD, MM, POSITION_MM, TORQUE, TURN_RAD

COUNT = 1000  # joint angles that are drawn
KILOGRAM = 1e-5  # an arm file has masses to 1e-6 kg
QUARTER, NEARLY = math.pi / 2, 1e-3  # [rad] so near to a quarter turn it is meant
SAME = 1e-12  # [rad]
ENDLESS = "continuous joints: the URDF states no range"
RPY = re.compile(r"""(\brpy\s*=\s*)(["'])(.*?)\2""", re.DOTALL)


@dataclass(frozen=True)
class UrdfChainNames:
    """Which part of a URDF is the arm.

    Attributes:
        text: Of the file.
        base, tip: Links at its ends.
        joints: Names of its six joints, base to tip.
    """

    text: str
    base: str
    tip: str
    joints: tuple[str, ...]

    def read(self, whole_turns: bool) -> PinocchioUrdf:
        """Let Pinocchio read it, rounded quarter turns (1.57) taken as whole or not.

        Raises:
            PostprocError: It cannot.
        """
        text = with_whole_turns(self.text) if whole_turns else self.text
        try:
            return PinocchioUrdf(text, self.joints, self.base, self.tip)
        except (ValueError, RuntimeError, IndexError) as exc:
            problem = " ".join(str(exc).split()).rstrip(".") or type(exc).__name__
            cure = "Mend the file, or leave --verify out"
            raise PostprocError(
                f"Pinocchio cannot read the URDF ({problem}). {cure}"
            ) from None


@dataclass(frozen=True)
class ArmClaim:
    """An arm file, and what the planner makes of it.

    Attributes:
        file: The arm file.
        flange: Places the flange, from (n, 6) [rad] to (n, 4, 4) [m].
        torque: Torques of gravity, from (n, 6) [rad] to (n, 6) [N m].
    """

    file: ArmFile
    flange: Callable[[Floats], Floats]
    torque: Callable[[Floats], Floats]


def with_whole_turns(text: str) -> str:
    """Take angles of origins that are rounded quarter turns as the whole ones.

    >>> with_whole_turns('<origin rpy="0 -1.57 1.5"/>')
    '<origin rpy="0 -1.5707963267948966 1.5"/>'
    """

    def mend(found: re.Match[str]) -> str:
        words = " ".join(map(_whole_turn, found[3].split()))
        return f"{found[1]}{found[2]}{words}{found[2]}"

    return RPY.sub(mend, text)


def _whole_turn(word: str) -> str:
    """Write a rounded quarter turn as the whole one, all else as it is."""
    try:
        angle = float(word)
        whole = round(angle / QUARTER) * QUARTER
    except (ValueError, OverflowError):
        return word
    return repr(whole) if SAME < abs(angle - whole) < NEARLY else word


def judge_urdf(
    name: str, chain: UrdfChainNames, claim: ArmClaim, count: int = COUNT
) -> Opinion:
    """Compare an arm file with Pinocchio's reading of a URDF.

    Args:
        name: Of what is judged.
        chain: The URDF.
        claim: The arm file.
        count: How many joint angles are drawn, within the limits of the arm file.

    Raises:
        PostprocError: Pinocchio cannot read the URDF.
    """
    begun = monotonic()
    q, stated, whole = (
        draw_angles(claim.file, count),
        chain.read(False),
        chain.read(True),
    )
    rounded = stated.measure_turn(whole)
    rows = _compare_flanges("flange", whole, claim, q, 0.0)
    if rounded > SAME:
        text = "flange, angles of the URDF as rounded"
        rows += _compare_flanges(text, stated, claim, q, rounded)
    rows.append(_limits(whole, claim.file))
    if claim.file.links is not None:
        rows += _weights(whole, claim, q)
    return Opinion(name, tuple(rows), monotonic() - begun)


def draw_angles(file: ArmFile, count: int) -> Floats:
    """Draw joint angles within the limits of an arm file, (n, 6) [rad]."""
    low, high = np.deg2rad(file.joints.lower_deg), np.deg2rad(file.joints.upper_deg)
    return np.random.default_rng(count).uniform(low, high, (count, 6))


def _compare_flanges(
    what: str, theirs: PinocchioUrdf, claim: ArmClaim, q: Floats, rounded: float
) -> list[OpinionRow]:
    """Compare where flanges are; rounded angles may turn and move them so far."""
    ours = claim.flange(q @ serial(claim.file).T)
    place, turn = np.empty(len(q)), np.empty(len(q))
    for k, angles in enumerate(q):
        flange = theirs.flange(angles)
        place[k] = np.linalg.norm(flange[:3, 3] - ours[k, :3, 3])
        turn[k] = np.abs(flange[:3, :3] - ours[k, :3, :3]).max()
    moved = POSITION_MM + rounded * theirs.reach / MM
    at = [
        f"at {' '.join(f'{angle:.0f}' for angle in row)} deg" for row in np.rad2deg(q)
    ]
    return [
        _row(f"{what}: place", "mm", place / MM, moved, at),
        _row(f"{what}: orientation", "rad", turn, TURN_RAD + rounded, at),
    ]


def _limits(theirs: PinocchioUrdf, file: ArmFile) -> OpinionRow:
    """Compare ranges and velocities of the joints."""
    joints = file.joints
    velocity = joints.velocity_deg_s or [math.nan] * 6
    ours = np.deg2rad([joints.lower_deg, joints.upper_deg, velocity])
    names = [
        f"axis {k + 1} {end}"
        for end in ("lower", "upper", "velocity")
        for k in range(6)
    ]
    return _row("joint limits", "rad", np.abs(ours - theirs.limits).ravel(), JOINT_RAD,
                names, ENDLESS)  # fmt: skip


def _weights(theirs: PinocchioUrdf, claim: ArmClaim, q: Floats) -> list[OpinionRow]:
    """Compare the masses of links, and the torques of gravity."""
    assert claim.file.links is not None
    mass = np.abs(theirs.mass - claim.file.links.mass_kg)
    alone = serial(claim.file)
    ours = claim.torque(q @ alone.T) @ alone
    off = np.abs([theirs.torque(angles) for angles in q] - ours)
    axes = [f"axis {k + 1}" for k in range(6)]
    return [
        _row("link masses", "kg", mass, KILOGRAM, axes),
        _row("gravity torque", "N m", off.ravel(), TORQUE, axes * len(q)),
    ]


def _row(
    what: str, unit: str, size: Floats, bound: float, names: list[str], lost: str = ""
) -> OpinionRow:
    """Make a row of differences, NaN where there is none."""
    known = ~np.isnan(size)
    worst = int(np.nanargmax(size))
    skipped = {lost: int((~known).sum())} if not known.all() else {}
    return OpinionRow(
        what, unit, int(known.sum()), int((size[known] > bound).sum()),
        float(size[worst]), bound, names[worst], skipped,
    )  # fmt: skip
