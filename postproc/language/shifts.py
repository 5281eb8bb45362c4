"""Shifts that stand in moves: from the numbers of a point to those of the target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.language.pose_encoding import Dialect
from postproc.robot.pose import MM, inverse, rotation_vector

ANGLES = slice(3, 6)  # of the six numbers of a shift
NUMBERS = 6
NO_TURN = 1e-12  # of a matrix: rotations that differ less are the same
LEAST_DEG = 1e-10  # angles that are computed, and less, turn nothing
TURNED = 1e-7  # [rad] and more are written into the angles of a shift
Pose = tuple[float, ...]
"""The rows of a pose (4, 4) [m] one after the other, empty where it is not known."""
IDENTITY: Pose = (1.0, *(0.0,) * 4, 1.0, *(0.0,) * 4, 1.0, *(0.0,) * 4, 1.0)


class ShiftKind(IntEnum):
    """Which axes the numbers of a shift count along."""

    AXES = 0  # moved along the axes of the frame that the point is in: Offs
    OWN = 1  # moved along, then turned about its own axes: RelTool, p : {..}
    FRAME = 2  # the frame that it is in is moved and turned: {..} : p


@dataclass(frozen=True)
class Shift:
    """How a move shifts the point that it names.

    Attributes:
        kind: What its numbers mean.
        numbers: x, y, z [mm] and three angles [deg], see `Dialect.shift_rotations`.
        origin: The numbers of the point, w.
        left, right: What the point is linked with before this shift, on either side of
            it: shifts around it that stay; rows of (4, 4) [m].
        flagged: The target has the configuration flags of the point.
    """

    kind: ShiftKind
    numbers: tuple[float, ...]
    origin: tuple[float, ...]
    left: Pose = IDENTITY
    right: Pose = IDENTITY
    flagged: bool = True

    @property
    def turns(self) -> bool:
        """Whether it turns the point, too."""
        return any(abs(angle) > LEAST_DEG for angle in self.numbers[ANGLES])

    def around(self, inner: Shift, dialect: Dialect) -> Shift:
        """Shift what another shift has shifted, which stays.

        Args:
            inner: The other one.
            dialect: What angles mean.
        """
        left, right = _matrix(inner.left), _matrix(inner.right)
        by = frames_of(np.array([inner.numbers]), dialect)[0]
        match inner.kind:
            case ShiftKind.AXES:
                only_moved = np.eye(4)
                only_moved[:3, 3] = by[:3, 3]
                left = only_moved @ left
            case ShiftKind.OWN:
                right = right @ by
            case ShiftKind.FRAME:
                left = by @ left
        return replace(
            self, origin=inner.origin, left=flat(left), right=flat(right),
            flagged=self.flagged and inner.flagged,
        )  # fmt: skip

    def apply(self, dialect: Dialect) -> tuple[float, ...]:
        """Return the numbers of the target, w; flags that it has not are -1."""
        row, none = np.zeros(1, dtype=np.int64), np.full(1, -1)
        flags = np.full((1, dialect.width), -1.0)
        own = Shifts.of(row, [self], none, none, flags, row > 0, dialect)
        return tuple(own.carry(own.origin, own.numbers)[0].tolist())


def _matrix(pose: Pose) -> Floats:
    return np.array(pose).reshape(4, 4)


def flat(pose: Floats) -> Pose:
    """Write the rows of a pose, (4, 4) [m], one after the other."""
    return tuple(pose.ravel().tolist())


def frames_of(numbers: Floats, dialect: Dialect) -> Floats:
    """Return the frames (k, 4, 4) [m] that the numbers (k, 6) of shifts say."""
    out = np.zeros((len(numbers), 4, 4))
    out[:, :3, :3] = dialect.shift_rotations(numbers[:, ANGLES])
    out[:, :3, 3] = numbers[:, :3] * MM
    out[:, 3, 3] = 1.0
    return out


@dataclass(frozen=True)
class Shifts:
    """The shifted targets among the visits of a program (structure of arrays).

    Attributes:
        rows: The visits, (k,).
        literal: Where the numbers of the shift stand, (k,), -1 where they stay.
        follows: Literal of the point, (k,), -1 where its numbers stay.
        kind, numbers, origin, left, right, flagged: As in `Shift`, k rows.
        values: Numbers of the targets, (k, w).
        turns: All three angles are written, (k,).
        dialect: What numbers mean.
    """

    rows: Ints
    literal: Ints
    follows: Ints
    kind: Ints
    numbers: Floats
    origin: Floats
    left: Floats
    right: Floats
    flagged: Bools
    values: Floats
    turns: Bools
    dialect: Dialect

    @classmethod
    def of(
        cls,
        rows: Ints,
        shifts: Sequence[Shift],
        literal: Ints,
        follows: Ints,
        values: Floats,
        turns: Bools,
        dialect: Dialect,
    ) -> Shifts:
        """Put the shifts of k visits into columns."""
        k = len(rows)
        return cls(
            rows, literal, follows,
            np.array([one.kind for one in shifts], np.int64),
            np.array([one.numbers for one in shifts], float).reshape(k, NUMBERS),
            np.array([one.origin for one in shifts], float).reshape(k, dialect.width),
            np.array([one.left for one in shifts], float).reshape(k, 4, 4),
            np.array([one.right for one in shifts], float).reshape(k, 4, 4),
            np.array([one.flagged for one in shifts], bool),
            values, turns, dialect,
        )  # fmt: skip

    def __len__(self) -> int:
        """Return the number of shifted targets."""
        return len(self.rows)

    def carry(self, origin: Floats, numbers: Floats) -> Floats:
        """Return the numbers of the targets, (k, w).

        Args:
            origin: Numbers of the points, (k, w).
            numbers: Numbers of the shifts, (k, 6).
        """
        own, by = self.dialect.poses(origin), frames_of(numbers, self.dialect)
        pose = self._link(self.left @ own @ self.right, by)
        turn = pose[:, :3, :3] @ np.swapaxes(own[:, :3, :3], 1, 2)
        turned = np.abs(turn - np.eye(3)).max(axis=(1, 2), initial=0.0) > NO_TURN
        out = np.array(origin)
        out[turned] = self.dialect.rotate(out[turned], turn[turned])
        out[:, :3] = pose[:, :3, 3] / MM
        free = np.flatnonzero(~self.flagged)
        for flag in self.dialect.flag_columns:
            out[free, flag] = self.values[free, flag]
        return out

    def _link(self, inner: Floats, by: Floats) -> Floats:
        """Link points as they are shifted by others with frames, (k, 4, 4) each."""
        out = np.where((self.kind == ShiftKind.OWN)[:, None, None], inner @ by, inner)
        out = np.where((self.kind == ShiftKind.FRAME)[:, None, None], by @ inner, out)
        axes = self.kind == ShiftKind.AXES
        out[axes, :3, 3] += by[axes, :3, 3]
        return np.asarray(out)

    def find_shift(self, origin: Floats, wanted: Floats) -> tuple[Floats, Floats]:
        """Find the numbers that lead from points to targets.

        Angles are written anew only where all three stand there and the target is to
        be turned otherwise than its point is.

        Args:
            origin: Numbers of the points, (k, w).
            wanted: Numbers of the targets, (k, w).

        Returns:
            Numbers of the shifts, (k, 6), and what the targets are then turned
            otherwise than wanted, (k,) [rad].
        """
        inner = self.left @ self.dialect.poses(origin) @ self.right
        to, numbers = self.dialect.poses(wanted), np.array(self.numbers)
        off = self._measure_turn(inner, to, numbers)
        rows = (off > TURNED) & self.turns & (self.kind != ShiftKind.AXES)
        rotation = np.where(
            (self.kind == ShiftKind.OWN)[:, None, None],
            inverse(inner) @ to, to @ inverse(inner),
        )[rows, :3, :3]  # fmt: skip
        written = numbers[rows, ANGLES]
        numbers[rows, ANGLES] = self.dialect.shift_angles(rotation, written)
        numbers[:, :3] = self._way(inner, to, numbers) / MM
        return numbers, self._measure_turn(inner, to, numbers)

    def _way(self, inner: Floats, to: Floats, numbers: Floats) -> Floats:
        """Return how far targets are shifted, along the axes of each, (k, 3) [m]."""
        by = frames_of(numbers, self.dialect)[:, :3, :3]
        start, end = inner[:, :3, 3], to[:, :3, 3]
        own = np.einsum("kji,kj->ki", inner[:, :3, :3], end - start)
        frame = end - np.einsum("kij,kj->ki", by, start)
        kind = self.kind[:, None]
        way = np.where(kind == ShiftKind.OWN, own, end - start)
        return np.asarray(np.where(kind == ShiftKind.FRAME, frame, way))

    def _measure_turn(self, inner: Floats, to: Floats, numbers: Floats) -> Floats:
        """Return what targets are turned otherwise than they should, (k,) [rad]."""
        got = self._link(inner, frames_of(numbers, self.dialect))[:, :3, :3]
        off = to[:, :3, :3] @ np.swapaxes(got, 1, 2)
        return np.asarray(np.linalg.norm(rotation_vector(off), axis=1))
