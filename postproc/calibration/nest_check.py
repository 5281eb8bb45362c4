"""Whether the rows of one tool are those of several, and nests where the cell says.

A wrong or a moved tool shifts what is measured by a constant in the flange frame. What
is left of a fit, turned into the flange frame, then lies in separate heaps, as neither
noise nor any error of the arm does.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.stats import chi2

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
        with warnings.catch_warnings():  # points that are few may leave a heap empty
            warnings.simplefilter("ignore", UserWarning)
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


# Which nest of a probe plate does not lie where the cell says.
#
# Where all nests lie together the tool's own error has it. One is wrong if the others
# lie to each other as they should, and it does not.

DIFFER = 1e-3  # chance that right nests look wrong
OFF = 5e-5  # [m] nests that differ by less are in order


@dataclass(frozen=True)
class WrongNest:
    """Nests of which one is off: more than one where rows cannot tell which.

    Attributes:
        tool_ids: The nest, or the group of which it is one.
        offset: Of the nest as seen from the others, flange frame, (3,) [m]; of a group,
            that of the first.
        std: Its standard deviations, (3,) [m].
    """

    tool_ids: tuple[int, ...]
    offset: Floats
    std: Floats

    def __str__(self) -> str:
        by = ", ".join(f"{v / MM:.2f}" for v in self.offset)
        sure = f"({by}) mm +- {float(self.std.max()) / MM:.2f}"
        cure = "the offset is fitted; correct [survey] points_mm"
        if len(self.tool_ids) == 1:
            return (
                f"nest {self.tool_ids[0]} lies {sure} beside where the cell has it, as "
                f"the other nests see it: {cure}"
            )
        names = " or ".join(map(str, self.tool_ids))
        return (
            f"one of the nests is not where the cell has it, {names}: which, the rows "
            f"cannot tell; nest {self.tool_ids[0]} lies {sure} off the others; {cure}"
        )


def find_wrong_nest(
    tool_ids: tuple[int, ...], offset: Floats, covariance: Floats
) -> WrongNest | None:
    """Find the nest, or the group, that does not lie where the cell says.

    Args:
        tool_ids: The k nests.
        offset: Their fitted offsets in the flange frame, (k, 3) [m].
        covariance: Of the offsets, nest by nest, (3 k, 3 k).
    """
    every = range(len(tool_ids))
    if len(tool_ids) < 2 or _agree(list(every), offset, covariance):
        return None
    alone = [
        k for k in every if _agree([m for m in every if m != k], offset, covariance)
    ]
    suspects = alone or list(every)
    first = max(
        suspects, key=lambda k: float(np.linalg.norm(_compare_offset(k, offset)))
    )
    order = [first, *(k for k in suspects if k != first)]
    weight = np.full(len(tool_ids), -1.0 / (len(tool_ids) - 1))
    weight[first] = 1.0
    mix = np.kron(weight, np.eye(3))
    std = np.sqrt(np.maximum(np.diag(mix @ covariance @ mix.T), 0.0))
    names = tuple(tool_ids[k] for k in order)
    return WrongNest(names, _compare_offset(first, offset), std)


def _compare_offset(nest: int, offset: Floats) -> Floats:
    """Return the offset of a nest from the mean of the others, (3,) [m]."""
    others: Floats = np.delete(offset, nest, axis=0).mean(axis=0)
    return np.asarray(offset[nest] - others)


def _agree(nests: list[int], offset: Floats, covariance: Floats) -> bool:
    """Tell whether nests lie to each other as they should, up to what is not known."""
    if len(nests) < 2:
        return True
    gap = np.concatenate([offset[k] - offset[nests[0]] for k in nests[1:]])
    mix = np.zeros((len(gap), covariance.shape[0]))
    for row, k in enumerate(nests[1:]):
        mix[3 * row : 3 * row + 3, 3 * k : 3 * k + 3] += np.eye(3)
        mix[3 * row : 3 * row + 3, 3 * nests[0] : 3 * nests[0] + 3] -= np.eye(3)
    spread = mix @ covariance @ mix.T + OFF**2 * np.eye(len(gap))
    square = float(gap @ np.linalg.solve(spread, gap))
    return bool(square < chi2.isf(DIFFER, len(gap)))
