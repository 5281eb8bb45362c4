"""How well every joint repeats, by what a fit leaves.

A fit has one scatter for all joints: the covariance of a row alone is then diagonal in
one basis, whatever the sizes. Joints of one arm differ. Targets with a long lever about
the worst of them scatter more than that one size says, and others less.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from postproc.arrays import Floats
from postproc.calibration.noise_estimate import (
    BlockCost,
    Cost,
    CostPoint,
    ReadingCost,
    minimise_costs,
)
from postproc.calibration.regression import Fit, products_of_rows
from postproc.model.whitening import PoseBlock

SPREAD = float(np.log(2.0)) / 1.96  # of the log: joints are alike within a factor of 2
LEVEL = 1.0  # of the log: what a fit has found of all joints, and of the tracker
WIDEST = 3.0  # of the log: bounds of all sizes
JOINTS = 6
KINDS = ("tracker", *(f"joint {j}" for j in range(1, JOINTS + 1)))
PRECISION = np.linalg.inv(
    np.diag(np.append(0.0, np.full(JOINTS, SPREAD**2)))
    + LEVEL**2 * block_diag(np.eye(1), np.ones((JOINTS, JOINTS)))
)  # of the prior of the logarithms, (7, 7)


def split_by_joint(fit: Fit) -> Fit:
    """Estimate the scatter of every joint, beside that of the tracker.

    The sizes maximise the likelihood of what the fit leaves, times a prior: joints of
    one arm are alike within a factor of two. The variances that the noise states are
    their means over what the rows leave open.

    Args:
        fit: The fit.

    Returns:
        The same fit with the noise of each joint.
    """
    costs: list[Cost] = [
        _cost_of_poses(fit, block, products)
        for block, products in zip(*_products_of_poses(fit), strict=True)
    ]
    noise = fit.noise
    begin = np.append(np.log(noise.tracker), np.zeros(JOINTS))
    costs += [ReadingCost(fit.whitener.readings, KINDS), _PriorCost(begin)]
    u = minimise_costs(costs, begin, begin - WIDEST, begin + WIDEST)
    found = np.exp(u + _open(costs, u))  # root of the mean of exp(2 u)
    noise = replace(noise, tracker=float(found[0]), by_joint=tuple(found[1:].tolist()))
    return replace(fit, noise=noise)


def _open(costs: list[Cost], u: Floats) -> Floats:
    """Return the variance of the logarithms of sizes that rows leave open, (7,)."""
    sizes = np.exp(2.0 * u)
    bend = np.sum([cost.at(sizes).slopes()[1] for cost in costs], axis=0)
    return np.diag(np.linalg.inv(4.0 * np.outer(sizes, sizes) * bend))


def _list_poses(fit: Fit) -> list[PoseBlock]:
    """List the poses of all rows, those of one row among them."""
    alone = np.ones(len(fit.batch), dtype=bool)
    for block in fit.whitener.blocks:
        alone[block.rows] = False
    rows, order = np.flatnonzero(alone)[:, None], fit.batch.states.order
    jacobian = fit.design.jacobian
    single = PoseBlock.of(rows, order, fit.whitener.turn, jacobian)
    return [b for b in (single, *fit.whitener.blocks) if len(b.rows)]


def _products_of_poses(fit: Fit) -> tuple[list[PoseBlock], list[Floats]]:
    """Return poses, and the products of what the fit leaves of their rows."""
    design = fit.design.rotate(fit.whitener.turn)
    turned, spread = fit.whitener.rotate(fit.residual), design.variance(fit.covariance)
    blocks = _list_poses(fit)
    return blocks, [
        products_of_rows(design, turned, block.rows, spread, fit.shared)
        for block in blocks
    ]


def _cost_of_poses(fit: Fit, block: PoseBlock, products: Floats) -> BlockCost:
    """Return what sizes of tracker and joints cost at some poses."""
    noise, whitener, rows = fit.noise, fit.whitener, block.rows
    count, m = rows.shape
    seen = (whitener.turn[rows] @ fit.design.jacobian[rows]).reshape(count, 3 * m, -1)
    turned = np.einsum("gik,gjk->gkij", seen, seen)
    stops = noise.joint**2 * block.stop + noise.pose_joint**2
    parts, k = np.zeros((count, 1 + JOINTS, 3 * m, 3 * m)), np.arange(3 * m)
    parts[:, 0, k, k] = whitener.tracker[rows].reshape(count, -1)
    parts[:, 1:] = turned * stops[:, None]
    known = (noise.stop**2 * block.stop + noise.pose**2) * block.shift
    known[:, k, k] += (whitener.extra + whitener.unseen)[rows].reshape(count, -1)
    return BlockCost.of_used(parts, known, products, fit.rows.weight[rows])


@dataclass(frozen=True, eq=False)
class _PriorCost:
    """Of sizes that a fit has not found alike.

    Attributes:
        centre: Logarithms of the sizes of tracker and joints in the fit, (7,).
    """

    centre: Floats

    def at(self, sizes: Floats) -> CostPoint:
        """Evaluate it at the squared sizes, (7,)."""
        off, half = np.log(sizes) / 2.0 - self.centre, 0.5 / sizes
        pull, bend = PRECISION @ off, PRECISION * np.outer(half, half)
        return CostPoint(0.5 * float(off @ pull), lambda: (pull * half, bend))
