"""Compliance: a joint yields to the weight that it carries."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import JOINTS
from postproc.model.effects.effect import (
    GEARED,
    Candidate,
    Cells,
    Effect,
    JointEffect,
    Parameter,
    alternatives,
    own_cells,
)
from postproc.model.effects.policies import FitPolicy
from postproc.model.kinematics import ArmStates, Loads
from postproc.model.terms import Term, Terms, about_joint, linear, turn_joint, weight
from postproc.robot.arm import Arm
from postproc.robot.state import States

SCALE = 1e-7  # [rad/(N m)] softness of the gears of a large arm
YIELDS = 2e-4  # [rad] by which a joint may be expected to yield to its largest torque
LOADED = 1e-3  # of the torque that varies most: less is no load of a joint
USUAL, RARE = 1.0, 3.0  # nats that one of `YIELDING`, or another, must be worth besides
UNSURE_PAYLOAD = 0.1  # [m] how well a payload's centre of mass is known
MASS_UNKNOWN = 10.0  # [kg] at a link's end, of an arm whose links are not known
YIELDING = (2, 3, 5)  # joints that carry most of the weight on most arms
AXES = "xyz"


def moments(arm: Arm, joint: int) -> tuple[tuple[int, float], ...]:
    """List the links whose first moments load a joint, with what is unsure of them.

    Of an arm whose links are not known all of the moments is unsure: what the joint
    yields by has the shapes of gravity, and the data alone say how much of each.

    Returns:
        (link, standard deviation of its moment [kg m]) of the joint's own link, which
        stands for all that is fixed to it, and of the next one.
    """
    links, out = arm.file.links, []
    for link in range(joint, min(joint + 2, 7)):
        length = float(np.hypot(arm.dh.a[link - 1], arm.dh.d[link - 1]))
        if links is None:
            out.append((link, MASS_UNKNOWN * length + 0.1))
            continue
        mass, com = np.array(links.mass_kg), np.array(links.com_mm) * 1e-3
        own = mass[link - 1] * np.linalg.norm(com[link - 1])
        out.append(
            (link, float(links.spread * (own + mass[link:].sum() * length) + 0.1))
        )
    return tuple(out)


def loads(batch: ArmStates, torque: Floats, unit: Floats) -> Floats:
    """Estimate by how much the load of every joint varies, (n, 6) [N m].

    Args:
        batch: The states.
        torque: Of nominal links and payload, (n, 6) [N m].
        unit: The same per first moment of every link, (n, 6, 6, 3).

    Returns:
        Standard deviation over the states, (6,) [N m]: that of the torque, and what
        is unsure of it.
    """
    variance = torque.var(axis=0) if len(torque) else np.zeros(6)
    if not len(torque):
        return variance
    for j in JOINTS:
        for link, spread in moments(batch.arm, j):
            own = unit[:, j - 1, link - 1].var(axis=0).sum()
            variance[j - 1] += spread**2 * own
    return np.sqrt(variance)


@dataclass(frozen=True)
class WeightEffect(Effect):
    """What joints yield by under weight, each kept or dropped by itself.

    Attributes:
        joints: Joints that yield.
        moments: Per joint, (link, standard deviation of its first moment [kg m]).
        payload: Whether the payload's centre of mass is to be corrected too.
        softness: Prior softness of each joint [rad/(N m)]; `SCALE` where there is none.
    """

    driven_by: ClassVar[str] = "torque"
    fit_policy: ClassVar[FitPolicy] = FitPolicy.IF_EVIDENT

    joints: tuple[int, ...] = YIELDING
    moments: tuple[tuple[tuple[int, float], ...], ...] = ((), (), ())
    payload: bool = False
    softness: tuple[float, ...] = ()

    @classmethod
    @abstractmethod
    def on(cls, batch: ArmStates) -> Self:
        """Make the effect of all joints whose load varies over the states."""

    @classmethod
    def of_joints(cls, batch: ArmStates, joints: tuple[int, ...], load: Floats) -> Self:
        """Make the effect of some joints.

        Args:
            batch: The states.
            joints: The joints.
            load: By how much the load of each of the 6 varies, (6,) [N m].
        """
        return cls(
            joints,
            tuple(moments(batch.arm, j) for j in joints),
            bool(np.nan_to_num(batch.states.payload).any()),
            tuple(max(SCALE, YIELDS / max(float(load[j - 1]), 1e-3)) for j in joints),
        )

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Let all joints yield that carry weight."""
        return cls.on(ArmStates(arm, states))

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try every joint that carries weight, or may if no weight is known."""
        return [
            c
            for effect in cls.on(batch).pieces()
            for j in effect.joints
            for c in alternatives([(effect, f"torque {j}")], j)
        ]

    def take_weights(
        self, arm: Arm, left: list[float], links: tuple[tuple[int, float], ...]
    ) -> tuple[Floats, float, Floats]:
        """Take the parameters of one softness off a list.

        Args:
            arm: The arm.
            left: Parameters; those that are taken are removed.
            links: The links whose moments the data may correct.

        Returns:
            Links, share of the load and places of the load, times the softness; see
            `terms.weight`.
        """
        softness, places = float(left.pop(0)), np.zeros((6, 3))
        own = softness * arm.lumps
        for link, _ in links:
            own[link - 1, 1:] += [left.pop(0) for _ in AXES]
        if self.payload:
            places[5] += [left.pop(0) for _ in AXES]
        return own, softness, places

    def pieces(self) -> tuple[Self, ...]:
        """Return the effect of each joint alone."""
        scales = self.softness or (SCALE,) * len(self.joints)
        return tuple(
            replace(self, joints=(j,), moments=(links,), softness=(scale,))
            for j, links, scale in zip(self.joints, self.moments, scales, strict=True)
        )


@dataclass(frozen=True)
class Compliance(WeightEffect, JointEffect):
    """Joint error torque / stiffness, with link moments that the data may correct.

    The torque is that of the nominal links and of the declared payload. Torque is
    linear in the links' first moments, so their deviations are columns too.

    Attributes:
        along: Direction in which weight pulls, base frame; None: as on this arm.
    """

    name: ClassVar[str] = "compliance"
    renewed_by: ClassVar[frozenset[str]] = GEARED
    cells: ClassVar[Cells] = own_cells("torque {j}", "linear")

    along: tuple[float, float, float] | None = None

    @classmethod
    def along_axes(cls, batch: ArmStates) -> tuple[Self, Self, Self]:
        """Make the effect of weight along each axis of the base.

        All have the same parameters: weight along any direction is a mix of them, its
        components the weights. Moments of links are columns where no links are known.
        """
        load = np.zeros(6)
        for axis in np.eye(3):
            on = ArmStates(batch.arm.mount(axis), batch.states).loads
            unit = on.basis.reshape(len(batch), 6, 6, 4)[..., 1:]
            load = np.maximum(load, loads(batch, on.total, unit))
        known = batch.arm.file.links is not None
        least = max(LOADED * float(load.max()), 1e-9)
        joints = tuple(
            j for j in (JOINTS if known else YIELDING) if load[j - 1] > least
        )
        made = cls.of_joints(batch, joints or YIELDING, load)
        if known:
            made = replace(made, moments=((),) * len(made.joints), payload=False)
        along = (
            replace(made, along=(1.0, 0.0, 0.0)),
            replace(made, along=(0.0, 1.0, 0.0)),
        )
        return *along, replace(made, along=(0.0, 0.0, 1.0))

    @classmethod
    def on(cls, batch: ArmStates) -> Self:
        """Make the effect of all joints whose load varies over the states."""
        total, unit = batch.loads.total, batch.loads.basis
        load = loads(batch, total, unit.reshape(len(batch), 6, 6, 4)[..., 1:])
        least = LOADED * float(load.max(initial=0.0))
        joints = tuple(j for j in JOINTS if load[j - 1] > max(least, 1e-9))
        if not joints:
            joints = YIELDING
        return cls.of_joints(batch, joints, load)

    def least_evidence(self) -> float:
        """Ask more of joints that carry little weight on most arms."""
        return USUAL if set(self.joints) <= set(YIELDING) else RARE

    def parameters(self) -> tuple[Parameter, ...]:
        """Name softness, and moments over stiffness, joint by joint."""
        out = []
        scales = self.softness or (SCALE,) * len(self.joints)
        for j, links, scale in zip(self.joints, self.moments, scales, strict=True):
            k, group = f"k{j}{self._where}", f"{j}{self._where}"
            out.append(Parameter(k, "rad/(N m)", scale, group, j, True))
            for link, spread in links:
                out += [
                    Parameter(f"{k}_m{link}{a}", "rad kg/N", scale * spread, group, j)
                    for a in AXES
                ]
            if self.payload:
                wide = scale * UNSURE_PAYLOAD
                out += [
                    Parameter(f"{k}_com_{a}", "rad/N", wide, group, j) for a in AXES
                ]
        return tuple(out)

    def settings(self) -> dict[str, Any]:
        """Leave the direction out where it is the arm's."""
        own = super().settings()
        return {k: v for k, v in own.items() if k != "along" or v is not None}

    @property
    def _where(self) -> str:
        """Tell weight of another direction than the arm's in names."""
        if self.along is None:
            return ""
        return "_along_" + "_".join(f"{v:g}" for v in self.along)

    def _loads(self, batch: ArmStates) -> Loads:
        """Take the torques of weight in its own direction."""
        if self.along is None:
            return batch.loads
        return Loads(batch.arm.mount(np.array(self.along)), batch.states)

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn every joint by torques of weights that are scaled and moved."""
        pulled = arm if self.along is None else arm.mount(np.array(self.along))
        out, left = [], list(p)
        for j, links in zip(self.joints, self.moments, strict=True):
            own, carried, places = self.take_weights(arm, left, links)
            load = weight(pulled, about_joint(arm, j), own, carried, places)
            out.append(Term(turn_joint(j), linear(1.0), (load,)))
        return out

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate torque [N m] and torque per unit of moment, (n, p)."""
        of = self._loads(batch)
        torque = of.gravity + of.payload
        unit = of.basis.reshape(len(batch), 6, 6, 4)
        mass = np.nan_to_num(batch.states.payload)[:, None]
        columns = []
        for j, links in zip(self.joints, self.moments, strict=True):
            columns.append(torque[:, j - 1 : j])
            columns += [unit[:, j - 1, link - 1, 1:] for link, _ in links]
            if self.payload:
                columns.append(mass * unit[:, j - 1, 5, 1:])
        return np.concatenate(columns, axis=1)
