"""The search: add the effect that is called for most, refit everything, look again."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.held_out import (
    Folds,
    Gain,
    compare_held_out,
    regions,
)
from postproc.calibration.diagnosis.jumps import jumps
from postproc.calibration.diagnosis.load_jumps import place_load_jump
from postproc.calibration.diagnosis.model_update import revises
from postproc.calibration.diagnosis.score import Null, Score, rank, rank_some
from postproc.calibration.diagnosis.table import Causes, free_carrier
from postproc.calibration.regression import Fit, beside, fit_effects
from postproc.model.carrier import Carrier, carrier
from postproc.model.covariate import JOINTS, covariate
from postproc.model.effects.compliance import WeightEffect
from postproc.model.effects.curve import Curve
from postproc.model.effects.effect import (
    FREE,
    NAMED,
    PART_MOTION,
    Candidate,
    Effect,
    Family,
)
from postproc.model.effects.joint_offset import JointOffset
from postproc.model.effects.part_motion import OF_STATE, PartMotion
from postproc.model.kinematics import ArmStates

# Finer settings around a candidate that a grid found.

HARDLY = 2.0  # nats
OFFSETS = np.linspace(-1.0, 1.0, 9)
LEVELS = tuple(0.5**k for k in range(9))  # widths tried, in steps of the grid
TURNS = 4  # times that a width is tried while settings of several kinds get better
IDLE = 5  # widths in a row at which nothing is gained
SETTLED = 0.3  # nats: finer settings no longer matter


def refine(projection: Projection, score: Score) -> Score:
    """Improve the settings of a score's best candidate by its evidence.

    The evidence of the family becomes that of the finer points, averaged over the part
    of the grid that they stand for: a sharp peak between two points of the grid counts,
    but only as much of the prior as it covers.
    """
    idle = 0
    for width in LEVELS:
        turns, gained = 0, np.inf
        while turns < TURNS and gained > SETTLED:
            score, gained = _finer(projection, score, width)
            turns += 1
        idle = idle + 1 if turns == 1 else 0
        if idle > IDLE:
            break
    score = place_load_jump(projection, score)
    plain = score.best.effect.plainer()
    if plain == score.best.effect:
        return score
    # A plainer effect, say a whole order of a gear, where it does hardly worse.
    return _instead(projection, score, replace(score.best, effect=plain), HARDLY)


def _finer(projection: Projection, score: Score, width: float) -> tuple[Score, float]:
    """Take the best settings around those of a score, and what is gained [nats]."""
    here, share = score.best.effect, score.best.log_prior
    effects = [here, *here.refine(width * OFFSETS, projection.at)]
    if len(effects) == 1:
        return score, 0.0
    tries = [replace(score.best, effect=e, log_prior=-e.doubt()) for e in effects]
    found = rank_some(projection, tries)[0]
    charge = found.best.effect.doubt() - here.doubt()
    gained = found.best_evidence - score.best_evidence - charge
    if gained <= 0.0:
        return score, gained
    covered = share + float(np.log(2.0 * width / len(tries)))
    best = replace(found.best, log_prior=share)
    evidence = max(score.evidence, found.evidence + covered)
    return replace(found, best=best, evidence=evidence), gained


def lawful(projection: Projection, score: Score, law: Candidate | None) -> Score:
    """Take a law with a place instead of a free curve that is not clearly ahead."""
    if law is None:
        return score
    (found,) = rank_some(projection, [law])
    found = refine(projection, found)
    if found.best_evidence < score.best_evidence - NEAR:
        return score
    return replace(found, evidence=max(found.evidence, score.evidence))


def readable(projection: Projection, score: Score, causes: Causes) -> Score:
    """Take what follows what a job can read, unless the other is clearly ahead."""
    form = score.best.effect.readable(projection.at, causes.without)
    if form is None:
        return score
    effect, source = form
    tried = replace(score.best, effect=effect, source=source)
    return _instead(projection, score, tried, ahead(score.best_evidence))


def _instead(
    projection: Projection, score: Score, tried: Candidate, by: float
) -> Score:
    """Take another candidate of a family, unless its best is ahead by so many nats."""
    found = rank_some(projection, [tried])[0]
    if found.best_evidence < score.best_evidence - by:
        return score
    return replace(found, evidence=score.evidence)


# Which candidate to take: families ranked, names before free forms.

SAME = 0.5  # nats within which two carriers move alike
EXPECTED = 3.0  # nats: odds of 20 to 1 for a law that other joints follow
LAWFUL = 0.03  # the same share for a law without a name
CLEARLY = (8.0, 0.1)  # nats, and share of the name's evidence, that a free form
#                       must be ahead by
LOOKED_AT = 4  # families whose settings are refined before the best is taken


def ranking(projection: Projection, causes: Causes) -> list[Score]:
    """Score the library, the settings of the leading families refined.

    Where a given model is revised, a law of a joint is scored beside the zero of this
    joint, which holds the law's mean: it must explain more than a joint that was
    mastered again.
    """
    views = Views(projection)
    scores = []
    for joint, moved in ((None, False), *product(JOINTS, (False, True))):
        some = causes.library.of_mean(joint, moved)
        if some.shelves:
            view = views.of_joint(joint, moved)
            square = float(view.rest @ view.rest)
            reduced = some.reduce(view, view.rest[:, None])
            known = frozenset(view.names)
            scores += rank(reduced, square, view.rows, without=known)
    if causes.table is not None:
        scores += causes.table.scores(views.of_carrier)
        scores += causes.table.score_moved_parts(projection)
    scores = [raise_expected(s, projection) for s in scores]
    scores.sort(key=lambda s: -s.evidence)
    leading: list[Score] = []
    for tier in (NAMED, FREE):
        leading += [s for s in scores if s.family.tier == tier][:LOOKED_AT]
    refined = []
    for score in leading:
        view = views.of(score.family, score.best.effect)
        found = lawful(view, refine(view, score), score.law)
        refined.append(readable(view, found, causes))
    rest = [s for s in scores if s not in leading]
    rest += jumps(refined[0], projection)
    return sorted([*refined, *rest], key=lambda s: -s.evidence)


def raise_expected(score: Score, projection: Projection) -> Score:
    """Raise the evidence of a law of the weight that other joints follow.

    Weight pulls at all joints at once: what yields at two of them does at a third.
    """
    effect = score.best.effect
    followed = any(n.startswith(f"{effect.name}.") for n in projection.names)
    if not (isinstance(effect, WeightEffect) and followed):
        return score
    return replace(score, evidence=score.evidence + EXPECTED)


@dataclass(frozen=True, eq=False)
class Views:
    """A fit, seen with what holds the mean of what a candidate moves.

    Attributes:
        projection: The fit.
        made: Those that were asked for.
    """

    projection: Projection
    made: dict[tuple[int, bool] | str, Projection] = field(default_factory=dict)

    def of_joint(self, joint: int | None, moved: bool = False) -> Projection:
        """See it with the zero of a joint, from 1, open, or moved by something."""
        if joint is None:
            return self.projection
        if (joint, moved) not in self.made:
            made = free_joint_zero(self.projection, joint, moved)
            self.made[joint, moved] = made
        return self.made[joint, moved]

    def of_carrier(self, carrier: Carrier) -> Projection:
        """See it with a constant motion of a carrier open, where a model is given."""
        if carrier.joint is not None:
            return self.of_joint(carrier.joint)
        if not revises(self.projection.fit):
            return self.projection
        if str(carrier) not in self.made:
            self.made[str(carrier)] = free_carrier(self.projection, carrier)
        return self.made[str(carrier)]

    def of(self, family: Family, effect: Effect) -> Projection:
        """See it as a candidate is seen."""
        if family.along is not None:
            return self.of_carrier(carrier(family.along))
        joint = family.joint if effect.has_mean() else None
        return self.of_joint(joint, effect.sets_zero)


def free_joint_zero(
    projection: Projection, joint: int, moved: bool = False
) -> Projection:
    """Return a filter that takes the zero of a joint, from 1, out of the rows too.

    It is the same where no given model is revised, or its zero is open already.
    """
    fit = projection.fit
    first, *others = fit.combination.effects or (JointOffset(()),)
    offsets = [j for e in others if isinstance(e, JointOffset) for j in e.joints]
    opened = first.free_zeros((joint,), moved)
    if joint in offsets or opened is first:
        return projection
    laid = beside(fit, (opened, *others))
    left = {n for n in fit.combination.names if n not in projection.names}
    out = [k for k, n in enumerate(laid.combination.names) if n in left]
    return Projection.leaving(laid, np.array(out, dtype=np.int64))


def choose(scores: list[Score]) -> Score:
    """Take the best name, unless a free form is clearly ahead of it.

    A free form of the torque never comes before the law of the same torque, which is
    what a joint that yields does: the law stays, and the free form gets what it leaves.
    """
    names = [s for s in scores if s.family.tier == NAMED]
    name = max(names, key=lambda s: s.evidence - s.best.effect.least_evidence())
    free = next((s for s in scores if s.family.tier == FREE), name)
    if free.evidence - name.evidence > find_margin(name, free):
        return _law(free, names) or plainest(free, scores)
    plain = (name.best.effect.variation_of, name.family.joint)
    for s in scores:
        if (s.family.effect, s.family.joint) == plain and s.evidence > CLEARLY[0]:
            return s
    return name


def find_margin(name: Score, free: Score) -> float:
    """Return by how much a free form must be ahead of a name [nats].

    A law with one or two numbers is no freer than a name: it must be ahead for sure. A
    step happens at one row: what varies smoothly and explains the rows as well, does. A
    jump where the arm passed a temperature once is rarer than a crash or a tool that
    slips, and takes their place where it explains more.
    """
    effect = free.best.effect
    if free.family.effect != PART_MOTION or effect.free:
        return ahead(name.evidence)
    if name.best.effect.at_one_row and not effect.at_one_row:
        return NEAR if isinstance(effect, PartMotion) and effect.law == "step" else 0.0
    return max(CLEARLY[0], LAWFUL * name.evidence)


def plainest(best: Score, scores: list[Score]) -> Score:
    """Take the plainest of the cells that explain as much as the best one.

    What a job can read comes before what passes with time unless that is clearly ahead,
    few numbers before many, and of those that are the same a joint before a link.
    """
    if best.family.effect != PART_MOTION:
        return best
    cells = [s for s in scores if s.family.effect == PART_MOTION]
    if best.best.effect.belongs_to() == "setup":
        least = best.evidence - ahead(best.evidence)
        read = [s for s in cells if s.best.effect.belongs_to() != "setup"]
        best = next((s for s in read if s.evidence > least), best)
    same = [s for s in cells if s.evidence > best.evidence - NEAR]

    def order(s: Score) -> tuple[bool, int, float]:
        set_up = s.best.effect.belongs_to() == "setup"
        joints_first = SAME if s.family.joint else 0.0
        return set_up, s.best.width, -s.evidence - joints_first

    return min(same, key=order)


def _law(free: Score, names: list[Score]) -> Score | None:
    """Find the law by the torque that drives a free form, if rows speak for it."""
    source = free.best.source
    for s in names if source.startswith("torque") else ():
        same = s.family.joint == free.family.joint and s.best.source == source
        if same and s.evidence > CLEARLY[0]:
            return s
    return None


def ahead(evidence: float) -> float:
    """Return by how much a free form must be ahead of so much evidence [nats]."""
    return max(CLEARLY[0], CLEARLY[1] * evidence)


# A fit with other effects, refitted to the same rows.


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
    """Fit other effects to the rows of a fit, beginning where it ended.

    The first of them is the given model where one is revised: it counts as known beside
    the others.
    """
    origin, effects = fit.noise.origin, tuple(effects)
    if effects:
        effects = (effects[0].beside(effects[1:]), *effects[1:])
    return fit_effects(fit.batch, fit.position, effects, origin, fit)


# A free form must not stand for causes that have names.
#
# One name need not reach what two causes do together, gravity on two joints for
# instance, while a free form of something that goes along with both does. Before a free
# form is taken, names are therefore added for trial, one after the other: where they
# leave it nothing to explain, they are what the rows call for.

CHAIN = 3  # names that together may stand for a free form


def names_instead(
    fit: Fit, causes: Causes, null: Null, level: float, scores: list[Score]
) -> Score | None:
    """Find the name to take before a free form, or None where names do not do.

    Args:
        fit: The fit that lacks something.
        causes: All candidates.
        null: Distribution of the largest evidence when there is nothing.
        level: Largest p-value of a name that is tried.
        scores: The ranking under the fit; its first is the free form.
    """
    free, first, joint = scores[0], None, scores[0].family.joint
    one_cause = free.family.effect == PART_MOTION  # names must explain more than it
    alone = extend(fit, free.best).log_evidence if one_cause else -np.inf
    for _ in range(CHAIN):
        names = (s for s in scores if s.family.tier == NAMED)
        name = next((s for s in names if joint in (None, s.family.joint)), None)
        if name is None or null.p_of(name) > level:
            return None
        first = first or name
        fit = extend(fit, name.best)
        scores = ranking(Projection.of(fit), causes)
        left = next((s.evidence for s in scores if s.family == free.family), 0.0)
        if left < ahead(free.evidence):
            more = NEAR if first.best.effect.at_one_row else 0.0
            return first if fit.log_evidence > alone + more else None
    return None


# The search: add the effect that is called for most, refit everything, look again.

MOST = 12  # additions
LEVEL = 0.005  # probability of a false addition, whole library
ALONE = 0.01  # level of the score test of the candidate itself
BETTER = 1.0  # nats that replace one family by another
NEAR = 3.0  # nats within which two causes are told together: odds of 20 to 1
CERTAIN = 3.0  # standard errors by which one must predict other regions better
MOST_OTHERS = 2  # that are told, and asked
MOST_CELLS = 5  # the same of a cell without a name
LOAD = re.compile(r"torque \d|moment \d[xy]")
ALIKE = 0.98  # correlation of two loads that are one but for the weights of links
ALWAYS = "constant"  # driver and law of a part that has moved once
SAME_LOAD = 0.5  # part of the evidence that one may be behind the other
RECENT = 2  # additions looked at again after each further one

Progress = Callable[[str, float], None]  # what is done, and how far everything is


@dataclass(frozen=True)
class Addition:
    """An effect that was added.

    Attributes:
        score: Evidence when it was chosen, settings refined.
        p_value: Probability that noise alone reaches the evidence anywhere.
        gain: What it brings on held-out rows.
        together: Whether it was weighed with others as one cause, not by itself.
    """

    score: Score
    p_value: float
    gain: Gain
    together: bool = False

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
        causes: All candidates.
        near: Names, and the cells that were among the best so far.
        additions: In the order of addition; they are the last effects of `fit`.
        null: Distribution of the largest evidence when there is nothing.
        refused: The candidate that the search stopped at, if there was one.
        ranked: The last fit that the library was ranked under, and its ranking.
        waves: How many of the last additions came out of maps; the library need not
            hold their orders.
    """

    base: Fit
    fit: Fit
    causes: Causes
    near: Causes
    additions: tuple[Addition, ...]
    null: Null
    refused: Addition | None
    ranked: tuple[Fit, list[Score]] | None = None
    waves: int = 0

    def ranking_under(self, fit: Fit) -> list[Score]:
        """Rank the library by what a fit lacks, if that is not known already."""
        if self.ranked is not None and self.ranked[0] is fit:
            return self.ranked[1]
        return ranking(Projection.of(fit), self.near)

    def place(self, number: int) -> int:
        """Return the place of an addition among the effects of the fit."""
        count = len(self.fit.combination.effects)
        return count - len(self.additions) + number


def search(base: Fit, causes: Causes, null: Null, progress: Progress) -> Search:
    """Search for effects that a fit lacks.

    Args:
        base: The fit.
        causes: All candidates.
        null: Distribution of the largest evidence under the fit.
        progress: Told what is being done.
    """
    return grow_on(Search(base, base, causes, causes, (), null, None), progress)


def grow_on(found: Search, progress: Progress) -> Search:
    """Go on with a search until nothing more is called for, and look at all again.

    Args:
        found: The search so far.
        progress: Told what is being done.
    """
    for number in range(MOST):
        progress(f"looking for effect {number + 1}", 0.1 + 0.4 * number / MOST)
        grown = _grow(found)
        if grown.fit is found.fit:
            found = grown
            break
        found = settle(grown, len(grown.additions) - RECENT)
    if len(found.additions) <= RECENT:
        return found
    return settle(found, 0, elsewhere=True)


def _grow(found: Search) -> Search:
    """Add the best candidate, or say which one was refused."""
    near = found.causes.narrow(Views(Projection.of(found.fit)).of_carrier, found.near)
    found = replace(found, near=near)
    scores = found.ranking_under(found.fit)
    found = replace(found, ranked=(found.fit, scores))
    best = _best(found, scores)
    p_value = found.null.p_of(best)
    if p_value > LEVEL or best.p_value > ALONE:
        return replace(found, refused=None)
    fit = extend(found.fit, best.best)
    gain = compare_held_out(fit, len(fit.combination.effects) - 1, best.best)
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
    name = names_instead(found.fit, found.near, found.null, LEVEL, rivals)
    return name or best


def settle(found: Search, first: int, elsewhere: bool = False) -> Search:
    """Look again at additions from some number on, now that the others are in.

    Args:
        found: The search.
        first: The number.
        elsewhere: Whether names that are alike are asked of regions of joint space.
    """
    number = max(first, 0)
    while number < len(found.additions) - found.waves:
        if found.additions[number].together:
            number += 1
            continue
        again = _again(found, number, elsewhere)
        number += len(again.additions) == len(found.additions)
        found = again
    return found


def _again(found: Search, number: int, elsewhere: bool) -> Search:
    """Keep an addition, replace it by what now fits better, or drop it."""
    place = found.place(number)
    old = found.additions[number].candidate
    scores = ranking(Projection.of(found.fit, without=place), found.near)
    best = choose(scores)
    if found.null.p_of(best) > LEVEL:
        return _drop(found, number)
    if best.family.tier == FREE and old.family.tier == NAMED:
        best = _best(_drop(found, number), scores)
    present = next((s for s in scores if s.family == old.family), best)
    if best.evidence < present.evidence + BETTER:
        best = present
    if elsewhere and best is present:
        best = predicts_elsewhere(found, place, present, scores)
    other = found
    if best.best.effect != old.effect:
        other = put_instead(found, number, best)
    return _confirm_addition(found, number) if other is found else other


def predicts_elsewhere(
    found: Search, place: int, present: Score, scores: list[Score]
) -> Score:
    """Take the name, of those alike, that predicts regions of joint space best.

    What was chosen early was chosen while much else was missing. Where the rows hardly
    tell it from another name, poses that had no part in fitting either do.

    Args:
        found: The search.
        place: Place of the effect in question among those of its fit.
        present: Its score.
        scores: Those of all that could take its place.
    """
    if present.family.tier != NAMED:
        return present
    fit = found.fit
    region = regions(fit.batch.states.q)
    best, left = present, Folds.of_fit(fit, region).errors()[0]
    for rival in tied_candidates(present.family, present.evidence - NEAR, scores):
        other = extend(fit, rival.best, instead_of=place)
        other = replace(other, noise=fit.noise, rows=fit.rows, whitener=fit.whitener)
        less = Folds.of_fit(other, region).errors()[0]
        gain = Gain.between(left, less, fit)
        if gain.mean > CERTAIN * gain.std_error:
            best, left = rival, less
    return best


def tied_candidates(own: Family, least: float, scores: list[Score]) -> list[Score]:
    """List the best names, but for a family's own, that have some evidence [nats]."""
    name = (own.effect, own.joint)
    names = [s for s in scores if s.family.tier == NAMED and s.evidence >= least]
    return [s for s in names if (s.family.effect, s.family.joint) != name][:MOST_OTHERS]


def put_instead(found: Search, number: int, best: Score) -> Search:
    """Put another candidate in the place of an addition, if it predicts held-out rows.

    Returns:
        The search as it was where the candidate's gain is not sure.
    """
    place = found.place(number)
    fit = extend(found.fit, best.best, instead_of=place)
    gain = compare_held_out(fit, place, best.best)
    if not gain.sure:
        return found
    additions = list(found.additions)
    additions[number] = Addition(best, found.null.p_of(best), gain)
    return replace(found, fit=fit, additions=tuple(additions))


def _confirm_addition(found: Search, number: int) -> Search:
    """Keep an addition if it still predicts held-out rows with all others in."""
    addition = found.additions[number]
    gain = compare_held_out(found.fit, found.place(number), addition.candidate)
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


# Which other causes would explain the same rows just as well.
#
# A name is preferred to a free form that is not clearly ahead of it, but that does not
# make the rows speak for the name: such a free form is told with it.


@dataclass(frozen=True)
class JudgedAddition:
    """An addition judged with everything else in the model.

    Attributes:
        evidence: What speaks for it [nats].
        p_value: Probability that noise alone reaches that anywhere in the library.
        confusable: Families that explain the same within a few nats, best first.
    """

    evidence: float
    p_value: float
    confusable: tuple[Score, ...]


def stand(found: Search, number: int) -> JudgedAddition:
    """Judge one addition of a search against all that could take its place."""
    own = found.additions[number].candidate
    projection = Projection.of(found.fit, without=found.place(number))
    scores = ranking(projection, found.near)
    here = next((s for s in scores if s.family == own.family), None)
    if number >= len(found.additions) - found.waves:
        here = rank_some(projection, [own])[0]
    if here is None:
        here = found.additions[number].score
    rivals = []
    names = {_name(own.family)}
    for s in scores:
        name = _name(s.family)
        # A law of two covariates is one of many that are alike: the free form of the
        # same two is named with it unless the law is clearly ahead.
        alike = own.source == s.best.source and " x " in own.source
        within = CLEARLY[0] if alike and s.best.family.tier == FREE else NEAR
        if _same_load((own.source, s.best.source), projection.at):
            within = max(within, SAME_LOAD * here.evidence)
        enough = s.evidence >= here.evidence - within or _same_moment(here, s)
        if enough and name not in names:
            rivals.append(s)
            names.add(name)
    evidence = here.evidence
    if found.additions[number].together:
        evidence = max(evidence, _of_cause(found, own.family.effect))
    p_value = found.null.p_of(replace(here, evidence=evidence))
    rivals = apart(own, rivals, projection.at)
    return JudgedAddition(evidence, p_value, _choose_reported(own.family, rivals))


def apart(own: Candidate, rivals: Sequence[Score], at: ArmStates) -> list[Score]:
    """Leave out cells that a name in the group stands for, by whatever law.

    A joint 4 that turns by the moment across joint 5 is no cause beside compliance of
    joint 4, where the two loads are one; nor is a link 6 that has turned about the axis
    of joint 5 beside a joint 5 that was mastered again.
    """
    names = [c for c in (own, *(s.best for s in rivals)) if c.family.tier == NAMED]
    cells = [cell for name in names for cell in _cells_of(name)]
    return [
        s
        for s in rivals
        if not isinstance(s.best.effect, PartMotion | Curve)
        or not any(_same_cell(cell, s.best, at) for cell in cells)
    ]


def _cells_of(name: Candidate) -> list[tuple[str, str]]:
    """List carrier and driver of the cells that a name is, at its joint."""
    own, effect = str(name.family.joint), type(name.effect)
    constant = [(f"joint {own}", ALWAYS)] if ("joint", ALWAYS) in effect.acts else []
    found = [(c, driver) for c, driver, _ in effect.cells if own in f"{c} {driver}"]
    return constant + found


def _same_cell(cell: tuple[str, str], other: Candidate, at: ArmStates) -> bool:
    """Tell whether a candidate moves what a cell moves, by the same driver."""
    moves, driver = cell
    effect = other.effect
    assert isinstance(effect, PartMotion | Curve)
    still = isinstance(effect, PartMotion) and effect.law == ALWAYS
    source = ALWAYS if still else other.source
    if driver != source and not _same_load((driver, source), at):
        return False
    one, two = (carrier(c).move(at).reshape(-1) for c in (moves, effect.direction))
    return bool(abs(one @ two) > ALIKE * np.linalg.norm(one) * np.linalg.norm(two))


def _of_cause(found: Search, effect: str) -> float:
    """Return what speaks for all additions of one effect, at whatever joints [nats]."""
    own = {
        found.place(k)
        for k, a in enumerate(found.additions)
        if a.candidate.family.effect == effect
    }
    every = enumerate(found.fit.combination.effects)
    less = with_effects(found.fit, [e for place, e in every if place not in own])
    return found.fit.log_evidence - less.log_evidence


def _choose_reported(own: Family, rivals: Sequence[Score]) -> tuple[Score, ...]:
    """Choose those that are told: names first, and more cells with a cell."""
    cells = [s for s in rivals if s.family.effect == PART_MOTION]
    others = [s for s in rivals if s.family.effect != PART_MOTION][:MOST_OTHERS]
    most = MOST_CELLS - len(others) if own.effect == PART_MOTION else MOST_OTHERS
    return (*others, *cells[:most])


def _same_moment(own: Score, other: Score) -> bool:
    """Tell whether a step in time may be a jump where the arm passed a value once.

    A tool that slips may do so in any way, a jump is one of these: for what a step has
    more of numbers it may be behind.
    """
    jump = own.best.effect
    if not (isinstance(jump, PartMotion) and jump.source in OF_STATE):
        return False
    step = other.best.effect.at_one_row and other.family.tier == NAMED
    more = NEAR + CLEARLY[0] * (other.best.width - own.best.width)
    return step and other.best_evidence >= own.best_evidence - more


def _same_load(both: tuple[str, str], at: ArmStates) -> bool:
    """Tell whether two loads are one but for weights that nobody knows so well.

    About the axis of joint 4, say, that is the torque of joint 4 and the moment across
    joint 5 of an arm whose link 4 hangs on this axis.
    """
    if not all(LOAD.fullmatch(source) for source in both):
        return False
    along = np.corrcoef([covariate(at, source) for source in both])[0, 1]
    return bool(abs(along) > ALIKE)


def _name(family: Family) -> tuple[str | int | None, ...]:
    """Return what a person tells a cause by: of a cell its place and what drives it."""
    if family.effect == PART_MOTION:
        return family.joint, family.along, family.driver
    return family.effect, family.joint
