"""Close the loop: what a model leaves of fresh measurements, and why."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from postproc.accuracy.diagnosis.choice import ranking
from postproc.accuracy.diagnosis.floor import multi_directional, noise_floor
from postproc.accuracy.diagnosis.groups import NEAR
from postproc.accuracy.diagnosis.outer import HeldOut, hold_out
from postproc.accuracy.diagnosis.planning import poses_that_separate, poses_that_sharpen
from postproc.accuracy.diagnosis.projection import Projection
from postproc.accuracy.diagnosis.refitting import refit
from postproc.accuracy.diagnosis.result import Diagnosis, Place, statistics
from postproc.accuracy.diagnosis.revision import Revision, fold_back
from postproc.accuracy.diagnosis.search import Progress, Search
from postproc.accuracy.diagnosis.tracing import Trace, silent, trace
from postproc.accuracy.fit_report import weighed_down
from postproc.accuracy.full import model_of
from postproc.accuracy.measurement import Measurements
from postproc.arrays import Floats
from postproc.model.kinematics import Batch
from postproc.model.model import Model
from postproc.model.statistics import ErrorStatistics
from postproc.robot.arm import Arm
from postproc.robot.pose import MM

PLACES = 5


@dataclass(frozen=True, eq=False)
class Extension:
    """A diagnosis with the model that follows from it.

    Attributes:
        diagnosis: What was found.
        model: The given model, refitted to the rows, with what was found.
        search: The search, for plots and further tests.
        held_out: Errors on held-out rows.
    """

    diagnosis: Diagnosis
    model: Model
    search: Search
    held_out: HeldOut


def diagnose(
    survey: Measurements,
    arm: Arm,
    model: Model,
    *,
    tracker: Floats | None = None,
    setup: tuple[str, ...] = (),
    seed: int = 0,
    progress: Progress = silent,
) -> Extension:
    """Find what a model lacks, and add it.

    All parameters of the given model are refitted to the rows, so a model of another
    day or another set-up may be given; where the rows are too few for that, its own
    covariance says how far they may move.

    Args:
        survey: Fresh measurements in the base frame, or those of the model itself.
        arm: The arm.
        model: The model, made by the full method.
        tracker: Tracker position in the base frame, (3,) [m], if known.
        setup: Names of effects of these measurements' set-up, fitted besides.
        seed: Of the bootstrap, the folds and the poses proposed.
        progress: Told what is being done.

    Raises:
        PostprocError: A model that cannot be refitted.
        ModelError: A model of another arm.
    """
    base = refit(survey, arm, model, tracker, setup)
    traced = trace(base, seed, progress)
    given = None
    if model.data_sha256 != survey.sha256:
        given = survey.position - base.batch.walk.tcp - model.error(arm, survey.states)
    held_out = hold_out(traced.search, seed, progress, given)
    diagnosis = _conclude(survey, traced, held_out, tracker, seed)
    extended = _extended(model, survey, traced.search, diagnosis)
    return Extension(diagnosis, extended, traced.search, held_out)


def _conclude(
    survey: Measurements,
    traced: Trace,
    held_out: HeldOut,
    tracker: Floats | None,
    seed: int,
) -> Diagnosis:
    """Put everything together."""
    found = traced.search
    floor = noise_floor(found.fit, tracker is not None)
    batch = Batch(found.fit.batch.arm, found.fit.batch.states[held_out.rows])
    before = multi_directional(batch, held_out.before)
    after = multi_directional(batch, held_out.after)
    why, poses = _next(traced, seed)
    return Diagnosis(
        verdict=traced.verdict,
        noise_floor_mm=floor.size / MM,
        noise_floor_source=floor.source,
        n_fit=held_out.fitted,
        n_held_out=len(held_out.rows),
        before=ErrorStatistics.of(held_out.before),
        after=ErrorStatistics.of(held_out.after),
        vap_mm=None if before is None or after is None else (before / MM, after / MM),
        findings=traced.findings,
        leftovers=traced.leftovers,
        places=_places(found),
        next_measurements=poses,
        why_next=why,
        dropped=weighed_down(found.fit, survey),
    )


def _places(found: Search) -> tuple[Place, ...]:
    """Say where what is left lives, from the candidates that come closest."""
    out = []
    for score in ranking(Projection.of(found.fit), found.library)[:PLACES]:
        family = score.family
        joint = f"joint {family.joint}"
        direction = family.effect if family.joint is None else joint
        driver = family.driver or score.best.source
        if family.effect == "curve" and family.joint is None:
            driver, _, direction = driver.partition(" along ")
        p_value = found.null.p_value(score.evidence)
        out.append(Place(direction, driver, score.evidence, p_value))
    return tuple(out)


def _next(traced: Trace, seed: int) -> tuple[str, Floats]:
    """Propose poses that separate the closest rivals, or sharpen the model."""
    found = traced.search
    for number, standing in enumerate(traced.standings):
        if standing.confusable:
            rival = standing.confusable[0]
            own = found.additions[number].candidate.family
            nats, poses = poses_that_separate(
                found.fit, found.place(number), rival, seed
            )
            worth = (
                f"a round is worth about {nats:.1f} nats, {NEAR:.0f} tell them apart"
            )
            return f"tell {own} from {rival.family} ({worth})", poses
    name, poses = poses_that_sharpen(found.fit, seed)
    if name.startswith(Revision.name):
        name = "the given model"
    return f"sharpen {name}, known worst for what it moves", poses


def _extended(
    model: Model, survey: Measurements, found: Search, diagnosis: Diagnosis
) -> Model:
    """Write the extended model with the record of how it came about."""
    record: dict[str, Any] = {
        "parent": model.id,
        "data_sha256": survey.sha256,
        "added": [
            {"effect": f.effect, "joint": f.joint, "source": f.source,
             "p_value": f.p_value, "share": f.share}
            for f in diagnosis.findings
        ],
        "verdict": diagnosis.verdict,
        "n_fit": diagnosis.n_fit,
        "n_held_out": diagnosis.n_held_out,
        "before": statistics(diagnosis.before),
        "after": statistics(diagnosis.after),
    }  # fmt: skip
    fit = found.fit
    revised = any(isinstance(e, Revision) for e in fit.combination.effects)
    fitted = model_of(fold_back(fit) if revised else fit, survey)
    return replace(fitted, parent=model.id, history=(*model.history, record))
