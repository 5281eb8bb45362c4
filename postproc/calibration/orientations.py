"""Measured orientations of a 6D probe, and rows that measure something else."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from postproc.arrays import Bools, Floats, Ints
from postproc.calibration.evidence import Normal
from postproc.model.effect_sum import Combination
from postproc.model.kinematics import ArmStates
from postproc.robot.pose import rotation_vector

# Which rows are no measurements of this arm: wrong nest, disturbed beam, a knock.
#
# A row is an outlier only if its neighbours disagree with it. Rows that stand out
# together, at one place of one joint or of the joint space, are a property of the arm.

NEIGHBOURS = 6
AGREES = 0.35  # share of a row's residual that its neighbours must show as well
FALSE_ALARMS = 0.01  # expected per survey of good rows
DROPPED = 0.05  # below this weight a row counts as dropped


@dataclass(frozen=True)
class RowWeights:
    """Weight of every row, and why it is not 1.

    Attributes:
        weight: (n,) in [0, 1].
        distance: Residual in standard deviations (Mahalanobis), (n,).
        spared: Rows that stand out and are kept, because neighbours agree, (n,).
    """

    weight: Floats
    distance: Floats
    spared: NDArray[np.bool_]


def student_weights(distance: Floats) -> Floats:
    """Weights of a heavy-tailed first pass, (n,): Student t with 4 degrees."""
    weight: Floats = (4.0 + 3.0) / (4.0 + distance**2)
    return weight


def limit_of(n: int) -> float:
    """Distance in standard deviations from which one of n rows stands out."""
    return float(np.sqrt(chi2.isf(FALSE_ALARMS / max(n, 1), 3)))


def judge(
    distance: Floats, residual: Floats, q: Floats, jacobian: Floats, pose: Ints
) -> RowWeights:
    """Weigh the rows of a survey.

    Args:
        distance: Mahalanobis distance of every residual, (n,).
        residual: Residual positions, (n, 3) [m].
        q: Joint angles, (n, 6) [rad].
        jacobian: Position Jacobian, (n, 3, 6) [m/rad].
        pose: Number of the pose of every row, (n,): rows of one pose are no neighbours.
    """
    limit = limit_of(len(distance))
    stands_out = distance > limit
    spared = np.zeros(len(distance), dtype=bool)
    _, first, of_row = np.unique(pose, return_index=True, return_inverse=True)
    if stands_out.any() and len(first) > 2 * NEIGHBOURS:
        rows, place = np.flatnonzero(stands_out), of_row.reshape(-1)
        mean = means(residual, place)
        poses = Poses(q[first], mean, jacobian[first])
        own = residual[rows], jacobian[rows], place[rows]
        spared[rows] = poses.share(*own) | poses.share_joint_error(*own)
    weight = np.where(stands_out & ~spared, (limit / distance.clip(1e-300)) ** 4, 1.0)
    weight[weight < DROPPED] = 0.0
    return RowWeights(weight, distance, spared)


@dataclass(frozen=True, eq=False)
class Poses:
    """All poses, each with the mean residual of its rows.

    Attributes:
        q: Joint angles, (k, 6) [rad].
        residual: Mean residuals, (k, 3) [m].
        jacobian: (k, 3, 6) [m/rad].
    """

    q: Floats
    residual: Floats
    jacobian: Floats

    def share(self, own: Floats, jacobian: Floats, place: Ints) -> Bools:
        """Find the rows whose residual the nearest poses in joint space share, (r,).

        Args:
            own: Residuals of the rows, (r, 3) [m].
            jacobian: Of the rows, (r, 3, 6) [m/rad].
            place: Their poses, (r,).
        """
        spread = np.maximum(self.q.std(axis=0), 1e-9)
        tree, asked = cKDTree(self.q / spread), self.q[place] / spread
        nearest = np.asarray(tree.query(asked, k=NEIGHBOURS + 1)[1])
        along = np.einsum("rkj,rj->rk", self.residual[_without(place, nearest)], own)
        return np.asarray(np.median(along, axis=1) > AGREES * (own**2).sum(axis=1))

    def share_joint_error(self, own: Floats, jacobian: Floats, place: Ints) -> Bools:
        """Find the rows whose joint error poses at the same angle share, (r,).

        The residual is read as an error of that joint alone; it must explain most of
        the row, and the poses next to it on that joint must show the same error.
        """
        angle, explained = _as_joint_error(own, jacobian)
        others, _ = _as_joint_error(self.residual, self.jacobian)
        count, agrees = len(self.q), np.zeros(len(own), dtype=bool)
        for j in range(self.q.shape[1]):
            order = np.argsort(self.q[:, j], kind="stable")
            rank = np.empty(count, dtype=int)
            rank[order] = np.arange(count)
            at = rank[place]  # their neighbours follow, NEIGHBOURS of each
            first = np.clip(at - NEIGHBOURS // 2, 0, count - NEIGHBOURS - 1)[:, None]
            beside = first + np.arange(NEIGHBOURS)
            near = order[beside + (beside >= at[:, None])]
            signed = others[near, j] * np.sign(angle[:, j])[:, None]
            same = np.median(signed, axis=1) > AGREES * np.abs(angle[:, j])
            agrees |= same & (explained[:, j] > 0.5)
        return agrees


def means(values: Floats, label: Ints) -> Floats:
    """Average values (n, k) over each label."""
    sums = [np.bincount(label, column) for column in values.T]
    return np.asarray(np.stack(sums, axis=1) / np.bincount(label)[:, None])


def _as_joint_error(residual: Floats, jacobian: Floats) -> tuple[Floats, Floats]:
    """Read residuals (k, 3) as errors of each joint alone.

    Returns:
        Angles, (k, 6) [rad], and the share of the squared residual that each explains.
    """
    square = np.maximum((jacobian**2).sum(axis=1), 1e-12)
    angle = np.einsum("nij,ni->nj", jacobian, residual) / square
    total = np.maximum((residual**2).sum(axis=1), 1e-300)[:, None]
    return angle, angle**2 * square / total


def _without(own: Ints, near: Ints) -> Ints:
    """Take each row out of those that are nearest to it, (r, k + 1) to (r, k).

    Where more rows are at one place it need not be the first, nor among them.
    """
    same = near == own[:, None]
    same[~same.any(axis=1), -1] = True
    return np.asarray(near[~same].reshape(len(own), -1))


# Measured orientations: what a 6D probe tells besides its position.
#
# A measured orientation is exp(e) R P: R the nominal flange's, P the probe's mounting
# on it, e the rotation error of the arm and of the set-up. Effects are linear in e as
# they are in position, so orientations are further rows of the same regression, with a
# noise level of their own.

TYPICAL = 1e-3  # [rad] scatter to begin with: that of an arm not yet calibrated
SMALLEST = 1e-7  # [rad]
PASSES = 5  # of the robust mean of a mounting
ROBUST = 3.0  # rows beyond this many typical distances do not count in it


@dataclass(frozen=True, eq=False)
class Turns:
    """Orientations of n rows against the nominal arm's.

    Attributes:
        measured: Rotation from the nominal to the measured orientation, (n, 3) [rad],
            base frame.
        residual: What the effects leave of it, (n, 3) [rad].
        columns: Derivatives by the parameters, (n, 3, p).
        std: Estimated scatter of one component [rad].
        weight: Weight of every row, (n,).
    """

    measured: Floats
    residual: Floats
    columns: Floats
    std: float
    weight: Floats

    @classmethod
    def of(cls, batch: ArmStates, rotation: Floats, mounting: Floats | None) -> Turns:
        """Compare measured orientations with the nominal arm's.

        Args:
            batch: States of the rows, nominal kinematics.
            rotation: Measured orientations in the base frame, (n, 3, 3).
            mounting: Orientation of the probe in the flange frame, (3, 3); None: it is
                estimated for every `tool_id`.
        """
        seen = np.swapaxes(batch.walk.flange, 1, 2) @ rotation
        mounted = np.empty_like(seen)
        for tool in np.unique(batch.states.tool_id):
            rows = batch.states.tool_id == tool
            mounted[rows] = _mean(seen[rows]) if mounting is None else mounting
        nominal = batch.walk.flange @ mounted
        turn = rotation_vector(rotation @ np.swapaxes(nominal, 1, 2))
        n = len(turn)
        return cls(turn, turn, np.zeros((n, 3, 0)), TYPICAL, np.ones(n))

    @property
    def typical(self) -> float:
        """Median angle from nominal to measured [rad]."""
        return float(np.median(np.linalg.norm(self.measured, axis=1)))

    def subtract_effects(
        self, effects: Combination, batch: ArmStates, values: Floats
    ) -> Turns:
        """Take off what effects explain."""
        return replace(self, residual=self.measured - effects.turn(batch, values))

    def linearise(self, effects: Combination, at: ArmStates) -> Turns:
        """Differentiate at the kinematics of a batch."""
        return replace(self, columns=effects.rotation_columns(at))

    def whiten(self) -> Floats:
        """Columns in standard deviations, (3 n, p)."""
        scale = (np.sqrt(self.weight) / self.std)[:, None, None]
        out: Floats = (self.columns * scale).reshape(-1, self.columns.shape[2])
        return out

    def normal(self, values: Floats, scales: Floats) -> Normal:
        """Write these rows as normal sums, see `Fit.normal`."""
        X = self.whiten() * scales
        target = self.residual + self.columns @ values
        y = (target * (np.sqrt(self.weight) / self.std)[:, None]).reshape(-1)
        rows = 3.0 * float((self.weight > 0).sum())
        noise = 2.0 * rows * float(np.log(self.std))
        return Normal(X.T @ X, X.T @ y, float(y @ y), noise, rows)

    def weigh_rows(self, covariance: Floats, row_weight: Floats, heavy: bool) -> Turns:
        """Weigh the rows and estimate the scatter from what is left.

        Args:
            covariance: Of the parameters, (p, p).
            row_weight: Weights by position, (n,): what is no measurement of the arm's
                position is none of its orientation.
            heavy: Whether to expect gross outliers, as in the first passes.
        """
        distance = np.linalg.norm(self.residual, axis=1) / self.std
        if heavy:
            weight = student_weights(distance)
        else:
            limit = limit_of(len(distance))
            weight = np.minimum((limit / distance.clip(1e-300)) ** 4, 1.0)
            weight[weight < DROPPED] = 0.0
        weight = weight * (row_weight > 0)
        columns = self.columns.reshape(-1, len(covariance))
        each = np.einsum("rp,rp->r", columns @ covariance, columns)
        spread = each.reshape(-1, 3).sum(axis=1)
        square = (self.residual**2).sum(axis=1) + np.maximum(spread, 0.0)
        variance = float((weight * square).sum()) / max(3.0 * float(weight.sum()), 1.0)
        return replace(self, weight=weight, std=max(np.sqrt(variance), SMALLEST))


def _mean(rotation: Floats) -> Floats:
    """Average rotations (n, 3, 3) without those that are far from the others."""
    used = np.ones(len(rotation), dtype=bool)
    mean = np.eye(3)
    for _ in range(PASSES):
        mean = Rotation.from_matrix(rotation[used]).mean().as_matrix()
        far = np.linalg.norm(rotation_vector(rotation @ mean.T), axis=1)
        used = far <= max(ROBUST * float(np.median(far)), 1e-12)
    return mean
