"""The design matrix of a fit: derivatives of positions, kept as they arise.

The column of a joint effect is J_j(q) phi(covariate). Sums over rows need J and phi
alone: a third of the numbers, and a sixth of the work.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.model.combination import Combination
from postproc.model.effects.effect import Effect, JointEffect
from postproc.model.kinematics import Batch


@dataclass(frozen=True, eq=False)
class JointColumns:
    """Columns of all effects that turn one joint.

    Attributes:
        joint: The joint, from 0.
        places: Their places among the parameters, (k,).
        angles: By what they turn the joint, (k, n) [rad per unit].
    """

    joint: int
    places: Ints
    angles: Floats


@dataclass(frozen=True, eq=False)
class DesignMatrix:
    """Derivatives of n positions by p parameters.

    Attributes:
        jacobian: By joint angles, (n, 3, 6) [m/rad].
        joints: Columns of effects that turn joints, by joint.
        direct: Columns of all other effects, (n, 3, m) [m per unit].
        moving: Their places among the parameters, (m,).
    """

    jacobian: Floats
    joints: tuple[JointColumns, ...]
    direct: Floats
    moving: Ints

    @classmethod
    def of(cls, combination: Combination, at: Batch) -> DesignMatrix:
        """Differentiate the effects at the kinematics of a batch."""
        places = np.arange(len(combination.parameters))
        moving = [np.zeros(0, dtype=int)]
        turning: dict[int, tuple[list[Ints], list[Floats]]] = {}
        for effect, part in zip(combination.effects, combination.slices, strict=True):
            if not isinstance(effect, JointEffect):
                moving.append(places[part])
                continue
            angles, joint = effect.basis(at).T, effect.acts_on()
            for j in np.unique(joint):
                own = turning.setdefault(int(j), ([], []))
                own[0].append(places[part][joint == j])
                own[1].append(angles[joint == j])
        joints = tuple(
            JointColumns(j, np.concatenate(own), np.concatenate(angles))
            for j, (own, angles) in sorted(turning.items())
        )
        direct = _direct(combination.effects, at)
        return cls(at.jacobian, joints, direct, np.concatenate(moving))

    def at(self, combination: Combination, at: Batch) -> DesignMatrix:
        """Differentiate the same effects at other kinematics of the same states."""
        return replace(
            self, jacobian=at.jacobian, direct=_direct(combination.effects, at)
        )

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.moving) + sum(len(c.places) for c in self.joints)

    def dense(self) -> Floats:
        """Write all columns out, (n, 3, p)."""
        n = len(self.jacobian)
        out = np.empty((self.size, 3, n))
        out[self.moving] = self.direct.T
        for c in self.joints:
            out[c.places] = self.jacobian[:, :, c.joint].T * c.angles[:, None]
        return out.T

    def shift(self, values: Floats) -> Floats:
        """Turn the joints by parameters, (n, 6) [rad]."""
        out = np.zeros((len(self.jacobian), 6))
        for c in self.joints:
            out[:, c.joint] = values[c.places] @ c.angles
        return out

    def times(self, values: Floats) -> Floats:
        """Move the positions by parameters, (n, 3) [m]."""
        turned = np.einsum("nij,nj->ni", self.jacobian, self.shift(values))
        moved: Floats = turned + self.direct @ values[self.moving]
        return moved

    def moment(self, rows: Floats) -> Floats:
        """Sum columns times rows (n, 3) over all rows, (p,)."""
        out = np.zeros(self.size)
        along = np.einsum("nij,ni->jn", self.jacobian, rows)
        for c in self.joints:
            out[c.places] = c.angles @ along[c.joint]
        out[self.moving] = np.einsum("nip,ni->p", self.direct, rows)
        return out

    def turned(self, by: Floats) -> DesignMatrix:
        """Multiply the columns of every row by a matrix, (n, 3, 3)."""
        return replace(self, jacobian=by @ self.jacobian, direct=by @ self.direct)

    def gram(self) -> Floats:
        """Sum products of columns over all rows, (p, p)."""
        out = np.zeros((self.size, self.size))
        J, D = self.jacobian, self.direct
        both = np.ascontiguousarray(np.einsum("nij,nik->jkn", J, J))
        for number, a in enumerate(self.joints):
            for b in self.joints[number:]:
                block = (a.angles * both[a.joint, b.joint]) @ b.angles.T
                out[np.ix_(a.places, b.places)] = block
                out[np.ix_(b.places, a.places)] = block.T
            mixed = a.angles @ np.einsum("nip,ni->np", D, J[:, :, a.joint])
            out[np.ix_(a.places, self.moving)] = mixed
            out[np.ix_(self.moving, a.places)] = mixed.T
        flat = D.reshape(3 * len(D), D.shape[2])
        out[np.ix_(self.moving, self.moving)] = flat.T @ flat
        return out

    def variance(self, covariance: Floats) -> Floats:
        """Variance of every component that uncertain parameters give, (n, 3).

        Args:
            covariance: Of the parameters, (p, p).
        """
        J, D, moving = self.jacobian, self.direct, self.moving
        direct = D @ covariance[np.ix_(moving, moving)]
        total = np.einsum("nip,nip->ni", direct, D)
        for number, a in enumerate(self.joints):
            along = J[:, :, a.joint]
            for b in self.joints[number:]:
                part = covariance[np.ix_(b.places, a.places)] @ a.angles
                both = np.einsum("kn,kn->n", part, b.angles)
                twice = 1.0 if a is b else 2.0
                total += twice * both[:, None] * along * J[:, :, b.joint]
            part = covariance[np.ix_(moving, a.places)] @ a.angles
            total += 2.0 * np.einsum("nip,pn->ni", D, part) * along
        variance: Floats = np.maximum(total, 0.0)
        return variance


def _direct(effects: tuple[Effect, ...], at: Batch) -> Floats:
    """Differentiate effects that turn no joint, (n, 3, m)."""
    columns = [e.columns(at) for e in effects if not isinstance(e, JointEffect)]
    if not columns:
        return np.zeros((len(at), 3, 0))
    return np.ascontiguousarray(np.concatenate(columns, axis=2))
