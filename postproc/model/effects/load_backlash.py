"""Load-dependent backlash: lost motion that follows the load on the teeth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import carrying
from postproc.model.effects.effect import (
    ANY,
    PLAY,
    Candidate,
    Cells,
    Effect,
    JointEffect,
    Parameter,
    alternatives,
    own_cells,
)
from postproc.model.effects.policies import FitPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.terms import (
    Driver,
    Term,
    TermLaw,
    Terms,
    driver,
    law,
    side,
    turn_joint,
)
from postproc.robot.arm import Arm
from postproc.robot.state import States

SCALE = 1e-4  # [rad] at the threshold torque
UNSURE = 0.2  # of the power of the load, and of torque against t0
FLANKS = (0.1, 0.3, 0.8)  # of the usual torque: t0 that are tried
SHOWN = 0.05  # of the rows that must be on either side of the bend
BELOW, BEYOND = 0.5, 1.5  # of t0: clearly on one side of the bend
STRAIGHT = 3.0  # of it: the law is nearly proportional


@dataclass(frozen=True)
class LoadBacklash(JointEffect):
    """Lost motion that grows with the gravity torque, or a flank that it chooses.

    Attributes:
        joints: Joints that have it.
        form: "load": lambda * b * |torque / t0|, with a column for a power other
            than 1. "signed": lambda * b * tanh(torque / t0), a gap that a load one
            way opens and a load the other way closes. "gravity_side": b *
            tanh(torque / t0), the flank that a preloaded gear rests on whatever the
            direction. The last two have a column for an offset of the torque.
        t0: Torque [N m].
    """

    name: ClassVar[str] = "load_backlash"
    renewed_by: ClassVar[frozenset[str]] = PLAY
    direct: ClassVar[bool] = True
    driven_by: ClassVar[str] = "torque"
    fit_policy: ClassVar[FitPolicy] = FitPolicy.IF_EVIDENT
    variation_of: ClassVar[str | None] = "backlash"
    cells: ClassVar[Cells] = own_cells("lambda {j} x torque {j}", *ANY)

    joints: tuple[int, ...] = (2, 3, 5)
    form: Literal["load", "signed", "gravity_side"] = "load"
    t0: float = 1000.0

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Take the typical torque of the joints that carry weight."""
        torque = np.abs(arm.gravity_torque(states.q)[:, [1, 2, 4]])
        return cls(t0=max(float(np.median(torque)), 1.0))

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try all forms at every joint that carries weight."""
        typical = np.median(np.abs(batch.loads.total), axis=0)
        out = []
        for j in carrying(batch):
            t0 = max(float(typical[j - 1]), 1e-3)
            tried = [law for law in laws(j, t0) if law.passes_bend(batch)]
            out += alternatives([(law, f"torque {j}") for law in tried], j)
        return out

    def has_mean(self) -> bool:
        """Return True: weight mostly chooses one flank of a joint."""
        return True

    def passes_bend(self, batch: ArmStates) -> bool:
        """Return True if the rows can tell its law from laws of other causes.

        A flank that weight chooses shows where weight pushes both ways beyond the bend
        of tanh, or is now clearly below the bend and now beyond. Below the bend the law
        is that of `compliance`, beyond it on one side a constant.
        """
        if self.form != "gravity_side":
            return True
        torque = batch.loads.total[:, np.array(self.joints) - 1] / self.t0
        sides = torque > 1.0, torque < -1.0
        sizes = np.abs(torque) < BELOW, np.abs(torque) > BEYOND
        shown = [
            np.minimum(a.mean(axis=0), b.mean(axis=0)) > SHOWN
            for a, b in (sides, sizes)
        ]
        return bool(np.logical_or(*shown).all())

    def refine(self, offsets: Floats, batch: ArmStates) -> list[Effect]:
        """Change the torque at which the flank changes."""
        if self.form == "load":
            return []
        finer = [replace(self, t0=float(self.t0 * 3.0**x)) for x in offsets]
        return [law for law in finer if law.passes_bend(batch)]

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell the torque."""
        return {"t0": (float(self.t0), "N m")}

    def parameters(self) -> tuple[Parameter, ...]:
        """Name size and correction of the law, joint by joint."""
        second = "power" if self.form == "load" else "offset"
        out = []
        for j in self.joints:
            group = f"{j} {self.form} {self.t0:.4g}"
            out.append(Parameter(f"b{j}_{self.form}", "rad", SCALE, group, j))
            name = f"b{j}_{second}"
            name += "" if self.form == "load" else f"_{self.form}"
            out.append(Parameter(name, "rad", UNSURE * SCALE, group, j))
        return tuple(out)

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn every joint by the torque about it."""
        return [
            Term(turn_joint(j), own, (driver(arm, f"torque {j}"),), sided)
            for j, own, sided in self.list_torque_laws(p)
        ]

    def list_torque_laws(
        self, p: Floats
    ) -> list[tuple[int, TermLaw, tuple[Driver, ...]]]:
        """List joints, or drives, with the laws of torques about them, and factors."""
        shape = ("size", ()) if self.form == "load" else ("bend", (0.0,))
        return [
            (j, law(shape[0], *pair, *shape[1], self.t0), self._side_factor(j))
            for j, pair in zip(self.joints, p.reshape(-1, 2), strict=True)
        ]

    def _side_factor(self, joint: int) -> tuple[Driver, ...]:
        return () if self.form == "gravity_side" else (side(joint),)

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate the laws and their corrections, (n, p)."""
        joint = np.array(self.joints) - 1
        torque = (batch.loads.gravity + batch.loads.payload)[:, joint] / self.t0
        side = batch.states.direction[:, joint]
        if self.form == "load":
            size = np.abs(torque)
            law = side * size
            second = law * np.log(np.maximum(size, 1e-6))
        else:
            sign = side if self.form == "signed" else np.ones_like(side)
            law = np.tanh(torque)
            law, second = sign * law, sign * (1.0 - law**2)
        return np.stack([law, second], axis=2).reshape(len(batch), 2 * len(joint))


def laws(joint: int, typical: float) -> list[LoadBacklash]:
    """List all forms of one joint, flanks changing about a typical torque [N m]."""
    out = [LoadBacklash((joint,), "load", typical)]
    out += [LoadBacklash((joint,), "gravity_side", k * typical) for k in FLANKS]
    out += [LoadBacklash((joint,), "signed", k * typical) for k in (*FLANKS, STRAIGHT)]
    return out
