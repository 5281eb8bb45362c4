"""The covariance of rows that share a stop or a pose, and what makes it diagonal.

A row is not a measurement, a stop is: readings and nests of one stop share where the
arm stood, and all stops of one pose share what the model cannot know of that pose. The
covariance of the rows of one pose is

    V = diag(t^2 T / k) + same stop * (r^2 J J^T + s^2 1) + (R^2 J J^T + S^2 1),

with t^2 T the tracker's variance (equal on all axes, growing with range) over the k
readings that a row is the mean of; r and s the scatter of a stop, as joint angles that
do not repeat and as a shift; R and S the same of the pose: rounded joint angles, and
errors that no effect describes. Rows of different poses are independent.

A row that is alone at its pose has a diagonal covariance in the eigenbasis of J J^T,
for any sizes. All rows are rotated there; those that share a pose then take a matrix
for all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.model.kinematics import ArmStates
from postproc.model.noise import Noise, groups_of, poses_of, tracker_shape
from postproc.robot.state import States

ENOUGH_RETURNS = 5  # to a pose, that part scatter of stops from errors of a pose
UNSEEN = 1.0  # [m] as good as not measured
NO_POSE = 0.05  # share of the variance below which poses scatter no more than stops
KINDS = ("tracker", "joint", "stop", "pose_joint", "pose")


def _along_first(heading: Floats) -> Floats:
    """Give right-handed bases (n, 3, 3) whose first columns are unit vectors (n, 3)."""
    aside = np.eye(3)[np.abs(heading).argmin(axis=1)]
    second = np.cross(heading, aside)
    second /= np.linalg.norm(second, axis=1)[:, None]
    return np.stack([heading, second, np.cross(heading, second)], axis=2)


# Matrices that act on the rows of a group at once.


@dataclass(frozen=True, eq=False)
class RowBlocks:
    """Matrices for groups of rows; all other rows stay as they are.

    Attributes:
        parts: For every size m of a group its rows, (groups, m), and matrices,
            (groups, 3 m, 3 m).
    """

    parts: tuple[tuple[Ints, Floats], ...] = ()

    def __bool__(self) -> bool:
        """Return True if there is any group."""
        return bool(self.parts)

    @cached_property
    def rows(self) -> Ints:
        """All rows of groups, ascending."""
        none = [np.zeros(0, dtype=np.int64)]
        return np.sort(np.concatenate([*none, *(r.reshape(-1) for r, _ in self.parts)]))

    def apply(self, rows: Floats, transposed: bool = False) -> Floats:
        """Multiply rows (n, 3) or (n, 3, k) by the matrices of their groups."""
        if not self.parts:
            return rows
        out = np.array(rows)
        for index, matrix in self.parts:
            count, m = index.shape
            stacked = rows[index].reshape(count, 3 * m, -1)
            by = np.swapaxes(matrix, 1, 2) if transposed else matrix
            out[index] = (by @ stacked).reshape(count, m, *rows.shape[1:])
        return out

    def at_rows(self, rows: Ints, count: int) -> RowBlocks:
        """Keep the groups of some rows.

        Args:
            rows: Which of the rows, in their new order.
            count: Number of rows now.

        Raises:
            ValueError: A group is among them in part.
        """
        place = np.full(count, -1, dtype=np.int64)
        place[rows] = np.arange(len(rows))
        parts = []
        for index, matrix in self.parts:
            inside = (place[index] >= 0).all(axis=1)
            if (place[index[~inside]] >= 0).any():
                raise ValueError("rows of one pose were separated")
            if inside.any():
                parts.append((place[index[inside]], matrix[inside]))
        return RowBlocks(tuple(parts))


@dataclass(frozen=True, eq=False)
class Whitening:
    """What makes the noise of rotated rows independent and of unit variance.

    Attributes:
        scale: What rotated components are multiplied with, (n, 3) [1/m]; 1 for rows of
            a group.
        blocks: Matrices of the groups [1/m].
        log_det: Sum of the logarithms of all variances of rows that are used.
    """

    scale: Floats
    blocks: RowBlocks
    log_det: float

    def apply(self, rotated: Floats) -> Floats:
        """Whiten rotated rows (n, 3) or (n, 3, k)."""
        scale = self.scale if rotated.ndim == 2 else self.scale[:, :, None]
        return self.blocks.apply(rotated * scale)


# The rows of one pose.


@dataclass(frozen=True, eq=False)
class PoseBlock:
    """Poses of m rows each.

    Attributes:
        rows: Their rows, (groups, m).
        stop: Whether two rows are of one stop, (groups, 3 m, 3 m), 1 or 0.
        joint: J J^T between the rows, in their eigenbases, (groups, 3 m, 3 m).
        shift: A common shift seen in their eigenbases, (groups, 3 m, 3 m).
    """

    rows: Ints
    stop: Floats
    joint: Floats
    shift: Floats

    @classmethod
    def of(cls, rows: Ints, order: Floats, turn: Floats, jacobian: Floats) -> PoseBlock:
        """Take the rows of poses, (groups, m).

        Args:
            rows: Their numbers.
            order: Place of every row in the visit order, (n,): equal within a stop.
            turn: Rotations into the eigenbases, (n, 3, 3).
            jacobian: (n, 3, 6) [m/rad].
        """
        count, m = rows.shape
        same = order[rows][:, :, None] == order[rows][:, None, :]
        stop = np.repeat(np.repeat(same.astype(float), 3, axis=1), 3, axis=2)
        seen = (turn[rows] @ jacobian[rows]).reshape(count, 3 * m, 6)
        axes = turn[rows].reshape(count, 3 * m, 3)
        joint = seen @ np.swapaxes(seen, 1, 2)
        return cls(rows, stop, joint, axes @ np.swapaxes(axes, 1, 2))

    def parts(self, kind: str) -> Floats:
        """Return the covariance per unit variance of a component off the tracker."""
        shape = self.joint if kind in ("joint", "pose_joint") else self.shift
        return shape * self.stop if kind in ("joint", "stop") else shape

    def covariance(self, noise: Noise, own: Floats) -> Floats:
        """Covariance of the rows of each pose, (groups, 3 m, 3 m) [m^2].

        Args:
            noise: The components.
            own: Variances of the rows by themselves, (n, 3) [m^2].
        """
        out = self.stop * (noise.joint**2 * self.joint + noise.stop**2 * self.shift)
        out += noise.pose_joint**2 * self.joint + noise.pose**2 * self.shift
        k = np.arange(out.shape[1])
        out[:, k, k] += own[self.rows].reshape(len(out), -1)
        return out


@dataclass(frozen=True)
class ReadingScatter:
    """Scatter of repeated readings round their means: the tracker's alone.

    Attributes:
        square: Sum of squares over the data sheet's variances.
        freedom: Degrees of freedom.
        log_shape: Sum of the logarithms of these variances.
    """

    square: float = 0.0
    freedom: float = 0.0
    log_shape: float = 0.0

    def log_noise(self, tracker: float) -> float:
        """Return minus twice their log likelihood, up to a constant."""
        if not self.freedom:
            return 0.0
        spread = self.freedom * 2.0 * float(np.log(tracker))
        return spread + self.log_shape + self.square / tracker**2


@dataclass(frozen=True, eq=False)
class Whitener:
    """Rotations that make the covariance of rows alone diagonal, and its parts.

    Attributes:
        turn: Rotates base axes into the eigenbasis of J J^T, (n, 3, 3).
        tracker, joint: Variances per unit t^2 and r^2 in that basis, (n, 3).
        extra: Variance known beforehand (an unknown direction), (n, 3) [m^2].
        unseen: Variance of what the reading does not tell at all, (n, 3) [m^2].
        origin: Tracker position, see `Noise`.
        blocks: Rows that share a pose.
        readings: Scatter of repeated readings.
        estimated: Names of the components that the rows can tell apart.
    """

    turn: Floats
    tracker: Floats
    joint: Floats
    extra: Floats
    unseen: Floats
    origin: tuple[float, float, float] | None
    blocks: tuple[PoseBlock, ...] = ()
    readings: ReadingScatter = field(default_factory=ReadingScatter)
    estimated: tuple[str, ...] = ("tracker", "joint")

    @classmethod
    def build(
        cls,
        batch: ArmStates,
        position: Floats,
        origin: tuple[float, float, float] | None,
        extra: Floats | None = None,
    ) -> Whitener:
        """Diagonalise the covariance of every row.

        Args:
            batch: The states.
            position: Measured positions, (n, 3) [m].
            origin: Tracker position in the frame of `position`, or None.
            extra: Additional variance of each row, (n,) [m^2].
        """
        J, states = batch.jacobian, batch.states
        square = J @ np.swapaxes(J, 1, 2)
        values, vectors = np.linalg.eigh(square)
        heading = states.heading
        unseen, moving = np.zeros_like(values), ~np.isnan(heading[:, 0])
        if moving.any():
            vectors[moving] = _along_first(heading[moving])
            turned = np.swapaxes(vectors, 1, 2) @ square @ vectors
            values[moving] = np.einsum("nii->ni", turned)[moving]
            unseen[moving, 0] = UNSEEN**2
        shape = tracker_shape(position, origin) ** 2
        more = np.zeros(len(batch)) if extra is None else extra
        turn = np.swapaxes(vectors, 1, 2)
        groups = groups_of(poses_of(states))
        return cls(
            turn=turn,
            tracker=np.repeat((shape / states.readings)[:, None], 3, axis=1),
            joint=np.maximum(values, 0.0),
            extra=np.repeat(more[:, None], 3, axis=1),
            unseen=unseen,
            origin=origin,
            blocks=tuple(PoseBlock.of(g, states.order, turn, J) for g in groups),
            readings=_scatter_of_readings(states, shape),
            estimated=_estimable(states, groups),
        )

    def rotate(self, rows: Floats) -> Floats:
        """Rotate (n, 3) or (n, 3, p) into the eigenbasis."""
        if rows.ndim == 2:
            return np.asarray(np.einsum("nij,nj->ni", self.turn, rows))
        return np.asarray(self.turn @ rows)

    def own_variance(self, noise: Noise) -> Floats:
        """Variance of every rotated component that a row shares with no other row."""
        own: Floats = noise.tracker**2 * self.tracker + self.extra + self.unseen
        return own

    def variance(self, noise: Noise) -> Floats:
        """Variance of every rotated component, (n, 3) [m^2]."""
        joint, shift = (
            noise.joint**2 + noise.pose_joint**2,
            noise.stop**2 + noise.pose**2,
        )
        total: Floats = self.own_variance(noise) + joint * self.joint + shift
        return total

    def read_variance(self, noise: Noise) -> float:
        """Return the mean variance of the components that are read [m^2].

        Of rows that were read in motion the one along it is not.
        """
        return float(self.variance(noise)[self.unseen == 0.0].mean())

    def whitening(self, noise: Noise, weight: Floats) -> Whitening:
        """Make the noise of rows independent and of unit variance.

        The variance of a row of weight w < 1 is larger by (1 / w - 1) of it; a row of
        weight 0 says nothing.

        Args:
            noise: Sizes of the components.
            weight: Of every row, (n,).
        """
        v, used = self.variance(noise), weight > 0
        scale: Floats = np.sqrt(weight[:, None] / v)
        logs = np.where(used[:, None], np.log(v), 0.0)
        log_det, parts = self.readings.log_noise(noise.tracker), []
        for block in self.find_correlated(noise):
            V = block.covariance(noise, self.own_variance(noise))
            own = np.linalg.slogdet(_mask_rows(V, used[block.rows]))[1]
            log_det += float(own.sum()) - float(logs[block.rows].sum())
            inflated = V + _inflation(v[block.rows], weight[block.rows])
            root = _inverse_root(_mask_rows(inflated, used[block.rows]))
            there = np.repeat(used[block.rows], 3, axis=1)
            parts.append((block.rows, root * (there[:, :, None] & there[:, None])))
            scale[block.rows] = 1.0
        return Whitening(scale, RowBlocks(tuple(parts)), log_det + float(logs.sum()))

    def find_correlated(self, noise: Noise) -> tuple[PoseBlock, ...]:
        """Return the poses whose rows must be taken together."""
        shared = noise.pose_joint**2 * self.joint + noise.pose**2
        if float(shared.mean()) > NO_POSE * float(self.variance(noise).mean()):
            return self.blocks
        return tuple(
            b for b in (_several_in_stop(b) for b in self.blocks) if len(b.rows)
        )

    def distances(self, rotated: Floats, noise: Noise, weight: Floats) -> Floats:
        """Measure residuals in standard deviations, (n,).

        A row of a pose with others is also compared with what those, as far as they
        are used, make likely of it: a reading that disagrees with its own stop. Of
        rows that disagree it is the one that is farther off by itself.

        Args:
            rotated: Residuals in the eigenbases, (n, 3) [m].
            noise: Sizes of the components.
            weight: Weight of every row so far, (n,).
        """
        alone: Floats = np.sqrt((rotated**2 / self.variance(noise)).sum(axis=1))
        out = np.array(alone)
        for block in self.find_correlated(noise):
            V = block.covariance(noise, self.own_variance(noise))
            used = weight[block.rows] > 0
            off = _condition_on_others(V, rotated[block.rows], used)
            worst = (alone[block.rows] * used).max(axis=1, keepdims=True)
            asked = ~used | (alone[block.rows] >= worst)
            out[block.rows] = np.where(
                asked, np.maximum(off, alone[block.rows]), alone[block.rows]
            )
        return out


def _scatter_of_readings(states: States, shape: Floats) -> ReadingScatter:
    """Sum the scatter of readings over the tracker's variances, (n,) [m^2]."""
    more = states.readings > 1.0
    if not more.any():
        return ReadingScatter()
    freedom = 3.0 * (states.readings[more] - 1.0)
    square = float((states.scatter[more] / shape[more]).sum())
    log_shape = float((freedom * np.log(shape[more])).sum())
    return ReadingScatter(square, float(freedom.sum()), log_shape)


def _estimable(states: States, groups: Sequence[Ints]) -> tuple[str, ...]:
    """Name the components that rows can tell apart."""
    repeated, returns = bool((states.readings > 1.0).any()), 0
    nests = False
    for rows in groups:
        same_stop = np.diff(np.sort(states.order[rows], axis=1), axis=1) == 0.0
        returns += int((~same_stop).sum())
        nests |= bool(same_stop.any())
    out = KINDS[:3] if repeated or nests else KINDS[:2]
    return (*out, *KINDS[3:]) if returns >= ENOUGH_RETURNS else out


def _several_in_stop(block: PoseBlock) -> PoseBlock:
    """Keep the poses of which a stop has several rows."""
    m = block.rows.shape[1]
    several = block.stop[:, ::3, ::3].sum(axis=(1, 2)) > m
    return PoseBlock(
        block.rows[several], block.stop[several], block.joint[several],
        block.shift[several],
    )  # fmt: skip


def _inflation(v: Floats, weight: Floats) -> Floats:
    """Give rows of a weight below 1 more variance, (groups, 3 m, 3 m)."""
    more = 1.0 / np.where(weight > 0, np.minimum(weight, 1.0), 1.0) - 1.0
    diagonal = (v * more[:, :, None]).reshape(len(v), -1)
    out = np.zeros((*diagonal.shape, diagonal.shape[1]))
    k = np.arange(diagonal.shape[1])
    out[:, k, k] = diagonal
    return out


def _mask_rows(V: Floats, used: Bools) -> Floats:
    """Take rows out of covariances: they have unit variance, and no other row's.

    Args:
        V: (groups, 3 m, 3 m).
        used: Which rows stay, (groups, m).
    """
    there = np.repeat(used, 3, axis=1).astype(float)
    out: Floats = V * there[:, :, None] * there[:, None]
    k = np.arange(V.shape[1])
    out[:, k, k] += 1.0 - there
    return out


def _inverse_root(V: Floats) -> Floats:
    """Return symmetric W with W V W = 1, (groups, k, k)."""
    values, vectors = np.linalg.eigh(V)
    scaled = vectors / np.sqrt(values)[:, None]
    root: Floats = scaled @ np.swapaxes(vectors, 1, 2)
    return root


def _condition_on_others(V: Floats, rotated: Floats, used: Bools) -> Floats:
    """Measure rows against what the other used rows of their pose make likely.

    Args:
        V: Covariances, (groups, 3 m, 3 m).
        rotated: Residuals, (groups, m, 3).
        used: Which rows the others may be, (groups, m).

    Returns:
        Mahalanobis distances, (groups, m).
    """
    out = _distances_of(V, rotated, used) * used
    for k in np.flatnonzero(~used.all(axis=0)).tolist():  # beside those that are used
        some = np.flatnonzero(~used[:, k])
        asked = np.array(used[some])
        asked[:, k] = True
        out[some, k] = _distances_of(V[some], rotated[some], asked)[:, k]
    return out


def _distances_of(V: Floats, rotated: Floats, asked: Bools) -> Floats:
    """Measure each of some rows against the others of them, (groups, m)."""
    count, m = asked.shape
    P = np.linalg.inv(_mask_rows(V, asked))
    kept = rotated.reshape(count, -1) * np.repeat(asked, 3, axis=1)
    pulled = np.einsum("gij,gj->gi", P, kept).reshape(count, m, 3)
    k = np.arange(m)
    own = P.reshape(count, m, 3, m, 3)[:, k, :, k].swapaxes(0, 1)
    spread = np.linalg.solve(own, pulled[..., None])[..., 0]
    return np.asarray(np.sqrt(np.maximum((pulled * spread).sum(axis=2), 0.0)))
