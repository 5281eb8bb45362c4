"""Inverse kinematics of an arm: all branches or one, on turns within its range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints, chunks
from postproc.kernels import floats, native
from postproc.robot.arm_file import OpwSection
from postproc.robot.pose import MM

# The closed-form inverse kinematics of an ortho-parallel arm, for very many poses.
#
# Brandstoetter, Angerer, Hofbaur: An analytical solution of the inverse kinematics
# problem of industrial serial manipulators with an ortho-parallel basis and a spherical
# wrist (2014). Written over arrays, and for one branch alone where that is known: a
# correction stays on its branch.

CHUNK = 8192  # poses solved at a time: what they need stays in the cache
WRIST, SHOULDER, ELBOW = 4, 2, 1  # bits of a slot


@dataclass(frozen=True)
class _Centre:
    """Where the wrist centre of n poses is, seen from axis 1.

    Attributes:
        R: Orientation of the flange, (n, 3, 3).
        azimuth: Direction of it, (n,) [rad].
        aside: How far the arm's plane lies off that, (n,) [rad].
        reach, z: Distance in that plane, and height above axis 2, (n,) [m].
    """

    R: Floats
    azimuth: Floats
    aside: Floats
    reach: Floats
    z: Floats


@dataclass(frozen=True)
class _Facing:
    """The triangle of upper arm and forearm for n poses.

    Attributes:
        t1: Axis 1, (n,) [rad].
        slope, lean, fold: Of the line from axis 2 to the wrist centre against the
            vertical, of the upper arm against that line, and between the arms, (n,)
            [rad].
        ahead, across, up: Components of the flange's axes ahead of axis 1, across and
            upwards, (n, 3).
    """

    t1: Floats
    slope: Floats
    lean: Floats
    fold: Floats
    ahead: Floats
    across: Floats
    up: Floats


class ClosedForm:
    """The closed form of one arm, in its geometric joint angles.

    Branches are named by slots 4 W + 2 S + E. W: axis 5 negative; S: wrist centre
    behind axis 1; E: the other elbow.
    """

    def __init__(self, parameters: OpwSection) -> None:
        """Take the arm file's section."""
        p = parameters
        self._a1, self._b, self._c1 = p.a1_mm * MM, p.b_mm * MM, p.c1_mm * MM
        self._upper, self._c4 = p.c2_mm * MM, p.c4_mm * MM
        self._forearm = float(np.hypot(p.a2_mm, p.c3_mm)) * MM
        self._bent = float(np.arctan2(p.a2_mm, p.c3_mm))
        self._offset = np.deg2rad(p.offsets_deg)
        self._sign = np.where(p.flip_axes, -1.0, 1.0)
        lengths = self._a1, self._b, self._c1, self._upper, self._forearm, self._c4
        self._packed = np.array([*lengths, self._bent, *self._offset, *self._sign])

    def branches(self, flange: Floats) -> Floats:
        """Solve for all branches of every pose.

        Args:
            flange: Flange poses, (n, 4, 4) [m].

        Returns:
            Geometric joint angles on no particular turn, (n, 8, 6) [rad], NaN where a
            branch does not exist.
        """
        if native is not None:
            solved: Floats = native.branches(self._packed, floats(flange))
            return solved
        out = np.empty((len(flange), 8, 6))
        for rows in chunks(len(flange), CHUNK):
            centre = self._centre(flange[rows])
            for behind in (False, True):
                facing = self._facing(centre, np.asarray(behind))
                for elbow, side in enumerate((1.0, -1.0)):
                    one = self._angles(facing, np.asarray(side))
                    slot = SHOULDER * behind + ELBOW * elbow
                    out[rows, slot] = self._to_joints(one)
                    out[rows, slot + WRIST] = self._to_joints(_wrist_flipped(one))
        return out

    def branch(self, flange: Floats, slot: Ints) -> Floats:
        """Solve for one branch of every pose.

        Args:
            flange: Flange poses, (n, 4, 4) [m].
            slot: Branches, (n,).

        Returns:
            Geometric joint angles on no particular turn, (n, 6) [rad], NaN where the
            branch does not exist.
        """
        if native is not None:
            flange, slot = floats(flange), np.ascontiguousarray(slot)
            solved: Floats = native.branch(self._packed, flange, slot)
            return solved
        out = np.empty((len(flange), 6))
        for rows in chunks(len(flange), CHUNK):
            facing = self._facing(
                self._centre(flange[rows]), (slot[rows] & SHOULDER) > 0
            )
            side = np.where((slot[rows] & ELBOW) > 0, -1.0, 1.0)
            one = self._angles(facing, side)
            flipped = np.flatnonzero(slot[rows] & WRIST)
            one[flipped] = _wrist_flipped(one.take(flipped, axis=0))
            out[rows] = self._to_joints(one)
        return out

    def slot(self, theta: Floats) -> Ints:
        """Name the branch of geometric joint angles (n, 6) [rad], (n,)."""
        t = theta * self._sign - self._offset
        elbow = t[:, 2] + self._bent
        ahead = self._upper * np.sin(t[:, 1]) + self._forearm * np.sin(t[:, 1] + elbow)
        slots: Ints = (
            WRIST * (np.sin(t[:, 4]) < 0)
            + SHOULDER * (self._a1 + ahead < 0)
            + ELBOW * (np.sin(elbow) < 0)
        )
        return slots

    def _to_joints(self, angles: Floats) -> Floats:
        """Convert the formulas' angles (n, 6) to the arm's geometric ones."""
        joints: Floats = (angles + self._offset) * self._sign
        return joints

    def _centre(self, flange: Floats) -> _Centre:
        """Find what all branches have in common."""
        R = flange[:, :3, :3]
        centre = flange[:, :3, 3] - self._c4 * R[:, :, 2]
        cx, cy, z = centre[:, 0], centre[:, 1], centre[:, 2] - self._c1
        with np.errstate(invalid="ignore"):
            reach = np.sqrt(cx**2 + cy**2 - self._b**2)
        azimuth, aside = np.arctan2(cy, cx), np.arctan2(self._b, reach)
        return _Centre(R, azimuth, aside, reach, z)

    def _facing(self, at: _Centre, behind: Bools) -> _Facing:
        """Find what both elbows have in common, with axis 1 towards the target or away.

        Args:
            at: Where the wrist centre is.
            behind: It is behind axis 1, (n,) or for all.
        """
        R, upper, forearm = at.R, self._upper, self._forearm
        t1 = at.azimuth + np.where(behind, at.aside - np.pi, -at.aside)
        x = np.where(behind, -at.reach, at.reach) - self._a1
        far = x**2 + at.z**2
        with np.errstate(invalid="ignore", divide="ignore"):
            gap = far - forearm**2 + upper**2
            lean = np.arccos(gap / (2 * np.sqrt(far) * upper))
            fold = np.arccos((far - upper**2 - forearm**2) / (2 * upper * forearm))
        s1, c1 = np.sin(t1)[:, None], np.cos(t1)[:, None]
        ahead, across = c1 * R[:, 0] + s1 * R[:, 1], c1 * R[:, 1] - s1 * R[:, 0]
        return _Facing(t1, np.arctan2(x, at.z), lean, fold, ahead, across, R[:, 2])

    def _angles(self, at: _Facing, side: Floats) -> Floats:
        """Solve for the branches with a positive axis 5, (n, 6) [rad].

        Args:
            at: What both elbows have in common.
            side: 1 or -1, the elbow, (n,) or for all.
        """
        t2 = at.slope - side * at.lean
        t3 = side * at.fold - self._bent
        s23, c23 = np.sin(t2 + t3)[:, None], np.cos(t2 + t3)[:, None]
        # The flange's axes out of and along the forearm.
        out, along = at.ahead * c23 - at.up * s23, at.ahead[:, 2] * s23[:, 0]
        along += at.up[:, 2] * c23[:, 0]
        t4 = np.arctan2(at.across[:, 2], out[:, 2])
        t5 = np.arctan2(np.hypot(at.across[:, 2], out[:, 2]), along)
        # Axis 5 seen from the flange; a straight wrist has it too.
        bend = np.cos(t4)[:, None] * at.across - np.sin(t4)[:, None] * out
        t6 = np.arctan2(bend[:, 0], bend[:, 1])
        angles = np.stack([at.t1, t2, t3, t4, t5, t6], axis=1)
        angles[np.isnan(angles).any(axis=1)] = np.nan
        return angles


def _wrist_flipped(angles: Floats) -> Floats:
    """Turn the wrist (n, 6) [rad] to its other solution."""
    flipped: Floats = angles + np.array([0.0, 0.0, 0.0, np.pi, 0.0, np.pi])
    flipped[:, 4] *= -1
    return flipped


# Inverse kinematics of an arm: all branches or one, on turns within its range.


@dataclass(frozen=True)
class Branches:
    """All closed-form solutions of n flange poses, in stable slots 4 W + 2 S + E.

    Attributes:
        q: (n, 8, 6) [rad], NaN where a branch does not exist. Axes lie in the arm's
            range where a turn of 360 deg can bring them there, else in (-pi, pi].
    """

    q: Floats


def wrap(angle: Floats) -> Floats:
    """Wrap angles into [-pi, pi)."""
    wrapped: Floats = np.mod(angle + np.pi, 2 * np.pi) - np.pi
    return wrapped


class Inverse:
    """The inverse kinematics of one arm."""

    def __init__(
        self, parameters: OpwSection, mix: Floats, lower: Floats, upper: Floats
    ) -> None:
        """Build it from the arm file's section, angle mixing and joint limits [rad]."""
        self._closed = ClosedForm(parameters)
        self._mix, self._unmix = mix, np.linalg.inv(mix)
        self._lower, self._upper = lower, upper

    def branches(self, flange: Floats) -> Branches:
        """Solve for all branches of flange poses (n, 4, 4) [m]."""
        q = self._closed.branches(flange) @ self._unmix.T
        return Branches(self.into_range(q))

    def branch(self, flange: Floats, slot: Ints) -> Floats:
        """Solve for one branch each of flange poses (n, 4, 4) [m], on any turn.

        Returns:
            (n, 6) [rad], NaN where the branch does not exist.
        """
        q: Floats = self._closed.branch(flange, slot) @ self._unmix.T
        return q

    def slot(self, q: Floats) -> Ints:
        """Name the branch (slot 4 W + 2 S + E) of joint angles (n, 6) [rad]."""
        return self._closed.slot(q @ self._mix.T)

    def into_range(self, q: Floats) -> Floats:
        """Shift angles by whole turns into the joint range where that is possible."""
        turn = 2 * np.pi
        below = np.pi - q
        around = np.flatnonzero((below < 0) | (below >= turn))
        if len(around):
            below.flat[around] = np.mod(below.flat[around], turn)
        q = np.pi - below
        low, high = np.nonzero(q < self._lower), np.nonzero(q > self._upper)
        if len(low[0]):
            up = q[low] + turn
            q[low] = np.where(up <= self._upper[low[-1]], up, q[low])
        if len(high[0]):
            down = q[high] - turn
            q[high] = np.where(down >= self._lower[high[-1]], down, q[high])
        return q
