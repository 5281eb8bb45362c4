"""The extreme learning machine of the source: joints in, position error out."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from postproc.accuracy.batch import Batch
from postproc.accuracy.effect import Effect, Parameter
from postproc.accuracy.hidden_layer import HiddenLayer
from postproc.arrays import Floats
from postproc.robot.state import States


@dataclass(frozen=True)
class ElmMap(Effect):
    """Position error x, y, z = beta . h, for one tool.

    Attributes:
        layer: The hidden layer.
    """

    name: ClassVar[str] = "elm_map"

    layer: HiddenLayer

    def __post_init__(self) -> None:
        if not isinstance(self.layer, HiddenLayer):
            object.__setattr__(self, "layer", HiddenLayer(**self.layer))

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the output weights, axis by axis."""
        return tuple(
            Parameter(f"{axis}_{k + 1}", "m", 1e-3, axis)
            for axis in "xyz"
            for k in range(len(self.layer))
        )

    def columns(self, batch: Batch) -> Floats:
        """Lay the neurons out per axis, (n, 3, 3 neurons)."""
        h = self.layer(batch.states)
        out = np.zeros((len(batch), 3, 3, h.shape[1]))
        for k in range(3):
            out[:, k, k] = h
        return out.reshape(len(batch), 3, -1)

    def displacement(self, batch: Batch, p: Floats) -> Floats:
        """Evaluate the network, (n, 3) [m]."""
        moved: Floats = self.layer(batch.states) @ p.reshape(3, -1).T
        return moved

    def settings(self) -> dict[str, Any]:
        """Return the hidden layer as plain data."""
        return {"layer": asdict(self.layer)}


def train(layer: HiddenLayer, states: States, error: Floats) -> Floats:
    """Solve for the output weights as the source does: beta = pinv(H) T, (p,)."""
    beta = np.linalg.pinv(layer(states)) @ error
    return np.asarray(beta.T.reshape(-1))
