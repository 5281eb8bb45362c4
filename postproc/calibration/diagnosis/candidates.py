"""All candidates with their columns, and the present fit taken out of them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats, Ints
from postproc.calibration.regression import Fit
from postproc.model.effects import EFFECTS
from postproc.model.effects.effect import Candidate
from postproc.model.kinematics import ArmStates
from postproc.model.whitening import Whitener, Whitening

# The present model taken out of the residual and of every candidate, once.
#
# Under the model the whitened errors are N(0, I + X X^T), X the whitened columns times
# their prior standard deviations. Multiplied by F = (I + X X^T)^(-1/2) they are plain
# noise N(0, I), and so is everything that the model cannot take up; what it determines
# well is gone. With X^T X = V diag(d) V^T, r = sqrt(1 + d) and U = X V diag(1 / r)
#
#     F = I - U diag(r / (r + 1)) U^T,   F F = I - U U^T.
#
# Directions of which the rows tell less than what sums over them are rounded by are not
# in U.

NOTHING = 1e-9  # part of a column that is left of it where the model takes it up
ROUNDED = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Projection:
    """A fit, seen as a filter that leaves plain noise.

    Attributes:
        fit: The fit.
        names: Parameters that are taken out.
        at: Its states, kinematics taken at its parameters.
        taken: U, (3 n, k).
        root: r, (k,).
        axes: V, (p, k).
        rest: Filtered residual, (3 n,): N(0, I) if the model is complete.
        free: A filtered column of unit length that may have any size, (3 n,), or None:
            what lies along it is taken out too.
        seen: The joint last asked for: its axes, and U along them, (n, k).
    """

    fit: Fit
    names: tuple[str, ...]
    at: ArmStates
    taken: Floats
    root: Floats
    axes: Floats
    rest: Floats
    free: Floats | None = None
    seen: dict[int, tuple[JointAxes, Floats]] = field(default_factory=dict)

    @classmethod
    def of(cls, fit: Fit, without: int | None = None) -> Projection:
        """Make the filter of a fit.

        Args:
            fit: The fit.
            without: Number of an effect that is left out of the model: the rest then
                holds what that effect explains.
        """
        part = slice(0) if without is None else fit.combination.slices[without]
        return cls.leaving(fit, np.arange(len(fit.values))[part])

    @classmethod
    def leaving(cls, fit: Fit, out: Ints) -> Projection:
        """Make the filter of a fit without some of its parameters, (k,)."""
        at = fit.combination.at(fit.batch, fit.values)
        known = np.delete(np.arange(len(fit.values)), out)
        names = tuple(fit.combination.names[k] for k in known)
        made = cls(fit, names, at, *_compute_known(fit, known), fit.target)
        return replace(made, rest=made.filter(made.rest), seen={})

    @property
    def rows(self) -> int:
        """Number of scalar rows that count."""
        return 3 * int((self.fit.rows.weight > 0).sum())

    def filter(self, whitened: Floats) -> Floats:
        """Take the model out of whitened columns, (3 n,) or (3 n, k)."""
        left = self._without_free(whitened)
        if self.free is not None:
            left -= np.multiply.outer(self.free, self.free @ left)
        return left

    def _without_free(self, rows: Floats) -> Floats:
        """Multiply by F without a free column, (3 n,) or (3 n, k)."""
        along = (self.taken.T @ rows).T * (self.root / (self.root + 1.0))
        left: Floats = rows - self.taken @ along.T
        return left

    def beside(self, whitened: Floats) -> Projection:
        """Take one more column, (3 n,), of any size out of the rows."""
        column = self.filter(whitened)
        size = float(np.linalg.norm(column))
        if size <= NOTHING * float(np.linalg.norm(whitened)):
            return self
        free = column / size
        rest = self.rest - free * (free @ self.rest)
        return replace(self, rest=rest, free=free, seen={})

    @cached_property
    def squares(self) -> Floats:
        """All that is taken out twice: I - F F = S S^T, (3 n, k)."""
        if self.free is None:
            return self.taken
        return np.column_stack([self.taken, self._without_free(self.free)])

    @cached_property
    def twice(self) -> Floats:
        """Residual filtered twice, as columns are that are not, (3 n, 1)."""
        return self.again(self.rest[:, None])

    def again(self, filtered: Floats) -> Floats:
        """Filter rows that are filtered, (3 n, k), as columns are that are not.

        Of a free column v that is F (I - v v^T): the transposed filter.
        """
        if self.free is not None:
            filtered = filtered - np.outer(self.free, self.free @ filtered)
        return self._without_free(filtered)

    def view(self, joint: int | None, rows: Floats) -> View:
        """See twice filtered rows (3 n, draws) and the model along columns of a shelf.

        Args:
            joint: Joint, from 0, that the columns turn, or None.
            rows: The rows.
        """
        if joint is None:
            return View(ColumnWhitening.of(self.fit.whitening), self.squares, rows)
        if joint not in self.seen:
            self.seen.clear()  # a search asks again and again for one joint
            axes = JointAxes.of(self.fit, self.at.jacobian[:, :, joint])
            self.seen[joint] = axes, axes.along(self.squares)
        axes, taken = self.seen[joint]
        return View(axes.size, taken, axes.along(rows))


@dataclass(frozen=True, eq=False)
class ColumnWhitening:
    """What whitens columns given as (c, k, m) by their m numbers.

    Attributes:
        size: What each number is multiplied with, (m,); 1 in a block.
        blocks: Numbers that are taken at once, (groups, w), and matrices of each group,
            (groups, w, w).
    """

    size: Floats
    blocks: tuple[tuple[Ints, Floats], ...] = ()

    @classmethod
    def of(cls, whitening: Whitening) -> ColumnWhitening:
        """Take the whitening of rotated rows, three numbers a row."""
        blocks = tuple(
            ((3 * rows[:, :, None] + np.arange(3)).reshape(len(rows), -1), matrix)
            for rows, matrix in whitening.blocks.parts
        )
        return cls(whitening.scale.reshape(-1), blocks)

    def apply(self, columns: Floats, out: Floats | None = None) -> Floats:
        """Whiten columns, (c, k, m)."""
        white: Floats = np.multiply(columns, self.size, out=out)
        for index, matrix in self.blocks:
            white[:, :, index] = np.einsum("gab,ckgb->ckga", matrix, white[:, :, index])
        return white


@dataclass(frozen=True, eq=False)
class JointAxes:
    """Whitened axes of one joint, orthonormal, and their sizes.

    Whitened columns of the joint are the axes times the sizes times its angles.

    Attributes:
        axis: Of every row alone, (n, 3), 0 in a block.
        size: The sizes.
        blocks: Rows of a pose, (groups, m), and their axes, (groups, 3 m, m).
    """

    axis: Floats
    size: ColumnWhitening
    blocks: tuple[tuple[Ints, Floats], ...]

    @classmethod
    def of(cls, fit: Fit, moved: Floats) -> JointAxes:
        """Whiten what the joint moves the rows by, (n, 3) [m/rad]."""
        by, turned = fit.whitening, fit.whitener.rotate(moved)
        axis = turned * by.scale
        size = np.linalg.norm(axis, axis=1)
        blocks, sizes = [], []
        for rows, matrix in by.blocks.parts:
            count, m = rows.shape
            apart = np.zeros((count, m, 3, m))
            apart[:, np.arange(m), :, np.arange(m)] = np.swapaxes(turned[rows], 0, 1)
            own, triangle = np.linalg.qr(matrix @ apart.reshape(count, 3 * m, m))
            blocks.append((rows, own))
            sizes.append((rows, triangle))
            axis[rows], size[rows] = 0.0, 1.0
        axis = axis / np.maximum(size, 1e-300)[:, None]
        return cls(axis, ColumnWhitening(size, tuple(sizes)), tuple(blocks))

    def along(self, columns: Floats) -> Floats:
        """Take columns of scalar rows (3 n, k) along the axes: (n, k)."""
        by_row = columns.reshape(len(self.axis), 3, columns.shape[1])
        out: Floats = np.einsum("nk,nkd->nd", self.axis, by_row)
        for rows, own in self.blocks:
            stacked = by_row[rows].reshape(*own.shape[:2], -1)
            out[rows] = np.swapaxes(own, 1, 2) @ stacked
        return out


def _compute_known(fit: Fit, known: NDArray[np.int64]) -> tuple[Floats, Floats, Floats]:
    """Compute U (3 n, k), r (k,) and V (p, k) of p of the parameters."""
    whitened, std = fit.whitened, fit.prior_std[known]
    gram = whitened.gram()[np.ix_(known, known)] * np.outer(std, std)
    size, axes = np.linalg.eigh(gram)
    told = size > ROUNDED * len(size) * float(size.max(initial=0.0))
    root = np.sqrt(1.0 + size[told])
    mix = np.zeros((len(fit.values), len(root)))
    mix[known] = std[:, None] * axes[:, told] / root
    return whitened.combine(mix), root, axes[:, told]


@dataclass(frozen=True, eq=False)
class View:
    """Filtered rows, and what the model takes, along the columns of candidates.

    Attributes:
        size: What whitens the columns.
        taken: U of `Projection` along them, (m, k).
        rows: Filtered rows along them, (m, draws).
    """

    size: ColumnWhitening
    taken: Floats
    rows: Floats


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
    view: View, candidates: Sequence[Candidate], columns: Floats
) -> ReducedCandidates:
    """Reduce candidates of one width against rows.

    Args:
        view: The rows, filtered twice: as errors, and as their columns are.
        candidates: c candidates.
        columns: Their whitened columns, (c, k, m), see `CandidateGroup`.
    """
    count, width, m = columns.shape
    each = columns.reshape(-1, m)
    along = (each @ view.rows).reshape(count, width, -1)
    known = (each @ view.taken).reshape(count, width, -1)
    gram = _grams(columns) - _grams(known)
    if width == 1:
        return ReducedCandidates(tuple(candidates), gram[:, :, 0], along)
    gain, turn = np.linalg.eigh(gram)
    along = np.swapaxes(turn, 1, 2) @ along
    return ReducedCandidates(tuple(candidates), np.maximum(gain, 0.0), along)


def _grams(blocks: Floats) -> Floats:
    """Sum products of each of some blocks of columns, (c, k, m): (c, k, k)."""
    if blocks.shape[1] == 1:
        return np.asarray(np.einsum("ckm,ckm->c", blocks, blocks))[:, None, None]
    grams: Floats = blocks @ np.swapaxes(blocks, 1, 2)
    return grams


# All candidates with their columns, ready to be filtered by any fit of the rows.

KEPT = 30_000_000  # numbers of columns that are kept rather than made again
CHUNK = 5_000_000  # numbers of columns held at once while they are made


@dataclass(frozen=True, eq=False)
class CandidateGroup:
    """Candidates of one width.

    Attributes:
        joint: The joint, from 0, that all their columns turn, or None.
        candidates: c candidates of k columns each.
        columns: In units of the prior scales: by what they turn the joint, (c, k, n);
            without one joint, rotated as the rows are whitened, (c, k, 3 n). None where
            they are made when needed.
    """

    joint: int | None
    candidates: tuple[Candidate, ...]
    columns: Floats | None

    @property
    def mean_of(self) -> int | None:
        """Joint, from 1, whose zero holds the mean of the candidates, or None."""
        if self.joint is None or not self.candidates[0].effect.has_mean():
            return None
        return self.joint + 1

    @property
    def sets_zero(self) -> bool:
        """Whether the candidates move the zero of their joint."""
        return self.candidates[0].effect.sets_zero

    def make_columns(self, batch: ArmStates, whitener: Whitener) -> CandidateGroup:
        """Make the columns."""
        columns = make_columns(self.joint, self.candidates, batch, whitener)
        return replace(self, columns=columns)

    def whiten(self, projection: Projection, size: ColumnWhitening) -> Floats:
        """Return the whitened columns, (c, k, m)."""
        if self.columns is not None:
            return size.apply(self.columns)
        made = self.make_columns(projection.at, projection.fit.whitener)
        assert made.columns is not None
        return size.apply(made.columns, out=made.columns)

    def at_rows(self, rows: NDArray[np.int64]) -> CandidateGroup:
        """Return the columns of some of the rows."""
        if self.columns is None:
            return self
        if self.joint is None:
            rows = (3 * rows[:, None] + np.arange(3)).reshape(-1)
        return replace(self, columns=self.columns[:, :, rows])


@dataclass(frozen=True, eq=False)
class Library:
    """Shelves by joint and width.

    Columns that are kept are those at the kinematics of the first fit: later fits
    differ by what moves a column by a thousandth.

    Attributes:
        shelves: The candidates.
        without: Names of effects that are known not to be there.
    """

    shelves: tuple[CandidateGroup, ...]
    without: frozenset[str] = frozenset()

    @classmethod
    def of(cls, fit: Fit, without: Collection[str] = ()) -> Library:
        """List all candidates that a fit's rows can show.

        Args:
            fit: The fit.
            without: Names of effects that are known not to be there.
        """
        at = fit.combination.at(fit.batch, fit.values)
        every = candidates(at, fit.noise.origin)
        tried = [c for c in every if c.family.effect not in without]
        shelves = [
            CandidateGroup(joint, alike[first : first + step], None)
            for some in by_mean(tried)
            for joint, alike in by_joint_and_width(some)
            for step in [max(1, CHUNK // numbers(joint, alike[:1], len(at)))]
            for first in range(0, len(alike), step)
        ]
        total = sum(numbers(s.joint, s.candidates, len(at)) for s in shelves)
        if total <= KEPT:
            shelves = [shelf.make_columns(at, fit.whitener) for shelf in shelves]
        return cls(tuple(shelves), frozenset(without))

    def of_mean(self, joint: int | None, moved: bool = False) -> Library:
        """Return the laws of a joint, from 1, with a mean; None: all other candidates.

        The zero of a given model holds the mean of what the model lacks.

        Args:
            joint: The joint.
            moved: Whether what moves its zero is asked for, or all else.
        """
        some = tuple(
            s for s in self.shelves if s.mean_of == joint and s.sets_zero == moved
        )
        return replace(self, shelves=some)

    def at_rows(self, rows: NDArray[np.int64]) -> Library:
        """Return the library for some of the rows."""
        some = tuple(shelf.at_rows(rows) for shelf in self.shelves)
        return replace(self, shelves=some)

    def reduce(
        self, projection: Projection, rows: Floats
    ) -> tuple[ReducedCandidates, ...]:
        """Filter all candidates and reduce them against filtered rows (3 n, draws)."""
        return _reduce_candidates(projection, self.shelves, projection.again(rows))


def candidates(
    batch: ArmStates, tracker: tuple[float, float, float] | None = None
) -> list[Candidate]:
    """List what a residual may be due to: effects with grids of settings, names first.

    Args:
        batch: The states, kinematics taken at the parameters of a fit.
        tracker: Where the tracker stands, base frame [m], where it is known.
    """
    every = [c for kind in EFFECTS for c in kind.candidates(batch)]
    every += [c for kind in EFFECTS for c in kind.propose_sighted(batch, tracker)]
    return sorted(every, key=lambda c: c.family.tier)


def by_mean(candidates: Sequence[Candidate]) -> tuple[list[Candidate], ...]:
    """Split candidates by what the zero of their joint is beside them: moved, open."""
    moved = [c for c in candidates if c.effect.sets_zero]
    others = [c for c in candidates if not c.effect.sets_zero]
    some = [c for c in others if c.effect.has_mean()]
    return moved, some, [c for c in others if not c.effect.has_mean()]


def numbers(joint: int | None, alike: Sequence[Candidate], rows: int) -> int:
    """Count the numbers of the columns of candidates."""
    return rows * (3 if joint is None else 1) * sum(c.width for c in alike)


def by_joint_and_width(
    candidates: Sequence[Candidate],
) -> list[tuple[int | None, tuple[Candidate, ...]]]:
    """Group candidates by the joint that they turn alone and their number of columns.

    Those of one joint follow each other.
    """
    alike: dict[tuple[int, int], list[Candidate]] = {}
    for candidate in candidates:
        joint = candidate.effect.only_joint()
        key = (-1 if joint is None else joint, candidate.width)
        alike.setdefault(key, []).append(candidate)
    return [(None if j < 0 else j, tuple(c)) for (j, _), c in sorted(alike.items())]


def reduce_some(
    projection: Projection, candidates: Sequence[Candidate]
) -> tuple[ReducedCandidates, ...]:
    """Filter a few candidates of any widths and reduce them against the residual."""
    shelves = [CandidateGroup(j, c, None) for j, c in by_joint_and_width(candidates)]
    return _reduce_candidates(projection, shelves, projection.twice)


def _reduce_candidates(
    projection: Projection, shelves: Sequence[CandidateGroup], rows: Floats
) -> tuple[ReducedCandidates, ...]:
    """Reduce candidates against rows that are filtered twice, (3 n, draws)."""
    out = []
    for joint, of_joint in groupby(shelves, key=lambda shelf: shelf.joint):
        view = projection.view(joint, rows)
        out += [
            reduce_columns(view, s.candidates, s.whiten(projection, view.size))
            for s in of_joint
        ]
    return tuple(out)


def make_columns(
    joint: int | None,
    candidates: Sequence[Candidate],
    batch: ArmStates,
    whitener: Whitener,
) -> Floats:
    """Make the scaled columns of candidates of one width, see `CandidateGroup`."""
    scale = np.array([p.scale for c in candidates for p in c.effect.parameters()])
    if joint is not None:
        made = np.concatenate([c.effect.turning(batch).T for c in candidates])
    else:
        raw = np.concatenate([c.effect.columns(batch) for c in candidates], axis=2)
        rotated = whitener.rotate(raw).reshape(3 * len(batch), -1)
        made = np.ascontiguousarray(rotated.T)
    made *= scale[:, None]
    return made.reshape(len(candidates), -1, made.shape[1])
