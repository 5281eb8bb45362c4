"""The design matrix of a fit: derivatives of positions, kept as they arise.

The column of a joint effect is J_j(q) phi(covariate). Sums over rows need J and phi
alone; of phi that are made of splines, the four that are not 0 at a row. The core sums
(`native/src/design.rs`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from postproc import _native
from postproc.arrays import Floats, Ints
from postproc.model.effect_sum import Combination
from postproc.model.effects.effect import Effect, JointEffect
from postproc.model.kinematics import ArmStates
from postproc.model.splines import Splines
from postproc.model.whitening import RowBlocks

Features = tuple[
    tuple[Floats, Floats],
    tuple[Floats, list[int]],
    tuple[Ints, Floats, list[int], int],
]

BLOCK = 1024  # rows that are written out at once


@dataclass(frozen=True, eq=False)
class JointColumns:
    """Columns that turn joints by a number of their own at every row.

    Attributes:
        joint: The joint of each, from 0, (d,).
        places: Their places among the parameters, (d,).
        angles: By what they turn it, (n, d) [rad per unit].
    """

    joint: Ints
    places: Ints
    angles: Floats


@dataclass(frozen=True, eq=False)
class SplineColumns:
    """Columns that turn one joint and are made of splines.

    Attributes:
        joint: The joint, from 0.
        places: Their places among the parameters, (k,).
        splines: At the n rows.
        mix: What of each makes every column, (m, k) [rad per unit].
    """

    joint: int
    places: Ints
    splines: Splines
    mix: Floats


@dataclass(frozen=True, eq=False)
class DesignMatrix:
    """Derivatives of n positions by p parameters.

    Attributes:
        jacobian: By joint angles, (n, 3, 6) [m/rad].
        turning: Columns of effects that turn joints, but for those made of splines.
        splines: Those.
        direct: Columns of all other effects, (n, 3, m) [m per unit].
        moving: Their places among the parameters, (m,).
        blocks: What the rows are multiplied with, those of a pose at once.
    """

    jacobian: Floats
    turning: JointColumns
    splines: tuple[SplineColumns, ...]
    direct: Floats
    moving: Ints
    blocks: RowBlocks = field(default_factory=RowBlocks)

    @classmethod
    def of(cls, combination: Combination, at: ArmStates) -> DesignMatrix:
        """Differentiate the effects at the kinematics of a batch."""
        places = np.arange(len(combination.parameters))
        moving, joint, turning = [places[:0]], [places[:0]], [places[:0]]
        angles, splines = [np.zeros((len(at), 0))], []
        for effect, part in zip(combination.effects, combination.slices, strict=True):
            if not isinstance(effect, JointEffect):
                moving.append(places[part])
            elif (made_of := effect.splines(at)) is not None:
                splines += _splines(places[part], made_of)
            else:
                joint.append(effect.acts_on())
                turning.append(places[part])
                angles.append(effect.basis(at))
        columns = JointColumns(
            np.concatenate(joint), np.concatenate(turning), np.concatenate(angles, 1)
        )
        direct = _direct(combination.effects, at)
        jacobian = np.ascontiguousarray(at.jacobian)
        return cls(jacobian, columns, tuple(splines), direct, np.concatenate(moving))

    def at(self, combination: Combination, at: ArmStates) -> DesignMatrix:
        """Differentiate the same effects at other kinematics of the same states."""
        jacobian = np.ascontiguousarray(at.jacobian)
        return replace(self, jacobian=jacobian, direct=_direct(combination.effects, at))

    def __getitem__(self, rows: Ints) -> DesignMatrix:
        """Return some of the rows; those that are taken at once stay together."""
        turning = replace(self.turning, angles=self.turning.angles[rows])
        splines = tuple(replace(c, splines=c.splines[rows]) for c in self.splines)
        return replace(
            self, jacobian=self.jacobian[rows], turning=turning, splines=splines,
            direct=self.direct[rows],
            blocks=self.blocks.at_rows(rows, len(self.jacobian)),
        )  # fmt: skip

    @property
    def by_row(self) -> DesignMatrix:
        """Return the columns before rows are taken at once."""
        return replace(self, blocks=RowBlocks()) if self.blocks else self

    @property
    def size(self) -> int:
        """Number of parameters."""
        turning = len(self.turning.places) + sum(len(c.places) for c in self.splines)
        return len(self.moving) + turning

    def dense(self) -> Floats:
        """Write all columns out, (n, 3, p)."""
        out = np.empty((self.size, 3, len(self.jacobian)))
        out[self.moving] = self.direct.T
        axes, t = self.jacobian.T, self.turning
        out[t.places] = axes[t.joint] * t.angles.T[:, None]
        for c in self.splines:
            out[c.places] = axes[c.joint] * c.splines.combine(c.mix).T[:, None]
        return self.blocks.apply(out.T)

    def shift(self, values: Floats) -> Floats:
        """Turn the joints by parameters, (n, 6) [rad]."""
        t = self.turning
        by_joint = np.zeros((len(t.joint), 6))
        by_joint[np.arange(len(t.joint)), t.joint] = values[t.places]
        out: Floats = t.angles @ by_joint
        for c in self.splines:
            out[:, c.joint] += c.splines.combine(c.mix @ values[c.places])
        return out

    def times(self, values: Floats) -> Floats:
        """Move the positions by parameters, (n, 3) [m]."""
        turned = np.einsum("nij,nj->ni", self.jacobian, self.shift(values))
        moved: Floats = turned + self.direct @ values[self.moving]
        return self.blocks.apply(moved)

    def combine(self, mix: Floats) -> Floats:
        """Mix the columns, (p, k), to columns of all scalar rows, (3 n, k)."""
        n, plain = len(self.jacobian), self.by_row
        out = np.empty((n, 3, mix.shape[1]))
        for first in range(0, n, BLOCK):
            some = plain[np.arange(first, min(first + BLOCK, n))]
            out[first : first + BLOCK] = some.dense() @ mix
        return self.blocks.apply(out).reshape(3 * n, -1)

    def moment(self, rows: Floats) -> Floats:
        """Sum columns times rows (n, 3) over all rows, (p,)."""
        out, t = np.zeros(self.size), self.turning
        rows = self.blocks.apply(rows, transposed=True)
        along = np.einsum("nij,ni->nj", self.jacobian, rows)
        out[t.places] = np.einsum("nd,nd->d", t.angles, along[:, t.joint])
        for c in self.splines:
            out[c.places] = c.mix.T @ c.splines.moment(along[:, c.joint], len(c.mix))
        out[self.moving] = np.einsum("nip,ni->p", self.direct, rows)
        return out

    def rotate(self, by: Floats) -> DesignMatrix:
        """Multiply the columns of every row by a matrix, (n, 3, 3)."""
        return replace(self, jacobian=by @ self.jacobian, direct=by @ self.direct)

    def gram(self) -> Floats:
        """Sum products of columns over all rows, (p, p)."""
        if self.blocks:
            alone = np.delete(np.arange(len(self.jacobian)), self.blocks.rows)
            whole = np.zeros((self.size, self.size))
            for X in self._columns_of_blocks():
                flat = X.reshape(-1, self.size)
                whole += flat.T @ flat
            return self[alone].gram() + whole
        plain, splines = _native.gram(*self._features())
        plain[: plain.shape[1]] += np.tril(plain[: plain.shape[1]], -1).T
        out = np.empty((self.size, self.size))
        places = self._plain_places()
        out[np.ix_(places, places)] = plain[: len(places)]
        for number, (a, own) in enumerate(self._sets()):
            mixed = a.mix.T @ plain[len(places) :][own]
            out[np.ix_(a.places, places)] = mixed
            out[np.ix_(places, a.places)] = mixed.T
            for b, others in self._sets()[: number + 1]:
                block = a.mix.T @ splines[own, others] @ b.mix
                out[np.ix_(b.places, a.places)] = block.T
                out[np.ix_(a.places, b.places)] = block
        return out

    def _columns_of_blocks(self) -> Iterator[Floats]:
        """Write the rows that are taken at once out, some (groups, 3 m, p) a time."""
        plain = self.by_row
        for rows, matrix in self.blocks.parts:
            count, m = rows.shape
            at_once = max(1, BLOCK // m)
            for first in range(0, count, at_once):
                some = rows[first : first + at_once]
                X = plain[some.reshape(-1)].dense().reshape(len(some), 3 * m, -1)
                yield matrix[first : first + at_once] @ X

    def variance(self, covariance: Floats) -> Floats:
        """Variance of every component that uncertain parameters give, (n, 3).

        Args:
            covariance: Of the parameters, (p, p).
        """
        if self.blocks:
            return self._variance_with_blocks(covariance)
        places, sets = self._plain_places(), self._sets()
        count = sum(len(a.mix) for a, _ in sets)
        plain, splines = np.empty((len(places) + count, len(places))), []
        plain[: len(places)] = covariance[np.ix_(places, places)]
        for a, own in sets:
            of_plain = a.mix @ covariance[np.ix_(a.places, places)]
            plain[len(places) :][own] = of_plain
            with_others = [covariance[np.ix_(a.places, b.places)] @ b.mix.T
                           for b, _ in sets]  # fmt: skip
            splines.append(a.mix @ np.concatenate(with_others, axis=1))
        plain = 2.0 * np.tril(plain)
        plain[np.diag_indices(len(places))] /= 2.0
        form = plain, np.concatenate([np.zeros((0, count)), *splines])
        total = _native.uncertainty(*self._features(), form)
        variance: Floats = np.maximum(total, 0.0)
        return variance

    def _variance_with_blocks(self, covariance: Floats) -> Floats:
        """Do it where rows are taken at once."""
        out = self.by_row.variance(covariance)
        own = [np.einsum("gkp,gkp->gk", X @ covariance, X).reshape(-1, 3)
               for X in self._columns_of_blocks()]  # fmt: skip
        rows = np.concatenate([r.reshape(-1) for r, _ in self.blocks.parts])
        out[rows] = np.maximum(np.concatenate(own), 0.0)
        return out

    def _plain_places(self) -> Ints:
        """Give the places of columns that are not made of splines, as the core does."""
        return np.concatenate([self.moving, self.turning.places])

    def _sets(self) -> list[tuple[SplineColumns, slice]]:
        """Say where the splines of every set stand among all of them."""
        ends = np.cumsum([0, *(len(c.mix) for c in self.splines)])
        own = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        return list(zip(self.splines, own, strict=True))

    def _features(self) -> Features:
        """Write the rows as the core takes them."""
        n, t, sets = len(self.jacobian), self.turning, self._sets()
        first = [c.splines.first[:, None] + own.start for c, own in sets]
        weight = [c.splines.weight for c, _ in sets]
        return (
            (self.jacobian, self.direct),
            (t.angles, t.joint.tolist()),
            (
                np.concatenate([np.zeros((n, 0), dtype=np.int64), *first], axis=1),
                np.concatenate([np.zeros((n, 0)), *weight], axis=1),
                [c.joint for c in self.splines],
                sum(len(c.mix) for c in self.splines),
            ),
        )


def _splines(
    places: Ints, made_of: list[tuple[int, Splines, Floats]]
) -> list[SplineColumns]:
    """Give every set of splines its places."""
    ends = np.cumsum([mix.shape[1] for _, _, mix in made_of])[:-1]
    return [
        SplineColumns(joint, own, splines, mix)
        for own, (joint, splines, mix) in zip(
            np.split(places, ends), made_of, strict=True
        )
    ]


def _direct(effects: tuple[Effect, ...], at: ArmStates) -> Floats:
    """Differentiate effects that turn no joint, (n, 3, m)."""
    columns = [e.columns(at) for e in effects if not isinstance(e, JointEffect)]
    if not columns:
        return np.zeros((len(at), 3, 0))
    return np.ascontiguousarray(np.concatenate(columns, axis=2))
