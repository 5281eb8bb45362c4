"""What scatters a measurement: its components, as a model keeps them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.robot.state import States

TRACKER_FIXED, TRACKER_RANGE = 1e-5, 5e-6  # [m], [m/m] a laser tracker's data sheet
ALIKE = (1.0,) * 6  # joints
SAME_POSE = 6e-5  # [rad] joint angles that are one pose, read back to 0.001 deg


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
        by_joint: Scatter of every joint over r and R, (6,).
    """

    tracker: float
    joint: float
    origin: tuple[float, float, float] | None = None
    stop: float = 0.0
    pose_joint: float = 0.0
    pose: float = 0.0
    rounding: float = 0.0
    by_joint: tuple[float, ...] = ALIKE

    @property
    def joint_std(self) -> Floats:
        """Standard deviation of every joint angle from stop to stop, (6,) [rad]."""
        return self.joint * np.array(self.by_joint)

    def tracker_std(self, position: Floats) -> Floats:
        """Standard deviation per axis of the tracker at positions (n, 3), (n,) [m]."""
        std: Floats = self.tracker * tracker_shape(position, self.origin)
        return std

    def arrival_variance(self, jacobian: Floats) -> Floats:
        """Variance per axis of one arrival, (n, 3) [m^2]."""
        return _propagate_angle(jacobian, self.joint_std, self.stop)

    def scatter_columns(self, jacobian: Floats) -> Floats:
        """Return independent parts of the scatter of one arrival, (n, 3, 9) [m]."""
        shift = np.broadcast_to(self.stop * np.eye(3), (len(jacobian), 3, 3))
        return np.concatenate([jacobian * self.joint_std, shift], axis=2)

    def pose_columns(self, jacobian: Floats) -> Floats:
        """Return the same of a pose that was not measured, (n, 3, 9) [m]."""
        of_pose = replace(self, joint=self.pose_joint, stop=self.pose)
        return of_pose.scatter_columns(jacobian)

    def pose_variance(self, jacobian: Floats) -> Floats:
        """Variance per axis of a pose that was not measured, (n, 3) [m^2]."""
        own = self.pose_joint * np.array(self.by_joint)
        return _propagate_angle(jacobian, own, self.pose)

    def rounding_variance(self, q: Floats, jacobian: Floats) -> Floats:
        """Variance per axis of rows with joint angles q (n, 6) [rad], (n, 3) [m^2]."""
        rounding = self.rounding if self.rounding and angle_step(q) else 0.0
        return _propagate_angle(jacobian, np.full(6, rounding), 0.0)

    def rescale(self, factor: float) -> Noise:
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


def _propagate_angle(jacobian: Floats, joint: Floats, shift: float) -> Floats:
    """Variance per axis of joint angles (6,) and of a shift, (n, 3) [m^2]."""
    return np.asarray(np.square(jacobian) @ joint**2 + shift**2)


def tracker_shape(
    position: Floats, origin: tuple[float, float, float] | None
) -> Floats:
    """Data-sheet standard deviation of a tracker at positions (n, 3), (n,) [m]."""
    if origin is None:
        return np.full(len(position), TRACKER_FIXED)
    reach = np.linalg.norm(position - np.array(origin), axis=1)
    return np.asarray(TRACKER_FIXED + TRACKER_RANGE * reach)


def poses_of(states: States, same: float = SAME_POSE) -> Ints:
    """Number the commanded poses, (n,): rows of one pose have equal joint angles.

    Angles that were read back differ in their last digit, and count as equal. A row
    that was read in motion is a pose of its own.

    Args:
        states: The rows.
        same: What angles of one pose differ by [rad].
    """
    from scipy.sparse import coo_array  # slow to load, and for fits alone
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    moving = ~np.isnan(states.heading[:, 0])
    payload = np.nan_to_num(states.payload)[:, None]
    own = np.where(moving, np.arange(1, len(states) + 1), 0)[:, None]
    key = np.concatenate([np.round(states.q / same), payload, own], axis=1)
    cells, first, label = np.unique(key, axis=0, return_index=True, return_inverse=True)
    near = cKDTree(states.q[first]).query_pairs(same, np.inf, output_type="ndarray")
    near = near[(cells[near[:, 0], 6:] == cells[near[:, 1], 6:]).all(axis=1)]
    if len(near):  # readings of one pose on both sides of a step of the rounding
        pair, count = (near[:, 0], near[:, 1]), len(cells)
        graph = coo_array((np.ones(len(near)), pair), shape=(count, count))
        joined = connected_components(graph, directed=False)[1]
        return np.asarray(joined[label.reshape(-1)], dtype=np.int64)
    return np.asarray(label.reshape(-1), dtype=np.int64)


def groups_of(label: Ints) -> list[Ints]:
    """List the rows that share a label with others: (groups, m) for every size m."""
    order = np.argsort(label, kind="stable")
    cuts = np.flatnonzero(np.diff(label[order])) + 1
    parts = [rows for rows in np.split(order, cuts) if len(rows) > 1]
    sizes = sorted({len(rows) for rows in parts})
    return [np.array([rows for rows in parts if len(rows) == m]) for m in sizes]
