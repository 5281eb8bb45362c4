"""Which rows are no measurements of this arm: wrong nest, disturbed beam, a knock.

A row is an outlier only if its neighbours disagree with it. Rows that stand out
together, at one place of one joint or of the joint space, are a property of the arm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import chi2

from postproc.arrays import Floats

NEIGHBOURS = 6
AGREES = 0.35  # share of a row's residual that its neighbours must show as well
FALSE_ALARMS = 0.01  # expected per survey of good rows
DROPPED = 0.05  # below this weight a row counts as dropped


@dataclass(frozen=True)
class RowWeights:
    """Weight of every row, and why it is not 1.

    Attributes:
        weight: (n,) in [0, 1].
        distance: Residual in standard deviations (Mahalanobis), (n,).
        spared: Rows that stand out and are kept, because neighbours agree, (n,).
    """

    weight: Floats
    distance: Floats
    spared: NDArray[np.bool_]


def student_weights(distance: Floats) -> Floats:
    """Weights of a heavy-tailed first pass, (n,): Student t with 4 degrees."""
    weight: Floats = (4.0 + 3.0) / (4.0 + distance**2)
    return weight


def limit_of(n: int) -> float:
    """Distance in standard deviations from which one of n rows stands out."""
    return float(np.sqrt(chi2.isf(FALSE_ALARMS / max(n, 1), 3)))


def judge(
    distance: Floats, residual: Floats, q: Floats, jacobian: Floats
) -> RowWeights:
    """Weigh the rows of a survey.

    Args:
        distance: Mahalanobis distance of every residual, (n,).
        residual: Residual positions, (n, 3) [m].
        q: Joint angles, (n, 6) [rad].
        jacobian: Position Jacobian, (n, 3, 6) [m/rad].
    """
    n = len(q)
    limit = limit_of(n)
    stands_out = distance > limit
    spared = np.zeros(n, dtype=bool)
    if stands_out.any() and n > 2 * NEIGHBOURS:
        rows = np.flatnonzero(stands_out)
        spared[rows] = _together(rows, residual, q) | _same_joint(
            rows, residual, q, jacobian
        )
    weight = np.where(stands_out & ~spared, (limit / distance.clip(1e-300)) ** 4, 1.0)
    weight[weight < DROPPED] = 0.0
    return RowWeights(weight, distance, spared)


def _together(
    rows: NDArray[np.int64], residual: Floats, q: Floats
) -> NDArray[np.bool_]:
    """Tell whether the nearest rows in joint space share a row's residual."""
    spread = np.maximum(q.std(axis=0), 1e-9)
    found = cKDTree(q / spread).query(q[rows] / spread, k=NEIGHBOURS + 1)
    nearest = np.asarray(found[1])[:, 1:]
    own = residual[rows]
    along = np.einsum("rkj,rj->rk", residual[nearest], own)
    agrees: NDArray[np.bool_] = np.median(along, axis=1) > AGREES * (own**2).sum(axis=1)
    return agrees


def _same_joint(
    rows: NDArray[np.int64], residual: Floats, q: Floats, jacobian: Floats
) -> NDArray[np.bool_]:
    """Tell whether rows at the same angle of one joint share the joint's error.

    The residual is read as an error of that joint alone; it must explain most of the
    row, and the rows next to it on that joint must show the same error.
    """
    square = np.maximum((jacobian**2).sum(axis=1), 1e-12)
    angle = np.einsum("nij,ni->nj", jacobian, residual) / square
    explained = (
        angle**2 * square / np.maximum((residual**2).sum(axis=1), 1e-300)[:, None]
    )
    agrees = np.zeros(len(rows), dtype=bool)
    for j in range(q.shape[1]):
        order = np.argsort(q[:, j], kind="stable")
        place = np.empty(len(q), dtype=int)
        place[order] = np.arange(len(q))
        offsets = np.array([-3, -2, -1, 1, 2, 3])
        near = order[np.clip(place[rows][:, None] + offsets, 0, len(q) - 1)]
        ratio = np.median(angle[near, j] * np.sign(angle[rows, j])[:, None], axis=1)
        same = ratio > AGREES * np.abs(angle[rows, j])
        agrees |= same & (explained[rows, j] > 0.5)
    return agrees
