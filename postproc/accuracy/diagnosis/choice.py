"""Which candidate to take: families ranked, names before free forms."""

from __future__ import annotations

from postproc.accuracy.diagnosis.candidate import FREE, NAMED
from postproc.accuracy.diagnosis.library import Library
from postproc.accuracy.diagnosis.projection import Projection
from postproc.accuracy.diagnosis.refine import refine
from postproc.accuracy.diagnosis.score import Score, rank

CLEARLY = (8.0, 0.1)  # nats, and share of the name's evidence, that a free form
#                       must be ahead by
LOOKED_AT = 4  # families whose settings are refined before the best is taken
FORERUNNER = "backlash"  # what these are variations of, where the model lacks it
VARIATIONS = ("backlash_profile", "load_backlash", "windup")


def ranking(projection: Projection, library: Library) -> list[Score]:
    """Score the library, the settings of the leading families refined."""
    square = float(projection.rest @ projection.rest)
    reduced = library.reduce(projection, projection.rest[:, None])
    known = frozenset(projection.names)
    scores = rank(reduced, square, projection.rows, without=known)
    leading: list[Score] = []
    for tier in (NAMED, FREE):
        leading += [s for s in scores if s.family.tier == tier][:LOOKED_AT]
    refined = [refine(projection, s) for s in leading]
    rest = [s for s in scores if s not in leading]
    return sorted([*refined, *rest], key=lambda s: -s.evidence)


def choose(scores: list[Score]) -> Score:
    """Take the best name, unless a free form is clearly ahead of it."""
    name = next(s for s in scores if s.family.tier == NAMED)
    free = next((s for s in scores if s.family.tier == FREE), name)
    lead = free.evidence - name.evidence
    return _forerunner(free if lead > ahead(name.evidence) else name, scores)


def ahead(evidence: float) -> float:
    """Return by how much a free form must be ahead of so much evidence [nats]."""
    return max(CLEARLY[0], CLEARLY[1] * evidence)


def _forerunner(best: Score, scores: list[Score]) -> Score:
    """Take plain backlash before what varies it, where the joint has none yet."""
    if best.family.effect not in VARIATIONS:
        return best
    plain = (FORERUNNER, best.family.joint)
    for s in scores:
        if (s.family.effect, s.family.joint) == plain and s.evidence > CLEARLY[0]:
            return s
    return best
