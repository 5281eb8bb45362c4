"""Held backlash: weight chooses the flank of a gear where friction does not hold it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

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
from postproc.model.effects.policies import SearchPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Term, Terms, constant, driver, law, side, turn_joint
from postproc.robot.arm import Arm
from postproc.robot.state import States

SCALE = 1e-4  # [rad] as of `backlash`
HOLDS = (0.1, 0.2, 0.4, 0.8)  # of the usual torque: what friction may hold
WIDTH = 0.1  # of that torque: over so much of it friction gives way
SHOWN = 0.05  # of the rows that friction must hold, and that it must not hold


@dataclass(frozen=True)
class HeldBacklash(JointEffect):
    """Where weight is more than friction holds, the link rests on its flank.

    With s from 0 to 1 as the torque passes what friction holds, lambda * b becomes
    (1 - s) * lambda * b + s * c * sign(torque): the columns are -lambda * s, beside
    `backlash`, and sign(torque) * s.

    Attributes:
        joints: Joints whose gears weight preloads.
        holds: Torque that friction holds [N m].
    """

    name: ClassVar[str] = "held_backlash"
    renewed_by: ClassVar[frozenset[str]] = PLAY
    driven_by: ClassVar[str] = "torque"
    search_policy: ClassVar[SearchPolicy] = SearchPolicy.ALONE
    variation_of: ClassVar[str | None] = "backlash"
    cells: ClassVar[Cells] = own_cells("lambda {j} x torque {j}", *ANY)

    joints: tuple[int, ...] = (2,)
    holds: float = 500.0

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try what friction may hold at every joint that carries weight."""
        typical = np.median(np.abs(batch.loads.total), axis=0)
        out = []
        for j in carrying(batch):
            tried = [cls((j,), k * float(typical[j - 1])) for k in HOLDS]
            shown = [(law, f"torque {j}") for law in tried if law.shows(batch)]
            out += alternatives(shown, j)
        return out

    @classmethod
    def propose(cls, arm: Arm, states: States) -> HeldBacklash:
        """Take a part of the typical torque of joint 2."""
        torque = np.abs(arm.gravity_torque(states.q)[:, 1])
        return cls(holds=max(0.3 * float(np.median(torque)), 1.0))

    def has_mean(self) -> bool:
        """Return True: weight mostly chooses one flank of a joint."""
        return True

    def shows(self, batch: ArmStates) -> bool:
        """Return True if friction holds some of the rows, and others not."""
        held = np.abs(self._torque(batch)) < 1.0
        share = held.mean(axis=0)
        return bool((np.minimum(share, 1.0 - share) > SHOWN).all())

    def refine(self, offsets: Floats, batch: ArmStates) -> list[Effect]:
        """Change the torque that friction holds."""
        finer = [replace(self, holds=float(self.holds * 2.0**x)) for x in offsets]
        return [law for law in finer if law.shows(batch)]

    def hold(self, factor: float) -> HeldBacklash:
        """Return it with friction that holds more."""
        return replace(self, holds=self.holds * factor)

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell the torque."""
        return {"holds": (float(self.holds), "N m")}

    def parameters(self) -> tuple[Parameter, ...]:
        """Name what the gap loses, and the flank that weight chooses."""
        return tuple(
            Parameter(f"{name}{j}", "rad", SCALE, f"{j} {self.holds:.4g}", j)
            for j in self.joints
            for name in ("held", "weight")
        )

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn every joint by the torque about it."""
        out: list[Term] = []
        for j, (lost, chosen) in zip(self.joints, p.reshape(-1, 2), strict=True):
            by, turn = (driver(arm, f"torque {j}"),), turn_joint(j)
            out.append(Term(turn, constant(-lost), (), (side(j),)))
            for sign in (1.0, -1.0):
                bend = 0.0, sign * self.holds, WIDTH * self.holds
                gone = law("bend", -sign * lost / 2, *bend)
                out.append(Term(turn, gone, by, (side(j),)))
                out.append(Term(turn, law("bend", chosen / 2, *bend), by))
        return out

    def _torque(self, batch: ArmStates) -> Floats:
        total = (batch.loads.gravity + batch.loads.payload)[
            :, np.array(self.joints) - 1
        ]
        return np.asarray(total / self.holds)

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate what friction does not hold, (n, p)."""
        torque, lam = self._torque(batch), batch.states.direction
        above, below = (np.tanh((torque + c) / WIDTH) for c in (-1.0, 1.0))
        even, odd = 1.0 + (above - below) / 2, (above + below) / 2
        lam = lam[:, np.array(self.joints) - 1]
        return np.stack([-lam * even, odd], axis=2).reshape(
            len(batch), 2 * len(self.joints)
        )
