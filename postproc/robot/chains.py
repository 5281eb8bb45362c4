"""A graph of visits on the drive side, cut into chains that need no loop inside.

Programs are mostly one move after the other: a chain is a visit (its head) and the
visits after it whose only predecessor is the one before them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from postproc.arrays import Bools, Floats, Ints


@dataclass(frozen=True)
class Edges:
    """How n visits are reached: the geometric path from every predecessor.

    Attributes:
        first: Edges first[v] .. first[v + 1] - 1 lead to visit v, (n + 1,).
        source: Visit an edge comes from, (e,); negative where that is not known.
        path: Samples of all edges, without the predecessor itself, with the visit as
            the last one, (s, 6) joint angles [rad]; equidistant but for `uneven`.
        start: Samples start[i] .. start[i + 1] - 1 are those of edge i, (e + 1,); an
            edge from an unknown place may have none.
        uneven: Samples whose neighbours are not equally far along the path, any number.
    """

    first: Ints
    source: Ints
    path: Floats
    start: Ints
    uneven: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))


@dataclass(frozen=True)
class Chains:
    """Visits on the drive side, cut into chains.

    Attributes:
        angles: Drive-side angles at the visits, (n, 6) [rad].
        first, source: As in `Edges`.
        heads: First visit of each chain, (c,), ascending; the first one is 0.
        ends: One past the last visit of each chain, (c,).
        chain_of: Chain of each visit, (n,).
    """

    angles: Floats
    first: Ints
    source: Ints
    heads: Ints
    ends: Ints
    chain_of: Ints

    def edges_to(self, visit: int) -> range:
        """Return the edges that lead to a visit."""
        return range(int(self.first[visit]), int(self.first[visit + 1]))

    def body(self, c: int) -> slice:
        """Return the edges behind the head of a chain, one to each of its visits."""
        begin = int(self.first[self.heads[c] + 1])
        return slice(begin, begin + int(self.ends[c] - self.heads[c]) - 1)

    def begins(self) -> Bools:
        """Tell which edges begin a path of their own, (e,).

        Those to the heads, and the first one behind each.
        """
        n = len(self.angles)
        own = np.zeros(n + 1, dtype=bool)
        own[self.heads] = own[self.heads + 1] = True
        return np.repeat(own[:n], np.diff(self.first))

    def followers(self) -> list[list[int]]:
        """List, for each chain, the chains whose head is reached from it."""
        out: list[list[int]] = [[] for _ in self.heads]
        for c, head in enumerate(self.heads):
            for edge in self.edges_to(head):
                if self.source[edge] >= 0:
                    out[self.chain_of[self.source[edge]]].append(c)
        return out


def chained(q: Floats, coupling: Floats, first: Ints, source: Ints) -> Chains:
    """Move a graph to the drive side and cut it into chains.

    Args:
        q: Joint angles at the n visits, (n, 6) [rad], NaN where not known.
        coupling: Drive-side angles = coupling @ q, (6, 6).
        first: Edges to the visits, as in `Edges`.
        source: Where they come from, likewise.
    """
    n, unknown = len(q), np.asarray(np.isnan(q).any(axis=1))
    source = np.array(source)
    source[unknown[np.repeat(np.arange(n), np.diff(first))]] = -1
    source[source >= 0] = np.where(
        unknown[source[source >= 0]], -1, source[source >= 0]
    )
    follows = np.zeros(n, dtype=bool)
    single = np.flatnonzero((np.diff(first) == 1) & ~unknown)
    follows[single] = source[first[single]] == single - 1
    follows[:1] = False
    heads = np.flatnonzero(~follows)
    return Chains(
        q @ coupling.T, first, source, heads, np.append(heads[1:], n),
        np.cumsum(~follows) - 1,
    )  # fmt: skip
