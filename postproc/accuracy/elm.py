"""An extreme learning machine as an effect of the joints, besides the named ones."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Self

import numpy as np

from postproc.accuracy.batch import Batch
from postproc.accuracy.effect import JointEffect, Parameter, fade
from postproc.accuracy.hidden_layer import HiddenLayer
from postproc.arrays import Floats
from postproc.robot.arm import Arm
from postproc.robot.state import States

SCALE = 3e-5  # [rad] prior scale of one output weight
NEURONS = 20
SEED = 0


@dataclass(frozen=True)
class Elm(JointEffect):
    """Joint errors beta . h(theta, lambda), the output weights beta fitted.

    A free-form effect: outside the surveyed joint ranges it fades to zero.

    Attributes:
        layer: Settings of the hidden layer.
    """

    name: ClassVar[str] = "elm"

    layer: HiddenLayer

    def __post_init__(self) -> None:
        if not isinstance(self.layer, HiddenLayer):
            object.__setattr__(self, "layer", HiddenLayer(**self.layer))

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Draw a layer with directions, scaled to the survey."""
        return cls(HiddenLayer.draw(states, NEURONS, SEED, directions=True))

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the output weights, joint by joint."""
        return tuple(
            Parameter(f"w{j}_{k + 1}", "rad", SCALE, f"joint {j}", j)
            for j in range(1, 7)
            for k in range(len(self.layer))
        )

    def basis(self, batch: Batch) -> Floats:
        """Evaluate the neurons for every joint, (n, 6 neurons)."""
        low, high = np.array(self.layer.lower), np.array(self.layer.upper)
        inside = fade(batch.states.q, low, high).prod(axis=1)
        return np.tile(self.layer(batch.states) * inside[:, None], (1, 6))

    def settings(self) -> dict[str, Any]:
        """Return the hidden layer as plain data."""
        return {"layer": asdict(self.layer)}
