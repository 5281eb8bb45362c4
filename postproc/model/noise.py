"""What scatters a measurement: tracker, arrival of the arm, and the pose.

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
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.model.kinematics import Batch
from postproc.robot.state import States

TRACKER_FIXED, TRACKER_RANGE = 1e-5, 5e-6  # [m], [m/m] a laser tracker's data sheet
DEAD = 0.03  # share of the largest component below which another begins again
LIVELY = 0.3  # with this share of the largest
UNSEEN = 1.0  # [m] as good as not measured
SMALLEST, LARGEST = 1e-7, 1e-2  # [m] bounds of all standard deviations at the TCP
SAME_POSE = 1e-5  # [rad] joint angles that are one pose
NO_POSE = 0.05  # share of the variance below which poses scatter no more than stops
KINDS = ("tracker", "joint", "stop", "pose_joint", "pose")


@dataclass(frozen=True)
class Noise:
    """The estimated components.

    Attributes:
        tracker: Factor t on the tracker's data sheet, 1 = as specified.
        joint: Standard deviation r of every joint angle from stop to stop [rad]. Where
            no pose has several stops, that of the pose is in it.
        origin: Tracker position in the base frame, (3,) [m], or None: the range is
            then not known, and the tracker's error is the same everywhere.
        stop: Standard deviation s of a stop per axis [m].
        pose_joint: Standard deviation R of every joint angle from pose to pose [rad].
        pose: Standard deviation S of a pose per axis [m].
        rounding: Part of R that rounded joint angles of the file explain [rad]: other
            rounded rows have it, commands have not.
    """

    tracker: float
    joint: float
    origin: tuple[float, float, float] | None = None
    stop: float = 0.0
    pose_joint: float = 0.0
    pose: float = 0.0
    rounding: float = 0.0

    def tracker_std(self, position: Floats) -> Floats:
        """Standard deviation per axis of the tracker at positions (n, 3), (n,) [m]."""
        std: Floats = self.tracker * tracker_shape(position, self.origin)
        return std

    def arrival_variance(self, jacobian: Floats) -> Floats:
        """Variance per axis of one arrival, (n, 3) [m^2]."""
        return _seen_through(jacobian, self.joint, self.stop)

    def pose_variance(self, jacobian: Floats) -> Floats:
        """Variance per axis of a pose that was not measured, (n, 3) [m^2]."""
        return _seen_through(jacobian, self.pose_joint, self.pose)

    def rounding_variance(self, q: Floats, jacobian: Floats) -> Floats:
        """Variance per axis of rows with joint angles q (n, 6) [rad], (n, 3) [m^2]."""
        rounding = self.rounding if self.rounding and angle_step(q) else 0.0
        return _seen_through(jacobian, rounding, 0.0)

    def scaled(self, factor: float) -> Noise:
        """Multiply the scatter of stops and poses, rounding aside, by a factor."""
        return replace(
            self, joint=factor * self.joint, stop=factor * self.stop,
            pose_joint=factor * self.pose_joint, pose=factor * self.pose,
        )  # fmt: skip


DECIMALS = 5  # of joint angles, from which on rounding is below all else
WRITTEN = 1e-6  # of the last decimal by which a written number is off


def angle_step(q: Floats) -> float:
    """Return the step of joint angles (n, 6) [rad] that were written rounded [rad].

    0 where they have more decimals than matter, as degrees or as radians.
    """
    for decimals in range(DECIMALS):
        for unit in (float(np.rad2deg(1.0)), 1.0):
            scaled = q * unit * 10.0**decimals
            if np.abs(scaled - np.round(scaled)).max(initial=0.0) < WRITTEN:
                return float(10.0**-decimals / unit)
    return 0.0


def _seen_through(jacobian: Floats, joint: float, shift: float) -> Floats:
    """Variance per axis of joint angles and of a shift, (n, 3) [m^2]."""
    square: Floats = np.einsum("nij,nij->ni", jacobian, jacobian)
    return joint**2 * square + shift**2


def tracker_shape(
    position: Floats, origin: tuple[float, float, float] | None
) -> Floats:
    """Data-sheet standard deviation of a tracker at positions (n, 3), (n,) [m]."""
    if origin is None:
        return np.full(len(position), TRACKER_FIXED)
    reach = np.linalg.norm(position - np.array(origin), axis=1)
    return np.asarray(TRACKER_FIXED + TRACKER_RANGE * reach)


def poses_of(states: States) -> Ints:
    """Number the commanded poses, (n,): rows of one pose have equal joint angles.

    A row that was read in motion is a pose of its own.
    """
    moving = ~np.isnan(states.heading[:, 0])
    payload = np.nan_to_num(states.payload)[:, None]
    own = np.where(moving, np.arange(1, len(states) + 1), 0)[:, None]
    key = np.concatenate([np.round(states.q / SAME_POSE), payload, own], axis=1)
    _, label = np.unique(key, axis=0, return_inverse=True)
    return np.asarray(label.reshape(-1), dtype=np.int64)


def groups_of(label: Ints) -> list[Ints]:
    """List the rows that share a label with others: (groups, m) for every size m."""
    order = np.argsort(label, kind="stable")
    cuts = np.flatnonzero(np.diff(label[order])) + 1
    parts = [rows for rows in np.split(order, cuts) if len(rows) > 1]
    sizes = sorted({len(rows) for rows in parts})
    return [np.array([rows for rows in parts if len(rows) == m]) for m in sizes]


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
                raise ValueError("rows of one pose were taken apart")
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
        batch: Batch,
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
        for block in self.correlated(noise):
            V = block.covariance(noise, self.own_variance(noise))
            log_det += _log_det(V, used[block.rows]) - float(logs[block.rows].sum())
            inflated = V + _inflation(v[block.rows], weight[block.rows])
            root = _inverse_root(_masked(inflated, used[block.rows]))
            there = np.repeat(used[block.rows], 3, axis=1)
            parts.append((block.rows, root * (there[:, :, None] & there[:, None])))
            scale[block.rows] = 1.0
        return Whitening(scale, RowBlocks(tuple(parts)), log_det + float(logs.sum()))

    def correlated(self, noise: Noise) -> tuple[PoseBlock, ...]:
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
        for block in self.correlated(noise):
            V = block.covariance(noise, self.own_variance(noise))
            used = weight[block.rows] > 0
            off = _given_others(V, rotated[block.rows], used)
            worst = (alone[block.rows] * used).max(axis=1, keepdims=True)
            asked = ~used | (alone[block.rows] >= worst)
            out[block.rows] = np.where(
                asked, np.maximum(off, alone[block.rows]), alone[block.rows]
            )
        return out

    def estimate(
        self,
        squares: Floats,
        weight: Floats,
        start: Noise,
        products: Sequence[Floats] = (),
    ) -> Noise:
        """Maximise the likelihood of expected squared residuals over the components.

        Args:
            squares: Squared residual plus its posterior variance, rotated, (n, 3).
            weight: Weight of every row, (n,), 0 drops it.
            start: Where to begin.
            products: The same as products between the rows of each of `blocks`,
                (groups, 3 m, 3 m); without them rows of a pose count by themselves.
        """
        with_others = len(products) == len(self.blocks)
        kinds = self.estimated if with_others else KINDS[:2]
        alone = np.ones(len(weight), dtype=bool)
        costs: list[_Cost] = []
        if with_others:
            for block, S in zip(self.blocks, products, strict=True):
                alone[block.rows] = False
                costs.append(_BlockCost.of(self, block, S, weight, kinds))
        costs.append(_RowCost.of(self, squares, weight * alone, kinds))
        costs.append(_ReadingCost(self.readings, kinds))
        best = _score(costs, *self._begin(start, kinds))
        found = dict(zip(kinds, np.exp(best).tolist(), strict=True))
        return replace(Noise(0.0, 0.0, self.origin), **found)

    def _begin(
        self, start: Noise, kinds: Sequence[str]
    ) -> tuple[Floats, Floats, Floats]:
        """Return logarithms to begin with, and their bounds.

        A component of no size has no slope by its logarithm and would stay so.
        """
        t0 = float(np.median(np.sqrt(self.tracker)))
        r0 = float(np.median(np.sqrt(self.joint.mean(axis=1))))
        unit = {"tracker": t0, "joint": r0, "pose_joint": r0, "stop": 1.0, "pose": 1.0}
        size = np.array([getattr(start, k) * unit[k] for k in kinds])
        largest = float(size.max())
        size = np.where(size < DEAD * largest, LIVELY * largest, size)
        units = np.array([unit[k] for k in kinds])
        low, high = np.log(SMALLEST / units), np.log(LARGEST / units)
        begin = np.log(np.maximum(size, SMALLEST) / units)
        return np.clip(begin, low, high), low, high


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
    order = states.order
    repeated = bool((states.readings > 1.0).any())
    nests = rounds = False
    for rows in groups:
        stops = order[rows]
        rounds |= bool((stops != stops[:, :1]).any())
        in_stop = (np.diff(np.sort(stops, axis=1), axis=1) == 0.0).any()
        nests |= bool(in_stop)
    out = KINDS[:3] if repeated or nests else KINDS[:2]
    return (*out, *KINDS[3:]) if rounds else out


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


def _masked(V: Floats, used: Bools) -> Floats:
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


def _log_det(V: Floats, used: Bools) -> float:
    """Sum log determinants of covariances of the rows that are used."""
    return float(np.linalg.slogdet(_masked(V, used))[1].sum())


def _given_others(V: Floats, rotated: Floats, used: Bools) -> Floats:
    """Measure rows against what the other used rows of their pose make likely.

    Args:
        V: Covariances, (groups, 3 m, 3 m).
        rotated: Residuals, (groups, m, 3).
        used: Which rows the others may be, (groups, m).

    Returns:
        Mahalanobis distances, (groups, m).
    """
    count, m = used.shape
    out = np.zeros((count, m))
    flat = rotated.reshape(count, -1)
    for k in range(m):
        asked = np.array(used)
        asked[:, k] = True
        P = np.linalg.inv(_masked(V, asked))
        kept = np.repeat(asked, 3, axis=1)
        own = slice(3 * k, 3 * k + 3)
        pulled = np.einsum("gij,gj->gi", P[:, own], flat * kept)
        spread = np.linalg.solve(P[:, own, own], pulled[:, :, None])[:, :, 0]
        out[:, k] = np.sqrt(np.maximum((pulled * spread).sum(axis=1), 0.0))
    return out


# What sizes of the components cost: minus their log likelihood, asked by their squares.

SCORES = 20  # steps at the most
FARTHEST = 1.5  # step of the logarithm of a standard deviation
HALVINGS = 6  # of a step that leads uphill
LEAST_BEND = 1e-6  # of the trace of the information, in every direction
ENOUGH = 1e-3  # nats that a further step must bring


class _Cost(Protocol):
    """Minus the log likelihood of some rows, by the squared sizes of the components."""

    def value(self, sizes: Floats) -> float:
        """Evaluate it."""

    def slopes(self, sizes: Floats) -> tuple[Floats, Floats]:
        """Return its slope by the sizes, and the Fisher information."""


@dataclass(frozen=True, eq=False)
class _RowCost:
    """Of rows alone.

    Attributes:
        parts: Variance per unit of each component, (kinds, n, 3).
        known, square, weight: As in `Whitener.estimate`.
    """

    parts: Floats
    known: Floats
    square: Floats
    weight: Floats

    @classmethod
    def of(
        cls, whitener: Whitener, square: Floats, weight: Floats, kinds: Sequence[str]
    ) -> _RowCost:
        """Take the rows that are used."""
        used = weight > 0
        ones = np.ones_like(whitener.joint)
        shape = {
            "tracker": whitener.tracker, "joint": whitener.joint, "stop": ones,
            "pose_joint": whitener.joint, "pose": ones,
        }  # fmt: skip
        parts = np.stack([shape[k][used] for k in kinds])
        known = (whitener.extra + whitener.unseen)[used]
        return cls(parts, known, square[used], weight[used, None])

    def value(self, sizes: Floats) -> float:
        """Return minus the log likelihood."""
        v = np.tensordot(sizes, self.parts, axes=1) + self.known
        return 0.5 * float((self.weight * (np.log(v) + self.square / v)).sum())

    def slopes(self, sizes: Floats) -> tuple[Floats, Floats]:
        """Return its slope by the sizes, and the Fisher information."""
        v = np.tensordot(sizes, self.parts, axes=1) + self.known
        slope = 0.5 * self.weight * (1.0 / v - self.square / v**2)
        scaled = (self.parts * np.sqrt(self.weight) / v).reshape(len(sizes), -1)
        return np.tensordot(self.parts, slope, axes=2), 0.5 * scaled @ scaled.T


@dataclass(frozen=True, eq=False)
class _BlockCost:
    """Of rows that share a pose.

    Attributes:
        parts: Covariance per unit of each component, (kinds, groups, 3 m, 3 m).
        known, square: Known covariance and expected products, (groups, 3 m, 3 m).
        weight: Of every group, (groups,).
    """

    parts: tuple[Floats, ...]
    known: Floats
    square: Floats
    weight: Floats

    @classmethod
    def of(
        cls,
        whitener: Whitener,
        block: PoseBlock,
        products: Floats,
        weight: Floats,
        kinds: Sequence[str],
    ) -> _BlockCost:
        """Take the poses of which any row is used."""
        rows = block.rows
        used = np.repeat(weight[rows] > 0, 3, axis=1).astype(float)
        mask, k = used[:, :, None] * used[:, None], np.arange(used.shape[1])
        parts = []
        for kind in kinds:
            if kind == "tracker":
                part = np.zeros_like(mask)
                part[:, k, k] = whitener.tracker[rows].reshape(len(rows), -1)
            else:
                part = block.parts(kind)
            parts.append(part * mask)
        known = np.zeros_like(mask)
        extra = (whitener.extra + whitener.unseen)[rows].reshape(len(rows), -1)
        known[:, k, k] = extra * used + (1.0 - used)
        heaviness = np.where(weight[rows] > 0, weight[rows], np.inf).min(axis=1)
        heaviness = np.where(np.isfinite(heaviness), heaviness, 0.0)
        return cls(tuple(parts), known, products * mask, heaviness)

    def value(self, sizes: Floats) -> float:
        """Return minus the log likelihood."""
        root = np.linalg.cholesky(self._covariance(sizes))
        log_det = 2.0 * np.log(np.einsum("gii->gi", root)).sum(axis=1)
        inverse = np.linalg.inv(root)
        square = np.einsum("gij,gji->g", inverse @ self.square, inverse.swapaxes(1, 2))
        return 0.5 * float((self.weight * (log_det + square)).sum())

    def slopes(self, sizes: Floats) -> tuple[Floats, Floats]:
        """Return its slope by the sizes, and the Fisher information."""
        P = np.linalg.inv(self._covariance(sizes))
        M = 0.5 * (P - P @ self.square @ P) * self.weight[:, None, None]
        slope = np.array([float((M * p).sum()) for p in self.parts])
        turned = [P @ p for p in self.parts]
        weighed = [t * self.weight[:, None, None] for t in turned]
        information = [
            [float((a * b.swapaxes(1, 2)).sum()) for b in turned] for a in weighed
        ]
        return slope, 0.5 * np.array(information)

    def _covariance(self, sizes: Floats) -> Floats:
        """Sum the components, (groups, 3 m, 3 m)."""
        parts = zip(sizes, self.parts, strict=True)
        return np.asarray(self.known + sum(s * p for s, p in parts))


@dataclass(frozen=True, eq=False)
class _ReadingCost:
    """Of repeated readings."""

    readings: ReadingScatter
    kinds: Sequence[str]

    def value(self, sizes: Floats) -> float:
        """Return minus the log likelihood."""
        return 0.5 * self.readings.log_noise(float(np.sqrt(sizes[0])))

    def slopes(self, sizes: Floats) -> tuple[Floats, Floats]:
        """Return its slope by the sizes, and the Fisher information."""
        slope, t2 = np.zeros(len(sizes)), float(sizes[0])
        slope[0] = (self.readings.freedom - self.readings.square / t2) / (2.0 * t2)
        information = np.zeros((len(sizes), len(sizes)))
        information[0, 0] = self.readings.freedom / (2.0 * t2**2)
        return slope, information


def _score(costs: Sequence[_Cost], begin: Floats, low: Floats, high: Floats) -> Floats:
    """Minimise costs by logarithms of standard deviations: Fisher's scoring.

    Args:
        costs: What sizes of the components cost.
        begin: Where to begin, (kinds,).
        low: Lower bounds, (kinds,).
        high: Upper bounds, (kinds,).
    """

    def value(u: Floats) -> float:
        return sum(cost.value(np.exp(2.0 * u)) for cost in costs)

    u, here = begin, value(begin)
    for _ in range(SCORES):
        sizes = np.exp(2.0 * u)
        parts = [cost.slopes(sizes) for cost in costs]
        slope = 2.0 * sizes * np.sum([p[0] for p in parts], axis=0)
        bend = 4.0 * np.outer(sizes, sizes) * np.sum([p[1] for p in parts], axis=0)
        free = ~((u <= low) & (slope > 0.0) | (u >= high) & (slope < 0.0))
        step = np.zeros(len(u))
        bend += np.eye(len(u)) * LEAST_BEND * max(float(np.trace(bend)), 1e-300)
        step[free] = -np.linalg.solve(bend[np.ix_(free, free)], slope[free])
        step *= min(1.0, FARTHEST / max(float(np.abs(step).max()), 1e-300))
        for _ in range(HALVINGS):
            there = np.clip(u + step, low, high)
            found = value(there)
            if found < here:
                break
            step = step / 2.0
        if not found < here - ENOUGH:
            break
        u, here = there, found
    return u
