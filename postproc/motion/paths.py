"""Places on the sampled paths of edges, between their samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from postproc.motion.trace import Trace

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def along(traced: Trace, edge: Ints, u: Array) -> Array:
    """Interpolate joint angles on edges (m,) at fractions u (m,): (m, 6) [rad].

    Parabolas through the three nearest of the equidistant samples, the place where the
    edge comes from being the first one; straight where an edge has but one sample.
    """
    edges, count = traced.edges, np.diff(traced.edges.start)[edge]
    x = u * count
    middle = np.clip(np.rint(x), 1, np.maximum(count - 1, 1)).astype(np.int64)
    t = (x - middle)[:, None]
    after = np.minimum(middle + 1, count)
    here, next_ = _node(traced, edge, middle), _node(traced, edge, after)
    before = _node(traced, edge, middle - 1)
    bend = np.where((count > 1)[:, None], next_ - 2 * here + before, 0.0)
    slope = np.where((count > 1)[:, None], (next_ - before) / 2, here - before)
    assert edges.source[edge].min(initial=0) >= 0
    out: Array = here + t * slope + t**2 / 2 * bend
    return out


def _node(traced: Trace, edge: Ints, i: Ints) -> Array:
    """Return sample i of each edge, counted from 1; 0 is where the edge comes from."""
    edges = traced.edges
    sample = np.maximum(edges.start[edge] + i - 1, 0)
    begin = traced.q[edges.source[edge]]
    out: Array = np.where((i == 0)[:, None], begin, edges.path[sample])
    return out
