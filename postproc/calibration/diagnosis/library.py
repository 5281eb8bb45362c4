"""All candidates with their columns, and the present fit taken out of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.calibration.regression import Fit
from postproc.model.effects import EFFECTS
from postproc.model.effects.effect import Candidate
from postproc.model.kinematics import Batch
from postproc.model.noise import Whitener

# The present model taken out of the residual and of every candidate, once.
#
# Under the model the whitened errors are N(0, I + X X^T), X the whitened columns times
# their prior standard deviations. Multiplied by F = (I + X X^T)^(-1/2) they are plain
# noise N(0, I), and so is everything that the model cannot take up; what it determines
# well is gone. With X^T X = V diag(d) V^T and r = sqrt(1 + d)
#
#     F = I - X V diag(1 / (r (r + 1))) V^T X^T,   F F = I - X V diag(1 / r^2) V^T X^T.


@dataclass(frozen=True, eq=False)
class Projection:
    """A fit, seen as a filter that leaves plain noise.

    Attributes:
        fit: The fit.
        names: Parameters that are taken out.
        at: Its states, kinematics taken at its parameters.
        columns: X, (3 n, p).
        axes: V, (p, p).
        root: r, (p,).
        rest: Filtered residual, (3 n,): N(0, I) if the model is complete.
    """

    fit: Fit
    names: tuple[str, ...]
    at: Batch
    columns: Floats
    axes: Floats
    root: Floats
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
        size, axes = np.linalg.eigh(X.T @ X)
        root = np.sqrt(1.0 + np.maximum(size, 0.0))
        target = fit.whiten(fit.residual + fit.design.times(fit.values))
        made = cls(fit, tuple(names), at, X, axes, root, target)
        return replace(made, rest=made.filter(target))

    @property
    def rows(self) -> int:
        """Number of scalar rows that count."""
        return 3 * int((self.fit.rows.weight > 0).sum())

    def filter(self, whitened: Floats) -> Floats:
        """Take the model out of whitened columns, (3 n,) or (3 n, k)."""
        along = self.axes.T @ (self.columns.T @ whitened)
        taken = (self.axes / (self.root * (self.root + 1.0))) @ along
        left: Floats = whitened - self.columns @ taken
        return left


@dataclass(frozen=True, eq=False)
class ReducedCandidates:
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
) -> ReducedCandidates:
    """Reduce candidates of one width against rows.

    Args:
        projection: The model to take out.
        candidates: c candidates.
        columns: Their rotated, scaled columns, (3 n, c, k).
        rows: Rows, filtered twice: as errors, and as their columns are, (3 n, draws).
    """
    B = columns * projection.fit.row_scale.reshape(-1, 1, 1)
    count, width = B.shape[1:]
    B = B.reshape(len(B), -1)
    along = (B.T @ rows).reshape(count, width, -1)
    known = (projection.axes / projection.root).T @ (projection.columns.T @ B)
    gram = _grams(B, count) - _grams(known, count)
    if width == 1:
        return ReducedCandidates(tuple(candidates), gram[:, :, 0], along)
    gain, turn = np.linalg.eigh(gram)
    along = np.swapaxes(turn, 1, 2) @ along
    return ReducedCandidates(tuple(candidates), np.maximum(gain, 0.0), along)


def _grams(B: Floats, count: int) -> Floats:
    """Sum products of each of some blocks of columns, (count, k, k)."""
    blocks = np.ascontiguousarray(B.T).reshape(count, -1, len(B))
    grams: Floats = blocks @ np.swapaxes(blocks, 1, 2)
    return grams


# All candidates with their columns, ready to be filtered by any fit of the rows.

KEPT = 60_000_000  # numbers of columns that are kept rather than made again
CHUNK = 5_000_000  # numbers of columns held at once while they are made


@dataclass(frozen=True, eq=False)
class Shelf:
    """Candidates of one width.

    Attributes:
        candidates: c candidates of k columns each.
        columns: Rotated as the rows are whitened, in units of the prior scales,
            (3 n, c, k), or None where they are made when needed.
    """

    candidates: tuple[Candidate, ...]
    columns: Floats | None

    def made(self, batch: Batch, whitener: Whitener) -> Floats:
        """Return the columns, (3 n, c, k)."""
        if self.columns is not None:
            return self.columns
        return make_columns(self.candidates, batch, whitener)


@dataclass(frozen=True, eq=False)
class Library:
    """Shelves by width.

    Columns are taken at the kinematics of the first fit: later fits differ by what
    moves a column by a thousandth.
    """

    shelves: tuple[Shelf, ...]

    @classmethod
    def of(cls, fit: Fit) -> Library:
        """List all candidates that a fit's rows can show."""
        at = fit.combination.at(fit.batch, fit.values)
        every = candidates(at)
        numbers = 3 * len(at) * sum(c.width for c in every)
        shelves = []
        for width, alike in by_width(every):
            step = max(1, CHUNK // (3 * len(at) * width))
            for first in range(0, len(alike), step):
                some = tuple(alike[first : first + step])
                keep = numbers <= KEPT
                columns = make_columns(some, at, fit.whitener) if keep else None
                shelves.append(Shelf(some, columns))
        return cls(tuple(shelves))

    def at_rows(self, rows: NDArray[np.int64]) -> Library:
        """Return the library for some of the rows."""
        scalar = (3 * rows[:, None] + np.arange(3)).reshape(-1)
        shelves = [
            s if s.columns is None else replace(s, columns=s.columns[scalar])
            for s in self.shelves
        ]
        return Library(tuple(shelves))

    def reduce(
        self, projection: Projection, rows: Floats
    ) -> tuple[ReducedCandidates, ...]:
        """Filter all candidates and reduce them against filtered rows (3 n, draws)."""
        whitener, rows = projection.fit.whitener, projection.filter(rows)
        return tuple(
            reduce_columns(
                projection, s.candidates, s.made(projection.at, whitener), rows
            )
            for s in self.shelves
        )


def candidates(batch: Batch) -> list[Candidate]:
    """List what a residual may be due to: effects with grids of settings, names first.

    Args:
        batch: The states, kinematics taken at the parameters of a fit.
    """
    every = [c for kind in EFFECTS for c in kind.candidates(batch)]
    return sorted(every, key=lambda c: c.family.tier)


def by_width(candidates: Sequence[Candidate]) -> list[tuple[int, list[Candidate]]]:
    """Group candidates by their number of columns."""
    widths: dict[int, list[Candidate]] = {}
    for candidate in candidates:
        widths.setdefault(candidate.width, []).append(candidate)
    return sorted(widths.items())


def reduce_some(
    projection: Projection, candidates: Sequence[Candidate], rows: Floats
) -> tuple[ReducedCandidates, ...]:
    """Filter a few candidates of any widths and reduce them against rows."""
    whitener, rows = projection.fit.whitener, projection.filter(rows)
    return tuple(
        reduce_columns(
            projection, alike, make_columns(alike, projection.at, whitener), rows
        )
        for _, alike in by_width(candidates)
    )


def make_columns(
    candidates: Sequence[Candidate], batch: Batch, whitener: Whitener
) -> Floats:
    """Make the rotated, scaled columns of candidates of one width, (3 n, c, k)."""
    raw = np.concatenate([c.effect.columns(batch) for c in candidates], axis=2)
    raw *= np.array([p.scale for c in candidates for p in c.effect.parameters()])
    turned = whitener.rotate(raw)
    return turned.reshape(3 * len(batch), len(candidates), -1)
