"""The search: add the effect that is called for most, refit everything, look again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from postproc.accuracy.diagnosis.bootstrap import Null
from postproc.accuracy.diagnosis.candidate import FREE, NAMED, Candidate
from postproc.accuracy.diagnosis.choice import choose, ranking
from postproc.accuracy.diagnosis.extending import extend, without
from postproc.accuracy.diagnosis.folds import Gain, held_out_gain
from postproc.accuracy.diagnosis.library import Library
from postproc.accuracy.diagnosis.names_first import names_instead
from postproc.accuracy.diagnosis.projection import Projection
from postproc.accuracy.diagnosis.score import Score
from postproc.accuracy.fitted import Fit

MOST = 12  # additions
LEVEL = 0.01  # probability of a false addition, whole library
ALONE = 0.01  # level of the score test of the candidate itself
BETTER = 1.0  # nats that replace one family by another
RECENT = 2  # additions looked at again after each further one

Progress = Callable[[str, float], None]  # what is done, and how far everything is


@dataclass(frozen=True)
class Addition:
    """An effect that was added.

    Attributes:
        score: Evidence when it was chosen, settings refined.
        p_value: Probability that noise alone reaches the evidence anywhere.
        gain: What it brings on held-out rows.
    """

    score: Score
    p_value: float
    gain: Gain

    @property
    def candidate(self) -> Candidate:
        """The candidate."""
        return self.score.best


@dataclass(frozen=True, eq=False)
class Search:
    """What a search found.

    Attributes:
        base: Fit of the model that was given.
        fit: Fit with all additions.
        library: All candidates.
        additions: In the order of addition; they are the last effects of `fit`.
        null: Distribution of the largest evidence when there is nothing.
        refused: The candidate that the search stopped at, if there was one.
    """

    base: Fit
    fit: Fit
    library: Library
    additions: tuple[Addition, ...]
    null: Null
    refused: Addition | None

    def place(self, number: int) -> int:
        """Return the place of an addition among the effects of the fit."""
        count = len(self.fit.combination.effects)
        return count - len(self.additions) + number


def search(base: Fit, library: Library, null: Null, progress: Progress) -> Search:
    """Search for effects that a fit lacks.

    Args:
        base: The fit.
        library: All candidates.
        null: Distribution of the largest evidence under the fit.
        progress: Told what is being done.
    """
    found = Search(base, base, library, (), null, None)
    for number in range(MOST):
        progress(f"looking for effect {number + 1}", 0.1 + 0.4 * number / MOST)
        grown = _grow(found)
        if grown.fit is found.fit:
            found = grown
            break
        found = _settle(grown, len(grown.additions) - RECENT)
    return _settle(found, 0) if len(found.additions) > RECENT else found


def _grow(found: Search) -> Search:
    """Add the best candidate, or say which one was refused."""
    best = _best(found, ranking(Projection.of(found.fit), found.library))
    p_value = found.null.p_value(best.evidence)
    if p_value > LEVEL or best.p_value > ALONE:
        return replace(found, refused=None)
    fit = extend(found.fit, best.best)
    gain = held_out_gain(fit, len(fit.combination.effects) - 1, best.best)
    added = Addition(best, p_value, gain)
    if not gain.sure:
        return replace(found, refused=added)
    return replace(found, fit=fit, additions=(*found.additions, added))


def _best(found: Search, scores: list[Score]) -> Score:
    """Choose among scores under the fit of a search, names before free forms."""
    best = choose(scores)
    if best.family.tier == NAMED:
        return best
    rivals = [best, *(s for s in scores if s != best)]
    name = names_instead(found.fit, found.library, found.null, LEVEL, rivals)
    return name or best


def _settle(found: Search, first: int) -> Search:
    """Look again at additions from some number on, now that the others are in."""
    number = max(first, 0)
    while number < len(found.additions):
        again = _again(found, number)
        number += len(again.additions) == len(found.additions)
        found = again
    return found


def _again(found: Search, number: int) -> Search:
    """Keep an addition, replace it by what now fits better, or drop it."""
    place = found.place(number)
    old = found.additions[number].candidate
    scores = ranking(Projection.of(found.fit, without=place), found.library)
    best = choose(scores)
    if found.null.p_value(best.evidence) > LEVEL:
        return _drop(found, number)
    if best.family.tier == FREE and old.family.tier == NAMED:
        best = _best(_drop(found, number), scores)
    present = next((s for s in scores if s.family == old.family), best)
    if best.evidence < present.evidence + BETTER:
        best = present
    other = found
    if best.best.effect != old.effect:
        other = put_instead(found, number, best)
    return _confirmed(found, number) if other is found else other


def put_instead(found: Search, number: int, best: Score) -> Search:
    """Put another candidate in the place of an addition, if it predicts held-out rows.

    Returns:
        The search as it was where the candidate's gain is not sure.
    """
    place = found.place(number)
    fit = extend(found.fit, best.best, instead_of=place)
    gain = held_out_gain(fit, place, best.best)
    if not gain.sure:
        return found
    additions = list(found.additions)
    additions[number] = Addition(best, found.null.p_value(best.evidence), gain)
    return replace(found, fit=fit, additions=tuple(additions))


def _confirmed(found: Search, number: int) -> Search:
    """Keep an addition if it still predicts held-out rows with all others in."""
    addition = found.additions[number]
    gain = held_out_gain(found.fit, found.place(number), addition.candidate)
    if not gain.sure:
        return _drop(found, number)
    additions = list(found.additions)
    additions[number] = replace(addition, gain=gain)
    return replace(found, additions=tuple(additions))


def _drop(found: Search, number: int) -> Search:
    """Take an addition out that is not called for any more."""
    fit = without(found.fit, found.place(number))
    additions = (*found.additions[:number], *found.additions[number + 1 :])
    return replace(found, fit=fit, additions=additions)
