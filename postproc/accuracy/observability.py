"""What a survey can see, and the names of what it cannot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr, solve_triangular

from postproc.arrays import Floats

EXACT = 1e-8  # relative size below which a direction is no direction at all
PARTNER = 0.2  # coefficient from which a parameter is named as a partner


@dataclass(frozen=True)
class Unseen:
    """A parameter whose effect others already have, and those others."""

    name: str
    partners: tuple[str, ...]

    def __str__(self) -> str:
        return (
            f"{self.name} with {', '.join(self.partners)}"
            if self.partners
            else (f"{self.name} (too small to see)")
        )


@dataclass(frozen=True)
class Observability:
    """Rank of a design and its condition.

    Attributes:
        rank: Number of directions that the rows determine.
        unseen: Directions that they do not; the fit leaves them at their prior.
        condition: Ratio of the largest to the smallest determined singular value.
        o1: Observability index O1 of Borm and Menq (1991): geometric mean of the
            singular values over the square root of the number of rows.
    """

    rank: int
    unseen: tuple[Unseen, ...]
    condition: float
    o1: float


def observe(X: Floats, names: tuple[str, ...], floor: float = 0.0) -> Observability:
    """Find the rank of scaled columns by pivoted QR and name what is redundant.

    Args:
        X: Columns times their prior scales, (rows, p).
        names: Names of the columns.
        floor: Size below which a direction counts as unseen. With whitened rows, 1
            means that the data say less than the prior.
    """
    if X.shape[1] == 0:
        return Observability(0, (), 1.0, 0.0)
    _, R, pivot = qr(X, mode="economic", pivoting=True)
    size = np.abs(np.diag(R))
    rank = int((size > max(floor, EXACT * float(size.max(initial=0.0)))).sum())
    unseen = []
    if rank:
        mix = np.asarray(solve_triangular(R[:rank, :rank], R[:rank, rank:])).T
        for k, share in enumerate(mix):
            order = np.argsort(-np.abs(share))[:4]
            keep = order[np.abs(share[order]) > PARTNER]
            partners = tuple(names[pivot[i]] for i in keep)
            unseen.append(Unseen(names[pivot[rank + k]], partners))
    values = np.linalg.svd(R[:rank, :], compute_uv=False) if rank else np.ones(1)
    o1 = float(np.exp(np.log(values).mean()) / np.sqrt(len(X)))
    return Observability(rank, tuple(unseen), float(values[0] / values[-1]), o1)
