"""How the path at a sharp fly point moves with the points next to it.

The corner superposes two moves, so that the place where the path passes a point moves
by the share 1 - v - w of what the point moves, and by the shares v and w of what the
points before and behind it move; see `corner`. Exact for straight moves of the TCP.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.kernels import floats, native

ROUNDS = 12  # of Jacobi's method; v + w is 1/4 at most, each gains a factor of two


def _no_points() -> Ints:
    return np.empty(0, dtype=np.int64)


def _no_shares() -> Floats:
    return np.empty(0)


@dataclass(frozen=True)
class Pull:
    """c rounded fly points where the path really bends.

    Attributes:
        visit: The point, (c,).
        before, behind: The targets next to it, (c,).
        v, w: Their shares, (c,).
    """

    visit: Ints = field(default_factory=_no_points)
    before: Ints = field(default_factory=_no_points)
    behind: Ints = field(default_factory=_no_points)
    v: Floats = field(default_factory=_no_shares)
    w: Floats = field(default_factory=_no_shares)

    def on(self, moved: Floats) -> Floats:
        """Tell how much farther than their targets points move, (n, 3).

        Args:
            moved: What all n targets move by, (n, 3).
        """
        here = moved.take(self.visit, axis=0)
        pulled = self.v[:, None] * (moved.take(self.before, axis=0) - here)
        pulled += self.w[:, None] * (moved.take(self.behind, axis=0) - here)
        out = np.zeros_like(moved)
        out[self.visit] = pulled
        return out

    def to_move(self, wanted: Floats) -> Floats:
        """Move targets so that the path moves as wanted where it passes, (n, 3)."""
        n, c = len(wanted), len(self.visit)
        if c == 0:
            return np.array(wanted)
        if native is not None:
            corners, shares = (self.visit, self.before, self.behind), (self.v, self.w)
            found: Floats = native.to_move(floats(wanted), corners, shares, ROUNDS)
            return found
        others = np.ones(n, dtype=bool)
        others[self.visit] = False
        order = np.concatenate([self.visit, np.flatnonzero(others)])
        place = np.empty(n, dtype=np.int64)
        place[order] = np.arange(n)
        before, behind = place.take(self.before), place.take(self.behind)
        moved = np.array(wanted.take(order, axis=0).T, order="C")  # the points first
        here, aim = moved[:, :c], np.array(moved[:, :c])
        for _ in range(ROUNDS):
            pulled = self.v * (moved.take(before, axis=1) - here)
            pulled += self.w * (moved.take(behind, axis=1) - here)
            here[:] = aim - pulled
        out = np.empty_like(wanted)
        out[order] = moved.T
        return out
