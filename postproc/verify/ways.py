"""The way between targets made anew: joints straight, TCP on lines and arcs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Floats
from postproc.language.visits import OrientationLaw, Visits
from postproc.robot.trajectory import Motion
from postproc.verify.goals import WrittenGoals
from postproc.verify.pinocchio_arm import PinocchioArm

STEP, TURN = 5e-3, np.deg2rad(1.0)  # [m] and [rad] between samples
LEAST, MOST = 4, 600  # samples of a way
NO_CIRCLE = 1e-9  # [m^2] twice the area of three points on a line
PLAIN_LAWS = (OrientationLaw.UNSET, OrientationLaw.ONE_AXIS)

SEVERAL = "several ways lead there, or none"
NO_BEGIN = "where the way begins is not confirmed"
NO_END = "where it ends is no pose or joint angles"
NOT_MADE = "a way of the controller's own: orientation law, spline, wrist, weaving"
NO_STEPS = "Jacobian steps do not lead along it"
NO_TIME = "no time law was found"


@dataclass(frozen=True)
class MadeWay:
    """A way that was made anew, or why it was not.

    Attributes:
        q: Joint angles from its begin to its end, (k, 6) [rad]; empty if not made.
        why: Why it was not made, or "".
        least: What it takes at the programmed speed at least [s].
    """

    q: Floats
    why: str = ""
    least: float = 0.0


def not_made(why: str) -> MadeWay:
    """Return no way, and why."""
    return MadeWay(np.empty((0, 6)), why)


@dataclass(frozen=True)
class WayMaker:
    """Makes the ways of one program.

    Attributes:
        arm: The arm.
        visits: The program.
        goals: What it asks for.
        confirmed: Joint angles at targets that Pinocchio has confirmed, (n, 6) [rad],
            NaN elsewhere.
    """

    arm: PinocchioArm
    visits: Visits
    goals: WrittenGoals
    confirmed: Floats

    def make(self, i: int, begin: Floats) -> MadeWay:
        """Make the way to visit i.

        Args:
            i: The visit.
            begin: Joint angles where it begins, (6,) [rad], NaN where not known.
        """
        v = self.visits
        if np.isnan(begin).any():
            return not_made(NO_BEGIN)
        if np.isnan(self.confirmed[i]).any():
            return not_made(NO_END)
        if v.motion.kind[i] == Motion.JOINT:
            return MadeWay(np.stack([begin, self.confirmed[i]]))
        plain = (
            v.motion.orientation_law[i] in PLAIN_LAWS and not v.motion.wrist_joint[i]
        )
        if (
            not plain
            or v.motion.curved[i]
            or v.motion.block[i] >= 0
            or v.motion.weaves[i]
        ):
            return not_made(NOT_MADE)
        return self._in_space(i, begin)

    def _in_space(self, i: int, begin: Floats) -> MadeWay:
        """Follow a line or an arc of the TCP by Jacobian steps."""
        tool = self.goals.tool[i]
        start, end = self.arm.flange(begin) @ tool, self._end(i)
        points = (
            _line(start, end)
            if self.visits.motion.kind[i] == Motion.LINEAR
            else self._arc(i, start, end)
        )
        if points is None or np.isnan(points).any():
            return not_made(NO_END)
        turn = np.linalg.norm(self.arm.turn(start, end))
        course = _ToolCourse(points, start, end, tool, float(turn))
        v = self.visits
        least = course.least(float(v.speed.linear[i]), float(v.speed.turning[i]))
        return replace(self._follow(begin, course), least=least)

    def _end(self, i: int) -> Floats:
        """Return the TCP at the end of a way, (4, 4)."""
        if np.isnan(self.goals.tcp[i]).any():  # a line to joint angles
            return np.asarray(self.arm.flange(self.confirmed[i]) @ self.goals.tool[i])
        return np.asarray(self.goals.tcp[i])

    def _arc(self, i: int, start: Floats, end: Floats) -> Floats | None:
        """Place points on the arc to its VIA point, or from there to its end."""
        via, n = bool(self.visits.motion.via[i]), len(self.visits)
        before = int(self.visits.graph.before[i])
        if via:
            if i + 1 >= n:
                return None
            three = start, end, self._end(i + 1)
        elif before >= 0 and self.visits.motion.via[before]:
            first = int(self.visits.graph.before[before])
            if first < 0 or np.isnan(self.confirmed[first]).any():
                return None
            at = self.arm.flange(self.confirmed[first]) @ self.goals.tool[i]
            three = at, start, end
        else:
            return None
        a, b, c = (T[:3, 3] for T in three)
        return _part_of_circle(a, b, c, first=via)

    def _follow(self, begin: Floats, course: _ToolCourse) -> MadeWay:
        """Go along by Jacobian steps, sample by sample."""
        steps = course.steps()
        out, q, undo = [begin], begin, np.linalg.inv(course.tool)
        for k in range(1, steps + 1):
            pose = course.at(k / steps, self.arm)
            found = self.arm.reach(pose @ undo, q)
            if found is None:
                return not_made(NO_STEPS)
            q = found
            out.append(q)
        return MadeWay(np.array(out))


@dataclass(frozen=True)
class _ToolCourse:
    """Where the TCP goes.

    Attributes:
        points: On its way, evenly, (k, 3) [m].
        start, end: Its poses there, (4, 4).
        tool: TCP in the flange frame, (4, 4).
        turn: Angle by which it turns [rad].
    """

    points: Floats
    start: Floats
    end: Floats
    tool: Floats
    turn: float

    @property
    def length(self) -> float:
        """Length of the way [m]."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    def least(self, speed: float, turning: float) -> float:
        """Return how long it takes [s] at speeds [m/s], [rad/s], NaN if not known."""
        return float(np.nanmax([0.0, self.length / speed, self.turn / turning]))

    def steps(self) -> int:
        """Choose how many steps to go."""
        share = max(self.length / STEP, self.turn / TURN)
        return int(np.clip(np.ceil(share), LEAST, MOST))

    def at(self, u: float, arm: PinocchioArm) -> Floats:
        """Place the TCP at a share of the way, (4, 4)."""
        T, exact = np.eye(4), u * (len(self.points) - 1)
        T[:3, 3] = self._point(exact)
        T[:3, :3] = arm.between(self.start, self.end, u)
        return T

    def _point(self, exact: float) -> Floats:
        """Return the point at a place between points (they are dense on arcs)."""
        k = min(int(exact), len(self.points) - 2)
        a, b = self.points[k], self.points[k + 1]
        return np.asarray(a + (exact - k) * (b - a))


def _line(start: Floats, end: Floats) -> Floats:
    """Return both ends of a line, (2, 3)."""
    return np.stack([start[:3, 3], end[:3, 3]])


ON_ARC = 2000  # points of a part of an arc: chords leave it by less than 1e-6 of it


def _part_of_circle(a: Floats, b: Floats, c: Floats, first: bool) -> Floats | None:
    """Return points on the circle through three, from a to b or from b to c, (k, 3).

    The centre m is as far from all three: (b - a) . m = (|b|^2 - |a|^2) / 2, likewise
    for c, and m lies in their plane.
    """
    normal = np.cross(b - a, c - a)
    if not np.linalg.norm(normal) > NO_CIRCLE:
        return None
    sides = np.stack([b - a, c - a, normal])
    m = np.linalg.solve(
        sides, [(b @ b - a @ a) / 2, (c @ c - a @ a) / 2, normal @ a]
    )  # fmt: skip
    x, n = a - m, normal / np.linalg.norm(normal)
    y = np.cross(n, x)
    ends = [np.arctan2((p - m) @ y, (p - m) @ x) % (2 * np.pi) for p in (b, c)]
    low, high = (0.0, ends[0]) if first else (ends[0], ends[1])
    angle = np.linspace(low, high, ON_ARC)[:, None]
    return np.asarray(m + np.cos(angle) * x + np.sin(angle) * y)
