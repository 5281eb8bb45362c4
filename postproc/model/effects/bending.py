"""Bending: links and bearings yield to the weight across their joints' axes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.carrier import carrier
from postproc.model.effects.compliance import (
    AXES,
    LOADED,
    UNSURE_PAYLOAD,
    WeightEffect,
    loads,
)
from postproc.model.effects.effect import (
    Cells,
    Parameter,
)
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Term, Terms, about_axis, linear, move, weight
from postproc.robot.arm import Arm

BENDING = (2, 3, 4, 5, 6)  # joint 1 stands on the base: that is `base_tilt`
ACROSS = "xy"  # axes of the frame before a joint, which turns about its z
Moved = Callable[[Floats, int], Floats]
LEAST = 5.0  # nats that it must be worth besides: it has many columns


@dataclass(frozen=True)
class Bending(WeightEffect):
    """All behind a joint turns across its axis by the moment of weight / stiffness.

    What stands behind the origin of D-H frame k - 1 turns about x and y of this frame,
    which does not turn with joint k, by a softness each times the moment of all weight
    behind about them. About z the joint itself yields: that is `compliance`, with the
    same moments of links and payload.

    Attributes:
        joints: Joints, 2 to 6, behind which the arm bends.
        moments: Per joint, (link, standard deviation of its first moment [kg m]).
        payload: Whether the payload's centre of mass is to be corrected too.
        softness: Prior scale of each joint [rad/(N m)].
    """

    name: ClassVar[str] = "bending"
    cells: ClassVar[Cells] = tuple(
        (f"link {j} turn {a}", f"moment {j}{a}", "linear")
        for j in BENDING
        for a in ACROSS
    )

    joints: tuple[int, ...] = BENDING
    moments: tuple[tuple[tuple[int, float], ...], ...] = ((),) * 5
    softness: tuple[float, ...] = (1e-7,) * 5

    @classmethod
    def on(cls, batch: ArmStates) -> Self:
        """Make the effect of all joints across which the load varies."""
        across = np.stack(
            [
                loads(
                    batch,
                    batch.loads.bending[..., a],
                    batch.loads.bending_basis[:, :, a],
                )
                for a in range(2)
            ]
        )
        load = np.hypot(*across)
        least = LOADED * float(load.max(initial=0.0))
        joints = tuple(j for j in BENDING if load[j - 1] > max(least, 1e-9))
        return cls.of_joints(batch, joints, load)

    def least_evidence(self) -> float:
        """Ask more of it than of a joint that yields."""
        return LEAST

    def parameters(self) -> tuple[Parameter, ...]:
        """Name softness about x and y, and moments times softness, joint by joint."""
        out = []
        for j, links, scale in zip(
            self.joints, self.moments, self.softness, strict=True
        ):
            for b in ACROSS:
                k = f"k{j}{b}"
                out.append(Parameter(k, "rad/(N m)", scale, f"{j}", j, True))
                for link, spread in links:
                    out += [
                        Parameter(
                            f"{k}_m{link}{a}", "rad kg/N", scale * spread, f"{j}", j
                        )
                        for a in AXES
                    ]
                if self.payload:
                    wide = scale * UNSURE_PAYLOAD
                    out += [
                        Parameter(f"{k}_com_{a}", "rad/N", wide, f"{j}", j)
                        for a in AXES
                    ]
        return tuple(out)

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn all behind every joint across it, by moments of weights likewise."""
        out, left = [], list(p)
        for j, links in zip(self.joints, self.moments, strict=True):
            for across, axis in enumerate(ACROSS):
                own, carried, places = self.take_weights(arm, left, links)
                share = about_axis(j - 1, across)
                load = weight(arm, share, own, carried, places)
                moves = move(carrier(f"link {j} turn {axis}"))
                out.append(Term(moves, linear(1.0), (load,)))
        return out

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position, (n, 3, p)."""
        w = batch.walk
        return self._about(batch, lambda axis, k: np.cross(axis, w.tcp - w.pivot[:, k]))

    def rotation_columns(self, batch: ArmStates) -> Floats:
        """Differentiate the tool's rotation, (n, 3, p)."""
        return self._about(batch, lambda axis, k: axis)

    def _about(self, batch: ArmStates, moved: Moved) -> Floats:
        """Multiply motions about the axes across the joints by the moments, (n, 3, p).

        Args:
            batch: The states.
            moved: Gives the motion by a turn about axes (n, 3) of a joint, from 0.
        """
        w, n = batch.walk, len(batch)
        out = [np.zeros((n, 3, 0))]
        for j, links in zip(self.joints, self.moments, strict=True):
            x = w.link[:, j - 2]
            for b, axis in enumerate((x, np.cross(w.turn[:, j - 1], x))):
                load = self._moments(batch, j, b, links)
                out.append(moved(axis, j - 1)[:, :, None] * load[:, None])
        return np.concatenate(out, axis=2)

    def _moments(
        self,
        batch: ArmStates,
        joint: int,
        across: int,
        links: tuple[tuple[int, float], ...],
    ) -> Floats:
        """Evaluate the moment across a joint, and that per unit of what is unsure."""
        loads_ = batch.loads
        unit = loads_.bending_basis[:, joint - 1, across]
        columns = [loads_.bending[:, joint - 1, across, None]]
        columns += [unit[:, link - 1] for link, _ in links]
        if self.payload:
            columns.append(np.nan_to_num(batch.states.payload)[:, None] * unit[:, 5])
        return np.concatenate(columns, axis=1)
