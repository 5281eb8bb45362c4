"""Travel of every joint since its last reversal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats, Ints
from postproc.robot.chains import Chains
from postproc.robot.play import passing, prefix
from postproc.robot.walks import Walks

ROUNDS = 2  # the second one sees what arrives over jumps backwards


@dataclass(frozen=True)
class Turned:
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

    def __getitem__(self, rows: int | slice | Ints) -> Turned:
        """Return some of them."""
        return Turned(self.side[rows], self.angle[rows], self.z[rows])


def never_turned(angle: Floats) -> Turned:
    """Begin at drive-side angles [rad] without a past."""
    return Turned(np.zeros_like(angle), np.array(angle), np.array(angle))


def last_reversals(chains: Chains, ways: Walks, play: Floats, before: Turned) -> Turned:
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
            at_head = _merged(chains, ways, head, last, seen, play, given)
            last.side[head], last.angle[head] = at_head.side, at_head.angle
            last.z[head] = at_head.z
            if chains.ends[c] > head + 1:
                samples, visits = ways.of(chains.body(c))
                since = along(samples, at_head, play)
                rows = slice(head + 1, chains.ends[c])
                last.side[rows] = since.side[visits]
                last.angle[rows] = since.angle[visits]
                last.z[rows] = since.z[visits]
            seen[head : chains.ends[c]] = True
    return last


def along(values: Floats, before: Turned, play: Floats) -> Turned:
    """Follow a path.

    Args:
        values: Drive-side angles, (s, 6) [rad].
        before: The last reversal before that, (6,).
        play: A return of more than this is a reversal, (6,) [rad].
    """
    half = play / 2
    z = np.vstack([before.z, prefix(passing(values, half))(before.z)])
    side = np.sign(np.diff(z, axis=0))
    side = np.vstack([before.side, side])
    rows = np.arange(len(side))[:, None]
    moved = np.maximum.accumulate(np.where(side != 0, rows, 0), axis=0)
    side = np.take_along_axis(side, moved, axis=0)
    turned = np.zeros(side.shape, dtype=bool)
    turned[1:] = side[1:] != side[:-1]
    angle = np.empty(side.shape)
    angle[0] = before.angle
    angle[1:] = z[:-1] + side[:-1] * half
    at = np.maximum.accumulate(np.where(turned, rows, 0), axis=0)
    return Turned(side[1:], np.take_along_axis(angle, at, axis=0)[1:], z[1:])


def _merged(
    chains: Chains,
    ways: Walks,
    head: int,
    last: Turned,
    seen: NDArray[np.bool_],
    play: Floats,
    given: Turned,
) -> Turned:
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
            before = Turned(side, last.angle[source], z)
            samples, _ = ways.of(slice(edge, edge + 1))
            pasts.append(along(samples, before, play)[-1])
    if not pasts:
        return never_turned(q)
    side = np.array([p.side for p in pasts])
    angle = np.array([p.angle for p in pasts])
    agree = (side == side[0]).all(axis=0)
    nearest = np.abs(angle - q).argmin(axis=0)
    sure = np.take_along_axis(angle, nearest[None], axis=0)[0]
    known = np.where(agree, side[0], 0.0)
    return Turned(known, np.where(agree, sure, q), q - known * half)
