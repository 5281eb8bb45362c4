"""Errors of the drives of a coupled wrist: gears that follow several joints.

In a hollow wrist the motor of a joint turns through `drive = coupling @ q`, for
instance q6 - q5, and what its gear errs by moves the joints through the inverse of the
coupling. Where drives are not coupled these are effects of joints, and not offered.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import CARRYING, JOINTS
from postproc.model.effects.backlash import Backlash
from postproc.model.effects.effect import (
    DRIVEN,
    NAMED,
    Candidate,
    Effect,
    Family,
    JointEffect,
    Parameter,
    alternatives,
)
from postproc.model.effects.load_backlash import LoadBacklash, laws
from postproc.model.effects.policies import FitPolicy
from postproc.model.effects.transmission import (
    ECCENTRIC,
    Orders,
    Transmission,
    orders_of,
    turns_alone,
    whole,
)
from postproc.model.kinematics import ArmStates, Loads
from postproc.model.terms import (
    Driver,
    Term,
    TermLaw,
    Terms,
    about_joints,
    drive,
    linear,
    side,
    turn_joints,
    weight,
)
from postproc.robot.arm import Arm
from postproc.robot.state import States

Matrix = tuple[tuple[float, ...], ...]
ALONE: Matrix = tuple(tuple(row) for row in np.eye(6).tolist())


def coupling_of(arm: Arm) -> Matrix:
    """Return an arm's coupling as plain numbers."""
    return tuple(tuple(map(float, row)) for row in arm.coupling)


def following(arm: Arm) -> tuple[int, ...]:
    """List the drives that turn with other joints or move others than their own."""
    moving = dragging(coupling_of(arm))
    return tuple(j for j in JOINTS if not turns_alone(arm, j) or j in moving)


def dragging(coupling: Matrix) -> tuple[int, ...]:
    """List the drives that move others than their own joint alone."""
    apart = np.abs(np.linalg.inv(np.array(coupling)) - np.eye(6)).max(axis=0) > 1e-9
    return tuple(int(j) + 1 for j in np.flatnonzero(apart))


def angle_text(row: Sequence[float]) -> str:
    """Write the angle of a drive.

    >>> angle_text((0, 0, 0, 0, -1.0, 1.0))
    'q6 - q5'
    """
    terms = [(float(c), j) for j, c in enumerate(row, 1) if c]
    out = ""
    for factor, j in sorted(terms, key=lambda t: (t[0] < 0, -t[1])):
        sign = ("" if factor > 0 else "-") if not out else (" - ", " + ")[factor > 0]
        size = "" if abs(factor) == 1.0 else f"{abs(factor):.4g} "
        out += f"{sign}{size}q{j}"
    return out


class DriveLoads(Loads):
    """Torques about the drives: the same power at every coupled speed."""

    def __init__(self, joints: Loads, inverse: Floats) -> None:
        """Take the torques about the joints and the inverse of the coupling."""
        super().__init__(joints.arm, joints.states)
        self.joints, self.inverse = joints, inverse

    @property
    def gravity(self) -> Floats:
        """Torque of the arm's own links, (n, 6) [N m]."""
        torque: Floats = self.joints.gravity @ self.inverse
        return torque

    @cached_property
    def payload(self) -> Floats:
        """Torque of the payload, (n, 6) [N m]."""
        torque: Floats = self.joints.payload @ self.inverse
        return torque


DriveLaw = tuple[int, TermLaw, tuple[Driver, ...], tuple[Driver, ...]]
"""A drive, from 1, a law, what drives that, and factors: see `Term`."""


@dataclass(frozen=True)
class DriveEffect(Effect):
    """What is an effect of a joint elsewhere, of drives.

    Attributes:
        coupling: Drive angles are this times joint angles, 6 rows.
    """

    fit_policy: ClassVar[FitPolicy] = FitPolicy.IF_EVIDENT

    coupling: Matrix = ALONE

    @property
    @abstractmethod
    def law(self) -> JointEffect:
        """The effect, with drives in the place of joints."""

    @cached_property
    def inverse(self) -> Floats:
        """What every drive moves, joint angles = inverse @ drives, (6, 6)."""
        return np.linalg.inv(np.array(self.coupling))

    def parameters(self) -> tuple[Parameter, ...]:
        """Take those of the law; their joints are drives."""
        return self.law.parameters()

    def look_up_driver(self, batch: ArmStates) -> ArmStates:
        """Put drives in the place of joints: angles and torques, sides are theirs."""
        angles = batch.states.q @ np.array(self.coupling).T
        out = ArmStates(batch.arm, batch.states.with_(q=angles))
        out.loads = DriveLoads(batch.loads, self.inverse)
        return out

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position: (n, 3, p) [m per unit]."""
        return self._about(batch.jacobian, batch)

    def rotation_columns(self, batch: ArmStates) -> Floats:
        """Differentiate the tool's rotation: (n, 3, p) [rad per unit]."""
        return self._about(batch.angular, batch)

    def _about(self, joints: Floats, batch: ArmStates) -> Floats:
        """Turn the joints, (n, 3, 6) per unit, by what moves the drives."""
        law = self.law
        columns: Floats = (joints @ self.inverse)[:, :, law.acts_on()]
        return np.asarray(columns * law.basis(self.look_up_driver(batch))[:, None, :])

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn the joints that a drive moves, by its own law."""
        return [
            Term(turn_joints(self.inverse[:, j - 1]), own, by, times)
            for j, own, by, times in self.list_laws(arm, p)
        ]

    @abstractmethod
    def list_laws(self, arm: Arm, p: Floats) -> list[DriveLaw]:
        """List what turns drives."""

    def only_joint(self) -> int | None:
        """Tell a drive that moves its own joint alone."""
        drive = self.law.only_joint()
        return None if drive is None or drive + 1 in dragging(self.coupling) else drive

    def turning(self, batch: ArmStates) -> Floats:
        """Evaluate the law, (n, p)."""
        return self.law.basis(self.look_up_driver(batch))

    def angles(self, batch: ArmStates, p: Floats) -> Floats:
        """Return the errors of the drives (n, 6) [rad] for parameters p."""
        return self.law.angles(self.look_up_driver(batch), p)

    def direction_slopes(self, batch: ArmStates, p: Floats) -> Floats:
        """Give the position error per unit of each drive's direction, (n, 3, 6) [m]."""
        ones = np.ones_like(batch.states.q)
        both = [self.angles(batch.arriving(side), p) for side in (ones, -ones)]
        moved = batch.jacobian @ self.inverse
        slopes: Floats = moved * ((both[0] - both[1]) / 2)[:, None, :]
        return slopes


@dataclass(frozen=True)
class DriveBacklash(DriveEffect):
    """Half the gap in the gear of a drive that moves several joints.

    Attributes:
        drives: Drives that have it.
    """

    name: ClassVar[str] = "drive_backlash"
    renewed_by: ClassVar[frozenset[str]] = DRIVEN
    acts: ClassVar[tuple[tuple[str, str], ...]] = (("joint", "lambda"),)
    direct: ClassVar[bool] = True
    driven_by: ClassVar[str] = "lambda"
    variation_of: ClassVar[str | None] = "backlash"

    drives: tuple[int, ...] = ()

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Take all drives that move several joints: `backlash` holds the others."""
        return cls(coupling_of(arm), dragging(coupling_of(arm)))

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try every drive."""
        every, out = cls.propose(batch.arm, batch.states), []
        for j in every.drives:
            one = cls(every.coupling, (j,))
            driver = angle_text(every.coupling[j - 1])
            out += alternatives([(one, f"lambda {j}")], j, driver)
        return out

    def list_laws(self, arm: Arm, p: Floats) -> list[DriveLaw]:
        """List drives with what their directions turn them by."""
        pairs = zip(self.drives, p, strict=True)
        return [(j, linear(b), (side(j),), ()) for j, b in pairs]

    @property
    def law(self) -> Backlash:
        """Backlash of the drives."""
        return Backlash(self.drives)


@dataclass(frozen=True)
class DriveTransmission(DriveEffect):
    """Waves of the angle of a drive, as in `Transmission`.

    Attributes:
        waves: (drive, order per turn) of every wave.
    """

    name: ClassVar[str] = "drive_transmission"
    renewed_by: ClassVar[frozenset[str]] = DRIVEN
    acts: ClassVar[tuple[tuple[str, str], ...]] = (("joint", "joint"),)

    waves: tuple[tuple[int, float], ...] = ()

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Let all coupled drives run out of centre."""
        waves = tuple((j, k) for j in following(arm) for k in ECCENTRIC)
        return cls(coupling_of(arm), waves)

    @classmethod
    def not_tried(cls, batch: ArmStates) -> tuple[str, ...]:
        """Say that drives may be coupled, where the arm file tells of none."""
        if following(batch.arm):
            return ()
        return (
            "waves of drives that turn with several joints of the wrist, such as "
            "q6 - q5: no drive_coupling in the arm file",
        )

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try every drive; eccentricity, the motor and the teeth share the prior."""
        coupling, out = coupling_of(batch.arm), []
        for j in following(batch.arm):
            family = Family(cls.name, j, angle_text(coupling[j - 1]), NAMED)
            for order, share in cls.orders(batch, j).list_orders():
                one = cls(coupling, ((j, order),))
                out.append(Candidate(family, one, f"drive {j}", share))
        return out

    @classmethod
    def orders(cls, batch: ArmStates, drive: int) -> Orders:
        """Take the orders of a drive, from 1, that may be tried."""
        ratio = float(abs(batch.arm.gear_ratio[drive - 1]))
        return orders_of(batch, coupling_of(batch.arm)[drive - 1], ratio)

    def refine(self, offsets: Floats, batch: ArmStates) -> list[Effect]:
        """Change the order of one wave, as in `Transmission`."""
        (drive, order), *others = self.waves
        tries = [] if others else self.orders(batch, drive).near(order, offsets)
        return [DriveTransmission(self.coupling, ((drive, k),)) for k in tries]

    def plainer(self) -> Effect:
        """Return waves of whole orders."""
        return DriveTransmission(self.coupling, whole(self.waves))

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell the order of the first wave."""
        return self.law.nonlinear()

    def amplitude(self, p: Floats, covariance: Floats) -> tuple[float, float] | None:
        """Return that of a single wave and its standard error [rad]."""
        return self.law.amplitude(p, covariance)

    def list_laws(self, arm: Arm, p: Floats) -> list[DriveLaw]:
        """List drives with what their angles turn them by."""
        return [
            (j, wave, (drive(self.coupling[j - 1]),), ())
            for j, wave in self.law.list_waves(p)
        ]

    @property
    def law(self) -> Transmission:
        """Waves of the drives."""
        return Transmission(self.waves)


@dataclass(frozen=True)
class DriveLoad(DriveEffect):
    """Lost motion that follows the torque on a drive, as in `LoadBacklash`.

    Attributes:
        drives: Drives that have it.
        form, t0: As there.
    """

    name: ClassVar[str] = "drive_load"
    renewed_by: ClassVar[frozenset[str]] = DRIVEN
    acts: ClassVar[tuple[tuple[str, str], ...]] = (("joint", "torque"),)
    direct: ClassVar[bool] = True
    driven_by: ClassVar[str] = "torque"
    fit_policy: ClassVar[FitPolicy] = FitPolicy.ON_REQUEST
    variation_of: ClassVar[str | None] = "drive_backlash"

    drives: tuple[int, ...] = ()
    form: Literal["load", "signed", "gravity_side"] = "load"
    t0: float = 1000.0

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Take the drives that move several joints, at a typical torque."""
        torque = np.abs(arm.gravity_torque(states.q) @ np.linalg.inv(arm.coupling))
        drives = dragging(coupling_of(arm))
        typical = [float(np.median(torque[:, j - 1])) for j in drives]
        return cls(coupling_of(arm), drives, t0=max([1.0, *typical]))

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try all forms at every drive that moves several joints and carries weight."""
        coupling, inverse = coupling_of(batch.arm), np.linalg.inv(batch.arm.coupling)
        joints = np.abs(batch.loads.gravity + batch.loads.payload)
        torque = np.abs((batch.loads.gravity + batch.loads.payload) @ inverse)
        least, out = CARRYING * float(joints.max(initial=0.0)), []
        for j in dragging(coupling):
            if torque[:, j - 1].max() <= least:
                continue
            t0 = max(float(np.median(torque[:, j - 1])), 1e-3)
            members: list[tuple[Effect, str]] = [
                (cls(coupling, (j,), law.form, law.t0), f"drive {j}")
                for law in laws(j, t0)
            ]
            out += alternatives(members, j, angle_text(coupling[j - 1]))
        return out

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell the torque."""
        return self.law.nonlinear()

    def list_laws(self, arm: Arm, p: Floats) -> list[DriveLaw]:
        """List drives with what the torques on them turn them by."""
        return [
            (j, own, (weight(arm, about_joints(arm, self.inverse[:, j - 1])),), sided)
            for j, own, sided in self.law.list_torque_laws(p)
        ]

    @property
    def law(self) -> LoadBacklash:
        """Load-dependent backlash of the drives."""
        return LoadBacklash(self.drives, self.form, self.t0)
