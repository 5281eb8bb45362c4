"""Transmission error: a gear or encoder runs out of centre, or its teeth show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import JOINTS
from postproc.model.effects.effect import (
    DRIVEN,
    GEARED,
    NAMED,
    Candidate,
    Cells,
    Effect,
    Family,
    JointEffect,
    Parameter,
    own_cells,
)
from postproc.model.effects.policies import FitPolicy, SearchPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Term, TermLaw, Terms, angle, law, turn_joint
from postproc.robot.arm import Arm

SCALE = 5e-5  # [rad]
ECCENTRIC = (1.0, 2.0)  # orders of a gear or encoder out of centre
FIRST_FREE, LAST_FREE = 3.0, 60.0  # orders of a gear's teeth, its ratio not known
BEYOND = 20.0  # orders beyond twice the ratio, where it is known
LOWEST = 2.5  # order that refining never falls below
FINEST = 0.25  # step of the free orders
ALIKE = 0.9  # correlation of two waves over the poses that are not told apart
LOOKED_AT = 1000  # angles that are enough to see how they are spaced
OUTPUT_SIDE = 4.0  # highest order of waves that a gear's output side makes


@dataclass(frozen=True)
class Transmission(JointEffect):
    """Joint error s sin(k theta) + c cos(k theta), for some joints and orders.

    Attributes:
        waves: (joint, order k per turn of the joint) of every wave. Orders need not be
            whole numbers: a gear's input side turns faster than the joint.
    """

    name: ClassVar[str] = "transmission"
    search_policy: ClassVar[SearchPolicy] = SearchPolicy.ALONE
    fit_policy: ClassVar[FitPolicy] = FitPolicy.IF_EVIDENT
    cells: ClassVar[Cells] = own_cells("joint {j}", "harmonic")

    waves: tuple[tuple[int, float], ...] = tuple(
        (j, float(k)) for j in range(1, 7) for k in (1, 2)
    )

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try every joint; eccentricity, the motor and the teeth share the prior."""
        out = []
        for j in JOINTS:
            family = Family(cls.name, j, None, NAMED)
            for order, share in cls.orders(batch, j).list_orders():
                out.append(Candidate(family, cls(((j, order),)), f"joint {j}", share))
        return out

    @classmethod
    def not_tried(cls, batch: ArmStates) -> tuple[str, ...]:
        """Say which orders are too high for the spacing of the poses, or not known."""
        highest: dict[int, list[int]] = {}
        for j in JOINTS:
            told = cls.orders(batch, j).told
            highest.setdefault(int(max(told, ECCENTRIC[-1])), []).append(j)
        out = [
            f"waves of more than {order} a turn of {_joints(joints)}"
            for order, joints in sorted(highest.items())
        ]
        if np.isnan(batch.arm.gear_ratio).any():
            out[-1] += ", those of the motors with them: no gear_ratio in the arm file"
        return tuple(out)

    @classmethod
    def orders(cls, batch: ArmStates, joint: int) -> Orders:
        """Take the orders of a joint, from 1, that may be tried."""
        own = tuple(float(j == joint) for j in JOINTS)
        ratio = float("nan")  # a motor that follows other joints too: see `drive`
        if turns_alone(batch.arm, joint):
            ratio = float(abs(batch.arm.gear_ratio[joint - 1]))
        return orders_of(batch, own, ratio)

    def refine(self, offsets: Floats, batch: ArmStates) -> list[Effect]:
        """Change the order of one wave; those of eccentricity are what they are."""
        (joint, _), *others = self.waves
        orders = self.orders(batch, joint)
        tries = [] if others else orders.near(self.waves[0][1], offsets)
        return [Transmission(((joint, k),)) for k in tries]

    def plainer(self) -> Effect:
        """Return waves of whole orders: gears have whole numbers of teeth."""
        return replace(self, waves=whole(self.waves))

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell the order of the first wave."""
        return {"order": (float(self.waves[0][1]), "1/turn")}

    def amplitude(self, p: Floats, covariance: Floats) -> tuple[float, float] | None:
        """Return that of a single wave and its standard error [rad]."""
        if len(self.waves) != 1:
            return None
        size = float(np.hypot(*p))
        along = p / max(size, 1e-300)
        return size, float(np.sqrt(along @ covariance @ along))

    def parameters(self) -> tuple[Parameter, ...]:
        """Name sine and cosine of every wave."""
        return tuple(
            Parameter(f"{wave}{j}_{k:g}", "rad", SCALE, f"{j} order {k:g}", j)
            for j, k in self.waves
            for wave in ("sin", "cos")
        )

    def list_renewals(self) -> tuple[frozenset[str], ...]:
        """Tell waves of the output side, which a new motor leaves as they are."""
        sides = (GEARED if k <= OUTPUT_SIDE else DRIVEN for _, k in self.waves)
        return tuple(side for side in sides for _ in ("sin", "cos"))

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn every joint by its waves."""
        return [
            Term(turn_joint(j), wave, (angle(j),)) for j, wave in self.list_waves(p)
        ]

    def list_waves(self, p: Floats) -> list[tuple[int, TermLaw]]:
        """List joints, or drives, with the waves of their angles."""
        pairs = zip(self.waves, p.reshape(-1, 2), strict=True)
        return [(j, law("wave", order, *sizes)) for (j, order), sizes in pairs]

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate the waves, (n, p)."""
        joint = np.array([j - 1 for j, _ in self.waves])
        order = np.array([k for _, k in self.waves])
        angle = batch.states.q[:, joint] * order
        both = np.stack([np.sin(angle), np.cos(angle)], axis=2)
        return both.reshape(len(batch), 2 * len(self.waves))


def _joints(numbers: list[int]) -> str:
    some = ", ".join(map(str, numbers))
    return f"joint {some}" if len(numbers) == 1 else f"joints {some}"


def whole(waves: tuple[tuple[int, float], ...]) -> tuple[tuple[int, float], ...]:
    """Round the orders of waves."""
    return tuple((j, float(round(k))) for j, k in waves)


def turns_alone(arm: Arm, joint: int) -> bool:
    """Tell whether the motor of a joint follows no other one."""
    return np.array_equal(arm.coupling[joint - 1], np.eye(6)[joint - 1])


@dataclass(frozen=True)
class Orders:
    """Orders of waves of one angle that may be tried.

    Attributes:
        covered: Surveyed range, a tenth of a radian at least [rad].
        ratio: Turns of the motor per turn; NaN where not known.
        asked: The highest order that is worth asking for.
        told: The highest order that the poses tell from all lower ones.
    """

    covered: float
    ratio: float
    asked: float
    told: float

    @classmethod
    def of(cls, angle: Floats, ratio: float) -> Orders:
        """Take the orders that poses can tell apart.

        Waves of orders k and k' are alike over the poses as far as the mean of
        exp(i (k - k') angle) is 1; of k and -k' as far as that of k + k' is: from half
        the first such difference on, waves look like lower ones.

        Args:
            angle: Surveyed angles, (n,) [rad].
            ratio: Turns of the motor per turn, or NaN.
        """
        covered = max(float(np.ptp(angle)), 0.1)
        asked = LAST_FREE if np.isnan(ratio) else 2.0 * ratio + BEYOND
        some = np.sort(angle)[:: max(len(angle) // LOOKED_AT, 1)]
        apart = np.arange(2.0 * np.pi / covered, 2.0 * asked, 1.0 / covered)
        alike = np.abs(np.exp(1j * np.outer(apart, some)).mean(axis=1)) > ALIKE
        alias = float(apart[np.argmax(alike)] / 2.0) if alike.any() else np.inf
        return cls(covered, ratio, asked, min(asked, alias))

    @property
    def free(self) -> Floats:
        """Give the free orders: steps of half of what the range resolves."""
        return np.arange(FIRST_FREE, self.told, max(np.pi / self.covered, FINEST))

    @property
    def motor(self) -> list[float]:
        """Give once and twice a turn of the motor, where the poses can tell."""
        return [k * self.ratio for k in ECCENTRIC if k * self.ratio < self.told]

    def list_orders(self) -> list[tuple[float, float]]:
        """List the orders, each with the log of its share of the prior."""
        sets = [list(ECCENTRIC), self.motor, self.free.tolist()]
        sets = [some for some in sets if some]
        return [(k, -float(np.log(len(s) * len(sets)))) for s in sets for k in s]

    def near(self, order: float, offsets: Floats) -> list[float]:
        """Vary a free order by steps of the grid; those of eccentricity stay."""
        if order <= ECCENTRIC[-1]:
            return []
        step, top = np.pi / self.covered, max(self.told, LOWEST)
        tries: list[float] = np.unique(
            np.clip(order + step * offsets, LOWEST, top)
        ).tolist()
        return tries


def orders_of(batch: ArmStates, row: tuple[float, ...], ratio: float) -> Orders:
    """Take the orders that may be tried of an angle, row @ q, found once."""
    key = ("orders", row, None if np.isnan(ratio) else ratio)
    return batch.once(key, lambda q: Orders.of(q @ np.array(row), ratio))
