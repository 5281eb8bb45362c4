"""The fixed random hidden layer of an extreme learning machine.

Huang, Zhu, Siew: Extreme learning machine: theory and applications, 2006. The inputs
are the joint angles and, in the extended joint angle variant, the arrival directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from postproc.accuracy.effect import FAR
from postproc.arrays import Floats
from postproc.robot.state import States


@dataclass(frozen=True)
class HiddenLayer:
    """h = G(weights . x + bias), x the scaled inputs.

    Attributes:
        weights: One row per neuron; 6 angles, then 6 directions if used.
        bias: One per neuron.
        lower, upper: Joint angles that become -1 and +1 [rad].
        activation: "sigmoid" or "tanh".
    """

    weights: tuple[tuple[float, ...], ...]
    bias: tuple[float, ...]
    lower: tuple[float, ...] = (-FAR,) * 6
    upper: tuple[float, ...] = (FAR,) * 6
    activation: str = "sigmoid"

    def __post_init__(self) -> None:
        if self.activation not in ("sigmoid", "tanh"):
            raise ValueError(f"unknown activation {self.activation!r}")

    @classmethod
    def draw(
        cls,
        states: States,
        neurons: int,
        seed: int,
        directions: bool,
        activation: str = "sigmoid",
    ) -> Self:
        """Draw weights in [-1, 1] and biases in [0, 1]; scale inputs to the survey."""
        rng = np.random.default_rng(seed)
        inputs = 12 if directions else 6
        weights = rng.uniform(-1.0, 1.0, (neurons, inputs))
        bias = rng.uniform(0.0, 1.0, neurons)
        low, high = states.q.min(axis=0), states.q.max(axis=0)
        return cls(
            weights=tuple(tuple(map(float, row)) for row in weights),
            bias=tuple(map(float, bias)),
            lower=tuple(map(float, low)),
            upper=tuple(map(float, high)),
            activation=activation,
        )

    def __len__(self) -> int:
        """Return the number of neurons."""
        return len(self.bias)

    def __call__(self, states: States) -> Floats:
        """Evaluate the neurons, (n, neurons).

        Joints that did not move in the survey are left out. Outside the surveyed
        range the inputs stay at its ends: the network has seen nothing there.
        """
        low, high = np.array(self.lower), np.array(self.upper)
        span = high - low
        moved = span > 1e-9
        x = np.where(moved, 2 * (states.q - low) / np.where(moved, span, 1.0) - 1, 0.0)
        x = np.clip(x, -1.0, 1.0)
        weights = np.array(self.weights)
        if weights.shape[1] == 12:
            x = np.hstack([x, states.direction])
        z = x @ weights.T + np.array(self.bias)
        if self.activation != "sigmoid":
            return np.asarray(np.tanh(z))
        from scipy.special import expit  # slow to load, and seldom wanted

        return np.asarray(expit(z))
