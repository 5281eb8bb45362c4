"""What the numbers and flags of a language's targets mean, and the words it uses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from postproc.arrays import Bools, Floats, Ints, all_in_rows
from postproc.robot.pose import MM

BESIDE = np.deg2rad(0.1)  # of a border of flags [rad]
STRAIGHT = 0.02  # sine of axis 5


@dataclass(frozen=True)
class Terms:
    """How a language names what messages speak of.

    Attributes:
        tool, base, uframe: Its frames.
        tool_remote: Says that the arm holds the part.
        blend: Names of `Blend.OVERLAP`, its percentage, the zone's size and its rule,
            with the values that are assumed where nothing is set.
        corner: What decides how far a point is passed, and how to hit it.
        branch_stops, branch_may_stop: Why a controller stops, or may, where a path
            arrives on another branch than the flags say.
        turn_stops, turn_may_stop: .. on another turn.
        branch, nearest: Why flags that need not count are doubtful; the settings are
            filled in.
        wrist: .. on a line whose wrist turns joint by joint.
        overruled: Says that flags are kept which the path does not follow.
        law_unknown, angles, arc: Why the way between is not sure; the law's name is
            filled in.
        laws: Names of the `OrientationLaw` members, by their number.
        border: Why flags of a joint so near a border must not be trusted; its number is
            filled in.
    """

    tool: str
    base: str
    uframe: str
    tool_remote: str
    blend: tuple[str, str, str, str]
    corner: str
    branch_stops: str
    branch_may_stop: str
    turn_stops: str
    turn_may_stop: str
    branch: str
    nearest: str
    wrist: str
    overruled: str
    law_unknown: str
    angles: str
    arc: str
    laws: tuple[str, ...] = ()
    border: str = ""


WIDEST = -99999.9  # [mm, deg] no number of a target is longer as it is written


class Dialect(ABC):
    """What the w numbers of a target mean.

    The first three of a pose are its position [mm]. The first six of a joint target are
    the joint angles [deg], the others count for nothing.

    Attributes:
        terms: Its words.
        flag_joints: Joints whose sides of a border flags say, which small moves decide:
            such flags are written anew.
        flag_step: From one border to the next [rad]; one of them is 0.
        sign_flags: Flags name the signs of axes, also of axes near 0.
        flag_columns: Which numbers of a pose are flags.
        orientation: .. and which say its orientation.
        heads: What tables head the numbers of a pose with, w words.
        pose_decimals, joint_decimals: Least decimals of every written number, w each.
        runs_alone: What runs beside a program is read with it: a point that other
            programs may read keeps its value, and a move may have a clone of it.
    """

    runs_alone: bool = False
    terms: Terms
    heads: tuple[str, ...]
    flag_joints: tuple[int, ...] = ()
    flag_step: float = 2 * np.pi
    sign_flags: bool = False
    flag_columns: tuple[int, ...] = ()
    orientation: ClassVar = slice(3, 6)
    pose_decimals: tuple[int, ...]
    joint_decimals: tuple[int, ...]

    def rounding_decides(self, q: Floats) -> Bools:
        """Tell where the last digits of a target may decide its flags, (k,).

        They move joints (k, 6) [rad] by far less than `BESIDE`, but where the wrist is
        nearly straight.
        """
        own = q[:, list(self.flag_joints)]
        off = own - self.flag_step * np.round(own / self.flag_step)
        far = all_in_rows(np.abs(off) > BESIDE)  # false of NaN too
        return ~(far & (np.abs(np.sin(q[:, 4])) > STRAIGHT))

    @property
    def width(self) -> int:
        """Return how many numbers a target has."""
        return len(self.pose_decimals)

    @property
    def widest(self) -> tuple[float, ...]:
        """Return numbers of a pose that none is longer than as it is written, (w,)."""
        return (WIDEST,) * self.width

    def poses(self, values: Floats) -> Floats:
        """Return the poses (k, 4, 4) [m] that numbers (k, w) say."""
        values = np.asarray(values, dtype=float)
        T = np.zeros((*values.shape[:-1], 4, 4))
        T[..., :3, :3] = self.rotations(values[..., self.orientation])
        T[..., :3, 3] = values[..., :3] * MM
        T[..., 3, 3] = 1.0
        return T

    @abstractmethod
    def rotations(self, written: Floats) -> Floats:
        """Return the rotations (k, 3, 3) that numbers for the orientation say."""

    @abstractmethod
    def orientations(self, R: Floats, near: Floats) -> Floats:
        """Return the numbers of rotations (k, 3, 3), next to others."""

    def rotate(self, values: Floats, by: Floats) -> Floats:
        """Turn targets, and write them next to what is written.

        Args:
            values: Numbers of poses, (k, w).
            by: Rotations in the frame of the numbers, (k, 3, 3).
        """
        out, written = np.array(values), values[:, self.orientation]
        new = self.orientations(by @ self.rotations(written), written)
        out[:, self.orientation] = new
        return out

    def count_flags(self, values: Floats, q: Floats) -> Floats:
        """Write the flags of new poses, as far as they depend on more than the branch.

        Args:
            values: Numbers of poses on one branch, with flags of another one, (k, w).
            q: Joint angles there, (k, 6) [rad].
        """
        return values

    def shift_rotations(self, angles: Floats) -> Floats:
        """Return the rotations (k, 3, 3) that the angles (k, 3) [deg] of shifts say.

        About x, about y as it is turned then, and about z likewise.
        """
        a, b, c = np.moveaxis(np.deg2rad(angles), -1, 0)
        ca, sa, cb, sb, cc, sc = (f(x) for x in (a, b, c) for f in (np.cos, np.sin))
        R = np.empty((*a.shape, 3, 3))
        R[..., 0, 0], R[..., 0, 1], R[..., 0, 2] = cb * cc, -cb * sc, sb
        R[..., 1, 0], R[..., 1, 1] = sa * sb * cc + ca * sc, ca * cc - sa * sb * sc
        R[..., 2, 0], R[..., 2, 1] = sa * sc - ca * sb * cc, ca * sb * sc + sa * cc
        R[..., 1, 2], R[..., 2, 2] = -sa * cb, ca * cb
        return R

    def shift_angles(self, rotations: Floats, near: Floats) -> Floats:
        """Return the angles of rotations (k, 3, 3) next to others (k, 3) [deg]."""
        R = rotations
        b = np.arctan2(R[:, 0, 2], np.hypot(R[:, 0, 0], R[:, 0, 1]))
        a, c = np.arctan2(-R[:, 1, 2], R[:, 2, 2]), np.arctan2(-R[:, 0, 1], R[:, 0, 0])
        one = np.rad2deg(np.stack([a, b, c], axis=1))
        other = np.array([180.0, 180.0, 180.0]) + one * np.array([1.0, -1.0, 1.0])
        return nearer(one, other, near, 360.0)

    @abstractmethod
    def flags(
        self, config: Ints, configs: tuple[str, ...], values: Floats
    ) -> tuple[Ints, Floats]:
        """Read the configuration flags of targets.

        Args:
            config: Index into `configs`, (n,).
            configs: Configuration strings.
            values: Numbers of the targets, (n, w).

        Returns:
            Slots 4 W + 2 S + E, (n,), and turns of axes 4, 6 and 3, (n, 3), NaN where
            not written: the angle is within half a turn of so many turns.
        """

    def flag_words(self, config: str, values: Floats) -> str:
        """Spell the flags of one target as ``S E W T1:0 T2:-1 T3:0``, unsaid ones not.

        Where only the sign of an axis is said, that is ``T1:>0`` or ``T1:<0``.

        Args:
            config: Its configuration string.
            values: Its numbers, (w,).
        """
        slot, turns = self.flags(np.zeros(1, dtype=np.int64), (config,), values[None])
        words = [w for w, bit in (("S", 2), ("E", 1), ("W", 4)) if slot[0] & bit]
        for k, turn in enumerate(turns[0], start=1):
            said = ("<0" if turn < 0 else ">0") if self.sign_flags else f"{turn:g}"
            words += [f"T{k}:{said}"] if turn == turn else []
        return " ".join(words)

    def rewrite_flags(self, values: Floats, q: Floats, before: Floats) -> Floats:
        """Write the flags anew of poses (k, w) that the arm reaches with joints (k, 6).

        Flags that go on being as true as they were, or that do not depend on small
        moves, are kept.

        Args:
            values: Numbers of the poses.
            q: Joints that reach them as they are rounded [rad].
            before: Joints that the source reaches them with.
        """
        return values

    def misses(self, values: Floats, q: Floats) -> Bools | None:
        """Tell which poses (k, w) say other flags than joints (k, 6) [rad] have.

        None where branch and turns say all that the flags do.
        """
        return None

    def near_border(
        self, values: Floats, q: Floats, before: Floats, rounded: bool = False
    ) -> Bools:
        """Tell which joints are too near a border of flags, (k, 6).

        Only where `sign_flags` says that flags name signs of axes.

        Args:
            values: Numbers of poses as they are in the source, (k, w).
            q: Joints that the commands reach, (k, 6) [rad].
            before: Joints that the source reaches, (k, 6) [rad].
            rounded: The commands are those of numbers as they are written.
        """
        return np.zeros(q.shape, dtype=bool)

    def leave_border(self, values: Floats, q: Floats, before: Floats) -> Floats:
        """Say how far joints must move to leave a border of flags, (k, 6) [rad].

        0 where they need not, or where the side they are on is not known. For the
        arguments see `near_border`.
        """
        return np.zeros(q.shape)


def nearer(one: Floats, other: Floats, near: Floats, turn: float) -> Floats:
    """Return the angles, of two (k, 3) that say the same, which are next to others.

    Args:
        one: Angles.
        other: .. and other ones.
        near: What they are to be next to, (k, 3).
        turn: A whole turn, in the unit of all of them.
    """
    both = np.stack([one, other])
    both -= turn * np.round((both - near) / turn)
    gap = np.abs(both - near).max(axis=2)
    return np.asarray(np.where((gap[0] <= gap[1])[:, None], both[0], both[1]))
