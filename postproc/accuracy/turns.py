"""Measured orientations: what a 6D probe tells besides its position.

A measured orientation is exp(e) R P: R the nominal flange's, P the probe's mounting on
it, e the rotation error of the arm and of the set-up. Effects are linear in e as they
are in position, so orientations are further rows of the same regression, with a noise
level of their own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from postproc.accuracy.evidence import Normal
from postproc.accuracy.outliers import DROPPED, limit_of, student_weights
from postproc.arrays import Floats
from postproc.model.combination import Combination
from postproc.model.kinematics import Batch
from postproc.robot.pose import rotation_vector

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
    def of(cls, batch: Batch, rotation: Floats, mounting: Floats | None) -> Turns:
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

    def left(self, effects: Combination, batch: Batch, values: Floats) -> Turns:
        """Take off what effects explain."""
        return replace(self, residual=self.measured - effects.turn(batch, values))

    def linearised(self, effects: Combination, at: Batch) -> Turns:
        """Differentiate at the kinematics of a batch."""
        return replace(self, columns=effects.rotation_columns(at))

    def whitened(self) -> Floats:
        """Columns in standard deviations, (3 n, p)."""
        scale = (np.sqrt(self.weight) / self.std)[:, None, None]
        out: Floats = (self.columns * scale).reshape(-1, self.columns.shape[2])
        return out

    def normal(self, values: Floats, scales: Floats) -> Normal:
        """Write these rows as normal sums, see `Fit.normal`."""
        X = self.whitened() * scales
        target = self.residual + self.columns @ values
        y = (target * (np.sqrt(self.weight) / self.std)[:, None]).reshape(-1)
        rows = 3.0 * float((self.weight > 0).sum())
        noise = 2.0 * rows * float(np.log(self.std))
        return Normal(X.T @ X, X.T @ y, float(y @ y), noise, rows)

    def judged(self, covariance: Floats, row_weight: Floats, heavy: bool) -> Turns:
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
        spread = ((self.columns @ covariance) * self.columns).sum(axis=(1, 2))
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
