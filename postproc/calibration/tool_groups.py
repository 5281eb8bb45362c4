"""Whether the rows of one tool are really those of several.

A wrong or a moved tool shifts what is measured by a constant in the flange frame. What
is left of a fit, turned into the flange frame, then lies in separate heaps, as neither
noise nor any error of the arm does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2

from postproc.arrays import Floats, Ints
from postproc.robot.pose import MM

APART = 4.0  # distance of heaps over the typical distance within one; noise has 1.3
FEWEST = 0.05  # share of the rows that a heap must have
MOST = 4  # heaps that are looked for
STARTS = 8
STRAY = 0.01  # share of rows that noise may put on the wrong heap


@dataclass(frozen=True)
class ToolGroups:
    """Rows in heaps.

    Attributes:
        which: Heap of every row, (n,).
        centre: Their middles in the flange frame, (k, 3) [m].
    """

    which: Ints
    centre: Floats

    @property
    def kinds(self) -> range:
        """Numbers of the heaps."""
        return range(len(self.centre))

    @property
    def apart(self) -> float:
        """Distance of the two nearest heaps [m]."""
        gaps = np.linalg.norm(self.centre[:, None] - self.centre, axis=2)
        return float(gaps[np.triu_indices(len(self.centre), 1)].min())

    @property
    def step(self) -> int | None:
        """Row from which the second heap holds, if the rows fall in two in their order.

        A row in a hundred may lie nearer to the other heap by its noise.
        """
        if len(self.centre) != 2:
            return None
        later = self.which != self.which[0]
        before = np.concatenate([[0], np.cumsum(later)])
        wrong = before + (~later).sum() - np.cumsum(np.concatenate([[0], ~later]))
        row = int(np.argmin(wrong))
        return row if wrong[row] <= STRAY * len(later) else None

    def describe(self) -> str:
        """Say where the others lie, as seen from the first row's."""
        first = self.centre[self.which[0]]
        others = [c for k, c in enumerate(self.centre) if k != self.which[0]]
        return " and ".join(
            "(" + ", ".join(f"{v / MM:.2f}" for v in c - first) + ") mm" for c in others
        )


def find_groups(left: Floats, flange: Floats) -> ToolGroups | None:
    """Look for heaps in what is left of a fit.

    Args:
        left: (n, 3) [m], base frame.
        flange: Rotation of the flange, (n, 3, 3).
    """
    seen = np.einsum("nji,nj->ni", flange, left)
    for count in range(MOST, 1, -1):
        if len(seen) * FEWEST >= 1.0:
            found = _heaps(seen, count)
            if found is not None:
                return found
    return None


def _heaps(seen: Floats, count: int) -> ToolGroups | None:
    """Divide points (n, 3) into heaps that stand apart, if they do."""
    scale = max(float(np.median(np.abs(seen))), 1e-9)
    best, least = None, np.inf
    for seed in range(STARTS):
        centre, which = kmeans2(seen / scale, count, minit="++", rng=seed)
        spread = np.linalg.norm(seen / scale - centre[which], axis=1)
        if float(np.median(spread)) < least:
            best, least = (centre, which), float(np.median(spread))
    if best is None:
        return None
    share = np.bincount(best[1], minlength=count) / len(seen)
    found = ToolGroups(np.asarray(best[1], dtype=np.int64), best[0] * scale)
    apart = found.apart > APART * least * scale
    return found if apart and share.min() >= FEWEST else None
