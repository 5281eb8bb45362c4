"""Exchange: which of many candidate poses tell the most together.

Fedorov's exchange on the Bayesian information I + sum X_k^T X_k, columns being whitened
and scaled by their prior (Chaloner and Verdinelli, Bayesian experimental design, 1995).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from postproc.arrays import Floats, Ints

Gain = Callable[[Floats, Floats], Floats]

SWAPS = 2  # passes of exchange


def choose(X: Floats, count: int, gain: Gain) -> Ints:
    """Choose poses greedily, then exchange each for the best one.

    Args:
        X: Rows of every candidate, (n, r, p).
        count: Poses wanted.
        gain: What candidates (m, r, p) add to a design of a given covariance (p, p).

    Returns:
        Indices of the chosen candidates, ascending, (count,).
    """
    covariance = np.eye(X.shape[2])
    chosen: list[int] = []
    free = np.ones(len(X), dtype=bool)

    def take_best(covariance: Floats) -> Floats:
        """Choose the free candidate that adds most."""
        best = int(np.flatnonzero(free)[np.argmax(gain(X[free], covariance))])
        chosen.append(best)
        free[best] = False
        return _updated(covariance, X[best], +1.0)

    for _ in range(count):
        covariance = take_best(covariance)
    for _ in range(SWAPS):
        before = sorted(chosen)
        for _ in range(count):
            one = chosen.pop(0)
            free[one] = True
            covariance = take_best(_updated(covariance, X[one], -1.0))
        if sorted(chosen) == before:
            break
    return np.array(sorted(chosen), dtype=np.int64)


def gain_d(part: Floats, covariance: Floats) -> Floats:
    """How much candidates lower the log volume of the parameters' uncertainty, (m,)."""
    both = _through(part, covariance)
    gain: Floats = np.linalg.slogdet(np.eye(part.shape[1]) + both).logabsdet
    return gain


def gain_i(everywhere: Floats) -> Gain:
    """Make the gain of I-optimality.

    Args:
        everywhere: Rows of poses all over the workspace, (n, r, p).
    """
    flat = everywhere.reshape(-1, everywhere.shape[2])
    moment = flat.T @ flat / len(flat)

    def gain(part: Floats, covariance: Floats) -> Floats:
        """How much candidates lower the mean variance of predictions, (m,)."""
        both = np.eye(part.shape[1]) + _through(part, covariance)
        seen = _through(part, covariance @ moment @ covariance)
        solved = np.linalg.solve(both, seen)
        return np.asarray(np.trace(solved, axis1=1, axis2=2))

    return gain


def _through(part: Floats, square: Floats) -> Floats:
    """Return X S X^T of every candidate, (m, r, r)."""
    flat = (part.reshape(-1, part.shape[2]) @ square).reshape(part.shape)
    return np.asarray(flat @ np.swapaxes(part, 1, 2))


def _updated(inverse: Floats, rows: Floats, sign: float) -> Floats:
    """Add (+1) or remove (-1) rows of an inverse information matrix (Woodbury)."""
    spread = inverse @ rows.T
    middle = np.linalg.inv(sign * np.eye(len(rows)) + rows @ spread)
    updated: Floats = inverse - spread @ middle @ spread.T
    return updated
