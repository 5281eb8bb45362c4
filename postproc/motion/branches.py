"""Branches, turns and continuity of joint angles along a segment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from postproc import _native
from postproc.arrays import Bools, Floats, Ints, floats, largest_in_rows
from postproc.robot.arm import Arm

# The solutions at the samples of a path: all branches, or only those asked for.


class Branched(Protocol):
    """Solutions of the inverse kinematics at k samples."""

    def __len__(self) -> int:
        """Return the number of samples."""
        ...

    def all(self, i: int) -> Floats:
        """Return all branches at sample i, (8, 6) [rad], NaN where none."""
        ...

    def on(self, slot: int, first: int, most: int) -> Floats:
        """Return one branch at samples from `first` on, (.., 6) [rad], on any turn.

        Args:
            slot: The branch.
            first: The first sample.
            most: How many are enough for the moment: a path that breaks off again and
                again must not be looked through to its end every time.
        """
        ...


@dataclass(frozen=True)
class SolvedBranches:
    """Ways of samples that were solved beforehand, (k, 8, 6) [rad]."""

    branches: Floats

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.branches)

    def all(self, i: int) -> Floats:
        """Look all branches up."""
        branches: Floats = self.branches[i]
        return branches

    def on(self, slot: int, first: int, most: int) -> Floats:
        """Look one branch up."""
        branch: Floats = self.branches[first : first + most, slot]
        return branch


@dataclass(frozen=True)
class BranchedLazily:
    """Ways of a long path, which keeps to one branch: the others are hardly needed.

    Attributes:
        arm: The arm.
        flange: Flange poses, (k, 4, 4) [m].
    """

    arm: Arm
    flange: Floats

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.flange)

    def all(self, i: int) -> Floats:
        """Solve for all branches at one sample."""
        branches: Floats = self.arm.inverse(self.flange[i : i + 1]).q[0]
        return branches

    def on(self, slot: int, first: int, most: int) -> Floats:
        """Solve for one branch."""
        ahead = self.flange[first : first + most]
        found = self.arm.on_branch(ahead, np.full(len(ahead), slot))
        return self.arm.into_range(found)


# Which of the eight solutions, on which turn: from the string, or by continuity.

FULL = 2 * np.pi
SUSPICIOUS = 0.3  # [rad] a step between samples that another branch might shorten
OTHER_TURN = 1.0  # [rad] more than rounding of a turn
LOST = 1.2  # [rad] a step between samples that no arm makes
FEW, MORE = 256, 4  # samples looked ahead, and their growth while nothing happens


def on_written_turns(q: Floats, turns: Floats) -> Floats:
    """Put solutions on the turns of their configuration strings.

    T1 counts the turns of axis 4, T2 of axis 6, T3 of axis 3: floor((q + 180) / 360).
    A missing T1 or T2 is 0; without T3 axis 3 stays where its range allows it. Turns
    between whole ones mean the angle within half a turn of them.

    Args:
        q: Joint angles, (n, 6) [rad].
        turns: T1, T2, T3, (n, 3), NaN where not written.
    """
    return _native.on_turns(floats(q), floats(turns))


def on_other_turns(q: Floats, turns: Floats) -> Bools:
    """Tell which angles (n, 6) [rad] are on other turns than those written, (n,)."""
    return _native.on_other_turns(floats(q), floats(turns))


def nearest_turns(q: Floats, near: Floats) -> Floats:
    """Put joint angles (.., 6) [rad] on the turns nearest to others."""
    turned: Floats = q - FULL * np.round((q - near) / FULL)
    return turned


def unwrap_samples(q: Floats) -> Floats:
    """Put samples (k, 6) [rad] on the turns that continue the first one.

    By whole turns from where they are given: it does not matter where one begins.
    """
    turns = np.cumsum(np.round(np.diff(q, axis=0) / FULL), axis=0)
    out = np.array(q)
    out[1:] -= FULL * turns
    return out


def nearest_slot(branches: Floats, near: Floats) -> int:
    """Name the branch (8, 6) nearest to joint angles (6,) [rad]; -1 without any."""
    return int(nearest_slots(branches[None], near[None])[0])


def nearest_slots(branches: Floats, near: Floats) -> Ints:
    """Name the branches (r, 8, 6) nearest to joint angles (r, 6) [rad], (r,)."""
    near = near[:, None]
    gap = np.abs(nearest_turns(branches, near) - near).max(axis=2)
    gap[np.isnan(gap)] = np.inf
    return np.where((gap < np.inf).any(axis=1), gap.argmin(axis=1), -1)


@dataclass(frozen=True)
class JointPath:
    """A path in joint space.

    Attributes:
        q: Joint angles, (k, 6) [rad], for the k samples that could be followed.
        slot: Their branches, (k,).
        reached: The first sample that could not be followed had a solution; it was a
            jump.
    """

    q: Floats
    slot: Ints
    reached: bool


def follow(begin: Floats, ways: Branched, slot: int = -1) -> JointPath:
    """Follow the branch and the turns that continue a motion.

    Args:
        begin: Joint angles before the first sample, (6,) [rad].
        ways: The solutions at the s samples.
        slot: The branch that is followed already; -1: that nearest to `begin`.

    Returns:
        The whole path, or its beginning up to where it cannot be followed.
    """
    s = len(ways)
    q, slots = np.empty((s, 6)), np.empty(s, dtype=np.int64)
    done, last, ahead = 0, begin, FEW
    while done < s:
        fresh = slot < 0
        if fresh:
            slot, ahead = nearest_slot(ways.all(done), last), FEW
            if slot < 0:
                return JointPath(q[:done], slots[:done], False)
        path = np.vstack([last, ways.on(slot, done, ahead)])
        step = np.abs(np.diff(path, axis=0))
        if not (step < np.pi).all():
            path = unwrap_samples(path)
            step = np.abs(np.diff(path, axis=0))
        step = largest_in_rows(step)
        if fresh and step[0] > LOST:
            return JointPath(q[:done], slots[:done], True)
        # The first step is the shortest there is; go on to the next suspicious one.
        good = ~(step > SUSPICIOUS) & ~np.isnan(step)
        good[0] |= fresh
        count = len(step) if good.all() else int(np.argmin(good))
        q[done : done + count] = path[1 : count + 1]
        slots[done : done + count] = slot
        done, last = done + count, path[count]
        slot, ahead = (slot if good.all() else -1), MORE * ahead
    return JointPath(q, slots, True)


# Lines whose wrist axes are interpolated instead of the orientation (WRIST_JNT).

ROUNDS = 20
CLOSE = 1e-9  # [m]


def wrist_interpolated(
    arm: Arm, begin: Floats, end: Floats, tool: Floats, k: int
) -> Floats:
    """Move the TCP along a line while axes 4 to 6 turn in proportion.

    Axes 1 to 3 follow by Newton's method on the TCP's position, from the straight line
    in joint space.

    Args:
        arm: The arm.
        begin: Joint angles at the start, (6,) [rad].
        end: Joint angles at the end, (6,) [rad].
        tool: TCP in the flange frame, (4, 4) [m].
        k: Number of samples, the end included.

    Returns:
        (k, 6) [rad]; empty where the line cannot be followed.
    """
    u = (np.arange(1, k + 1) / k)[:, None]
    q = begin + u * (end - begin)
    ends = arm.flange(np.vstack([begin, end])) @ tool
    wanted = ends[0, :3, 3] + u * (ends[1, :3, 3] - ends[0, :3, 3])
    for _ in range(ROUNDS):
        missing = wanted - (arm.flange(q) @ tool)[:, :3, 3]
        if np.isnan(missing).any():
            break
        if np.abs(missing).max() < CLOSE:
            return q
        J = arm.jacobian(q, tool[:3, 3])[:, :3, :3]
        if np.abs(np.linalg.det(J)).min() < CLOSE:
            break
        q[:, :3] += np.linalg.solve(J, missing[:, :, None])[:, :, 0]
    return np.empty((0, 6))
