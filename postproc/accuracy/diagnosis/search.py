"""The search: add the effect that is called for most, refit everything, look again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from postproc.accuracy.diagnosis.bootstrap import Null
from postproc.accuracy.diagnosis.candidate import FREE, NAMED, Candidate
from postproc.accuracy.diagnosis.folds import Gain, held_out_gain
from postproc.accuracy.diagnosis.library import Library
from postproc.accuracy.diagnosis.projection import Projection
from postproc.accuracy.diagnosis.refine import refine
from postproc.accuracy.diagnosis.score import Score, rank
from postproc.accuracy.effect import Effect, JointEffect
from postproc.accuracy.fit import Fit, fit_effects

MOST = 10  # additions
LEVEL = 0.01  # probability of a false addition, whole library
ALONE = 0.01  # level of the score test of the candidate itself
CLEARLY = (8.0, 0.1)  # nats, and share of the name's evidence, that a free form
#                       must be ahead by
BETTER = 1.0  # nats that replace one family by another
UNSTEADY = 1e-3  # level at which scatter that follows a law takes its name away
STANDS_IN = 0.5  # share of the name's evidence that a free form must have
LOOKED_AT = 4  # families whose settings are refined before the best is taken

Progress = Callable[[str], None]


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
    while len(found.additions) < MOST:
        progress(f"looking for effect {len(found.additions) + 1}")
        grown = _grow(found)
        if grown.refused is not None or grown.fit is found.fit:
            return withdraw(grown)
        found = _settle(grown)
    return withdraw(found)


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
    ahead = max(CLEARLY[0], CLEARLY[1] * name.evidence)
    return free if free.evidence > name.evidence + ahead else name


def _grow(found: Search) -> Search:
    """Add the best candidate, or say which one was refused."""
    best = choose(ranking(Projection.of(found.fit), found.library))
    p_value = found.null.p_value(best.evidence)
    if p_value > LEVEL or best.p_value > ALONE:
        return replace(found, refused=None)
    fit = extend(found.fit, best.best)
    gain = held_out_gain(fit, len(fit.combination.effects) - 1, best.best)
    added = Addition(best, p_value, gain)
    if not gain.sure:
        return replace(found, refused=added)
    return replace(found, fit=fit, additions=(*found.additions, added))


def extend(fit: Fit, candidate: Candidate, instead_of: int | None = None) -> Fit:
    """Refit everything with a candidate added, or in the place of an effect."""
    effects = list(fit.combination.effects)
    if instead_of is None:
        effects.append(candidate.effect)
    else:
        effects[instead_of] = candidate.effect
    return refit(fit, effects)


def _settle(found: Search) -> Search:
    """Look at every addition again, now that the others are in."""
    number = 0
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
    present = next((s for s in scores if s.family == old.family), best)
    if best.evidence < present.evidence + BETTER:
        best = present
    if best.best.effect == old.effect:
        return found
    return _instead(found, number, best)


def _instead(found: Search, number: int, best: Score) -> Search:
    """Put another candidate in the place of an addition."""
    place = found.place(number)
    fit = extend(found.fit, best.best, instead_of=place)
    gain = held_out_gain(fit, place, best.best)
    additions = list(found.additions)
    additions[number] = Addition(best, found.null.p_value(best.evidence), gain)
    return replace(found, fit=fit, additions=tuple(additions))


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
            found = _instead(found, number, same[0])
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


def _drop(found: Search, number: int) -> Search:
    """Take an addition out that the others have made superfluous."""
    effects = list(found.fit.combination.effects)
    del effects[found.place(number)]
    additions = (*found.additions[:number], *found.additions[number + 1 :])
    return replace(found, fit=refit(found.fit, effects), additions=additions)


def refit(fit: Fit, effects: Sequence[Effect]) -> Fit:
    """Fit other effects to the rows of a fit, beginning where it ended."""
    position = fit.error + fit.batch.walk.tcp
    return fit_effects(fit.batch, position, tuple(effects), fit.noise.origin, fit)
