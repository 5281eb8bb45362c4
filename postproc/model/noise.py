"""What scatters a measurement: the tracker, and the arm's own repeatability.

The covariance of one measured position is  t^2 T + r^2 J J^T : the tracker's error,
equal on all axes and growing with range, and joint angles that do not repeat, seen
through the Jacobian. In the eigenbasis of J J^T both are diagonal, for any t and r, so
one rotation of every row makes all further algebra a matter of weights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.model.kinematics import Batch

TRACKER_FIXED, TRACKER_RANGE = 1e-5, 5e-6  # [m], [m/m] a laser tracker's data sheet
LIVELY = 0.3  # share of the other component that each begins with at least
UNSEEN = 1.0  # [m] as good as not measured
SMALLEST, LARGEST = 1e-7, 1e-2  # [m] bounds of both standard deviations at the TCP


@dataclass(frozen=True)
class Noise:
    """The two estimated components.

    Attributes:
        tracker: Factor t on the tracker's data sheet, 1 = as specified.
        joint: Standard deviation r of every joint angle [rad].
        origin: Tracker position in the base frame, (3,) [m], or None: the range is
            then not known, and the tracker's error is the same everywhere.
    """

    tracker: float
    joint: float
    origin: tuple[float, float, float] | None = None

    def tracker_std(self, position: Floats) -> Floats:
        """Standard deviation per axis of the tracker at positions (n, 3), (n,) [m]."""
        std: Floats = self.tracker * tracker_shape(position, self.origin)
        return std

    def arrival_variance(self, jacobian: Floats) -> Floats:
        """Variance per axis that repeatability gives, (n, 3) [m^2]."""
        variance: Floats = self.joint**2 * np.einsum("nij,nij->ni", jacobian, jacobian)
        return variance


def tracker_shape(
    position: Floats, origin: tuple[float, float, float] | None
) -> Floats:
    """Data-sheet standard deviation of a tracker at positions (n, 3), (n,) [m]."""
    if origin is None:
        return np.full(len(position), TRACKER_FIXED)
    reach = np.linalg.norm(position - np.array(origin), axis=1)
    return np.asarray(TRACKER_FIXED + TRACKER_RANGE * reach)


def _along_first(heading: Floats) -> Floats:
    """Give right-handed bases (n, 3, 3) whose first columns are unit vectors (n, 3)."""
    aside = np.eye(3)[np.abs(heading).argmin(axis=1)]
    second = np.cross(heading, aside)
    second /= np.linalg.norm(second, axis=1)[:, None]
    return np.stack([heading, second, np.cross(heading, second)], axis=2)


@dataclass(frozen=True)
class Whitener:
    """Rotations that make every row's covariance diagonal, and its two parts.

    Attributes:
        turn: Rotates base axes into the eigenbasis of J J^T, (n, 3, 3).
        tracker, joint: Variances per unit t^2 and r^2 in that basis, (n, 3).
        extra: Variance known beforehand (an unknown direction), (n, 3) [m^2].
        unseen: Variance of what the reading does not tell at all, (n, 3) [m^2].
        origin: Tracker position, see `Noise`.
    """

    turn: Floats
    tracker: Floats
    joint: Floats
    extra: Floats
    unseen: Floats
    origin: tuple[float, float, float] | None

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
        J = batch.jacobian
        square = J @ np.swapaxes(J, 1, 2)
        values, vectors = np.linalg.eigh(square)
        heading = batch.states.heading
        unseen, moving = np.zeros_like(values), ~np.isnan(heading[:, 0])
        if moving.any():
            vectors[moving] = _along_first(heading[moving])
            turned = np.swapaxes(vectors, 1, 2) @ square @ vectors
            values[moving] = np.einsum("nii->ni", turned)[moving]
            unseen[moving, 0] = UNSEEN**2
        shape = np.repeat(tracker_shape(position, origin)[:, None] ** 2, 3, axis=1)
        more = np.zeros(len(batch)) if extra is None else extra
        return cls(
            turn=np.swapaxes(vectors, 1, 2),
            tracker=shape,
            joint=np.maximum(values, 0.0),
            extra=np.repeat(more[:, None], 3, axis=1),
            unseen=unseen,
            origin=origin,
        )

    def rotate(self, rows: Floats) -> Floats:
        """Rotate (n, 3) or (n, 3, p) into the eigenbasis."""
        if rows.ndim == 2:
            return np.asarray(np.einsum("nij,nj->ni", self.turn, rows))
        return np.asarray(self.turn @ rows)

    def variance(self, noise: Noise) -> Floats:
        """Variance of every rotated component, (n, 3) [m^2]."""
        total: Floats = (
            noise.tracker**2 * self.tracker
            + noise.joint**2 * self.joint
            + self.extra
            + self.unseen
        )
        return total

    def estimate(self, squares: Floats, weight: Floats, start: Noise) -> Noise:
        """Maximise the likelihood of expected squared residuals over t and r.

        Args:
            squares: Squared residual plus its posterior variance, rotated, (n, 3).
            weight: Weight of every row, (n,), 0 drops it.
            start: Where to begin.
        """
        t0 = float(np.median(np.sqrt(self.tracker)))
        r0 = float(np.median(np.sqrt(self.joint.mean(axis=1))))
        used = weight > 0
        T, R = self.tracker[used], self.joint[used]
        E, S, w = (self.extra + self.unseen)[used], squares[used], weight[used, None]

        def cost(u: Floats) -> tuple[float, Floats]:
            """Negative log likelihood and its gradient by log standard deviations."""
            t2, r2 = np.exp(2 * u)
            v = t2 * T + r2 * R + E
            slope = w * (1.0 / v - S / v**2)
            grad = np.array([(slope * t2 * T).sum(), (slope * r2 * R).sum()])
            return float(0.5 * (w * (np.log(v) + S / v)).sum()), grad

        from scipy.optimize import minimize  # slow to load, and for fits alone

        bounds = [(np.log(SMALLEST / s), np.log(LARGEST / s)) for s in (t0, r0)]
        # A component of no size has no slope by its logarithm and would stay so.
        t1 = max(start.tracker, LIVELY * start.joint * r0 / t0)
        r1 = max(start.joint, LIVELY * start.tracker * t0 / r0)
        begin = np.clip(np.log([t1, r1]), *np.array(bounds).T)
        best = minimize(cost, begin, jac=True, method="L-BFGS-B", bounds=bounds)
        t, r = np.exp(best.x)
        return Noise(float(t), float(r), self.origin)
