"""Wind-up: after a reversal, friction winds the shaft up over some way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from postproc.arrays import Floats
from postproc.model.covariate import JOINTS, loops, varies
from postproc.model.effects.effect import (
    ANY,
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
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Term, Terms, law, side, state_value, turn_joint
from postproc.robot.arm import Arm

SCALE = 3e-5  # [rad]
WAYS = tuple(np.radians([0.5, 1.0, 2.0, 4.0, 7.0]))  # d0 that are tried
LONGEST = float(np.radians(8.0))  # what fades more slowly is no wind-up
FLANKS = tuple(np.radians([2.0, 5.0, 10.0, 18.0]))  # ways from flank to flank
LONGEST_FLANK = float(np.radians(25.0))


@dataclass(frozen=True)
class Windup(JointEffect):
    """Joint error lambda * w * s(travel), s from -1 at the reversal to 1.

    Where the travel since the last reversal is not known, it counts as long.

    Attributes:
        joints: Joints that wind up.
        d0: Way over which they do [rad].
        form: "friction": s = 1 - 2 exp(-travel / d0). "dahl": the same from where the
            reversal left it, s = 1 - 2 (1 - exp(-loop / d0)) exp(-travel / d0), loop
            the way between the last two reversals, long where it is not known.
            "elastic": a flank that gives way before it carries,
            s = -cos(pi travel / d0) up to d0.
    """

    name: ClassVar[str] = "windup"
    renewed_by: ClassVar[frozenset[str]] = GEARED
    direct: ClassVar[bool] = True
    driven_by: ClassVar[str] = "travel"
    fit_policy: ClassVar[FitPolicy] = FitPolicy.IF_EVIDENT
    variation_of: ClassVar[str | None] = "backlash"
    cells: ClassVar[Cells] = own_cells("lambda {j} x way {j}", *ANY)

    joints: tuple[int, ...] = JOINTS
    d0: float = 0.05
    form: Literal["friction", "dahl", "elastic"] = "friction"

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """Try short and long ways at every joint whose travel is known."""
        out = []
        for j in JOINTS:
            if varies(batch.states.travel[:, j - 1]):
                each = [cls((j,), float(d0)) for d0 in WAYS]
                each += [cls((j,), float(d0), "elastic") for d0 in FLANKS]
                members: list[tuple[Effect, str]] = [(e, f"travel {j}") for e in each]
                if not np.isnan(loops(batch, j - 1)).all():
                    both = f"travel {j} x loop {j}"
                    members += [(cls((j,), float(d0), "dahl"), both) for d0 in WAYS]
                out += alternatives(members, j)
        return out

    @classmethod
    def not_tried(cls, batch: ArmStates) -> tuple[str, ...]:
        """Say that joints may wind up, where nothing tells how far they came."""
        if any(varies(batch.states.travel[:, j - 1]) for j in JOINTS):
            return ()
        return (
            "what joints do over the way since they turned, such as flanks that give "
            "way: the rows do not tell it (travel1_deg ..), nor does their order",
        )

    def refine(self, offsets: Floats, batch: ArmStates) -> list[Effect]:
        """Change the way."""
        longest = LONGEST_FLANK if self.form == "elastic" else LONGEST
        ways = np.unique(np.minimum(self.d0 * 2.0**offsets, longest))
        return [replace(self, d0=float(way)) for way in ways]

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """Tell the way."""
        return {"d0": (float(self.d0) * float(np.degrees(1.0)), "deg")}

    def parameters(self) -> tuple[Parameter, ...]:
        """Name one size per joint."""
        form = "" if self.form == "friction" else f" {self.form}"
        over = f"over {self.d0:.4g}{form}"
        return tuple(
            Parameter(f"w{j}", "rad", SCALE, f"{j} {over}", j) for j in self.joints
        )

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn every joint by its way since it turned, times its direction."""
        out = []
        for j, w in zip(self.joints, p, strict=True):
            names = ("way", "turned") if self.form == "dahl" else ("way",)
            by = [state_value(f"{name} {j}", unknown=np.inf) for name in names]
            wound = law(self.form, w, self.d0)
            out.append(Term(turn_joint(j), wound, tuple(by), (side(j),)))
        return out

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate lambda s(travel), (n, p)."""
        joint = self.acts_on()
        travel = np.nan_to_num(batch.states.travel[:, joint], nan=np.inf)
        if self.form == "elastic":
            wound = -np.cos(np.pi * np.minimum(travel / self.d0, 1.0))
        else:
            share = np.ones((1, len(self.joints)))
            if self.form == "dahl":  # of the friction, what a reversal had to turn
                way = np.column_stack([loops(batch, int(j)) for j in joint])
                share = 1.0 - np.exp(-np.nan_to_num(way, nan=np.inf) / self.d0)
            wound = 1.0 - 2.0 * share * np.exp(-travel / self.d0)
        return np.asarray(batch.states.direction[:, joint] * wound)
