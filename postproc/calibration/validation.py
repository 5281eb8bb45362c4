"""The model that a survey deserves: what new poses are left decides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.calibration.backward_elimination import SURE, keep_needed, worth
from postproc.calibration.cross_validation import (
    PARTS,
    HeldOutError,
    HeldOutRows,
    PairedErrors,
    choose,
    mean_error_mm,
    parts_of,
    predict_held_out,
    predict_held_out_linearly,
    regions_of,
    summarise,
)
from postproc.calibration.diagnosis.search import with_effects
from postproc.calibration.doubt import doubt_of
from postproc.calibration.effect_selection import (
    Progress,
    fit_survey,
    model_of,
    no_progress,
)
from postproc.calibration.measurements import Measurements
from postproc.calibration.regression import Fit
from postproc.model.doubt import Doubt
from postproc.model.effects import BASE_EFFECTS
from postproc.model.effects.compliance import Compliance
from postproc.model.effects.effect import Effect
from postproc.model.effects.placement import Placement
from postproc.model.model import Model
from postproc.robot.arm import Arm
from postproc.robot.pose import MM

FEW_POSES = 300  # at the most: effects are chosen again without each part
FEWEST_POSES = 6  # that a part of the rows can be predicted from
HARDLY_CHANCE = 10.0  # nats that an effect must be worth in so few poses
SEED = 0
DETERMINED = 0.5  # effective parameters a coordinate, from which on rows are few
GOOD = 2.0  # times the repeatability: errors of an arm that needs no model
FLOOR = 2e-5  # [m] an arm that is as good as its drawing


@dataclass(frozen=True)
class Rung:
    """Effects that a survey may deserve.

    Attributes:
        name: As it is reported.
        effects: Their names; None: those that the survey gives evidence for.
        free: Whether functions without a law may be among those.
    """

    name: str
    effects: tuple[str, ...] | None
    free: bool = False


SET_UP = Rung("registration and probe alone", (Placement.name,))
ASKED = "the effects that were asked for"
DEFAULT = "the effects that the survey gives evidence for"


SIMPLER = Rung("geometry", ("geometry",))
USUAL = Rung("geometry,backlash", ("geometry", "backlash"))
REFINED = Rung("geometry,backlash,backlash_profile", (*BASE_EFFECTS,))
WITH_LAWS = Rung("effects with a law", None)


@dataclass(frozen=True, eq=False)
class FitTask:
    """A survey that is to be fitted.

    Attributes:
        survey: One row a stop and probe point, base frame.
        arm: The arm.
        effects: Names of effects; None: those that it gives evidence for.
        tracker: Tracker position in the base frame, (3,) [m], or None.
        setup: Names of effects of the set-up, fitted besides.
        mounted: Whether the cell states the direction of weight.
    """

    survey: Measurements
    arm: Arm
    effects: Sequence[str] | None
    tracker: Floats | None
    setup: tuple[str, ...] = ()
    mounted: bool = True

    @property
    def rung(self) -> Rung:
        """What was asked for."""
        if self.effects is None:
            return Rung(DEFAULT, None, free=True)
        return Rung(ASKED, tuple(self.effects))

    def fit(
        self,
        rung: Rung | None = None,
        rows: Measurements | None = None,
        progress: Progress = no_progress,
    ) -> Fit:
        """Fit the effects that were asked for, or others, to all rows or some."""
        chosen = rung or self.rung
        some = self.survey if rows is None else rows
        return fit_survey(
            some, self.arm, chosen.effects, self.tracker, self.setup, progress,
            chosen.free,
        )  # fmt: skip

    def doubt(self, fitted: Fit) -> Doubt | None:
        """Weigh what may be there besides, where it was left to the rows."""
        return doubt_of(fitted, self.mounted) if self.effects is None else None

    def errors(self, rung: Rung, part: Ints, used: Bools) -> HeldOutRows:
        """Predict every part of the rows by fits of all others."""

        def fit(rows: Measurements) -> tuple[Fit, Model]:
            found = self.fit(rung, rows)
            return found, model_of(found, rows, doubt=self.doubt(found))

        return predict_held_out(self.survey, self.arm, fit, part, used)


@dataclass(frozen=True, eq=False)
class Validated:
    """A fit that was compared with simpler ones at poses that none has seen.

    Attributes:
        fit: The fit to take.
        error: What it is expected to leave; None where there are too few poses.
        widening: Factor on its stated standard deviations that held-out rows ask for.
        notes: What a reader of the fit should know.
        rejected: Why no model must be used; "" where it may be.
    """

    fit: Fit
    error: HeldOutError | None
    widening: float = 1.0
    notes: tuple[str, ...] = ()
    rejected: str = ""


def validate_fit(task: FitTask, fitted: Fit) -> Validated:
    """Find what a fit leaves at new poses; take simpler effects that leave less.

    Args:
        task: What was fitted.
        fitted: The fit.
    """
    used = fitted.rows.weight > 0
    poses = len(np.unique(fitted.pose[used]))
    if poses < FEWEST_POSES + PARTS:
        note = f"{poses} poses are too few to hold some out: the model is not checked"
        return Validated(fitted, None, notes=(note,))
    part = parts_of(fitted.pose, SEED)
    if poses > FEW_POSES:
        rows = predict_held_out_linearly(fitted, part)
        return _conclude(task, fitted, rows, chosen=False)
    effects = fitted.combination.effects
    rung, rows, notes = _choose(task, effects, part, used)
    if rung != task.rung:
        fitted = task.fit(rung)
    if rung.effects is None:
        fitted = _without_doubtful(fitted)
    return replace(_conclude(task, fitted, rows, chosen=True), notes=notes)


def _without_doubtful(fitted: Fit) -> Fit:
    """Drop effects that few poses hardly call for: held-out poses chose all or none.

    Many causes and joints are tried, and one of them is worth some nats by chance. Most
    joints of most arms yield to the weight: of these no more is asked than of all. Nor
    of a set-up that stands still; that it moves with time is doubtful like the rest.
    """
    effects = fitted.combination.effects
    always = tuple(
        e for e in effects
        if e.name in BASE_EFFECTS or e.driven_by == "torque"
        or (e.belongs_to() == "setup" and not e.refers_to())
    )  # fmt: skip
    needed = keep_needed(fitted, always, enough=HARDLY_CHANCE)
    return fitted if len(needed) == len(effects) else with_effects(fitted, needed)


def _choose(
    task: FitTask, effects: tuple[Effect, ...], part: Ints, used: Bools
) -> tuple[Rung, HeldOutRows, tuple[str, ...]]:
    """Choose the effects that leave new poses least.

    Args:
        task: What was fitted.
        effects: Effects of the fit that was asked for.
        part: Part of every row, (n,).
        used: Rows that count, (n,).

    Returns:
        The effects, their held-out errors, and a note where they are others than asked.
    """
    asked = task.rung
    if task.effects is not None:
        return asked, task.errors(asked, part, used), ()
    laws = (WITH_LAWS,) if any(e.free for e in effects) else ()
    rungs = (*_plain_rungs(task, used), *laws, asked)
    tried = [task.errors(rung, part, used) for rung in rungs]
    number = choose(tried)
    rung, rows = rungs[number], tried[number]
    if rung == asked:
        return rung, rows, ()
    note = (
        f"the model holds {rung.name} alone ({mean_error_mm(rows):.4f} mm on new "
        f"poses): {DEFAULT} predict new poses no better "
        f"({mean_error_mm(tried[-1]):.4f} mm)"
    )
    return rung, rows, (note,)


def _plain_rungs(task: FitTask, used: Bools) -> tuple[Rung, ...]:
    """Return what more effects must beat, and what is simpler than that.

    Where backlash is worth it by its evidence, it varies with the angle, and joints
    yield to the weight: priors keep both small where rows say little. Fewer effects are
    tried where the rows hardly determine these.
    """
    refined = task.fit(REFINED)
    usual = REFINED if _weigh_addition(refined, USUAL, task) > SURE else USUAL
    name = Compliance.name
    loaded = Rung(f"{usual.name},{name}", (*(usual.effects or ()), name))
    if _weigh_addition(task.fit(loaded), usual, task) > SURE:
        usual = loaded
    independent = 3 * len(np.unique(task.survey.states.order[used]))
    if refined.effective < DETERMINED * independent:
        return (usual,)
    return SIMPLER, usual


def _weigh_addition(fitted: Fit, rung: Rung, task: FitTask) -> float:
    """Weigh what a fit has besides some effects and the set-up [nats]."""
    names = (*(rung.effects or ()), *task.setup)
    return worth(
        fitted, tuple(e for e in fitted.combination.effects if e.name in names)
    )


def _conclude(task: FitTask, fitted: Fit, rows: HeldOutRows, chosen: bool) -> Validated:
    """Put figures together, and compare with a set-up without errors of the arm."""
    region = predict_held_out_linearly(fitted, regions_of(task.survey.states))
    error = summarise(rows, mean_error_mm(region), chosen)
    plain = task.errors(SET_UP, rows.part, rows.used)
    if PairedErrors.of(plain, rows).better or mean_error_mm(plain) < FLOOR / MM:
        return Validated(fitted, error, rows.widening)
    cause = "The rows are those of another arm, program or frame, or there are too few"
    if mean_error_mm(plain) * MM < GOOD * task.arm.repeatability:
        cause = "The arm is as good as its drawing, as far as these rows show"
    why = (
        f"the error of new poses is {error.error.mean_mm:.4f} mm with this model and "
        f"{mean_error_mm(plain):.4f} mm with {SET_UP.name}. {cause}"
    )
    return Validated(fitted, error, rows.widening, rejected=why)
