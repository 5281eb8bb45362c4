"""Published maps of the workspace: interpolation and kriging."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.exceptions import PostprocError
from postproc.model.carrier import carrier
from postproc.model.effects.effect import Effect, Parameter
from postproc.model.kinematics import ArmStates
from postproc.model.terms import Neighbours, Neurons, Term, Terms, constant, move
from postproc.robot.arm import Arm
from postproc.robot.state import States

# Spatial interpolation: the error at a place is that of its measured neighbours.

NEAREST_GAP = 1e-6  # [m] a neighbour at the very place takes all the weight


@dataclass(frozen=True)
class Interpolation(Effect):
    """Inverse-distance weighting over Cartesian neighbours.

    Attributes:
        points: Nominal TCP positions of the measurements [m].
        neighbours: How many of them count.
        power: Of the distance.
    """

    name: ClassVar[str] = "interpolation"
    published: ClassVar[bool] = True

    points: tuple[tuple[float, ...], ...]
    neighbours: int = 8
    power: float = 2.0

    @classmethod
    def through(cls, position: Floats) -> Self:
        """Interpolate between nominal positions (m, 3) [m]."""
        points = tuple(tuple(map(float, p)) for p in position)
        return cls(points, neighbours=min(8, len(points)))

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the measured errors, point by point."""
        return tuple(
            Parameter(f"{axis}_{k + 1}", "m", 1e-3, axis)
            for k in range(len(self.points))
            for axis in "xyz"
        )

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Average the nearest errors."""
        places, errors = np.array(self.points), p.reshape(-1, 3)
        return [Neighbours(places, errors, self.neighbours, self.power)]

    def _weights(self, batch: ArmStates) -> tuple[NDArray[np.int64], Floats]:
        """Find neighbours and their weights, (n, k) each."""
        from scipy.spatial import cKDTree  # slow to load, and seldom wanted

        tree = cKDTree(np.array(self.points))
        gap, index = tree.query(batch.walk.tcp, k=list(range(1, self.neighbours + 1)))
        weight = np.maximum(np.asarray(gap), NEAREST_GAP) ** -self.power
        return np.asarray(index), weight / weight.sum(axis=1, keepdims=True)

    def columns(self, batch: ArmStates) -> Floats:
        """Lay the weights out, (n, 3, 3 m)."""
        index, weight = self._weights(batch)
        out = np.zeros((len(batch), 3, len(self.points), 3))
        rows = np.arange(len(batch))[:, None]
        for k in range(3):
            out[rows, k, index, k] = weight
        return out.reshape(len(batch), 3, -1)

    def displacement(self, batch: ArmStates, p: Floats) -> Floats:
        """Average the neighbours' errors, (n, 3) [m]."""
        index, weight = self._weights(batch)
        moved: Floats = (p.reshape(-1, 3)[index] * weight[:, :, None]).sum(axis=1)
        return moved


# Reversal-aware kriging: a Gaussian process over joint angles and directions.
#
# The modified joint space has the six angles and the six arrival directions as axes,
# each with its own length; lengths, signal and noise maximise the marginal likelihood.

MOST_CENTRES = 2500  # the work grows with their cube
MOST_TUNED = 400  # rows that the lengths are chosen on
LOG_LENGTH = (-2.0, 5.0)  # bounds of the log lengths, in half ranges
LOG_NOISE = (-9.0, 1.0)  # bounds of the log noise, in units of the signal


@dataclass(frozen=True)
class Kriging(Effect):
    """Position error = mean + k(x, centres) . alpha, axis by axis.

    Attributes:
        centres: Scaled inputs of the measurements, 12 each.
        lower, upper: Joint angles that become -1 and +1 [rad].
        length: Correlation length of each input.
    """

    name: ClassVar[str] = "kriging"
    published: ClassVar[bool] = True

    centres: tuple[tuple[float, ...], ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    length: tuple[float, ...]

    def parameters(self) -> tuple[Parameter, ...]:
        """Name the mean and the weights, axis by axis."""
        return tuple(
            Parameter(f"{axis}_{name}", "m", 1e-3, axis)
            for axis in "xyz"
            for name in ("mean", *map(str, range(1, len(self.centres) + 1)))
        )

    def terms(self, arm: Arm, p: Floats) -> Terms:
        """Move the TCP by the mean and the kernels."""
        sizes, centres = p.reshape(3, -1), np.array(self.centres)
        ends = np.array(self.lower), np.array(self.upper)
        kernels = Neurons(
            *ends, centres, np.zeros(len(centres)), "gaussian", False, sizes[:, 1:],
            self.length,
        )  # fmt: skip
        along = [move(carrier(f"base shift {a}")) for a in "xyz"]
        means = [Term(a, constant(m)) for a, m in zip(along, sizes[:, 0], strict=True)]
        return [*means, kernels]

    def _design(self, batch: ArmStates) -> Floats:
        """Evaluate one and the kernel, (n, 1 + m)."""
        x = scale_states(batch.states, np.array(self.lower), np.array(self.upper))
        K = correlation(x, np.array(self.centres), np.array(self.length))
        return np.hstack([np.ones((len(x), 1)), K])

    def columns(self, batch: ArmStates) -> Floats:
        """Lay the design out per axis, (n, 3, p)."""
        D = self._design(batch)
        out = np.zeros((len(batch), 3, 3, D.shape[1]))
        for k in range(3):
            out[:, k, k] = D
        return out.reshape(len(batch), 3, -1)

    def displacement(self, batch: ArmStates, p: Floats) -> Floats:
        """Evaluate the process, (n, 3) [m]."""
        moved: Floats = self._design(batch) @ p.reshape(3, -1).T
        return moved


def scale_states(states: States, lower: Floats, upper: Floats) -> Floats:
    """Scale joint angles to [-1, 1] and append the directions, (n, 12)."""
    span = np.where(upper - lower > 1e-9, upper - lower, 2.0)
    x = 2 * (states.q - lower) / span - 1
    return np.hstack([np.clip(x, -1.5, 1.5), states.direction])


def correlation(a: Floats, b: Floats, length: Floats) -> Floats:
    """Squared-exponential correlation of inputs (n, 12) and (m, 12), (n, m)."""
    a, b = a / length, b / length
    square = (a**2).sum(1)[:, None] + (b**2).sum(1) - 2 * a @ b.T
    return np.asarray(np.exp(-0.5 * np.maximum(square, 0.0)))


def train(states: States, error: Floats, seed: int) -> tuple[Kriging, Floats]:
    """Choose lengths and noise, and solve for the weights.

    Args:
        states: m states.
        error: Measured errors, (m, 3) [m].
        seed: Of the choice of rows that the lengths are tuned on.

    Returns:
        The effect and its parameters (p,).

    Raises:
        PostprocError: Too many rows.
    """
    from scipy.linalg import cho_factor, cho_solve  # slow to load, and for fits alone

    if len(states) > MOST_CENTRES:
        raise PostprocError(
            f"kriging of {len(states)} rows is too large. Use at most {MOST_CENTRES}"
        )
    lower, upper = states.q.min(axis=0), states.q.max(axis=0)
    x = scale_states(states, lower, upper)
    mean = error.mean(axis=0)
    size = float(np.std(error - mean)) or 1.0
    y = (error - mean) / size
    rows = np.random.default_rng(seed).permutation(len(x))[:MOST_TUNED]
    length, noise, signal = _tune(x[np.sort(rows)], y[np.sort(rows)])
    K = signal * correlation(x, x, length) + noise * np.eye(len(x))
    alpha = signal * cho_solve(cho_factor(K, lower=True), y) * size
    effect = Kriging(
        tuple(tuple(map(float, row)) for row in x),
        tuple(map(float, lower)),
        tuple(map(float, upper)),
        tuple(map(float, length)),
    )
    return effect, np.concatenate([mean[None], alpha]).T.reshape(-1)


def _tune(x: Floats, y: Floats) -> tuple[Floats, float, float]:
    """Maximise the marginal likelihood over lengths, noise and signal variance."""
    from scipy.linalg import cho_factor, cho_solve
    from scipy.optimize import minimize  # slow to load, and for fits alone

    inputs = x.shape[1]
    gaps = (x[:, None] - x) ** 2

    def cost(u: Floats) -> tuple[float, Floats]:
        """Negative log likelihood, summed over the axes, and its gradient."""
        inverse_square = np.exp(-2 * u[:inputs])
        noise, signal = np.exp(u[-2]), np.exp(u[-1])
        S = signal * np.exp(-0.5 * (gaps @ inverse_square))
        K = S + noise * np.eye(len(x))
        factor = cho_factor(K, lower=True)
        inverse = cho_solve(factor, np.eye(len(x)))
        a = inverse @ y
        axes = y.shape[1]
        W = axes * inverse - a @ a.T  # d(-2 log L) / dK
        value = 0.5 * float((y * a).sum()) + axes * float(
            np.log(np.diag(factor[0])).sum()
        )
        by_length = 0.5 * np.einsum("ij,ijk->k", W * S, gaps) * inverse_square
        by_noise, by_signal = 0.5 * noise * np.trace(W), 0.5 * float((W * S).sum())
        return value, np.concatenate([by_length, [by_noise, by_signal]])

    start = np.concatenate([np.full(inputs, 0.7), [-3.0, 0.0]])
    bounds = [LOG_LENGTH] * inputs + [LOG_NOISE, (-3.0, 5.0)]
    best = minimize(
        cost, start, jac=True, method="L-BFGS-B", bounds=bounds,
        options={"maxiter": 80},
    )  # fmt: skip
    u = best.x
    return np.exp(u[:inputs]), float(np.exp(u[-2])), float(np.exp(u[-1]))
