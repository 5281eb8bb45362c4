"""Joint spline: the whole error of a joint along its angle.

Where `joint_map` finds a place, this resolves every gear and encoder wave that the rows
can show, without naming them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.model.effects.effect import DRIVEN, JointEffect, Parameter, fade
from postproc.model.effects.policies import FitPolicy
from postproc.model.effects.smooth import smooth, smooth_count, smooth_mix
from postproc.model.kinematics import ArmStates
from postproc.model.splines import Splines
from postproc.model.terms import Term, Terms, angle, joint_angles, law, turn_joint
from postproc.robot.arm import Arm
from postproc.robot.state import States

SCALE = 1e-4  # [rad]
TURN = 2.0 * np.pi
LONG = np.deg2rad(60.0)
SHORTEST = np.deg2rad(5.0)  # while waves are not named: a shorter one takes them up
FINEST = np.deg2rad(3.0)  # and once they are
ROWS_A_LENGTH = 10.0  # rows that the shortest length must see
ROWS_BESIDE_WAVES = 15.0  # and the finer one that waves are named beside
LEAST_RANGE = np.deg2rad(10.0)
LEAST_ROWS = 100
LONG_SURVEY = 600  # rows from which no other free form resolves more
WHOLE = 1.0 / 1.2  # of a turn: what fades at the ends of a longer range meets


@dataclass(frozen=True)
class JointSpline(JointEffect):
    """Joint error f(theta), a sum of smooth functions at a long and a short length.

    Attributes:
        joints: Joints that have one.
        lower, upper: Surveyed range of every joint [rad]; outside, what is finer than
            the long length fades to zero.
        lengths: Correlation lengths [rad]; the data share f among them.
        turns: Whether f repeats with every turn of the joint, as the errors of its gear
            and of its encoder do: an angle counts as that of its nearest turn, and at
            the long length f goes on all round, as unsure as that leaves it.
    """

    name: ClassVar[str] = "joint_spline"
    renewed_by: ClassVar[frozenset[str]] = DRIVEN
    acts: ClassVar[tuple[tuple[str, str], ...]] = (("joint", "joint"),)
    fit_policy: ClassVar[FitPolicy] = FitPolicy.LAST
    free: ClassVar[bool] = True

    joints: tuple[int, ...] = (1, 2, 3, 4, 5, 6)
    lower: tuple[float, ...] = (-np.pi,) * 6
    upper: tuple[float, ...] = (np.pi,) * 6
    lengths: tuple[float, ...] = (LONG, 3 * SHORTEST)
    turns: bool = False

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Resolve as much as the number of rows allows, on every joint that moved."""
        low, high = states.q.min(axis=0), states.q.max(axis=0)
        span = np.minimum(high - low, TURN)
        short = _resolve_length(states, ROWS_A_LENGTH, SHORTEST)
        return cls(
            joints=tuple(int(j) + 1 for j in np.flatnonzero(span > LEAST_RANGE)),
            lower=tuple(map(float, low)),
            upper=tuple(map(float, high)),
            lengths=(LONG, short),
            turns=True,
        )

    @classmethod
    def may_show(cls, states: States) -> bool:
        """Wait for a survey that is long enough, and moved a joint far enough."""
        moved = np.ptp(states.q, axis=0) > LEAST_RANGE
        return len(states) >= LEAST_ROWS and bool(moved.any())

    def beside_waves(self, states: States) -> Self:
        """Resolve what named waves leave: as much as more rows allow."""
        short = _resolve_length(states, ROWS_BESIDE_WAVES, FINEST)
        if short >= min(self.lengths):
            return self
        return replace(self, lengths=(max(self.lengths), short))

    def _parts(self) -> list[_LengthPart]:
        """List the functions of every joint and length."""
        parts = []
        for j, length in product(self.joints, self.lengths):
            low, high = self.lower[j - 1], self.upper[j - 1]
            half, middle = (high - low) / 2.0, (low + high) / 2.0
            short = length < max(self.lengths) and half < WHOLE * np.pi
            if whole := self.turns and not short:  # all round
                low, high = middle - np.pi, middle + np.pi
            parts.append(_LengthPart(j - 1, length, low, high, whole))
        return parts

    def _count_angles(self, q: Floats) -> Floats:
        """Take angles (n, 6) as they count."""
        if not self.turns:
            return q
        middle = (np.array(self.lower) + np.array(self.upper)) / 2.0
        counted: Floats = middle + np.mod(q - middle + np.pi, TURN) - np.pi
        return counted

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the columns of every joint and length."""
        out = []
        for part in self._parts():
            joint, wide = part.j + 1, f"{np.rad2deg(part.length):.1f} deg"
            for k in range(part.count):
                name = f"f{joint} {wide} {k + 1}"
                out.append(
                    Parameter(name, "rad", SCALE, f"joint {joint} {wide}", joint)
                )
        return tuple(out)

    def fine(self, joint: int) -> NDArray[np.int64]:
        """Take a joint's functions at the short length."""
        parts, shortest = self._parts(), min(self.lengths)
        short = [(part.j + 1, part.length) == (joint, shortest) for part in parts]
        return np.flatnonzero(np.repeat(short, [part.count for part in parts]))

    def splines(self, batch: ArmStates) -> list[tuple[int, Splines, Floats]]:
        """Write the functions of every joint and length as splines, see `smooth`."""
        q, out = self._count_angles(batch.states.q), []
        for part in self._parts():
            x = q[:, part.j]
            found, mix = smooth(x, part.lower, part.upper, part.length, part.closed)
            out.append((part.j, found.fade(part.inside(x)), mix))
        return out

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate the functions, (n, p)."""
        columns = [found.combine(mix) for _, found, mix in self.splines(batch)]
        return np.concatenate(columns, axis=1)

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn every joint by its splines."""
        out, left = [], p
        for part in self._parts():
            j, own = part.j, left[: part.count]
            left = left[part.count :]
            middle = (self.lower[j] + self.upper[j]) / 2.0
            ends = part.lower, part.upper, not part.closed, self.turns, middle
            mix = smooth_mix(part.lower, part.upper, part.length, part.closed) @ own
            spline = law("spline", *ends, *mix)
            out.append(Term(turn_joint(j + 1), spline, (angle(j + 1),)))
        return out

    def list_ended(self, prior_std: Floats) -> tuple[float, ...]:
        """Return the prior variance of every function."""
        first = np.cumsum([0, *(part.count for part in self._parts())])[:-1]
        return tuple((prior_std[first] ** 2).tolist())

    def angles(self, batch: ArmStates, p: Floats) -> Floats:
        """Return the joint errors (n, 6) [rad]: one function for every joint."""
        return joint_angles(self.terms(batch.arm, p), batch.states)

    def beyond(self, batch: ArmStates, prior_std: Floats) -> Floats:
        """Give back the prior's variance as far as the functions have faded, (n, 6)."""
        q, start, out = self._count_angles(batch.states.q), 0, np.zeros((len(batch), 6))
        for part in self._parts():
            ended = 1.0 - part.inside(q[:, part.j]) ** 2
            out[:, part.j] += ended * prior_std[start] ** 2
            start += part.count
        return out


def _resolve_length(states: States, rows: float, shortest: float) -> float:
    """Say what length so many rows see, `shortest` at least [rad]."""
    span = min(float(np.ptp(states.q, axis=0).max()), TURN)
    seen = rows * span / max(len(states), 1)
    return float(np.clip(seen, shortest, LONG / 2))


@dataclass(frozen=True)
class _LengthPart:
    """The functions of a joint at one length.

    Attributes:
        j: The joint, from 0.
        length: Correlation length [rad].
        lower, upper: Where they begin and end [rad].
        closed: Whether they go all round, and have no end.
    """

    j: int
    length: float
    lower: float
    upper: float
    closed: bool

    @property
    def count(self) -> int:
        """How many there are."""
        return smooth_count(self.lower, self.upper, self.length, self.closed)

    def inside(self, x: Floats) -> Floats:
        """Tell how far they hold at angles (n,): 1, and 0 where they have faded."""
        if self.closed:
            return np.ones(len(x))
        return fade(x, np.array(self.lower), np.array(self.upper))
