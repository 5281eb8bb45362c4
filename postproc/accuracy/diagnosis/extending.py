"""A fit with other effects, refitted to the same rows."""

from __future__ import annotations

from collections.abc import Sequence

from postproc.accuracy.diagnosis.candidate import Candidate
from postproc.accuracy.fit import fit_effects
from postproc.accuracy.fitted import Fit
from postproc.model.effects.effect import Effect


def extend(fit: Fit, candidate: Candidate, instead_of: int | None = None) -> Fit:
    """Refit everything with a candidate added, or in the place of an effect."""
    effects = list(fit.combination.effects)
    if instead_of is None:
        effects.append(candidate.effect)
    else:
        effects[instead_of] = candidate.effect
    return with_effects(fit, effects)


def without(fit: Fit, place: int) -> Fit:
    """Refit everything without one effect."""
    effects = list(fit.combination.effects)
    del effects[place]
    return with_effects(fit, effects)


def with_effects(fit: Fit, effects: Sequence[Effect]) -> Fit:
    """Fit other effects to the rows of a fit, beginning where it ended."""
    position = fit.error + fit.batch.walk.tcp
    return fit_effects(fit.batch, position, tuple(effects), fit.noise.origin, fit)
