"""How large the largest evidence gets when there is nothing to find."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.accuracy.diagnosis.library import Library
from postproc.accuracy.diagnosis.projection import Projection
from postproc.accuracy.diagnosis.score import family_maxima
from postproc.arrays import Floats

DRAWS = 300
LEAST = 1e-300  # p-values below this are all the same to anybody
TAIL = 0.2  # share of the draws that the tail is taken from


@dataclass(frozen=True, eq=False)
class Null:
    """Distribution of the largest evidence of the whole library under the model.

    Attributes:
        maxima: Sorted maxima of the draws, (draws,) [nats].
    """

    maxima: Floats

    @property
    def _tail(self) -> tuple[float, float]:
        """Where the tail begins, and its mean excess."""
        start = float(np.quantile(self.maxima, 1.0 - TAIL))
        excess = self.maxima[self.maxima > start] - start
        return start, max(float(excess.mean()) if len(excess) else 1.0, 1e-3)

    def p_value(self, evidence: float) -> float:
        """Give the probability that noise alone reaches an evidence anywhere.

        Beyond the start of the tail the draws are continued by an exponential.
        """
        start, scale = self._tail
        if evidence <= start:
            reached = (self.maxima >= evidence).sum()
            return float((reached + 1) / (len(self.maxima) + 1))
        return max(float(TAIL * np.exp(-(evidence - start) / scale)), LEAST)

    def threshold(self, level: float) -> float:
        """Give the evidence that noise reaches with a probability [nats]."""
        start, scale = self._tail
        if level >= TAIL:
            return float(np.quantile(self.maxima, 1.0 - level))
        return start + scale * float(np.log(TAIL / level))


def bootstrap(projection: Projection, library: Library, seed: int) -> Null:
    """Draw from the current model and score the whole library against each draw.

    The filter turns draws from the model into plain noise, so no draw needs a fit.
    """
    rng = np.random.default_rng(seed)
    used = np.repeat(projection.fit.rows.weight > 0, 3)
    rows = rng.standard_normal((len(projection.rest), DRAWS)) * used[:, None]
    reduced = library.reduce(projection, rows)
    square = (rows**2).sum(axis=0)
    return Null(np.sort(family_maxima(reduced, square, projection.rows)))
