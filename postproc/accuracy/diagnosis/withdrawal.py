"""Taking names back that promise more than they explain."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from postproc.accuracy.diagnosis.bootstrap import Null
from postproc.accuracy.diagnosis.candidate import FREE
from postproc.accuracy.diagnosis.choice import ranking
from postproc.accuracy.diagnosis.library import Library
from postproc.accuracy.diagnosis.projection import Projection
from postproc.accuracy.diagnosis.search import Progress, Search, put_instead, search
from postproc.accuracy.fitted import Fit
from postproc.model.effects.effect import JointEffect

UNSTEADY = 1e-4  # level at which scatter that follows a law takes its name away
STANDS_IN = 0.9  # share of the name's evidence that a free form must have


def investigate(base: Fit, library: Library, null: Null, progress: Progress) -> Search:
    """Search for what a fit lacks, and take back names that do not hold."""
    return withdraw(search(base, library, null, progress))


def withdraw(found: Search) -> Search:
    """Take names back whose law does not hold: the scatter follows the law's size.

    Rows at which a law is large then err more than others, which its mean cannot show:
    something that no covariate tells drives it too. A free form takes its place.
    """
    for number, addition in enumerate(found.additions):
        place, family = found.place(number), addition.candidate.family
        effect = found.fit.combination.effects[place]
        if family.tier == FREE or not isinstance(effect, JointEffect):
            continue
        without = Projection.of(found.fit, without=place)
        if incomplete(without, effect, place) > UNSTEADY:
            continue
        scores = ranking(without, found.library)
        free = [s for s in scores if s.family.tier == FREE]
        same = [s for s in free if s.family.joint == family.joint]
        if same and same[0].evidence > STANDS_IN * addition.score.evidence:
            found = put_instead(found, number, same[0])
    return found


def incomplete(projection: Projection, effect: JointEffect, place: int) -> float:
    """Test whether the scatter of a joint follows the size of a law; the p-value.

    Args:
        projection: The fit with the law left out: what only the law can explain counts.
        effect: The law.
        place: Its place in the fit.
    """
    fit = projection.fit
    part = fit.combination.slices[place]
    moved = fit.whiten(fit.columns[:, :, part] @ fit.values[part])
    own = projection.filter(moved[:, None]).reshape(-1, 3)
    axis = fit.whiten(fit.batch.jacobian[:, :, int(effect.acts_on()[0])])
    axis = axis.reshape(-1, 3)
    axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-12)
    square = np.einsum("nk,nk->n", axis, fit.whiten(fit.residual).reshape(-1, 3)) ** 2
    size = (own**2).sum(axis=1)
    size, square = size - size.mean(), square - square.mean()
    spread = float(np.sqrt((size**2).sum() * (square**2).mean()))
    return float(norm.sf(float(size @ square) / max(spread, 1e-300)))
