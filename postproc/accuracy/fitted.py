"""What a fit has found, with all that tests of further effects need."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import qr

from postproc.accuracy.evidence import Normal, Posterior, widened
from postproc.accuracy.outliers import RowWeights
from postproc.accuracy.turns import Turns
from postproc.arrays import Floats, Ints
from postproc.model.combination import Combination
from postproc.model.kinematics import Batch
from postproc.model.noise import Noise, Whitener


@dataclass(frozen=True, eq=False)
class Fit:
    """Fitted effects.

    Attributes:
        batch: The survey's states, nominal kinematics.
        combination: The effects.
        error: Measured minus nominal position, (n, 3) [m].
        values: Parameters, (p,) [SI].
        covariance: Of the parameters, (p, p).
        log_scale: Log factor that the data put on each group's prior scale, (g,).
        groups: Names of the prior groups, in the order of `log_scale`.
        noise: Estimated noise components.
        rows: Weight of every row.
        residual: Error that the effects leave, (n, 3) [m].
        columns: Derivatives at the solution, (n, 3, p).
        whitener: Rotations and variances of the rows.
        log_evidence: Log marginal likelihood of the whitened rows.
        effective: Effective number of parameters.
        turns: Measured orientations, where the survey has them.
    """

    batch: Batch
    combination: Combination
    error: Floats
    values: Floats
    covariance: Floats
    log_scale: Floats
    groups: tuple[str, ...]
    noise: Noise
    rows: RowWeights
    residual: Floats
    columns: Floats
    whitener: Whitener
    log_evidence: float
    effective: float
    turns: Turns | None = None

    @property
    def std(self) -> Floats:
        """Standard errors of the parameters, (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def prior_std(self) -> Floats:
        """Prior standard deviations that the data chose, (p,)."""
        std: Floats = self.combination.scales * np.exp(self.log_scale)[self.group]
        return std

    @cached_property
    def group(self) -> Ints:
        """Index into `groups` of every parameter, (p,)."""
        index = {g: i for i, g in enumerate(self.groups)}
        return np.array([index[g] for g in self.combination.groups], dtype=np.int64)

    @cached_property
    def row_scale(self) -> Floats:
        """What whitening multiplies the rotated components with, (n, 3) [1/m]."""
        v = self.whitener.variance(self.noise)
        scale: Floats = np.sqrt(self.rows.weight[:, None] / v)
        return scale

    def whiten(self, rows: Floats) -> Floats:
        """Whiten (n, 3) or (n, 3, k): the noise of the result has unit variance.

        Returns:
            (3 n,) or (3 n, k).
        """
        turned = self.whitener.rotate(rows)
        if rows.ndim == 2:
            return (turned * self.row_scale).reshape(-1)
        return (turned * self.row_scale[:, :, None]).reshape(-1, rows.shape[2])

    @cached_property
    def basis(self) -> Floats:
        """Orthonormal basis of the whitened columns, (3 n, rank)."""
        X = self.whiten(self.columns) * self.prior_std
        Q, R, _ = qr(X, mode="economic", pivoting=True)
        size = np.abs(np.diag(R))
        known = size > max(1e-9 * float(size.max(initial=0.0)), 1e-3)
        return np.asarray(Q[:, : int(known.sum())])

    def project_out(self, whitened: Floats) -> Floats:
        """Remove from whitened rows what the fitted effects can take up."""
        left: Floats = whitened - self.basis @ (self.basis.T @ whitened)
        return left

    def normal(self) -> Normal:
        """Write the regression, linearised at the present values, as its normal sums.

        Columns are scaled by the prior scales before the data rescale them.
        """
        X = self.whiten(self.columns) * self.combination.scales
        y = self.whiten(self.residual + self.columns @ self.values)
        v = self.whitener.variance(self.noise)
        used = self.rows.weight > 0
        normal = Normal(
            X.T @ X, X.T @ y, float(y @ y),
            float(np.log(v[used]).sum()), 3.0 * float(used.sum()),
        )  # fmt: skip
        if self.turns is None:
            return normal
        return normal + self.turns.normal(self.values, self.combination.scales)

    def stacked(self) -> Floats:
        """Stack all whitened columns, those of orientations too, (rows, p)."""
        X = self.whiten(self.columns)
        return X if self.turns is None else np.vstack([X, self.turns.whitened()])

    @cached_property
    def stated(self) -> Floats:
        """Covariance that knows how unsure the prior scales are themselves, (p, p)."""
        scales = self.combination.scales
        at = Posterior(
            self.values / scales, self.covariance / np.outer(scales, scales),
            self.log_scale, self.log_evidence, self.effective,
        )  # fmt: skip
        return widened(self.normal(), self.group, at) * np.outer(scales, scales)
