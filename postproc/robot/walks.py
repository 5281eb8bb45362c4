"""The ways between visits on the drive side, and what passing them does to plays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats, Ints, spans
from postproc.kernels import native
from postproc.robot.chains import Chains, Edges
from postproc.robot.play import Clamps, identity, passing, prefix, with_turning_values


@dataclass(frozen=True)
class Walks:
    """The drive-side samples of e edges, with turning values inside.

    Attributes:
        values: Samples, (s, 6) [rad].
        start: Samples start[i] .. start[i + 1] - 1 are those of edge i, (e + 1,).
    """

    values: Floats
    start: Ints

    def of(self, edges: slice) -> tuple[Floats, Ints]:
        """Return some edges one after the other.

        Returns:
            Their samples (m, 6), and where among them the last one of each edge stands.
        """
        start = self.start[edges.start : edges.stop + 1]
        return self.values[start[0] : start[-1]], start[1:] - start[0] - 1

    def clamps(self, half_width: Floats) -> Clamps:
        """Compose the clamps of passing each edge, (e, 6)."""
        if native is not None:
            return Clamps(*native.clamps(self.values, self.start, half_width))
        count = np.diff(self.start)
        out = identity((len(count), 6))
        one, more = np.flatnonzero(count == 1), np.flatnonzero(count > 1)
        last = self.start[1:] - 1
        alone = passing(self.values[last[one]], half_width)
        out.lo[one], out.hi[one] = alone.lo, alone.hi
        if len(more):
            end = np.cumsum(count[more])
            begins = np.zeros(end[-1], dtype=bool)
            begins[end[:-1]] = True
            rows = spans(self.start[more], count[more])
            steps = prefix(passing(self.values[rows], half_width), begins)
            out.lo[more], out.hi[more] = steps.lo[end - 1], steps.hi[end - 1]
        return out


def walks(chains: Chains, coupling: Floats, edges: Edges) -> Walks:
    """Move the ways between visits to the drive side.

    Args:
        chains: The visits there.
        coupling: Drive-side angles = coupling @ q, (6, 6).
        edges: The ways.
    """
    values = edges.path @ coupling.T
    if len(values) > len(chains.source):
        return _refined(chains.angles, chains.source, values, edges)
    return Walks(values, edges.start)


def _refined(angles: Floats, source: Ints, values: Floats, edges: Edges) -> Walks:
    """Insert turning values inside every edge from a known place."""
    start = edges.start
    if native is not None:
        return Walks(*native.refined(angles, source, values, start, edges.uneven))
    filled = np.flatnonzero(np.diff(start) > 0)
    begins, lasts = start[filled], start[filled + 1] - 1
    before = np.vstack([values[:1], values[:-1]])
    before[begins] = np.where(
        source[filled, None] >= 0, angles[source[filled]], values[begins]
    )
    inside = np.ones(len(values), dtype=bool)
    inside[lasts] = inside[edges.uneven] = False
    inside[begins[source[filled] < 0]] = False
    out, count = with_turning_values(before, values, inside)
    return Walks(out, np.append(0, np.cumsum(count))[start])
