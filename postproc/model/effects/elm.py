"""Extreme learning machines: fixed random neurons, output weights to be fitted."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Self

import numpy as np

from postproc.arrays import Floats
from postproc.model.effects.effect import (
    FAR,
    Effect,
    JointEffect,
    Parameter,
    fade,
)
from postproc.model.effects.joint_spline import LEAST_ROWS
from postproc.model.effects.policies import FitPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Neurons, Terms
from postproc.robot.arm import Arm
from postproc.robot.state import States

# The fixed random hidden layer of an extreme learning machine.
#
# Huang, Zhu, Siew: Extreme learning machine: theory and applications, 2006. The inputs
# are the joint angles and, in the extended joint angle variant, the arrival directions.


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

    def neurons(self, sizes: Floats, turns: bool) -> Neurons:
        """Return it as the core has it, see `Neurons`."""
        ends = np.array(self.lower), np.array(self.upper)
        layer = np.array(self.weights), np.array(self.bias)
        shape = "logistic" if self.activation == "sigmoid" else self.activation
        return Neurons(*ends, *layer, shape, turns, sizes)

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


# An extreme learning machine as an effect of the joints, besides the named ones.

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
    fit_policy: ClassVar[FitPolicy] = FitPolicy.LAST
    free: ClassVar[bool] = True

    layer: HiddenLayer

    def __post_init__(self) -> None:
        if not isinstance(self.layer, HiddenLayer):
            object.__setattr__(self, "layer", HiddenLayer(**self.layer))

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Draw a layer with directions, scaled to the survey."""
        return cls(HiddenLayer.draw(states, NEURONS, SEED, directions=True))

    @classmethod
    def may_show(cls, states: States) -> bool:
        """Leave longer surveys to the joint spline, which carries over better."""
        return len(states) < LEAST_ROWS

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the output weights, joint by joint."""
        return tuple(
            Parameter(f"w{j}_{k + 1}", "rad", SCALE, f"joint {j}", j)
            for j in range(1, 7)
            for k in range(len(self.layer))
        )

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Turn all joints by the neurons."""
        return [self.layer.neurons(p.reshape(6, -1), turns=True)]

    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate the neurons for every joint, (n, 6 neurons)."""
        low, high = np.array(self.layer.lower), np.array(self.layer.upper)
        inside = fade(batch.states.q, low, high).prod(axis=1)
        return np.tile(self.layer(batch.states) * inside[:, None], (1, 6))

    def settings(self) -> dict[str, Any]:
        """Return the hidden layer as plain data."""
        return {"layer": asdict(self.layer)}


# The extreme learning machine of the source: joints in, position error out.


@dataclass(frozen=True)
class ElmMap(Effect):
    """Position error x, y, z = beta . h, for one tool.

    Attributes:
        layer: The hidden layer.
    """

    name: ClassVar[str] = "elm_map"
    published: ClassVar[bool] = True

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

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Move the TCP by the neurons."""
        return [self.layer.neurons(p.reshape(3, -1), turns=False)]

    def columns(self, batch: ArmStates) -> Floats:
        """Lay the neurons out per axis, (n, 3, 3 neurons)."""
        h = self.layer(batch.states)
        out = np.zeros((len(batch), 3, 3, h.shape[1]))
        for k in range(3):
            out[:, k, k] = h
        return out.reshape(len(batch), 3, -1)

    def displacement(self, batch: ArmStates, p: Floats) -> Floats:
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
