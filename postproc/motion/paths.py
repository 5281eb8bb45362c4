"""Places on the sampled paths of edges, between their samples."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.kernels import native
from postproc.motion.trace import Trace


def along(traced: Trace, edge: Ints, u: Floats) -> Floats:
    """Interpolate joint angles on edges (m,) at fractions u (m,): (m, 6) [rad].

    Parabolas through the three nearest of the equidistant samples, the place where the
    edge comes from being the first one; straight where an edge has but one sample.
    """
    if native is not None:
        out: Floats = native.along(traced.edges, traced.q, edge, u)
        return out
    return between(traced, edge)(u)


def between(traced: Trace, edge: Ints) -> Callable[[Floats], Floats]:
    """Prepare to interpolate on edges again and again, as `along` does once."""
    start = traced.edges.start
    count = start.take(edge + 1) - start.take(edge)
    if (count == 1).all():
        return _straight(traced, edge)
    one = count == 1
    straight = _straight(traced, edge[one])

    def at(u: Floats) -> Floats:
        out = np.empty((len(edge), 6))
        out[one] = straight(u[one])
        out[~one] = _curved(traced, edge[~one], u[~one], count[~one])
        return out

    return at


def _straight(traced: Trace, edge: Ints) -> Callable[[Floats], Floats]:
    """Interpolate on edges with one sample."""
    edges = traced.edges
    end = edges.path.take(edges.start.take(edge), axis=0)
    way = end - traced.q.take(edges.source.take(edge), axis=0)

    def at(u: Floats) -> Floats:
        out: Floats = end + (u - 1)[:, None] * way
        return out

    return at


def _curved(traced: Trace, edge: Ints, u: Floats, count: Ints) -> Floats:
    """Interpolate on edges with more samples."""
    x = u * count
    middle = np.clip(np.rint(x), 1, np.maximum(count - 1, 1)).astype(np.int64)
    t = (x - middle)[:, None]
    here, after = _node(traced, edge, middle), _node(traced, edge, middle + 1)
    before = _node(traced, edge, middle - 1)
    bend, slope = after - 2 * here + before, (after - before) / 2
    out: Floats = here + t * slope + t**2 / 2 * bend
    return out


def _node(traced: Trace, edge: Ints, i: Ints) -> Floats:
    """Return sample i of each edge, counted from 1; 0 is where the edge comes from."""
    edges, first = traced.edges, np.flatnonzero(i == 0)
    sample = np.maximum(edges.start.take(edge) + i - 1, 0)
    out: Floats = edges.path.take(sample, axis=0)
    out[first] = traced.q[edges.source[edge[first]]]
    return out
