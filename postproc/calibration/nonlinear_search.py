"""What a fit must find before it can fit it: steps, tilt, warming-up, fast waves."""

from __future__ import annotations

from collections.abc import Collection

from postproc.calibration.backward_elimination import SURE, keep_needed, worth
from postproc.calibration.diagnosis.candidates import Library, Projection
from postproc.calibration.diagnosis.score import leftovers
from postproc.calibration.diagnosis.search import search, with_effects
from postproc.calibration.diagnosis.table import Causes
from postproc.calibration.regression import Fit
from postproc.model.effects import EFFECTS
from postproc.model.effects.policies import FitPolicy, SearchPolicy

REMAINS = 0.01  # level at which what is left is no noise: a step may be a piece of it
SOUGHT_BESIDE_FREE = 600  # poses at the most: of more, with many columns, it takes long
LEAST_POSES = 100  # fewer leave alike what happens and what has no form


def with_sought(fitted: Fit, without: Collection[str] = ()) -> Fit:
    """Look in what a fit leaves for what cannot be fitted before it is found.

    A drift in time stands in for a step, and laws and free forms for a law that is
    missing: the search goes without such a drift, which is among what is sought, and
    the others are weighed again beside what is found. Where free forms are needed all
    the same, or what is left is no noise, the arm does more than has a name, and steps
    may be pieces of that.

    Args:
        fitted: The fit.
        without: Names of effects that are known not to be there.
    """
    kept = fitted.combination.effects
    free = any(e.free for e in kept)
    poses = fitted.poses
    if poses < LEAST_POSES or (free and poses > SOUGHT_BESIDE_FREE):
        return fitted
    now = {SearchPolicy.ALWAYS, SearchPolicy.RIVAL}
    if not free:
        now.add(SearchPolicy.ALONE)
    found = _search_residuals(fitted, now, without)
    new = tuple(e for e in found.combination.effects if e not in kept)
    if not new or any(e.search_policy == SearchPolicy.RIVAL for e in new):
        return fitted
    if worth(found, kept) < SURE:
        return fitted
    sure = tuple(e for e in kept if not e.free and e.fit_policy != FitPolicy.IF_EVIDENT)
    needed = keep_needed(found, always=(*sure, *new))
    if any(e.free for e in needed):
        return fitted
    better = with_effects(found, needed)
    left = leftovers(Projection.of(better), seed=0)
    remains = any(what.p_value < REMAINS for what in left)
    return fitted if remains else better


def _search_residuals(
    fitted: Fit, now: Collection[SearchPolicy], without: Collection[str]
) -> Fit:
    """Search the residual of a fit, drifts aside, for effects of some policies."""
    kept, states = fitted.combination.effects, fitted.batch.states
    never = SearchPolicy.NEVER
    steady = tuple(e for e in kept if e.search_policy == never or e.driven_by != "time")
    base = fitted if steady == kept else with_effects(fitted, steady)
    other = {
        k.name
        for k in EFFECTS
        if k.search_policy not in now or not k.may_be_searched(states)
    }
    causes = Causes(Library.of(base, other.union(without)))
    if not causes.library.shelves:
        return fitted
    null = causes.null(Projection.of(base), seed=0)
    return search(base, causes, null, lambda *_: None).fit
