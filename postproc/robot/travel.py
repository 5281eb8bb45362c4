"""Travel of every joint since its last reversal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.robot.chains import Chains
from postproc.robot.play import Array, passing, prefix

ROUNDS = 2  # the second one sees what arrives over jumps backwards


@dataclass(frozen=True)
class Turned:
    """The last reversal before some moment, arrays of one shape.

    Attributes:
        side: Direction since then, +1, -1, or 0 where the joint never moved or where
            several pasts disagree.
        angle: Drive-side angle where the joint turned, or where its known past begins
            [rad].
    """

    side: Array
    angle: Array


def travel_since_reversal(chains: Chains, play: Array) -> Array:
    """Measure the travel since the last reversal at every visit, (n, 6) [rad].

    A reversal is a return by more than one play from the extreme value, so that jitter
    resets nothing; travel counts from that extreme value. Where the past begins at an
    unknown moment it is what is sure, and where several predecessors agree in the
    direction the smallest of them, else 0.
    """
    n = len(chains.angles)
    last = Turned(np.zeros((n, 6)), np.array(chains.angles))
    seen = np.zeros(n, dtype=bool)
    for _ in range(ROUNDS if len(chains.heads) > 1 else 1):
        for c, head in enumerate(chains.heads):
            at_head = _merged(chains, head, last, seen, play)
            last.side[head], last.angle[head] = at_head.side, at_head.angle
            if chains.ends[c] > head + 1:
                samples, visits = chains.body(c)
                since = along(samples, chains.angles[head], at_head, play)
                rows = slice(head + 1, chains.ends[c])
                last.side[rows] = since.side[visits]
                last.angle[rows] = since.angle[visits]
            seen[head : chains.ends[c]] = True
    travel: Array = np.abs(chains.angles - last.angle)
    return travel


def along(values: Array, begin: Array, before: Turned, play: Array) -> Turned:
    """Follow a path.

    Args:
        values: Drive-side angles, (s, 6) [rad].
        begin: Angle before the first of them, (6,) [rad].
        before: The last reversal before that, (6,).
        play: A return of more than this is a reversal, (6,) [rad].
    """
    half = play / 2
    z0 = begin - before.side * half
    z = np.vstack([z0, prefix(passing(values, half))(z0)])
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
    return Turned(side[1:], np.take_along_axis(angle, at, axis=0)[1:])


def _merged(
    chains: Chains, head: int, last: Turned, seen: NDArray[np.bool_], play: Array
) -> Turned:
    """Merge the pasts that arrive at a head."""
    q = chains.angles[head]
    pasts = []
    for edge in chains.edges_to(head):
        source = chains.source[edge]
        if source < 0:
            return Turned(np.zeros(6), q)
        if seen[source]:
            before = Turned(last.side[source], last.angle[source])
            since = along(chains.samples_of(edge), chains.angles[source], before, play)
            pasts.append(Turned(since.side[-1], since.angle[-1]))
    if not pasts:
        return Turned(np.zeros(6), q)
    side = np.array([p.side for p in pasts])
    angle = np.array([p.angle for p in pasts])
    agree = (side == side[0]).all(axis=0)
    nearest = np.abs(angle - q).argmin(axis=0)
    sure = np.take_along_axis(angle, nearest[None], axis=0)[0]
    return Turned(np.where(agree, side[0], 0.0), np.where(agree, sure, q))
