"""The present model taken out of the residual and of every candidate, once.

Under the model the whitened errors are N(0, I + X X^T), X the whitened columns times
their prior standard deviations. Multiplied by F = (I + X X^T)^(-1/2) they are plain
noise N(0, I), and so is everything that the model cannot take up; what it determines
well is gone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from postproc.accuracy.diagnosis.candidate import Candidate
from postproc.accuracy.fitted import Fit
from postproc.arrays import Floats
from postproc.model.kinematics import Batch


@dataclass(frozen=True, eq=False)
class Projection:
    """A fit, seen as a filter that leaves plain noise.

    Attributes:
        fit: The fit.
        names: Parameters that are taken out.
        at: Its states, kinematics taken at its parameters.
        basis: Orthonormal directions that the model knows, (3 n, r).
        shrink: What the filter takes of each, (r,) in [0, 1].
        rest: Filtered residual, (3 n,): N(0, I) if the model is complete.
    """

    fit: Fit
    names: tuple[str, ...]
    at: Batch
    basis: Floats
    shrink: Floats
    rest: Floats

    @classmethod
    def of(cls, fit: Fit, without: int | None = None) -> Projection:
        """Make the filter of a fit.

        Args:
            fit: The fit.
            without: Number of an effect that is left out of the model: the rest then
                holds what that effect explains.
        """
        at = fit.combination.at(fit.batch, fit.values)
        X = fit.whiten(fit.columns) * fit.prior_std
        names = list(fit.combination.names)
        if without is not None:
            X = np.delete(X, fit.combination.slices[without], axis=1)
            del names[fit.combination.slices[without]]
        basis, size, _ = np.linalg.svd(X, full_matrices=False)
        shrink = 1.0 - 1.0 / np.sqrt(1.0 + size**2)
        target = fit.whiten(fit.residual + fit.columns @ fit.values)
        rest = target - basis @ (shrink * (basis.T @ target))
        return cls(fit, tuple(names), at, basis, shrink, rest)

    @property
    def rows(self) -> int:
        """Number of scalar rows that count."""
        return 3 * int((self.fit.rows.weight > 0).sum())

    def filter(self, whitened: Floats) -> Floats:
        """Take the model out of whitened columns (3 n, k)."""
        left: Floats = whitened - self.basis @ (
            self.shrink[:, None] * (self.basis.T @ whitened)
        )
        return left


@dataclass(frozen=True, eq=False)
class Blocks:
    """Candidates reduced to what their evidence needs, in their own eigenbasis.

    Attributes:
        candidates: c candidates.
        gain: Eigenvalues of their Gram matrices, (c, k), padded with 0.
        along: Their columns times filtered rows, in that basis, (c, k, draws).
    """

    candidates: tuple[Candidate, ...]
    gain: Floats
    along: Floats


def reduce_columns(
    projection: Projection,
    candidates: Sequence[Candidate],
    columns: Floats,
    rows: Floats,
) -> Blocks:
    """Reduce candidates of one width against rows.

    Args:
        projection: The model to take out.
        candidates: c candidates.
        columns: Their rotated, scaled columns, (3 n, c, k).
        rows: Filtered rows, (3 n, draws).
    """
    B = columns * projection.fit.row_scale.reshape(-1, 1, 1)
    count, width = B.shape[1:]
    B = projection.filter(B.reshape(len(B), -1))
    along = (B.T @ rows).reshape(count, width, -1)
    B = np.ascontiguousarray(B.T).reshape(count, width, -1)
    gram = B @ np.swapaxes(B, 1, 2)
    if width == 1:
        return Blocks(tuple(candidates), gram[:, :, 0], along)
    gain, turn = np.linalg.eigh(gram)
    along = np.swapaxes(turn, 1, 2) @ along
    return Blocks(tuple(candidates), np.maximum(gain, 0.0), along)
