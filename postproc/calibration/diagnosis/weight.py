"""Laws of the weight beside shapes of joints: the law stays, a shape gets what is left.

A joint that yields to the weight errs by its own angle for the most part, and so do its
gear and its encoder. A smooth shape of the angle therefore takes nearly all of the law
where it is looked at first, and what is then left of the law is little at every joint.
How much there is cannot be asked before there are shapes either: a wave of a gear is
like a torque. But weight pulls at all joints at once. So where a search took shapes,
all joints that carry weight are let yield together, in two ways: beside the shapes, and
before any shape, of which the search then takes what it still lacks. Joints that are
not needed beside the shapes go. What stays is taken where it is worth something beside
the same shapes, or where a model with the law is hardly behind one with shapes alone.

A law that some joints follow is no surprise at another one: there it need not stand out
from all that a search asks for, but only be worth what an effect of a fit must be.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.calibration.backward_elimination import ENOUGH, SURE, keep_needed
from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.held_out import compare_held_out
from postproc.calibration.diagnosis.score import Score, rank_some
from postproc.calibration.diagnosis.search import (
    NEAR,
    Addition,
    Progress,
    Search,
    extend,
    grow_on,
    settle,
    with_effects,
)
from postproc.calibration.regression import Fit
from postproc.calibration.report import impossible
from postproc.model.effects.compliance import Compliance, WeightEffect
from postproc.model.effects.effect import Candidate, JointEffect


def weigh_laws(found: Search, progress: Progress) -> Search:
    """Let joints yield to the weight where a search took shapes of their own angles.

    Args:
        found: The search.
        progress: Told what is being done.
    """
    own = [a.candidate for a in found.additions if a.candidate.family.joint != 1]
    shapes = [c for c in own if c.source == f"joint {c.family.joint}"]
    if not _lacking(found) or not any(
        isinstance(c.effect, JointEffect) for c in shapes
    ):
        return found
    start = replace(found, fit=found.base, additions=(), refused=None, ranked=None)
    before = _drop_unneeded(grow_on(_with_laws(start), progress))
    tried = [
        tried
        for tried, least in ((_drop_unneeded(_with_laws(found)), SURE), (before, -NEAR))
        if _together(tried) and _compare_searches(tried, found) > least
    ]
    if not tried:
        return found
    best = max(tried, key=lambda s: s.fit.log_evidence)
    settled = settle(grow_on(best, progress), 0)
    return settled if _compare_searches(settled, found) > -NEAR else found


def pass_on(found: Search, progress: Progress) -> Search:
    """Take a law of the weight at further joints, where one joint follows it.

    Args:
        found: The search.
        progress: Told what is being done.
    """
    grown = found
    while (more := _further(grown)) is not None:
        grown = more
    return found if grown is found else settle(grow_on(grown, progress), 0)


def _further(found: Search) -> Search | None:
    """Add the best further joint of a law that was found, None where there is none."""
    kinds = {a.candidate.family.effect for a in found.additions if _of_weight(a.score)}
    for score in found.ranking_under(found.fit):
        if not _of_weight(score) or score.family.effect not in kinds:
            continue
        if score.best_evidence < ENOUGH:
            return None
        place = len(found.fit.combination.effects)
        fit = extend(found.fit, score.best)
        added = _score_law(found, fit, place, score.best)
        grown = replace(
            found, fit=fit, additions=(*found.additions, added), ranked=None
        )
        if not _impossible(grown, len(grown.additions) - 1):
            return grown
    return None


def _of_weight(score: Score) -> bool:
    return isinstance(score.best.effect, WeightEffect)


def _compare_searches(tried: Search, found: Search) -> float:
    """Return by how many nats a search explains the rows better than another."""
    return tried.fit.log_evidence - found.fit.log_evidence


def _lacking(found: Search) -> list[Candidate]:
    """List the laws of joints that yield, of those that a fit does not have."""
    every = found.causes.library.shelves
    held = set(found.fit.combination.names)
    return [
        c
        for shelf in every
        for c in shelf.candidates
        if isinstance(c.effect, Compliance) and held.isdisjoint(c.names)
    ]


def _with_laws(found: Search) -> Search:
    """Add the laws that a search lacks, together."""
    laws = _lacking(found)
    effects = [*found.fit.combination.effects, *(c.effect for c in laws)]
    fit = with_effects(found.fit, effects)
    first = len(found.fit.combination.effects)
    added = tuple(_score_law(found, fit, first + k, c) for k, c in enumerate(laws))
    return replace(found, fit=fit, additions=(*found.additions, *added), ranked=None)


def _score_law(found: Search, fit: Fit, place: int, law: Candidate) -> Addition:
    seen = Projection.of(fit, without=place)
    score = rank_some(seen, [law])[0]
    gain = compare_held_out(fit, place, law)
    return Addition(score, found.null.p_of(score), gain, together=True)


def _together(found: Search) -> tuple[int, ...]:
    """Number the additions that were weighed together."""
    return tuple(k for k, a in enumerate(found.additions) if a.together)


def _drop_unneeded(found: Search) -> Search:
    """Drop laws that are not needed beside all else, or that nothing can follow."""
    asked = {found.place(k): k for k in _together(found)}
    effects = found.fit.combination.effects
    always = tuple(e for p, e in enumerate(effects) if p not in asked)
    kept = keep_needed(found.fit, always)
    return _only(found, {k for p, k in asked.items() if effects[p] in kept})


def _only(found: Search, kept: set[int]) -> Search:
    """Keep some of the laws that were weighed together, those that physics allows."""
    while True:
        out = set(_together(found)) - kept
        if out:
            left = [k for k in range(len(found.additions)) if k not in out]
            found, kept = _without(found, out), {left.index(k) for k in kept}
        bad = {k for k in kept if _impossible(found, k)}
        if not bad:
            return found
        kept = kept - bad


def _impossible(found: Search, number: int) -> bool:
    """Tell whether a joint yields against the weight, or predicts nothing."""
    place = found.place(number)
    own = np.zeros(len(found.fit.values), dtype=bool)
    own[found.fit.combination.slices[place]] = True
    gain = compare_held_out(found.fit, place, found.additions[number].candidate)
    return bool(impossible(found.fit, own)) or not gain.sure


def _without(found: Search, out: set[int]) -> Search:
    """Take some additions out of a search."""
    places = {found.place(k) for k in out}
    every = enumerate(found.fit.combination.effects)
    fit = with_effects(found.fit, [e for p, e in every if p not in places])
    additions = tuple(a for k, a in enumerate(found.additions) if k not in out)
    return replace(found, fit=fit, additions=additions, ranked=None)
