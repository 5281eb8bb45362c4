"""How far a changed program leads the arm from where it was, move by move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from postproc import _native
from postproc.arrays import (
    Bools,
    Floats,
    Ints,
    any_in_rows,
    floats,
    largest_in_rows,
    spans,
)
from postproc.motion.joint_path import STRAIGHT, Trace
from postproc.robot.arm import Arm
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
    joints, sizes = _measure(arm, old, new, tool, offset)
    rows = np.flatnonzero(~np.isnan(sizes[:, 0]))
    branch = np.zeros(len(old), dtype=bool)
    branch[rows] = other_branch(arm, old[rows], new[rows])
    elbow, wrist_centre, tcp = sizes.T
    return JointDeviation(joints, elbow, wrist_centre, tcp, branch)


def _measure(
    arm: Arm, old: Floats, new: Floats, tool: Floats, offset: Floats
) -> tuple[Floats, Floats]:
    """Measure what joints change by beyond offsets, (n, 6), and move, (n, 3).

    The args are those of `departure`; what moves are elbow, wrist centre and TCP.
    """
    angles, point = (floats(old), floats(new)), floats(tool)
    return _native.departure(arm.dh.pack(), angles, point, floats(offset))


def other_branch(arm: Arm, old: Floats, new: Floats) -> Bools:
    """Tell where joint angles (n, 6) [rad] lie on different branches, (n,).

    A straight wrist lies on both of its own.
    """
    differ = arm.branch(old) ^ arm.branch(new)
    straight = np.abs(np.minimum(old[:, 4] * new[:, 4], 0.0)) < STRAIGHT**2
    return np.asarray((differ & ~np.where(straight, 4, 0)) != 0)


# The same along the ways: both programs at the same parts of every way.

ON_JOINT_MOVES = 4  # places looked at on a JOINT move, its end among them


@dataclass(frozen=True)
class _Samples:
    """k places on the ways to n targets.

    Attributes:
        visit: The target of each, (k,).
        old, new: Joint angles, (k, 6) [rad].
    """

    visit: Ints
    old: Floats
    new: Floats


def path_departure(
    arm: Arm,
    move: Ints,
    tool: Floats,
    old: Trace,
    q: Floats,
    follow: Callable[[], Trace],
    offset: Floats,
) -> JointDeviation:
    """Compare the joint paths of two programs that differ in their targets alone.

    Args:
        arm: The arm.
        move: `Motion` of n moves, (n,).
        tool: TCP in the flange frame at each, (n, 3) [m].
        old: Where one leads.
        q: Joint angles at the targets of the other, (n, 6) [rad].
        follow: Finds where it leads; asked where a way has places inside.
        offset: See `departure`.

    Returns:
        The largest on the ways to every target, itself included.
    """
    at = departure(arm, old.q, q, tool, offset)
    visit = np.repeat(np.arange(len(move)), np.diff(old.edges.first))
    count = np.diff(old.edges.start)
    count = np.where(move[visit] == Motion.JOINT, ON_JOINT_MOVES, count) - 1
    if not ((count > 0) & (old.edges.source >= 0)).any():
        return at
    some = _samples(visit, count, old, follow())
    if len(some.visit) == 0:
        return at
    joints, branch = np.array(at.joints), np.array(at.branch)
    sizes = np.column_stack([at.elbow, at.wrist_centre, at.tcp])
    inside = _measure(arm, some.old, some.new, tool[some.visit], offset)
    first = np.flatnonzero(np.diff(some.visit, prepend=-1))
    rows = some.visit[first]
    for largest, found in zip((joints, sizes), inside, strict=True):
        most = np.fmax.reduceat(found, first, axis=0)
        largest[rows] = np.fmax(largest[rows], most)
    way = move[some.visit] != Motion.JOINT  # joints may pass a singularity as they like
    other = other_branch(arm, some.old[way], some.new[way])
    branch[some.visit[way][other]] = True
    elbow, wrist_centre, tcp = sizes.T
    return JointDeviation(joints, elbow, wrist_centre, tcp, branch)


def _samples(visit: Ints, count: Ints, old: Trace, new: Trace) -> _Samples:
    """Find the places inside of the ways that both programs are known to go.

    Args:
        visit: The target of every edge, (e,).
        count: How many places are looked at on each, (e,).
        old: One program.
        new: The other.
    """
    known = (old.edges.source >= 0) & (new.edges.source == old.edges.source)
    edge = np.flatnonzero(known)
    count = count[edge]
    of = np.repeat(edge, count)
    step = spans(np.ones(len(edge), dtype=np.int64), count)
    part = step / np.repeat(count + 1, count)
    both = [_native.along_edges(t.edges, t.q, of, part) for t in (old, new)]
    good = ~any_in_rows(np.isnan(both[0] + both[1]))
    return _Samples(visit[of[good]], both[0][good], both[1][good])
