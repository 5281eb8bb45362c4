"""Which effects earn their place in the default model."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.backward_elimination import ENOUGH, SURE, keep_needed
from postproc.calibration.diagnosis.candidates import Projection
from postproc.calibration.diagnosis.harmonics import waves_of
from postproc.calibration.diagnosis.held_out import Folds, gain_in, regions
from postproc.calibration.diagnosis.search import with_effects
from postproc.calibration.direction_labels import mend_directions
from postproc.calibration.expected_noise import expect_noise
from postproc.calibration.extrapolation import widening
from postproc.calibration.joint_scatter import split_by_joint
from postproc.calibration.measurements import Measurements
from postproc.calibration.monuments import TrackerMotion, exclude_effects
from postproc.calibration.nest_check import find_groups
from postproc.calibration.nonlinear_search import with_sought
from postproc.calibration.orientations import Turns
from postproc.calibration.regression import NEARLY, Fit, beside, fit_effects
from postproc.model.covariate import DRIVERS, JOINTS
from postproc.model.doubt import Doubt
from postproc.model.effect_sum import Combination
from postproc.model.effects import BASE_EFFECTS, EFFECTS, propose
from postproc.model.effects.effect import Effect
from postproc.model.effects.policies import FitPolicy
from postproc.model.effects.probe_turn import ProbeTurn
from postproc.model.effects.tool_shift import ToolShift
from postproc.model.kinematics import ArmStates
from postproc.model.model import COMPENSATED, READING, WORST_STD, Model, weight_of
from postproc.model.noise import Noise
from postproc.model.validity import Ranges
from postproc.robot.arm import Arm
from postproc.robot.pose import MM
from postproc.robot.state import States

# Which effects a survey gives evidence for.
#
# An effect stays only if the marginal likelihood falls without it, all prior scales
# being chosen anew. Named effects are weighed first; free forms must then explain what
# is left. Where one of them does, it has taken away what the named ones were weighed
# against: gravity of 0.1 mm does not show beside waves of 0.3 mm. So what was laid
# aside is weighed once more, beside the free forms. What of these is a wave of a gear
# is found as `diagnose` finds it, and weighed beside all else; in a short survey it
# must also predict regions of joint space that it was not found in. Free forms that are
# fine enough to take up the waves come last: a name holds where no row was, too.

Progress = Callable[[str], None]

FEW_POSES = 450  # fewer leave many orders of waves alike
HARDLY_ANY = 100  # poses: fewer leave alike what free forms follow, and what not


def no_progress(stage: str) -> None:
    """Tell nobody."""


def candidates(
    arm: Arm, states: States, motion: TrackerMotion | None = None
) -> tuple[str, ...]:
    """Name the effects that a survey may give evidence for, by what drives them.

    Args:
        arm: The arm.
        states: States of the rows.
        motion: What readings of fixed points say of the tracker, if there are any.
    """
    without = exclude_effects(motion)
    tried = [
        k for k in EFFECTS
        if k.fit_policy == FitPolicy.IF_EVIDENT and k.name not in without
        and (k.may_show_alone(states) if without else k.may_show(states))
        and k.propose(arm, states).parameters()
    ]  # fmt: skip
    tried.sort(key=lambda kind: DRIVERS.index(kind.driven_by))
    return tuple(kind.name for kind in tried)


def free_forms(states: States) -> tuple[str, ...]:
    """Name the effects without a law that are weighed for what the others leave."""
    last = [k for k in EFFECTS if k.fit_policy == FitPolicy.LAST and k.may_show(states)]
    return tuple(kind.name for kind in last)


def fit_best(
    arm: Arm,
    states: States,
    position: Floats,
    origin: tuple[float, float, float] | None,
    setup: tuple[str, ...] = (),
    turns: Turns | None = None,
    progress: Progress = no_progress,
    motion: TrackerMotion | None = None,
    free: bool = True,
) -> Fit:
    """Fit the base effects and all others that a survey gives evidence for.

    Args:
        arm: The arm.
        states: States of the rows.
        position: Measured positions in the base frame, (n, 3) [m].
        origin: Tracker position, where it is known.
        setup: Effects of the set-up that are always fitted.
        turns: Measured orientations, where the survey has them.
        progress: Told what is being done.
        motion: What readings of fixed points say of the tracker, if there are any.
        free: Whether functions without a law may be taken.
    """

    def fit(more: tuple[str, ...] = ()) -> Fit:
        found = _fit_kept(
            arm, states, position, origin, (*setup, *more), turns, progress, motion,
            free,
        )  # fmt: skip
        progress("look for steps, tilt, warming-up and waves of gears")
        return with_sought(found, exclude_effects(motion))

    fitted = fit()
    seen = sightings(fitted, origin)
    if not seen:
        return fitted
    progress("fit again beside " + ", ".join(seen))
    return fit(seen)


def sightings(
    fitted: Fit, origin: tuple[float, float, float] | None
) -> tuple[str, ...]:
    """Name what the tracker reads wrongly, where all else then has a law.

    Where free forms are needed beside it, nobody can say who errs: the arm, in a way
    that has no name, may look like a tracker. `diagnose` looks for more names there.

    Args:
        fitted: A fit of all else.
        origin: Tracker position, where it is known.
    """
    if origin is None:
        return ()
    kept, batch = fitted.combination.effects, fitted.batch
    names = [k.name for k in EFFECTS if k.fit_policy == FitPolicy.WITH_TRACKER]
    more = propose(names, batch.arm, batch.states)
    tried = beside(fitted, (*kept, *(e.see_from(origin) for e in more)))
    if len(keep_needed(tried, always=(), aside=kept, enough=SURE)) == len(kept):
        return ()
    laws = tuple(e for e in kept if not e.free)
    needed = keep_needed(tried, always=(), aside=laws, enough=SURE)
    if any(e.free for e in needed):
        return ()
    return tuple(e.name for e in needed if e not in kept)


def _fit_kept(
    arm: Arm,
    states: States,
    position: Floats,
    origin: tuple[float, float, float] | None,
    setup: tuple[str, ...],
    turns: Turns | None,
    progress: Progress,
    motion: TrackerMotion | None,
    with_free: bool,
) -> Fit:
    """Fit and weigh once, as `fit_best`."""
    batch = ArmStates(arm, states)
    base = propose((*BASE_EFFECTS, *setup), arm, states)
    base = tuple(effect.see_from(origin) for effect in base)
    kept = base
    progress("fit " + ", ".join(e.name for e in base))
    fitted = fit_effects(batch, position, base, origin, turns=turns, until=NEARLY)
    named = candidates(arm, states, motion)
    free = free_forms(states) if with_free else ()
    for names in (named, *((name,) for name in free)):
        progress("fit and weigh " + ", ".join(names))
        more = pieces(propose(names, arm, states))
        tried = (*kept, *more, *propose_slip(fitted))
        fitted = fit_effects(batch, position, tried, origin, fitted, until=NEARLY)
        kept = generalising(fitted, keep_needed(fitted, always=base))
    if any(e.name in free for e in kept):
        progress("weigh once more what was laid aside")
        kept = reweigh_effects(fitted, kept, named, always=base)
    progress("look for waves in free forms")
    waves = waves_in(fitted, kept)
    progress("fit " + ", ".join(e.name for e in kept))
    fitted = fit_effects(batch, position, (*kept, *waves), origin, fitted)
    needed = waves_needed(fitted, kept) if waves else kept
    last = tuple(effect.beside_waves(states) for effect in needed)
    if last == fitted.combination.effects:
        return fitted
    return fit_effects(batch, position, last, origin, fitted)


def generalising(fitted: Fit, kept: tuple[Effect, ...]) -> tuple[Effect, ...]:
    """Drop free forms of hardly any rows that predict no region they were not found in.

    An error that they cannot follow looks like one that they can, at a few rows: other
    poses are left worse than without them.

    Args:
        fitted: A fit of what is kept, and of more.
        kept: The effects.
    """
    free = [e for e in kept if e.free]
    if fitted.poses >= HARDLY_ANY or not free:
        return kept
    held = predicting(beside(fitted, kept), free)
    return tuple(e for e in kept if not e.free or e in held)


def predicting(fitted: Fit, asked: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return the effects of a fit, of some, that predict regions left out for sure."""
    folds = Folds.of_fit(fitted, regions(fitted.batch.states.q))
    own = enumerate(fitted.combination.effects)
    return tuple(e for k, e in own if e in asked and gain_in(fitted, k, folds).sure)


def waves_in(fitted: Fit, kept: tuple[Effect, ...]) -> tuple[Effect, ...]:
    """Name the waves of gears that free forms hold, without fitting anew.

    Args:
        fitted: A fit of what is kept, whose noise and prior scales are taken.
        kept: The effects that are kept so far.
    """
    if not any(len(e.fine(j)) for e in kept for j in JOINTS):
        return ()
    whole = Projection.of(beside(fitted, kept))
    found = [waves_of(whole, joint, ENOUGH) for joint in JOINTS]
    return tuple(score.best.effect for scores in found for score in scores)


def waves_needed(fitted: Fit, kept: tuple[Effect, ...]) -> tuple[Effect, ...]:
    """Drop waves that are not needed, and of few rows those that carry nothing over.

    A wave that rows at random ask for may be one of a few periods: in a region of joint
    space that it was not found in it must predict, too.

    Args:
        fitted: A fit of what is kept and of the waves.
        kept: All else, which is not in question.
    """
    if fitted.poses < FEW_POSES:
        waves = [e for e in fitted.combination.effects if e not in kept]
        held = predicting(fitted, waves)
        if not held:
            return kept
        fitted = beside(fitted, (*kept, *held))
    return keep_needed(fitted, always=(), aside=kept)


def reweigh_effects(
    fitted: Fit,
    kept: tuple[Effect, ...],
    named: tuple[str, ...],
    always: tuple[Effect, ...],
) -> tuple[Effect, ...]:
    """Weigh named effects beside the free forms of a fit, without fitting anew.

    Args:
        fitted: A fit of what is kept, whose noise and free forms are taken as they are.
        kept: The effects that are kept so far; named ones of them may go now.
        named: Names of all that are weighed.
        always: Effects that are not in question.
    """
    batch = fitted.batch
    have = {(e.name, joints_of(e)) for e in kept}
    every = pieces(propose(named, batch.arm, batch.states))
    more = [e for e in every if (e.name, joints_of(e)) not in have]
    free = tuple(e for e in kept if e.name not in named and e not in always)
    return keep_needed(beside(fitted, (*kept, *more)), always, free)


def pieces(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return what is weighed by itself of effects: each at one joint, or as it is."""
    return tuple(piece for effect in effects for piece in effect.pieces())


def joints_of(effect: Effect) -> frozenset[int | None]:
    """Return the joints that the parameters of an effect act on."""
    return frozenset(p.joint for p in effect.parameters())


def propose_slip(fitted: Fit) -> tuple[Effect, ...]:
    """Propose a step of the tool where what is left falls in two heaps in its order."""
    found = find_groups(fitted.residual, fitted.batch.walk.flange)
    if found is None or found.step is None:
        return ()
    return (ToolShift(row=float(fitted.batch.states.order[found.step])),)


# The product's own method: a survey becomes a fit of named effects, and a model.


def fit_survey(
    survey: Measurements,
    arm: Arm,
    effects: Sequence[str] | None,
    tracker: Floats | None,
    setup: tuple[str, ...] = (),
    progress: Progress = no_progress,
    free: bool = True,
) -> Fit:
    """Fit effects to a survey in the base frame.

    Args:
        survey: The measurements.
        arm: The arm.
        effects: Names of effects; None: those that the survey gives evidence for.
        tracker: Tracker position in the base frame, (3,) [m], or None.
        setup: Names of effects of the set-up, fitted besides.
        progress: Told what is being done.
        free: Whether functions without a law may be taken where none are named.

    Returns:
        The fit. Where directions of the file are probably wrong, its states have them
        the other way, or as not known.

    Raises:
        PostprocError: An unknown effect, or one whose covariate was not recorded.
    """
    origin = None if tracker is None else (tracker[0], tracker[1], tracker[2])
    states, position, batch = (
        survey.states,
        survey.position,
        ArmStates(arm, survey.states),
    )
    turns = None
    if survey.rotation is not None and survey.mounting is not None:
        turns = Turns.of(batch, survey.rotation, survey.mounting)
        setup = (*setup, ProbeTurn.name)

    def fit(states: States) -> Fit:
        if effects is None:
            return fit_best(
                arm, states, position, origin, setup, turns, progress, survey.motion,
                free,
            )  # fmt: skip
        asked = propose((*effects, *setup), arm, states)
        chosen = tuple(effect.see_from(origin) for effect in asked)
        return fit_effects(
            ArmStates(arm, states), position, chosen, origin, turns=turns
        )

    fitted = fit(states)
    if not survey.inferred.all():
        progress("look for wrong directions")
        mended = mend_directions(fitted, position)
        again = effects is None and mended is not fitted
        fitted = fit(mended.batch.states) if again else mended
    return attribute_drift(fitted, survey.motion)


def attribute_drift(fitted: Fit, motion: TrackerMotion | None) -> Fit:
    """Settle whose it is what passes with time: the arm's, or perhaps the tracker's.

    Args:
        fitted: The fit.
        motion: What readings of fixed points say of the tracker, if there are any.
    """
    if motion is not None:
        warm = _refit_declared(fitted, told=True)
        if motion.leaves(_peak_of_others(warm, fitted)):
            return warm
    return _refit_declared(fitted, told=False)


def _refit_declared(fitted: Fit, told: bool) -> Fit:
    """Fit again with effects as they count, where any counts otherwise."""
    old = fitted.combination.effects
    effects = tuple(effect.attribute_drift(told, fitted.batch) for effect in old)
    if all(a is b for a, b in zip(effects, old, strict=True)):
        return fitted
    return with_effects(fitted, effects)


def _peak_of_others(fitted: Fit, before: Fit) -> float:
    """Return the most that effects move that a fit has not had before [m]."""
    old, c = before.combination.effects, fitted.combination
    moved = [
        float(np.linalg.norm(fitted.move(part), axis=1).max(initial=0.0))
        for was, effect, part in zip(old, c.effects, c.slices, strict=True)
        if effect is not was
    ]
    return min(moved, default=0.0)


def model_of(
    fitted: Fit,
    survey: Measurements,
    wide: float = 1.0,
    doubt: Doubt | None = None,
) -> Model:
    """Keep what a fit found as a model.

    Args:
        fitted: The fit.
        survey: Its rows.
        wide: Factor on all standard deviations off the tracker, by held-out rows.
        doubt: What may be there besides.
    """
    fitted = split_by_joint(fitted)
    used = fitted.rows.weight > 0
    left = np.linalg.norm(fitted.residual[used], axis=1) / MM
    covariance = fitted.stated * max(widening(fitted), wide**2)
    arm, noise = fitted.batch.arm, expect_noise(fitted).rescale(wide)
    known = np.sqrt(_prediction_variance(fitted, covariance, noise, wide, doubt))
    statistics = {
        "residual_mean_mm": float(left.mean()),
        "residual_max_mm": float(left.max()),
        WORST_STD: float(known.max(initial=0.0) / MM),
        "effective_parameters": fitted.effective,
        "log_evidence": fitted.log_evidence,
        "rows_dropped": float((~used).sum() + len(survey.dropped)),
        READING: fitted.reading_spread,
    }
    if fitted.turns is not None:
        statistics["orientation_std_mrad"] = fitted.turns.std * 1e3
    if survey.motion is not None:
        statistics |= survey.motion.statistics
    return Model(
        method="full",
        arm_name=arm.name,
        arm_id=arm.id,
        effects=fitted.combination,
        values=fitted.values,
        covariance=covariance,
        prior_std=fitted.prior_std,
        noise=noise,
        ranges=Ranges.of(survey.states[used], fitted.turns is not None),
        rows=int(used.sum()),
        data_sha256=survey.sha256,
        statistics=statistics,
        weight=weight_of(arm),
        doubt=None if doubt is None else doubt.rescale(wide**2),
    )


def _prediction_variance(
    fitted: Fit, covariance: Floats, noise: Noise, wide: float, doubt: Doubt | None
) -> Floats:
    """Variance of predictions at the rows of a fit, (n, 3) [m^2].

    Args:
        fitted: The fit.
        covariance: Of its parameters; predictions have nothing of the set-up.
        noise: What poses have besides.
        wide: Factor on standard deviations that a doubt gives.
        doubt: What may be there besides.
    """
    c, kept = fitted.combination, fitted.combination.where(*COMPENSATED)
    own = np.where(np.outer(kept, kept), covariance, 0.0)
    variance = fitted.design.variance(own) + noise.pose_variance(fitted.design.jacobian)
    if doubt is not None:
        effects = tuple(e for e in c.effects if e.belongs_to() in COMPENSATED)
        at = Combination(effects), c.at(fitted.batch, fitted.values)
        variance = variance + wide**2 * doubt.get_settings(kept).variance(*at)
    return variance
