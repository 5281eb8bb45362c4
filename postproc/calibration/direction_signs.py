"""What changes at one row of a file: the sign of lambda, or the zero of a joint.

The backlash that the rows show tells the first: its sign is that of the lambda columns,
in all rows too. Geometry is free beside both.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from postproc.arrays import Bools, Floats
from postproc.calibration.registration import robust_weights
from postproc.model.kinematics import ArmStates

FEWEST = 12  # rows on either side of a change
BOTH = 0.1  # share of the rarer direction of a joint that tells
CLEAR = 6.0  # standard errors of a backlash that tells
JOINTS = 2  # that tell, at least, of a change within the file
MOST_JOINTS = 4  # that tell, at least, of all rows: physics alone speaks for these
LESS = 0.7  # of the median residual that may be left by a change
ALONE = 0.2  # of the change of one joint that others may have


@dataclass(frozen=True)
class JointChange:
    """A joint that is off by another angle from one row on.

    Attributes:
        joint: The joint, from 0.
        by: What its angles lack from there on [rad].
        first: Number of the row.
    """

    joint: int
    by: float
    first: int


@dataclass(frozen=True, eq=False)
class Sided:
    """Rows with what backlash does to them, without everything else.

    Attributes:
        free: What else moves the rows, orthonormal columns, (n, 3, p).
        turned: Motion per rad of every joint, (n, 3, 6) [m].
        left: What the rows are off by, (n, 3) [m].
        weight: Of the rows, (n,).
        side: Directions of the file, (n, 6).
    """

    free: Floats
    turned: Floats
    left: Floats
    weight: Floats
    side: Floats

    @classmethod
    def of(cls, batch: ArmStates, free: Floats, left: Floats) -> Sided:
        """Take rows of errors `left` (n, 3) [m], beside free columns (n, 3, p)."""
        n = len(batch)
        flat = free.reshape(3 * n, -1)
        scale = np.maximum(np.linalg.norm(flat, axis=0), 1e-300)
        solved = np.linalg.lstsq(flat / scale, left.reshape(-1), rcond=1e-6)[0]
        rest = left.reshape(-1) - flat / scale @ solved
        weight = robust_weights(rest.reshape(-1, 3))
        root = np.sqrt(weight)[:, None]
        u, size, _ = np.linalg.svd(flat / scale * np.repeat(root, 3)[:, None], False)
        basis = u[:, size > 1e-6 * size[0]].reshape(n, 3, -1)
        turned = batch.jacobian * root[:, :, None]
        return cls(basis, turned, left * root, weight, batch.states.direction)

    @cached_property
    def moved(self) -> Floats:
        """Motion per rad of every joint times its direction, (n, 3, 6) [m]."""
        return self.turned * self.side[:, None, :]

    def score_changes(self) -> Floats:
        """Return the squares that backlash explains where lambda changes sign at a row.

        Returns:
            (n + 1,) [m^2], the change being before row k; the last is without one.
        """
        overlap = np.einsum("nkp,nkj->npj", self.free, self.moved)
        along = np.einsum("nkj,nk->nj", self.moved, self.left)
        gram = np.einsum("nkj,nkl->jl", self.moved, self.moved)
        seen = np.einsum("nkp,nk->p", self.free, self.left)
        crossed, reached = (_with_change(v) for v in (overlap, along))
        target = reached - np.einsum("npj,p->nj", crossed, seen)
        inner = gram - np.swapaxes(crossed, 1, 2) @ crossed
        inverse = np.linalg.pinv(inner, rcond=1e-9, hermitian=True)
        return np.asarray(np.einsum("nj,njk,nk->n", target, inverse, target))

    def most_telling_row(self) -> int:
        """Return the row from which on another sign explains most."""
        gained = self.score_changes()
        inside = np.arange(FEWEST, len(self.left) - FEWEST + 1)
        return int(inside[np.argmax(gained[inside])])

    def backlashes(self, parts: list[Bools]) -> tuple[Floats, Floats, Floats]:
        """Fit a backlash of every joint to each part of the rows.

        Returns:
            Values [rad] and standard errors, (parts, 6), and the residual, (n,) [m].
        """
        columns = np.concatenate([self.moved * p[:, None, None] for p in parts], axis=2)
        columns = columns.reshape(3 * len(self.left), -1)
        free = self.free.reshape(len(columns), -1)
        own = columns - free @ (free.T @ columns)
        y = self.left.reshape(-1)
        y = y - free @ (free.T @ y)
        inverse = np.linalg.pinv(own.T @ own, rcond=1e-9, hermitian=True)
        value = inverse @ (own.T @ y)
        rest = y - own @ value
        spent = free.shape[1] + columns.shape[1]
        count = max(3.0 * float((self.weight > 0.5).sum()) - spent, 1.0)
        error = np.sqrt(np.maximum(np.diag(inverse), 0.0) * float(rest @ rest) / count)
        size = np.linalg.norm(rest.reshape(-1, 3), axis=1)
        shape = (len(parts), -1)
        return value.reshape(shape), error.reshape(shape), size

    def beside_free(self) -> Floats:
        """Return what the free columns leave of the rows, (n,) [m]."""
        free, y = self.free.reshape(3 * len(self.left), -1), self.left.reshape(-1)
        rest = (y - free @ (free.T @ y)).reshape(-1, 3)
        return np.asarray(np.linalg.norm(rest, axis=1))

    @cached_property
    def joint_change(self) -> JointChange | None:
        """The joint that is off by another angle from one row on, None if none is.

        Zeros of the joints are among what is free.
        """
        n = len(self.left)
        if n < 2 * FEWEST:
            return None
        forward = replace(self, side=np.ones((n, 6)))
        first = forward.most_telling_row()
        value, error, after = forward.backlashes([np.arange(n) >= first])
        joint = int(np.argmax(np.abs(value[0]) / np.maximum(error[0], 1e-12)))
        by = float(value[0, joint])
        others = np.delete(np.abs(value[0]) - CLEAR * error[0], joint)
        clear = abs(by) > CLEAR * error[0, joint] and others.max() < ALONE * abs(by)
        if not clear or np.median(after) > LESS * np.median(self.beside_free()):
            return None
        return JointChange(joint, by, first)

    def telling(self, rows: Bools) -> Bools:
        """Return the joints that some rows reach from both directions, (6,)."""
        some = self.side[rows]
        rarer = np.minimum((some > 0).mean(axis=0), (some < 0).mean(axis=0))
        return np.asarray(rarer >= BOTH)


def _with_change(values: Floats) -> Floats:
    """Sum values (n, ..) with the other sign from each row on, (n + 1, ..)."""
    total = values.sum(axis=0)
    before = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    return np.asarray(2.0 * before - total)


def find_change_of_sign(sided: Sided) -> tuple[Bools, str] | None:
    """Find the row at which lambda changes its sign, None where it does not.

    Returns:
        The rows whose sign is the other one, and "from" or "until". A link stays behind
        its drive, so that backlash is below 0 where lambda is right.
    """
    n = len(sided.left)
    if n < 2 * FEWEST:
        return None
    first = sided.most_telling_row()
    parts = [np.arange(n) < first, np.arange(n) >= first]
    value, error, after = sided.backlashes(parts)
    before = sided.backlashes([np.ones(n, dtype=bool)])[2]
    if np.median(after) > LESS * np.median(before):
        return None
    clear = (np.abs(value) > CLEAR * error).all(axis=0)
    clear &= sided.telling(parts[0]) & sided.telling(parts[1])
    if clear.sum() < JOINTS or (value[0] * value[1])[clear].max() > 0.0:
        return None
    late = float((value[1] - value[0])[clear].sum()) > 0.0
    return (parts[1], "from") if late else (parts[0], "until")


def all_reversed(sided: Sided) -> bool:
    """Return True if the links of all joints that tell run ahead of their drives."""
    every = np.ones(len(sided.left), dtype=bool)
    value, error, _ = sided.backlashes([every])
    clear = (np.abs(value[0]) > CLEAR * error[0]) & sided.telling(every)
    return bool(clear.sum() >= MOST_JOINTS and (value[0][clear] > 0.0).all())
