"""What is known of an arm from its survey and all checks since, as a normal law.

The unknowns are the model's parameters and, of every pose that a check has visited from
a side, what no effect describes there: it comes again at every visit, and is no change
of the arm. Readings are linearised where the arm is thought to be (an iterated extended
Kalman filter; Jazwinski, Stochastic Processes and Filtering Theory, 1970, section 8.3).
Where the tracker stood is new in every check, and nothing is known of it beforehand.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.record.check_rows import CheckRows
from postproc.record.events import REFITTED, Event, open_base
from postproc.robot.arm import Arm
from postproc.robot.state import States

PASSES = 4  # linearisations of an update
SETTLED = 1e-9  # [m] by which the last of them moves a reading at most
OF_POSE = 9  # unknowns of a pose: an error of every joint, and a shift
SAME = 2e-4  # [rad] joint angles of one pose, as they are read back
NEVER = 1e-9  # share of the largest singular value below which columns are dependent


@dataclass(frozen=True, eq=False)
class Expected:
    """What readings of a check are expected to be, linearised.

    Attributes:
        left: Readings less what is expected, (m,) [m].
        columns: Derivatives by the unknowns, (m, k).
        precision: Inverse covariance of `left` with the tracker's place projected out,
            (m, m) [1/m^2].
        free: Degrees of freedom of the readings that remain.
    """

    left: Floats
    columns: Floats
    precision: Floats
    free: int

    @property
    def statistic(self) -> float:
        """Hotelling's T2: chi square with `free` degrees of freedom."""
        return float(self.left @ self.precision @ self.left)


@dataclass(frozen=True, eq=False)
class Knowledge:
    """The normal law of the unknowns.

    Attributes:
        arm: The arm.
        model: The model; its values are where effects with settings begin.
        mean: Parameters, then nine unknowns a pose, (k,).
        covariance: Of them, (k, k).
        poses: Joint angles of the poses, and from which side each joint came to them,
            (n, 12) [rad].
    """

    arm: Arm
    model: Model
    mean: Floats
    covariance: Floats
    poses: Floats

    @classmethod
    def of(cls, model: Model, arm: Arm) -> Knowledge:
        """Begin with what a survey's model knows."""
        model = open_base(model.without_clock(()))
        nothing = np.zeros((0, 12))
        return cls(arm, model, model.values.copy(), model.covariance.copy(), nothing)

    @property
    def parameters(self) -> slice:
        """Where the model's parameters are among the unknowns."""
        return slice(0, len(self.model.values))

    def after(self, event: Event) -> Knowledge:
        """Return what is left of it after an event."""
        wider = self.covariance.copy()
        own = np.arange(len(self.model.values))
        wider[own, own] += event.widening(self.model)
        rest = replace(self, covariance=wider)
        return rest.without_poses() if event.kind in REFITTED else rest

    def without_poses(self) -> Knowledge:
        """Return it without what was found of poses."""
        own = self.parameters
        return replace(
            self, mean=self.mean[own], covariance=self.covariance[own, own],
            poses=self.poses[:0],
        )  # fmt: skip

    def visiting(self, rows: CheckRows) -> Knowledge:
        """Return it with the poses of a check among the unknowns."""
        new = np.flatnonzero(self.find_poses(rows.states) < 0)
        if not len(new):
            return self
        _, first = np.unique(rows.arrival[new], return_index=True)
        first = np.sort(new[first])
        prior = np.concatenate([rows.pose_variance[k] for k in first])
        count, old = len(prior), len(self.mean)
        covariance = np.zeros((old + count, old + count))
        covariance[:old, :old] = self.covariance
        covariance[range(old, old + count), range(old, old + count)] = prior
        return replace(
            self, mean=np.append(self.mean, np.zeros(count)), covariance=covariance,
            poses=np.concatenate([self.poses, _pose_of(rows.states)[first]]),
        )  # fmt: skip

    def find_poses(self, states: States) -> Ints:
        """Return which known pose each of n rows stands at, (n,), -1 for none."""
        if not len(self.poses):
            return np.full(len(states), -1)
        far = np.abs(_pose_of(states)[:, None] - self.poses).max(axis=2)
        near = far.argmin(axis=1)
        return np.where(far[np.arange(len(states)), near] < SAME, near, -1)

    def expect(self, rows: CheckRows, at: Floats | None = None) -> Expected:
        """Predict the readings of a check whose poses are among the unknowns.

        Args:
            rows: The check.
            at: Unknowns at which the arm is linearised, (k,); None: the mean.
        """
        at = self.mean if at is None else at
        values, effects = at[self.parameters], self.model.effects
        batch = ArmStates(self.arm, rows.states)
        moved = effects.at(batch, values)
        columns = np.zeros((len(rows), 3, len(at)))
        columns[:, :, self.parameters] = effects.columns(moved)
        first = len(values) + OF_POSE * self.find_poses(rows.states)
        for k, begin in enumerate(first):
            columns[k, :, begin : begin + OF_POSE] = rows.pose_columns[k]
        flat = columns.reshape(-1, len(at))
        expected = batch.walk.tcp + effects.error_at(moved, batch, values)
        left = (rows.position - expected).reshape(-1)
        left = left - flat[:, len(values) :] @ at[len(values) :]
        left = left - flat @ (self.mean - at)  # as from the mean
        flat = np.concatenate([flat, np.zeros((3 * len(rows.fixed), len(at)))])
        return self._whiten(rows, np.append(left, rows.fixed.reshape(-1)), flat)

    def _whiten(self, rows: CheckRows, left: Floats, columns: Floats) -> Expected:
        """Project out where the tracker stood: a flat prior on its place."""
        S = columns @ self.covariance @ columns.T + rows.noise
        inverse = np.linalg.inv((S + S.T) / 2)
        free, G = len(left), rows.placing
        if G.shape[1]:
            U, size, _ = np.linalg.svd(G / np.abs(G).max(axis=0), full_matrices=False)
            U = U[:, size > NEVER * size[0]]
            known = inverse @ U
            inverse = inverse - known @ np.linalg.solve(U.T @ known, known.T)
            free -= U.shape[1]
        return Expected(left, columns, (inverse + inverse.T) / 2, free)

    def update(self, rows: CheckRows, trusted: Bools | None = None) -> Knowledge:
        """Take in the readings of a check.

        Args:
            rows: The check.
            trusted: Rows of the arm that count, (n,); None: all.
        """
        rows = rows if trusted is None else rows.only(trusted)
        before = self.visiting(rows)
        at = before.mean
        for _ in range(PASSES):
            expected = before.expect(rows, at)
            gain = before.covariance @ expected.columns.T @ expected.precision
            step = before.mean + gain @ expected.left - at
            at = at + step
            if np.abs(expected.columns @ step).max(initial=0.0) < SETTLED:
                break
        left = before.covariance - gain @ expected.columns @ before.covariance
        return replace(before, mean=at, covariance=(left + left.T) / 2)

    @cached_property
    def values(self) -> Floats:
        """The model's parameters as they are thought to be, (p,)."""
        return self.mean[self.parameters]

    def to_model(self) -> Model:
        """Return the model with what is known now, but for poses."""
        own = self.parameters
        return replace(
            self.model, values=self.mean[own], covariance=self.covariance[own, own]
        )


def _pose_of(states: States) -> Floats:
    """Return joint angles and directions: what tells poses apart, (n, 12)."""
    return np.concatenate([states.q, states.direction], axis=1)
