"""What all the rows say about what a fit lacks."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.describe import describe
from postproc.calibration.diagnosis.harmonics import name_waves
from postproc.calibration.diagnosis.result import Finding, Verdict
from postproc.calibration.diagnosis.score import Null, ResidualTest, leftovers
from postproc.calibration.diagnosis.search import (
    LEVEL,
    JudgedAddition,
    Progress,
    Search,
    put_instead,
    ranking,
    search,
    stand,
)
from postproc.calibration.diagnosis.step_places import place_steps
from postproc.calibration.diagnosis.table import Causes
from postproc.calibration.diagnosis.weight import pass_on, weigh_laws
from postproc.calibration.regression import Fit
from postproc.model.effects.effect import FREE, JointEffect
from postproc.model.effects.policies import NamingPolicy

# Taking names back that promise more than they explain.

UNSTEADY = 1e-4  # level at which scatter that follows a law takes its name away
STANDS_IN = 0.9  # share of the name's evidence that a free form must have


def investigate(base: Fit, causes: Causes, null: Null, progress: Progress) -> Search:
    """Search for what a fit lacks, take back names that do not hold, name waves.

    Steps are moved to the middle of where the rows let them be.
    """
    found = withdraw(search(base, causes, null, progress))
    return place_steps(name_waves(pass_on(weigh_laws(found, progress), progress)))


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
        scores = ranking(without, found.near)
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
    moved = fit.whiten(fit.move(part))
    own = projection.filter(moved[:, None]).reshape(-1, 3)
    axis = fit.whiten(fit.batch.jacobian[:, :, int(effect.acts_on()[0])])
    axis = axis.reshape(-1, 3)
    axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-12)
    square = np.einsum("nk,nk->n", axis, fit.whiten(fit.residual).reshape(-1, 3)) ** 2
    size = (own**2).sum(axis=1)
    size, square = size - size.mean(), square - square.mean()
    spread = float(np.sqrt((size**2).sum() * (square**2).mean()))
    return float(norm.sf(float(size @ square) / max(spread, 1e-300)))


# What all the rows say about what a fit lacks.
#
# Rows that lack nothing are asked twice whether they do: by the library, at its LEVEL,
# and without any effect in mind. Both together may be wrong in 1 of 100.

REMAINS = 0.01 - LEVEL  # level at which structure is called so: nothing was added
STILL_REMAINS = 0.001  # ... after something was


def no_progress(stage: str, share: float) -> None:
    """Tell nobody."""


@dataclass(frozen=True, eq=False)
class Investigation:
    """What all the rows say.

    Attributes:
        search: What was added.
        standings: Every addition judged with all others in the model.
        leftovers: What the final residual still shows.
    """

    search: Search
    standings: tuple[JudgedAddition, ...]
    leftovers: tuple[ResidualTest, ...]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Describe the additions."""
        return describe(self.search, self.standings)

    @property
    def verdict(self) -> Verdict:
        """Decide between an effect, noise, and structure without a name."""
        p_value = min((x.p_value for x in self.leftovers), default=1.0)
        added = [a.candidate.effect for a in self.search.additions]
        if not added:
            return "unexplained" if p_value < REMAINS else "noise"
        nameless = (
            any(e.naming_policy == NamingPolicy.UNEXPLAINED for e in added)
            or p_value < STILL_REMAINS
        )
        return "unexplained" if nameless else "effect"


def trace(
    base: Fit,
    seed: int,
    progress: Progress = no_progress,
    without: Collection[str] = (),
) -> Investigation:
    """Search a fit's rows for what it lacks, and judge what was found.

    Args:
        base: The fit.
        seed: Of the bootstrap.
        progress: Told what is being done.
        without: Names of effects that are known not to be there.
    """
    progress("candidates", 0.0)
    causes = Causes.of(base, without)
    progress("thresholds", 0.05)
    null = causes.null(Projection.of(base), seed)
    found = investigate(base, causes, null, progress)
    progress("groups that fit equally well", 0.5)
    standings = tuple(stand(found, k) for k in range(len(found.additions)))
    progress("tests of the residuals", 0.55)
    left = leftovers(Projection.of(found.fit), seed)
    return Investigation(found, standings, left)
