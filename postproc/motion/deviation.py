"""How far a changed program leads the arm from where it was, move by move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from postproc import _native
from postproc.arrays import Bools, Floats, Ints, floats, largest_in_rows
from postproc.motion.joint_path import Trace
from postproc.robot.arm import Arm
from postproc.robot.backlash_operator import Edges
from postproc.robot.trajectory import Motion

# A cell feels elbow and wrist as well as the tool: near a singularity a small step of
# the tool is a large one of the joints.


@dataclass(frozen=True)
class JointDeviation:
    """Of n joint angles, or the largest on the ways to n targets; NaN: not known.

    Attributes:
        joints: Change of every joint, (n, 6) [rad], but for constant offsets.
        elbow: Distance of the elbow from where it was, (n,) [m].
        wrist_centre: .. of the wrist centre, (n,) [m].
        tcp: .. of the TCP, (n,) [m].
        branch: It is on another branch, (n,).
    """

    joints: Floats
    elbow: Floats
    wrist_centre: Floats
    tcp: Floats
    branch: Bools

    @property
    def joint(self) -> Floats:
        """The largest change of a joint, (n,) [rad]."""
        return largest_in_rows(self.joints)

    @property
    def sizes(self) -> Floats:
        """Joint [rad], elbow, wrist centre and TCP [m], (n, 4)."""
        return np.column_stack([self.joint, self.elbow, self.wrist_centre, self.tcp])

    def with_rows(self, rows: Ints, new: JointDeviation) -> JointDeviation:
        """Return it with other values in some rows, (k,)."""
        found = {f.name: np.array(getattr(self, f.name)) for f in fields(self)}
        for name, values in found.items():
            values[rows] = getattr(new, name)
        return JointDeviation(**found)

    def largest(self, other: JointDeviation) -> JointDeviation:
        """Return the larger of two; what is not known of one is that of the other."""
        pairs = [(getattr(self, f.name), getattr(other, f.name)) for f in fields(self)]
        return JointDeviation(*(np.fmax(a, b) for a, b in pairs))


def departure(
    arm: Arm, old: Floats, new: Floats, tool: Floats, offset: Floats
) -> JointDeviation:
    """Compare joint angles.

    Args:
        arm: The arm.
        old: Joint angles, (n, 6) [rad], NaN where not known.
        new: Those that they become.
        tool: TCP in the flange frame, (n, 3) [m].
        offset: Change of every joint that is constant for this arm (zero errors that
            are compensated), (6,) [rad]: all of it or a part swings nothing, though it
            moves elbow and wrist.
    """
    angles, point = (floats(old), floats(new)), floats(tool)
    packed = arm.dh.pack(), arm.solver
    return _deviation(*_native.departure(*packed, angles, point, floats(offset)))


def _deviation(joints: Floats, sizes: Floats, branch: Bools) -> JointDeviation:
    """Name what the core gives: `sizes` are of elbow, wrist centre and TCP, (n, 3)."""
    elbow, wrist_centre, tcp = sizes.T
    return JointDeviation(joints, elbow, wrist_centre, tcp, branch)


# The same along the ways: both programs at the same parts of every way.

ON_JOINT_MOVES = 4  # places looked at on a JOINT move, its end among them


def path_departure(
    arm: Arm,
    move: Ints,
    tool: Floats,
    old: Trace,
    q: Floats,
    follow: Callable[[], Edges],
    offset: Floats,
) -> JointDeviation:
    """Compare the joint paths of two programs that differ in their targets alone.

    Args:
        arm: The arm.
        move: `Motion` of n moves, (n,).
        tool: TCP in the flange frame at each, (n, 3) [m].
        old: Where one leads.
        q: Joint angles at the targets of the other, (n, 6) [rad].
        follow: Finds the ways to them; asked where a way has places inside.
        offset: See `departure`.

    Returns:
        The largest on the ways to every target, itself included.
    """
    at = departure(arm, old.q, q, tool, offset)
    edges, joint = old.edges, move == Motion.JOINT
    of_joints = np.repeat(joint, np.diff(edges.first))
    parts = np.where(of_joints, ON_JOINT_MOVES, np.diff(edges.start))
    if not ((parts > 1) & (edges.source >= 0)).any():
        return at
    ways = (edges, floats(old.q)), (follow(), floats(q))
    inside = _native.departure_along(
        arm.dh.pack(), arm.solver, ways, edges.first, parts, ~joint, floats(tool),
        floats(offset),
    )  # fmt: skip
    return at.largest(_deviation(*inside))
