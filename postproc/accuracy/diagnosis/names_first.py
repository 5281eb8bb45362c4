"""A free form must not stand for causes that have names.

One name need not reach what two causes do together, gravity on two joints for
instance, while a free form of something that goes along with both does. Before a free
form is taken, names are therefore added for trial, one after the other: where they
leave it nothing to explain, they are what the rows call for.
"""

from __future__ import annotations

from postproc.accuracy.diagnosis.bootstrap import Null
from postproc.accuracy.diagnosis.candidate import NAMED
from postproc.accuracy.diagnosis.choice import ahead, ranking
from postproc.accuracy.diagnosis.extending import extend
from postproc.accuracy.diagnosis.library import Library
from postproc.accuracy.diagnosis.projection import Projection
from postproc.accuracy.diagnosis.score import Score
from postproc.accuracy.fitted import Fit

CHAIN = 3  # names that together may stand for a free form


def names_instead(
    fit: Fit, library: Library, null: Null, level: float, scores: list[Score]
) -> Score | None:
    """Find the name to take before a free form, or None where names do not do.

    Args:
        fit: The fit that lacks something.
        library: All candidates.
        null: Distribution of the largest evidence when there is nothing.
        level: Largest p-value of a name that is tried.
        scores: The ranking under the fit; its first is the free form.
    """
    free, first = scores[0], None
    for _ in range(CHAIN):
        name = _best_name(scores, free.family.joint)
        if name is None or null.p_value(name.evidence) > level:
            return None
        first = first or name
        fit = extend(fit, name.best)
        scores = ranking(Projection.of(fit), library)
        left = next((s.evidence for s in scores if s.family == free.family), 0.0)
        if left < ahead(free.evidence):
            return first
    return None


def _best_name(scores: list[Score], joint: int | None) -> Score | None:
    """Find the best name, of a joint if one is given."""
    for s in scores:
        if s.family.tier == NAMED and joint in (None, s.family.joint):
            return s
    return None
