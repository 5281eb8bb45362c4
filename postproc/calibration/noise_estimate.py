"""The sizes of the noise components, by the likelihood of what a fit leaves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from postproc.arrays import Floats
from postproc.model.noise import Noise
from postproc.model.whitening import KINDS, PoseBlock, ReadingScatter, Whitener

DEAD = 0.03  # share of the largest component below which another begins again
LIVELY = 0.3  # with this share of the largest
SMALLEST, LARGEST = 1e-7, 1e-2  # [m] bounds of all standard deviations at the TCP


def estimate_noise(
    whitener: Whitener,
    squares: Floats,
    weight: Floats,
    start: Noise,
    products: Sequence[Floats] = (),
) -> Noise:
    """Maximise the likelihood of expected squared residuals over the components.

    Args:
        whitener: The rows.
        squares: Squared residual plus its posterior variance, rotated, (n, 3).
        weight: Weight of every row, (n,), 0 drops it.
        start: Where to begin.
        products: The same as products between the rows of each of `blocks`,
            (groups, 3 m, 3 m); without them rows of a pose count by themselves.
    """
    with_others = len(products) == len(whitener.blocks)
    kinds = whitener.estimated if with_others else KINDS[:2]
    alone = np.ones(len(weight), dtype=bool)
    costs: list[Cost] = []
    if with_others:
        for block, S in zip(whitener.blocks, products, strict=True):
            alone[block.rows] = False
            costs.append(BlockCost.of(whitener, block, S, weight, kinds))
    costs.append(_RowCost.of(whitener, squares, weight * alone, kinds))
    costs.append(ReadingCost(whitener.readings, kinds))
    best = minimise_costs(costs, *_begin(whitener, start, kinds))
    found = dict(zip(kinds, np.exp(best).tolist(), strict=True))
    return replace(Noise(0.0, 0.0, whitener.origin), **found)


def _begin(
    whitener: Whitener, start: Noise, kinds: Sequence[str]
) -> tuple[Floats, Floats, Floats]:
    """Return logarithms to begin with, and their bounds.

    A component of no size has no slope by its logarithm and would stay so.
    """
    t0 = float(np.median(np.sqrt(whitener.tracker)))
    r0 = float(np.median(np.sqrt(whitener.joint.mean(axis=1))))
    unit = {"tracker": t0, "joint": r0, "pose_joint": r0, "stop": 1.0, "pose": 1.0}
    size = np.array([getattr(start, k) * unit[k] for k in kinds])
    largest = float(size.max())
    size = np.where(size < DEAD * largest, LIVELY * largest, size)
    units = np.array([unit[k] for k in kinds])
    low, high = np.log(SMALLEST / units), np.log(LARGEST / units)
    begin = np.log(np.maximum(size, SMALLEST) / units)
    return np.clip(begin, low, high), low, high


# What sizes of the components cost: minus their log likelihood, asked by their squares.

SCORES = 20  # steps at the most
FARTHEST = 1.5  # step of the logarithm of a standard deviation
HALVINGS = 6  # of a step that leads uphill
LEAST_BEND = 1e-6  # of the trace of the information, in every direction
ENOUGH = 1e-3  # nats that a further step must bring


@dataclass(frozen=True)
class CostPoint:
    """What some sizes of the components cost.

    Attributes:
        value: Minus the log likelihood.
        slopes: Its slope by the sizes, and the Fisher information, where asked for.
    """

    value: float
    slopes: Callable[[], tuple[Floats, Floats]]


class Cost(Protocol):
    """Minus the log likelihood of some rows, by the squared sizes of the components."""

    def at(self, sizes: Floats) -> CostPoint:
        """Evaluate it."""


@dataclass(frozen=True, eq=False)
class _RowCost:
    """Of rows alone.

    Attributes:
        parts: Variance per unit of each component, (kinds, n, 3).
        known, square, weight: As in `Whitener.estimate`.
    """

    parts: Floats
    known: Floats
    square: Floats
    weight: Floats

    @classmethod
    def of(
        cls, whitener: Whitener, square: Floats, weight: Floats, kinds: Sequence[str]
    ) -> _RowCost:
        """Take the rows that are used."""
        used = weight > 0
        ones = np.ones_like(whitener.joint)
        shape = {
            "tracker": whitener.tracker, "joint": whitener.joint, "stop": ones,
            "pose_joint": whitener.joint, "pose": ones,
        }  # fmt: skip
        parts = np.stack([shape[k][used] for k in kinds])
        known = (whitener.extra + whitener.unseen)[used]
        return cls(parts, known, square[used], weight[used, None])

    def at(self, sizes: Floats) -> CostPoint:
        """Evaluate it."""
        v = np.tensordot(sizes, self.parts, axes=1) + self.known
        value = 0.5 * float((self.weight * (np.log(v) + self.square / v)).sum())
        return CostPoint(value, lambda: self._slopes(v))

    def _slopes(self, v: Floats) -> tuple[Floats, Floats]:
        slope = 0.5 * self.weight * (1.0 / v - self.square / v**2)
        scaled = (self.parts * np.sqrt(self.weight) / v).reshape(len(self.parts), -1)
        return np.tensordot(self.parts, slope, axes=2), 0.5 * scaled @ scaled.T


@dataclass(frozen=True, eq=False)
class BlockCost:
    """Of rows that share a pose.

    Attributes:
        parts: Covariance per unit of each component, (groups, kinds, 3 m, 3 m).
        known, square: Known covariance and expected products, (groups, 3 m, 3 m).
        weight: Of every group, (groups,).
    """

    parts: Floats
    known: Floats
    square: Floats
    weight: Floats

    @classmethod
    def of(
        cls,
        whitener: Whitener,
        block: PoseBlock,
        products: Floats,
        weight: Floats,
        kinds: Sequence[str],
    ) -> BlockCost:
        """Take the poses of which any row is used."""
        rows, parts = block.rows, []
        k = np.arange(3 * rows.shape[1])
        for kind in kinds:
            if kind == "tracker":
                part = np.zeros((len(rows), len(k), len(k)))
                part[:, k, k] = whitener.tracker[rows].reshape(len(rows), -1)
            else:
                part = block.parts(kind)
            parts.append(part)
        known = np.zeros((len(rows), len(k), len(k)))
        extra = whitener.extra + whitener.unseen
        known[:, k, k] = extra[rows].reshape(len(rows), -1)
        return cls.of_used(np.stack(parts, axis=1), known, products, weight[rows])

    @classmethod
    def of_used(
        cls, parts: Floats, known: Floats, products: Floats, weight: Floats
    ) -> BlockCost:
        """Take the rows of weights (groups, m) above 0, each pose of its least."""
        used = np.repeat(weight > 0, 3, axis=1).astype(float)
        mask, k = used[:, :, None] * used[:, None], np.arange(used.shape[1])
        known = known * mask
        known[:, k, k] += 1.0 - used
        heaviness = np.where(weight > 0, weight, np.inf).min(axis=1)
        heaviness = np.where(np.isfinite(heaviness), heaviness, 0.0)
        return cls(parts * mask[:, None], known, products * mask, heaviness)

    def at(self, sizes: Floats) -> CostPoint:
        """Evaluate it."""
        V = self.known + np.einsum("k,gkij->gij", sizes, self.parts)
        root = np.linalg.cholesky(V)
        log_det = 2.0 * np.log(np.einsum("gii->gi", root)).sum(axis=1)
        P = np.linalg.inv(V)
        square = np.einsum("gij,gij->g", P, self.square)
        value = 0.5 * float((self.weight * (log_det + square)).sum())
        return CostPoint(value, lambda: self._slopes(P))

    def _slopes(self, P: Floats) -> tuple[Floats, Floats]:
        """Take the inverse of the covariance, (groups, 3 m, 3 m)."""
        M = 0.5 * (P - P @ self.square @ P) * self.weight[:, None, None]
        slope = np.einsum("gij,gkij->k", M, self.parts)
        turned = P[:, None] @ self.parts
        scaled = turned * np.sqrt(self.weight)[:, None, None, None]
        a = scaled.reshape(*scaled.shape[:2], -1)
        b = scaled.swapaxes(2, 3).reshape(a.shape)
        return slope, 0.5 * (a @ b.swapaxes(1, 2)).sum(axis=0)


@dataclass(frozen=True, eq=False)
class ReadingCost:
    """Of repeated readings."""

    readings: ReadingScatter
    kinds: Sequence[str]

    def at(self, sizes: Floats) -> CostPoint:
        """Evaluate it."""
        t2 = float(sizes[0])
        value = 0.5 * self.readings.log_noise(float(np.sqrt(t2)))
        return CostPoint(value, lambda: self._slopes(t2))

    def _slopes(self, t2: float) -> tuple[Floats, Floats]:
        slope = np.zeros(len(self.kinds))
        slope[0] = (self.readings.freedom - self.readings.square / t2) / (2.0 * t2)
        information = np.zeros((len(slope), len(slope)))
        information[0, 0] = self.readings.freedom / (2.0 * t2**2)
        return slope, information


def minimise_costs(
    costs: Sequence[Cost], begin: Floats, low: Floats, high: Floats
) -> Floats:
    """Minimise costs by logarithms of standard deviations: Fisher's scoring.

    Args:
        costs: What sizes of the components cost.
        begin: Where to begin, (kinds,).
        low: Lower bounds, (kinds,).
        high: Upper bounds, (kinds,).
    """

    def at(u: Floats) -> tuple[float, list[CostPoint]]:
        points = [cost.at(np.exp(2.0 * u)) for cost in costs]
        return sum(point.value for point in points), points

    u = begin
    here, points = at(u)
    for _ in range(SCORES):
        sizes = np.exp(2.0 * u)
        parts = [point.slopes() for point in points]
        slope = 2.0 * sizes * np.sum([p[0] for p in parts], axis=0)
        bend = 4.0 * np.outer(sizes, sizes) * np.sum([p[1] for p in parts], axis=0)
        free = ~((u <= low) & (slope > 0.0) | (u >= high) & (slope < 0.0))
        step = np.zeros(len(u))
        bend += np.eye(len(u)) * LEAST_BEND * max(float(np.trace(bend)), 1e-300)
        step[free] = -np.linalg.solve(bend[np.ix_(free, free)], slope[free])
        step *= min(1.0, FARTHEST / max(float(np.abs(step).max()), 1e-300))
        for _ in range(HALVINGS):
            there = np.clip(u + step, low, high)
            found, reached = at(there)
            if found < here:
                break
            step = step / 2.0
        if not found < here - ENOUGH:
            break
        u, here, points = there, found, reached
    return u
