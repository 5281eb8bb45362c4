"""Payload: a joint yields to the payload, beyond what its own weight does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.batch import Batch
from postproc.accuracy.compliance import AXES, SCALE, UNSURE_PAYLOAD
from postproc.accuracy.effect import JointEffect, Origin, Parameter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Payload(JointEffect):
    """Joint error payload torque / stiffness; the centre of mass may be corrected.

    Attributes:
        joints: Joints that yield.
    """

    name: ClassVar[str] = "payload"
    origin: ClassVar[Origin] = "state"
    needs: ClassVar[tuple[str, ...]] = ("payload",)

    joints: tuple[int, ...] = (2, 3, 5)

    def parameters(self) -> tuple[Parameter, ...]:
        """Name softness, and softness times the shift of the centre of mass."""
        out = []
        for j in self.joints:
            out.append(Parameter(f"k{j}", "rad/(N m)", SCALE, f"{j}", j))
            wide = SCALE * UNSURE_PAYLOAD
            out += [Parameter(f"k{j}_com_{a}", "rad/N", wide, f"{j}", j) for a in AXES]
        return tuple(out)

    def basis(self, batch: Batch) -> Array:
        """Evaluate the payload's torque, and that per metre of its centre, (n, p)."""
        unit = batch.loads.basis.reshape(len(batch), 6, 6, 4)[:, :, 5, 1:]
        mass = np.nan_to_num(batch.states.payload)[:, None]
        columns = []
        for j in self.joints:
            columns += [batch.loads.payload[:, j - 1 : j], mass * unit[:, j - 1]]
        return np.concatenate(columns, axis=1)
