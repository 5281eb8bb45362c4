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

from postproc.accuracy.batch import Batch
from postproc.accuracy.diagnosis.candidate import Candidate
from postproc.accuracy.effect import Array, Effect
from postproc.accuracy.fit import Fit

CHUNK = 5_000_000  # numbers of columns held at once


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
    basis: Array
    shrink: Array
    rest: Array

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

    def filter(self, whitened: Array) -> Array:
        """Take the model out of whitened columns (3 n, k)."""
        left: Array = whitened - self.basis @ (
            self.shrink[:, None] * (self.basis.T @ whitened)
        )
        return left

    def columns(self, effects: Sequence[Effect]) -> Array:
        """Whiten, scale and filter the columns of effects, (3 n, sum of p)."""
        raw = np.concatenate([e.columns(self.at) for e in effects], axis=2)
        scale = np.array([p.scale for e in effects for p in e.parameters()])
        return self.filter(self.fit.whiten(raw * scale))


@dataclass(frozen=True, eq=False)
class Blocks:
    """Candidates reduced to what their evidence needs, in their own eigenbasis.

    Attributes:
        candidates: c candidates.
        gain: Eigenvalues of their Gram matrices, (c, k), padded with 0.
        along: Their columns times filtered rows, in that basis, (c, k, draws).
    """

    candidates: tuple[Candidate, ...]
    gain: Array
    along: Array


def reduce_blocks(
    projection: Projection, candidates: Sequence[Candidate], rows: Array
) -> tuple[Blocks, ...]:
    """Reduce candidates against rows.

    Args:
        projection: The model to take out.
        candidates: Any number; reduced together with those of the same width.
        rows: Filtered rows, (3 n, draws).
    """
    widths: dict[int, list[Candidate]] = {}
    for candidate in candidates:
        widths.setdefault(len(candidate.effect.parameters()), []).append(candidate)
    out = []
    for width, alike in sorted(widths.items()):
        step = max(1, CHUNK // (rows.shape[0] * width))
        for first in range(0, len(alike), step):
            out.append(_reduce(projection, alike[first : first + step], width, rows))
    return tuple(out)


def _reduce(
    projection: Projection, alike: list[Candidate], width: int, rows: Array
) -> Blocks:
    """Reduce candidates of one width."""
    B = projection.columns([c.effect for c in alike])
    B = B.reshape(len(B), len(alike), width)
    gram = np.einsum("rck,rcl->ckl", B, B, optimize=True) if width > 1 else None
    along = (B.reshape(len(B), -1).T @ rows).reshape(len(alike), width, -1)
    if gram is None:
        return Blocks(tuple(alike), np.einsum("rck,rck->ck", B, B), along)
    gain, turn = np.linalg.eigh(gram)
    along = np.einsum("ckl,ckd->cld", turn, along)
    return Blocks(tuple(alike), np.maximum(gain, 0.0), along)
