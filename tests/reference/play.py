"""The play operator by its definition: step by step, visit by visit."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from postproc.robot.backlash_operator import PlayOperator, VisitChains


def passing(q, half):
    """Return the clamps of passing each angle."""
    return PlayOperator(q - half, q + half)


def reversals(values, before, play):
    """Follow a path sample by sample: side, angle and state of the play, (s, 6)."""
    side, angle, z = (np.array(x) for x in (before.side, before.angle, before.z))
    found = []
    for q in values:
        new = np.minimum(np.maximum(z, q - play / 2), q + play / 2)
        turned = np.where(new == z, side, np.sign(new - z))
        angle = np.where(turned == side, angle, z + side * play / 2)
        side, z = turned, new
        found.append((side, angle, z))
    return np.swapaxes(np.reshape(found, (-1, 3, 6)), 0, 1)


def clamps(values, start, half):
    """Compose the clamps of passing each edge."""
    ends = []
    for first, last in pairwise(start):
        one = PlayOperator(np.full(6, -np.inf), np.full(6, np.inf))
        for q in values[first:last]:
            one = one.then(PlayOperator(q - half, q + half))
        ends.append(one)
    lo, hi = ([getattr(end, name) for end in ends] for name in ("lo", "hi"))
    return PlayOperator(np.reshape(lo, (-1, 6)), np.reshape(hi, (-1, 6)))


def turning(behind, middle, ahead):
    """Tell where the parabola of one joint through three samples turns.

    Returns:
        The value there, and whether it is before the middle one (-1), behind it (1), or
        at neither side of it (0).
    """
    rise, bend = (ahead - behind) / 2, (ahead + behind) / 2 - middle
    if not (abs(rise) < 2 * abs(bend) and rise != 0):
        return middle, 0
    return middle - rise**2 / (4 * bend), -1 if (rise > 0) == (bend > 0) else 1


def refined(angles, source, values, start, uneven):
    """Put in the values at which joints turn between samples."""
    out, begins = [], [0]
    for e, (first, last) in enumerate(pairwise(start)):
        for i in range(first, last):
            behind = values[i - 1] if i > first else None
            if i == first and source[e] >= 0:
                behind = angles[source[e]]
            if behind is None or i + 1 == last or i in uneven:
                out.append(values[i])
                continue
            found = [turning(behind[j], *values[i : i + 2, j]) for j in range(6)]
            value, at = np.transpose(found)
            out += [np.where(at == -1, value, values[i])] * (-1 in at)
            out.append(values[i])
            out += [np.where(at == 1, value, values[i])] * (1 in at)
        begins.append(len(out))
    return np.reshape(out, (-1, 6)), np.array(begins)


def states(chains: VisitChains, own, half, before):
    """Find the hull of what may hold at every visit: sweeps until nothing changes."""
    n = len(chains.angles)
    known: list[PlayOperator | None] = [None] * n
    changed = True
    while changed:
        changed = False
        for visit in range(n):
            new = _arrived(chains, own, half, before, known, visit)
            if new is not None and not _same(known[visit], new):
                known[visit], changed = new, True
    unknown = [PlayOperator(q - half, q + half) for q in chains.angles]
    at = [k or u for k, u in zip(known, unknown, strict=True)]
    return PlayOperator(np.array([c.lo for c in at]), np.array([c.hi for c in at]))


def _arrived(chains, own, half, before, known, visit):
    if visit == 0 and len(before.lo):
        return before[0]
    found = []
    for edge in range(chains.first[visit], chains.first[visit + 1]):
        if chains.source[edge] < 0:
            q = chains.angles[visit]
            return PlayOperator(q - half, q + half)
        state = known[chains.source[edge]]
        if state is not None:
            found.append(state.then(own[edge]))
    if not found:
        return None
    low = np.min([f.lo for f in found], axis=0)
    return PlayOperator(low, np.max([f.hi for f in found], axis=0))


def _same(a, b):
    ends = ((a.lo, b.lo), (a.hi, b.hi)) if a is not None else ()
    return bool(ends) and all(np.array_equal(*two, equal_nan=True) for two in ends)


def side(angles, z, half):
    """Place every joint in its play."""
    out = np.zeros_like(angles)
    for at, q in np.ndenumerate(angles):
        lo, hi, h = z.lo[at], z.hi[at], half[at[1]]
        s = float(np.clip((q - (lo + hi) / 2) / h, -1.0, 1.0))
        if abs(s) > 0.999:
            out[at] = np.sign(s)
        elif hi - lo < h / 2 and not np.isnan(s):
            out[at] = s
    return out
