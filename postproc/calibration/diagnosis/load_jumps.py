"""Jumps at a load: where one is and what the links weigh are found together.

Whether a row is before or after a jump depends on the load, and the load on the first
moments of the links, which an arm file states to a tenth or so. A step has no slope in
either. It therefore begins as a wide tanh, which has one, and is narrowed; at each
width Gauss-Newton steps move its place and all moments, which have the normal prior of
`moment_root`. They cost what Laplace's approximation says: their prior, and the share
of it that the rows leave.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.link_weights import links_beyond, moment_root
from postproc.calibration.diagnosis.score import Score, rank_some
from postproc.model.covariate import by_weight, covariate
from postproc.model.effects.part_motion import PartMotion

WIDTHS = 0.3 * 0.6 ** np.arange(9)  # of half of the load's range
TURNS = 4  # Gauss-Newton steps at a width
SHORTEST = 0.05  # part of a step that is tried
SEEN = 8  # rows within a width that still shows what the moments cost


@dataclass(frozen=True, eq=False)
class _Jump:
    """The rows about a jump at a load.

    Attributes:
        projection: The fit without it.
        moved: Motion of the tool point per unit of the carrier's motion, (n, 3).
        load: The load of nominal links, (n,), in halves of its range.
        by_moment: Its slopes by what is unsure of the links' moments, (n, m).
    """

    projection: Projection
    moved: Floats
    load: Floats
    by_moment: Floats

    def filter_values(self, values: Floats) -> Floats:
        """Whiten and filter the motion by some values (n, k), (3 n, k)."""
        rows = self.moved[:, :, None] * values[:, None, :]
        return self.projection.filter(self.projection.fit.whiten(rows))

    def level(self, at: Floats, width: float) -> Floats:
        """Evaluate a tanh of some width, (n,).

        Args:
            at: Place, in halves of the range, and moments, in spreads, (1 + m,).
            width: Of the tanh, in halves of the range.
        """
        values: Floats = np.tanh((self.load + self.by_moment @ at[1:] - at[0]) / width)
        return values

    def misfit(self, at: Floats, width: float) -> float:
        """Return twice the negative log posterior, the size of the jump at its best."""
        column = self.filter_values(self.level(at, width)[:, None])[:, 0]
        rest = self.projection.rest
        left = rest - column * (column @ rest) / (column @ column)
        return float(left @ left + at[1:] @ at[1:])

    def slopes(self, at: Floats, width: float) -> tuple[Floats, float]:
        """Differentiate the rows by size, place and moments, (3 n, 2 + m), at the size.

        Returns:
            The slopes, and the size.
        """
        level = self.level(at, width)
        column = self.filter_values(level[:, None])[:, 0]
        size = float(column @ self.projection.rest) / float(column @ column)
        steep = size * (1.0 - level**2) / width
        inner = np.column_stack([-steep, steep[:, None] * self.by_moment])
        return np.column_stack([column, self.filter_values(inner)]), size

    def step(self, at: Floats, width: float) -> Floats:
        """Return the Gauss-Newton step of place and moments, (1 + m,)."""
        slopes, size = self.slopes(at, width)
        rest = self.projection.rest - size * slopes[:, 0]
        prior = np.r_[0.0, 1e-6, np.ones(len(at) - 1)]
        gradient = slopes.T @ rest - prior * np.r_[0.0, at]
        found: Floats = np.linalg.solve(slopes.T @ slopes + np.diag(prior), gradient)
        return found[1:]

    def narrow(self, at: Floats) -> tuple[Floats, float]:
        """Narrow the tanh to a jump, and return what its moments cost [nats]."""
        charge = 0.0
        for width in WIDTHS:
            least = self.misfit(at, width)
            for _ in range(TURNS):
                step, part = self.step(at, width), 1.0
                tried = self.misfit(at + step, width)
                while tried >= least and part > 2.0 * SHORTEST:
                    part /= 2.0
                    tried = self.misfit(at + part * step, width)
                if tried >= least:
                    break
                at, least = at + part * step, tried
            away = self.load + self.by_moment @ at[1:] - at[0]
            if int((np.abs(away) < width).sum()) >= SEEN:
                # Half the logarithm of what rows leave of the moments' prior [nats].
                slopes = self.slopes(at, width)[0]
                basis, _ = np.linalg.qr(slopes[:, :2])
                own = slopes[:, 2:] - basis @ (basis.T @ slopes[:, 2:])
                values = np.linalg.svd(own, compute_uv=False)
                charge = float(np.log1p(values**2).sum()) / 2
        return at, charge + float(at[1:] @ at[1:]) / 2.0


def place_load_jump(projection: Projection, score: Score) -> Score:
    """Move a step at a load to where it is with other weights of links.

    Args:
        projection: The fit without it.
        score: Of a step; any other is returned as it is.

    Returns:
        The better score, the weights charged.
    """
    cell = score.best.effect
    if not isinstance(cell, PartMotion) or cell.law != "step" or cell.factor:
        return score
    per_moment = by_weight(projection.at, cell.source)
    if per_moment is None:
        return score
    tried, charge = _move(projection, cell, per_moment)
    (found,) = rank_some(projection, [replace(score.best, effect=tried)])
    gained = found.best_evidence - charge - score.best_evidence + cell.doubt()
    if gained <= 0.0:
        return score
    return replace(found, evidence=score.evidence + gained)


def _move(
    projection: Projection, cell: PartMotion, per_moment: Floats
) -> tuple[PartMotion, float]:
    """Place a step with other moments of links, which cost some nats.

    Args:
        projection: The fit without it.
        cell: The step.
        per_moment: Slopes of its load by the moments of all links, (n, 6, 3).
    """
    links = links_beyond(cell.source)
    root = moment_root(projection.at.arm, links)
    load = covariate(projection.at, cell.source)
    half = float(np.ptp(load)) / 2
    slopes = per_moment[:, links[0] - 1 :].reshape(len(load), -1) @ root / half
    jump = _Jump(projection, cell.carrier.move(projection.at), load / half, slopes)
    known = dict(cell.heavier)
    start = np.array([known.get(k, np.zeros(3)) for k in links]).reshape(-1)
    start = np.linalg.solve(root, start)
    at, charge = jump.narrow(np.r_[cell.middle / half, start])
    more = (root @ at[1:]).reshape(-1, 3)
    heavier = tuple((k, tuple(map(float, m))) for k, m in zip(links, more, strict=True))
    return replace(cell, middle=float(at[0]) * half, heavier=heavier), charge
