"""Moving averages over checks of what each cause explains: they find what creeps.

Lowry, Woodall, Champ and Rigdon, A multivariate exponentially weighted moving average
control chart, Technometrics 34, 1992; here of what causes explain, not of readings, so
that the readings of a check need not be those of the last.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi2

from postproc.arrays import Floats
from postproc.record.causes import Change, project
from postproc.record.knowledge import Expected

NEW = 0.3  # weight of the newest check
DRAWS, SEED = 20_000, 9283  # of the law of the largest average


@dataclass(frozen=True, eq=False)
class Averages:
    """The averages of an arm since its survey or its last event.

    Attributes:
        of: By the name of a cause, (r,), of unit variance in each check.
        share: Sum of the squared weights in them.
    """

    of: Mapping[str, Floats] = field(default_factory=dict)
    share: float = 0.0

    def add(
        self, causes: Sequence[Change], expected: Expected, scale: float
    ) -> Averages:
        """Average in what the causes explain of a check.

        Args:
            causes: The causes.
            expected: The readings of the check.
            scale: Variance of readings over what is expected of it.
        """
        found = {}
        for cause in causes:
            u, B = project(cause, expected)
            own = _whiten(B) @ u / np.sqrt(scale)
            before = self.of.get(cause.name, np.zeros(len(own)))
            found[cause.name] = (1.0 - NEW) * before + NEW * own
        return Averages(found, (1.0 - NEW) ** 2 * self.share + NEW**2)

    def test(
        self, causes: Sequence[Change], expected: Expected, sure: float, alarms: float
    ) -> tuple[float, float]:
        """Return the largest average and its limit, as minus log of chance.

        The causes overlap, and the scatter of readings is known from few: the law of
        the largest average is drawn.

        Args:
            causes: The causes.
            expected: The readings of the newest check.
            sure: Degrees of freedom from which the scatter of readings is known.
            alarms: Share of false alarms.
        """
        root = _root(expected.precision)
        draws = _draw(root.shape[1], sure)
        largest, seen = np.zeros(DRAWS), 0.0
        for cause in causes:
            _, B = project(cause, expected)
            known = _whiten(B) @ cause.columns(expected).T @ root
            free = int(np.linalg.matrix_rank(known))
            if not free:
                continue
            drawn = ((draws @ known.T) ** 2).sum(axis=1)
            largest = np.maximum(largest, -chi2.logsf(drawn, free))
            square = float((self.of[cause.name] ** 2).sum()) / self.share
            seen = max(seen, -float(chi2.logsf(square, free)))
        return seen, float(np.quantile(largest, 1.0 - alarms))


NO_AVERAGES = Averages()


def _draw(count: int, sure: float) -> Floats:
    """Draw whitened readings whose scale is known from few, (DRAWS, count)."""
    rng = np.random.default_rng(SEED)
    draws = rng.standard_normal((DRAWS, count))
    return np.asarray(draws / np.sqrt(rng.chisquare(sure, DRAWS) / sure)[:, None])


def _whiten(B: Floats) -> Floats:
    """Return W with W B W' = 1 on what shows at all, (r, r)."""
    size, axes = np.linalg.eigh(B)
    shows = size > 1e-9 * max(float(size.max(initial=0.0)), 1e-300)
    scale = np.where(shows, 1.0 / np.sqrt(np.where(shows, size, 1.0)), 0.0)
    return np.asarray((axes * scale) @ axes.T)


def _root(M: Floats) -> Floats:
    """Return Q with Q Q' = M, (m, f)."""
    size, axes = np.linalg.eigh(M)
    kept = size > 1e-9 * size.max()
    return np.asarray(axes[:, kept] * np.sqrt(size[kept]))
