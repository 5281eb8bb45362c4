"""Geometry: the placement errors of base, joints and tool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.effect import ZERO, Effect, Parameter
from postproc.model.effects.placement import Placement
from postproc.model.effects.policies import FitPolicy
from postproc.model.kinematics import ArmStates, Deviation
from postproc.model.terms import Terms
from postproc.robot.arm import Arm
from postproc.robot.pose import cross
from postproc.robot.state import States

AXES = ("x", "y", "z")
KINDS = ("a", "d", "alpha", "theta", "beta")
LENGTH, ANGLE = 1e-3, 1e-3  # [m], [rad] prior scales of a new arm
RENEWED_BY = {
    "base shift": frozenset({"base", "crash"}),
    "base turn": frozenset({"base", "crash"}),
    "tool": frozenset({"tool", "crash", "arm"}),
    "zero": ZERO,
    "link": frozenset({"crash", "arm"}),
}


@dataclass(frozen=True)
class Geometry(Effect):
    """D-H errors of every joint, Hayati's beta where D-H is incomplete, base and tool.

    The set is complete and not minimal: what the data cannot tell apart is shared
    according to the prior scales. Base and joint 1, tool and joint 6 are such gauges.

    Attributes:
        beta: Joints (1 to 6) that have a beta: those whose next axis is nearly
            parallel, and the last, so that the flange may turn about every axis.
        base: Whether the base may be misplaced. Where the base frame is only known
            through the arm itself, base, d1 and theta1 are nothing by definition.
    """

    name: ClassVar[str] = "geometry"
    acts: ClassVar[tuple[tuple[str, str], ...]] = (
        ("link turn", "constant"),
        ("link shift", "constant"),
        ("base turn", "constant"),
        ("base shift", "constant"),
        ("tool shift", "constant"),
        ("joint", "constant"),
    )
    fit_policy: ClassVar[FitPolicy] = FitPolicy.ALWAYS

    beta: tuple[int, ...] = (2, 6)
    base: bool = True

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Give a beta to the joints whose next axis is parallel, and to the last."""
        parallel = np.abs(np.sin(arm.dh.alpha)) < 0.2
        parallel[5] = True
        return cls(beta=tuple(int(j) + 1 for j in np.flatnonzero(parallel)))

    def beside(self, others: Sequence[Effect]) -> Effect:
        """Leave the base to a registration, which places the base frame by the arm."""
        placed = any(isinstance(e, Placement) for e in others)
        return replace(self, base=False) if placed else self

    @property
    def links(self) -> list[tuple[int, int]]:
        """List (joint, kind) of the link parameters."""
        return [
            (j, k)
            for j in range(6)
            for k in range(5)
            if (k < 4 or (j + 1) in self.beta)
            and (self.base or j > 0 or KINDS[k] not in ("d", "theta"))
        ]

    def parameters(self) -> tuple[Parameter, ...]:
        """Name base, link and tool parameters."""
        base = [Parameter(f"base_{a}", "m", LENGTH, "base shift") for a in AXES]
        base += [Parameter(f"base_r{a}", "rad", ANGLE, "base turn") for a in AXES]
        links = [
            Parameter(f"{KINDS[k]}{j + 1}", "m", LENGTH, "length", j + 1)
            if k < 2
            else Parameter(f"{KINDS[k]}{j + 1}", "rad", ANGLE, "angle", j + 1)
            for j, k in self.links
        ]
        tool = [Parameter(f"tool_{a}", "m", LENGTH, "tool") for a in AXES]
        return (*(base if self.base else []), *links, *tool)

    def list_renewals(self) -> tuple[frozenset[str], ...]:
        """Tell zeros of joints, links, base and tool apart."""
        parts = ("zero" if p.name.startswith("theta") else p.group
                 for p in self.parameters())  # fmt: skip
        return tuple(RENEWED_BY.get(part, RENEWED_BY["link"]) for part in parts)

    def deviation(self, p: Floats) -> Deviation:
        """Read parameters (p,) as deviations of the chain."""
        p = np.asarray(p, dtype=float)
        base = p[:6] if self.base else np.zeros(6)
        rest = p[6:] if self.base else p
        link = np.zeros((6, 5))
        for value, (j, k) in zip(rest, self.links, strict=False):
            link[j, k] = value
        return Deviation(np.array(base), link, np.array(rest[-3:]))

    def zero_errors(self, p: Floats) -> Floats:
        """Return the errors theta of the joints' zeros, (6,) [rad]."""
        return np.array(self.deviation(p).link[:, KINDS.index("theta")])

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Return none: it deviates the chain itself."""
        return []

    def _kind(
        self, batch: ArmStates, kind: int, joint: int
    ) -> tuple[Floats, Floats | None]:
        """Return the axis (n, 3) of a link motion and, if it is a turn, its point."""
        w = batch.walk
        axis = (w.link, w.turn, w.link, w.turn, w.bend)[kind][:, joint]
        point = (None, None, w.corner, w.pivot, w.corner)[kind]
        return axis, None if point is None else point[:, joint]

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position at the batch's deviation, (n, 3, p)."""
        w, n = batch.walk, len(batch)
        columns = []
        if self.base:
            columns += [np.tile(np.eye(3)[k], (n, 1)) for k in range(3)]
            lever = w.tcp - w.base_point
            columns += [cross(w.base_axes[k], lever) for k in range(3)]
        for j, k in self.links:
            axis, point = self._kind(batch, k, j)
            columns.append(axis if point is None else cross(axis, w.tcp - point))
        columns += [w.flange[:, :, k] for k in range(3)]
        return np.stack([column.T for column in columns]).T

    def rotation_columns(self, batch: ArmStates) -> Floats:
        """Differentiate the tool's rotation, (n, 3, p) [rad per unit]."""
        w, n = batch.walk, len(batch)
        still = np.zeros((n, 3))
        columns = []
        if self.base:
            columns += [still] * 3
            columns += [np.tile(w.base_axes[k], (n, 1)) for k in range(3)]
        for j, k in self.links:
            axis, point = self._kind(batch, k, j)
            columns.append(still if point is None else axis)
        columns += [still] * 3
        return np.stack(columns, axis=-1)

    def displacement(self, batch: ArmStates, p: Floats) -> Floats:
        """Move the TCP exactly: full kinematics with deviations against without."""
        moved: Floats = batch.move(self.deviation(p), batch.shift).walk.tcp
        return moved - batch.walk.tcp
