"""A graph of visits on the drive side, cut into chains that need no loop inside.

Programs are mostly one move after the other: a chain is a visit (its head) and the
visits after it whose only predecessor is the one before them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from postproc.robot.play import Array, Ints, with_turning_values


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
    path: Array
    start: Ints
    uneven: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))


@dataclass(frozen=True)
class Chains:
    """Edges on the drive side, with turning values inside, cut into chains.

    Attributes:
        angles: Drive-side angles at the visits, (n, 6) [rad].
        first, source, start: As in `Edges`.
        values: Drive-side samples, (s, 6) [rad].
        heads: First visit of each chain, (c,), ascending; the first one is 0.
        ends: One past the last visit of each chain, (c,).
        chain_of: Chain of each visit, (n,).
    """

    angles: Array
    first: Ints
    source: Ints
    values: Array
    start: Ints
    heads: Ints
    ends: Ints
    chain_of: Ints

    def edges_to(self, visit: int) -> range:
        """Return the edges that lead to a visit."""
        return range(int(self.first[visit]), int(self.first[visit + 1]))

    def samples_of(self, edge: int) -> Array:
        """Return the drive-side samples of one edge."""
        return self.values[self.start[edge] : self.start[edge + 1]]

    def body(self, c: int) -> tuple[Array, Ints]:
        """Return what lies after the head of a chain.

        Returns:
            The samples of all its edges, one after the other (m, 6), and where among
            them the last sample of each edge stands, which is the visit itself.
        """
        begin = self.first[self.heads[c] + 1]
        end = begin + self.ends[c] - self.heads[c] - 1
        offset = self.start[begin]
        last = self.start[begin + 1 : end + 1] - offset - 1
        return self.values[offset : self.start[end]], last

    def begins(self) -> Ints:
        """List the edges that begin a path of their own, if they have samples, (k,).

        Those to the heads, and the first one behind each.
        """
        n = len(self.angles)
        own = np.zeros(n + 1, dtype=bool)
        own[self.heads] = own[self.heads + 1] = True
        edges = np.flatnonzero(np.repeat(own[:n], np.diff(self.first)))
        filled: Ints = edges[np.diff(self.start)[edges] > 0]
        return filled

    def followers(self) -> list[list[int]]:
        """List, for each chain, the chains whose head is reached from it."""
        out: list[list[int]] = [[] for _ in self.heads]
        for c, head in enumerate(self.heads):
            for edge in self.edges_to(head):
                if self.source[edge] >= 0:
                    out[self.chain_of[self.source[edge]]].append(c)
        return out


def cut(q: Array, coupling: Array, edges: Edges) -> Chains:
    """Move a graph to the drive side and cut it into chains.

    Args:
        q: Joint angles at the n visits, (n, 6) [rad], NaN where not known.
        coupling: Drive-side angles = coupling @ q, (6, 6).
        edges: The paths between the visits.
    """
    n, unknown = len(q), np.asarray(np.isnan(q).any(axis=1))
    source = np.array(edges.source)
    source[unknown[np.repeat(np.arange(n), np.diff(edges.first))]] = -1
    source[source >= 0] = np.where(
        unknown[source[source >= 0]], -1, source[source >= 0]
    )
    angles, values, start = q @ coupling.T, edges.path @ coupling.T, edges.start
    if len(values) > len(source):
        values, start = _refined(angles, source, values, edges)
    follows = np.zeros(n, dtype=bool)
    single = np.flatnonzero((np.diff(edges.first) == 1) & ~unknown)
    follows[single] = source[edges.first[single]] == single - 1
    follows[:1] = False
    heads = np.flatnonzero(~follows)
    return Chains(
        angles, edges.first, source, values, start, heads, np.append(heads[1:], n),
        np.cumsum(~follows) - 1,
    )  # fmt: skip


def _refined(
    angles: Array, source: Ints, values: Array, edges: Edges
) -> tuple[Array, Ints]:
    """Insert turning values inside every edge from a known place."""
    start = edges.start
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
    return out, np.append(0, np.cumsum(count))[start]
