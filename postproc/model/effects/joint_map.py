"""Joint map: a free smooth function of one joint's angle, such as a worn spot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import JOINTS
from postproc.model.effects.effect import (
    DRIVEN,
    FREE,
    Candidate,
    Cells,
    Effect,
    JointEffect,
    Parameter,
    alternatives,
    own_cells,
)
from postproc.model.effects.joint_spline import LONG_SURVEY
from postproc.model.effects.policies import FitPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Term, Terms, angle, law, turn_joint
from postproc.robot.arm import Arm
from postproc.robot.state import States

SCALE = 1e-4  # [rad]
SPACING = 1.5  # distance of the bumps of a map, in their widths
KNOTS = 24  # bumps over the range of a joint that is mapped
KNOTS_TRIED = (12, 24, 48)
ROWS_PER_KNOT = 12
SPOTS = tuple(np.radians([3.0, 6.0, 12.0]))  # widths of a worn spot that are tried
MOST_OF_A_SPOT = 9  # bumps: more are a map of the whole joint, with no one place


@dataclass(frozen=True)
class JointMap(JointEffect):
    """Joint error sum_i h_i exp(-(theta - c_i)^2 / (2 w^2)).

    Evenly spaced bumps make a smooth function; a single one is a worn spot. Outside
    the mapped range it fades to zero by itself.

    Attributes:
        bumps: (joint, centre c [rad]) of every bump.
        width: w [rad].
    """

    name: ClassVar[str] = "joint_map"
    renewed_by: ClassVar[frozenset[str]] = DRIVEN
    fit_policy: ClassVar[FitPolicy] = FitPolicy.LAST
    free: ClassVar[bool] = True
    cells: ClassVar[Cells] = own_cells("joint {j}", "curve", "step", "saturating")

    bumps: tuple[tuple[int, float], ...] = ()
    width: float = 0.1

    @classmethod
    def over(cls, joint: int, low: float, high: float, knots: int) -> Self:
        """Cover a joint's range with evenly spaced bumps."""
        centres = np.linspace(low, high, knots)
        width = max(float(high - low), 1e-3) / (knots - 1) / SPACING
        return cls(tuple((joint, float(c)) for c in centres), width)

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Map every joint over the largest surveyed range."""
        low, high = states.q.min(axis=0), states.q.max(axis=0)
        width = max(float((high - low).max()), 1e-3) / (KNOTS - 1) / SPACING
        bumps = [
            (j + 1, float(c))
            for j in range(6)
            for c in np.arange(low[j], high[j] + width, SPACING * width)
        ]
        return cls(tuple(bumps), width)

    @classmethod
    def may_show(cls, states: States) -> bool:
        """Leave long surveys to the joint spline, which resolves more of them."""
        return len(states) < LONG_SURVEY

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try a worn spot anywhere, and free maps of a joint's whole range."""
        return [
            c
            for j in JOINTS
            for c in (
                *alternatives(cls._spots(batch, j), j),
                *alternatives(cls._maps(batch, j), j, tier=FREE),
            )
        ]

    @classmethod
    def _spots(cls, batch: ArmStates, joint: int) -> list[tuple[Effect, str]]:
        """List single bumps all along a joint."""
        q = batch.states.q[:, joint - 1]
        return [
            (cls(((joint, float(c)),), float(w)), f"joint {joint}")
            for w in SPOTS
            for c in np.arange(q.min(), q.max() + w, w)
        ]

    @classmethod
    def _maps(cls, batch: ArmStates, joint: int) -> list[tuple[Effect, str]]:
        """List smooth maps of one joint's own angle, as fine as the rows allow."""
        q = batch.states.q[:, joint - 1]
        return [
            (cls.over(joint, float(q.min()), float(q.max()), k), f"joint {joint}")
            for k in KNOTS_TRIED
            if k == KNOTS_TRIED[0] or ROWS_PER_KNOT * k <= len(q)
        ]

    def refine(self, offsets: Floats, batch: ArmStates) -> list[Effect]:
        """Move and widen a spot, and give it a shape of its own."""
        if len(self.bumps) != 1:
            return []
        ((joint, centre),) = self.bumps
        each = self.width * 2.0 ** np.array([-0.5, -0.25, 0.0, 0.25, 0.5])
        moved = centre + self.width * offsets
        single = [JointMap(((joint, float(c)),), float(w)) for c in moved for w in each]
        shapes, reach = [], 2.0 * self.width
        for half in (2, 4):  # 2 half + 1 narrower bumps over the same place
            places = centre + reach * np.arange(-half, half + 1) / half
            bumps = tuple((joint, float(c)) for c in places)
            shapes.append(JointMap(bumps, float(reach / half / SPACING)))
        return [*single, *shapes]

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell where a spot is and how wide; a whole map has no one place."""
        if not 0 < len(self.bumps) <= MOST_OF_A_SPOT:
            return {}
        places = np.degrees([centre for _, centre in self.bumps])
        out = {
            "centre": (float(places.mean()), "deg"),
            "width": (float(np.degrees(self.width)), "deg"),
        }
        if len(places) > 1:
            out["reach"] = (float(np.ptp(places)), "deg")
        return out

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the height of every bump by its place in degrees."""
        wide = np.degrees(self.width)
        return tuple(
            Parameter(f"h{j}_{np.degrees(c):.2f}w{wide:.2f}", "rad", SCALE, f"{j}", j)
            for j, c in self.bumps
        )

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn every joint by its bumps."""
        each: dict[int, list[float]] = {}
        for (j, centre), size in zip(self.bumps, p, strict=True):
            each.setdefault(j, [self.width]).extend([centre, size])
        return [
            Term(turn_joint(j), law("bumps", *numbers), (angle(j),))
            for j, numbers in each.items()
        ]

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate the bumps, (n, p)."""
        joint = np.array([j - 1 for j, _ in self.bumps], dtype=int)
        centre = np.array([c for _, c in self.bumps])
        away = (batch.states.q[:, joint] - centre) / self.width
        return np.asarray(np.exp(-0.5 * away**2))
