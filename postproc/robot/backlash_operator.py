"""What joints with backlash remember of their path: the play operator."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from postproc import _native
from postproc.arrays import Floats, Ints, any_in_rows, floats

# The play operator: what a joint with backlash remembers of its path.
#
# A play of half width h has a state z that the joint angle drags along: always
# q - h <= z <= q + h. Passing one angle q is the clamp z -> min(max(z, q - h), q + h),
# and a sequence of clamps is one clamp again, so that a path of any length costs two
# numbers (Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989, chapter 2).


@dataclass(frozen=True)
class PlayOperator:
    """Maps z -> min(max(z, lo), hi) with lo <= hi, any equal shapes [rad]."""

    lo: Floats
    hi: Floats

    def __getitem__(self, rows: int | slice | Ints) -> PlayOperator:
        """Return some of the maps."""
        return PlayOperator(self.lo[rows], self.hi[rows])

    def __call__(self, z: Floats) -> Floats:
        """Apply the maps to states."""
        return np.minimum(np.maximum(z, self.lo), self.hi)

    def then(self, after: PlayOperator) -> PlayOperator:
        """Compose: these maps first, then the others."""
        return PlayOperator(after(self.lo), after(self.hi))


def identity(shape: tuple[int, ...]) -> PlayOperator:
    """Return maps that change nothing."""
    return PlayOperator(np.full(shape, -np.inf), np.full(shape, np.inf))


# A graph of visits on the drive side, cut into chains that need no loop inside.
#
# Programs are mostly one move after the other: a chain is a visit (its head) and the
# visits after it whose only predecessor is the one before them.


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
class VisitChains:
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


def chains_of(q: Floats, coupling: Floats, first: Ints, source: Ints) -> VisitChains:
    """Move a graph to the drive side and cut it into chains.

    Args:
        q: Joint angles at the n visits, (n, 6) [rad], NaN where not known.
        coupling: Drive-side angles = coupling @ q, (6, 6).
        first: Edges to the visits, as in `Edges`.
        source: Where they come from, likewise.
    """
    n, unknown = len(q), any_in_rows(np.isnan(q))
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
    return VisitChains(
        q @ coupling.T, first, source, heads, np.append(heads[1:], n),
        np.cumsum(~follows) - 1,
    )  # fmt: skip


# The ways between visits on the drive side, and what passing them does to plays.


@dataclass(frozen=True)
class DrivePaths:
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

    def clamps(self, half_width: Floats) -> PlayOperator:
        """Compose the clamps of passing each edge, (e, 6)."""
        return PlayOperator(*_native.clamps(self.values, self.start, half_width))


def drive_paths(chains: VisitChains, coupling: Floats, edges: Edges) -> DrivePaths:
    """Move the ways between visits to the drive side.

    Args:
        chains: The visits there.
        coupling: Drive-side angles = coupling @ q, (6, 6).
        edges: The ways.
    """
    values = edges.path @ coupling.T
    if len(values) > len(chains.source):
        return _insert_turning_values(chains.angles, chains.source, values, edges)
    return DrivePaths(values, edges.start)


def _insert_turning_values(
    angles: Floats, source: Ints, values: Floats, edges: Edges
) -> DrivePaths:
    """Insert turning values inside every edge from a known place.

    The parabola through three consecutive equidistant samples turns somewhere; where
    that lies between them its value is inserted, so that a joint that turns between the
    last two samples is not missed. The others pass their value at the sample again.
    """
    start = edges.start
    found = _native.refined(angles, source, values, start, edges.uneven)
    return DrivePaths(*found)


# Travel of every joint since its last reversal.

ROUNDS = 2  # the second one sees what arrives over jumps backwards


@dataclass(frozen=True)
class LastReversal:
    """The last reversal before some moment, arrays of one shape.

    Attributes:
        side: Direction since then, +1, -1, or 0 where the joint never moved or where
            several pasts disagree.
        angle: Drive-side angle where the joint turned, or where its known past begins
            [rad].
        z: State of the play operator that looks for reversals [rad].
    """

    side: Floats
    angle: Floats
    z: Floats

    def __getitem__(self, rows: int | slice | Ints) -> LastReversal:
        """Return some of them."""
        return LastReversal(self.side[rows], self.angle[rows], self.z[rows])


def never_turned(angle: Floats) -> LastReversal:
    """Begin at drive-side angles [rad] without a past."""
    return LastReversal(np.zeros_like(angle), np.array(angle), np.array(angle))


def last_reversals(
    chains: VisitChains, ways: DrivePaths, play: Floats, before: LastReversal
) -> LastReversal:
    """Find the last reversal before every visit, (n, 6); travel counts from there.

    A reversal is a return by more than one play from the extreme value, so that jitter
    resets nothing; travel counts from that extreme value. Where the past begins at an
    unknown moment it is what is sure, and where several predecessors agree in the
    direction the smallest of them, else 0.

    Args:
        chains: The visits.
        ways: The paths between them.
        play: As in `along`.
        before: What is known at the first visit, (1, 6); (0, 6) where nothing is.
    """
    n = len(chains.angles)
    last = never_turned(chains.angles)
    seen = np.zeros(n, dtype=bool)
    for _ in range(ROUNDS if len(chains.heads) > 1 else 1):
        for c, head in enumerate(chains.heads):
            given = before if head == 0 else before[:0]
            at_head = _merge_pasts(chains, ways, head, last, seen, play, given)
            last.side[head], last.angle[head] = at_head.side, at_head.angle
            last.z[head] = at_head.z
            if chains.ends[c] > head + 1:
                samples, visits = ways.of(chains.body(c))
                since = along(samples, at_head, play, visits)
                rows = slice(head + 1, chains.ends[c])
                last.side[rows], last.angle[rows] = since.side, since.angle
                last.z[rows] = since.z
            seen[head : chains.ends[c]] = True
    return last


def along(values: Floats, before: LastReversal, play: Floats, at: Ints) -> LastReversal:
    """Follow a path.

    Args:
        values: Drive-side angles, (s, 6) [rad].
        before: The last reversal before that, (6,).
        play: A return of more than this is a reversal, (6,) [rad].
        at: The k samples asked for, ascending.

    Returns:
        The last reversals there, (k, 6).
    """
    return LastReversal(*_native.reversals(floats(values), at, before, play / 2))


def _merge_pasts(
    chains: VisitChains,
    ways: DrivePaths,
    head: int,
    last: LastReversal,
    seen: NDArray[np.bool_],
    play: Floats,
    given: LastReversal,
) -> LastReversal:
    """Merge the pasts that arrive at a head, unless its past is given."""
    if len(given.side):
        return given[0]
    q, half = chains.angles[head], play / 2
    pasts = []
    for edge in chains.edges_to(head):
        source = chains.source[edge]
        if source < 0:
            return never_turned(q)
        if seen[source]:
            side = last.side[source]
            z = chains.angles[source] - side * half
            before = LastReversal(side, last.angle[source], z)
            samples, _ = ways.of(slice(edge, edge + 1))
            end = np.array([len(samples) - 1])
            pasts.append(along(samples, before, play, end)[0])
    if not pasts:
        return never_turned(q)
    side = np.array([p.side for p in pasts])
    angle = np.array([p.angle for p in pasts])
    agree = (side == side[0]).all(axis=0)
    nearest = np.abs(angle - q).argmin(axis=0)
    sure = np.take_along_axis(angle, nearest[None], axis=0)[0]
    known = np.where(agree, side[0], 0.0)
    return LastReversal(known, np.where(agree, sure, q), q - known * half)


# What joints remember of the way that brought them to a place.


@dataclass(frozen=True)
class PlayState:
    """What is known at n places, (n, 6) each; (0, 6) where nothing is.

    Attributes:
        play: Interval that the state of every play operator lies in [rad].
        turned: The last reversal of every joint.
    """

    play: PlayOperator
    turned: LastReversal

    def __getitem__(self, rows: slice) -> PlayState:
        """Return what is known at some of them."""
        return PlayState(self.play[rows], self.turned[rows])


_NONE = np.empty((0, 6))
NOTHING = PlayState(PlayOperator(_NONE, _NONE), LastReversal(_NONE, _NONE, _NONE))
