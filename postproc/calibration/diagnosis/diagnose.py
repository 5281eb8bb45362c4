"""Close the loop: what a model leaves of fresh measurements, and why."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Floats, Ints, data_frame
from postproc.calibration.cross_validation import (
    HeldOutError,
    HeldOutRows,
    PairedErrors,
    mean_error_mm,
    predict_held_out_linearly,
    regions_of,
    summarise,
)
from postproc.calibration.diagnosis.held_out import (
    LENGTH,
    NoiseFloor,
    deal,
    multi_directional,
    noise_floor,
    whole_poses,
)
from postproc.calibration.diagnosis.investigate import (
    Investigation,
    investigate,
    no_progress,
    trace,
)
from postproc.calibration.diagnosis.model_update import (
    FrameShift,
    Revision,
    fold_back,
    is_fresh,
    no_surer,
    refit,
)
from postproc.calibration.diagnosis.next_poses import (
    poses_that_separate,
    poses_that_sharpen,
)
from postproc.calibration.diagnosis.result import (
    Diagnosis,
    Profile,
    ResidualPlace,
    Verdict,
    not_excluded,
    profile,
    statistics,
)
from postproc.calibration.diagnosis.search import NEAR, Progress, Search
from postproc.calibration.direction_labels import mend_directions
from postproc.calibration.effect_selection import attribute_drift, model_of
from postproc.calibration.measurements import Measurements
from postproc.calibration.monuments import exclude_effects
from postproc.calibration.regression import Fit, fit_effects
from postproc.calibration.report import list_downweighted, report_directions
from postproc.calibration.reversal_test import (
    newer_widths,
    split_reversals,
    tell_widths,
)
from postproc.calibration.stops import AVERAGED, pool_readings
from postproc.exceptions import ModelError
from postproc.model.covariate import JOINTS
from postproc.model.doubt import Doubt
from postproc.model.effect_sum import Combination
from postproc.model.effects.policies import NamingPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.model import WORST_STD, Model
from postproc.model.statistics import ErrorStatistics
from postproc.robot.arm import Arm
from postproc.robot.pose import MM
from postproc.threads import in_one_thread

if TYPE_CHECKING:
    from postproc.arrays import DataFrame

# Before and after, on rows that took no part in choosing or fitting.
#
# The whole search is repeated without each part of the rows; the errors on that part
# are then errors on rows that no fit has seen and that chose nothing.

CLEARLY_ABOVE = 1.2  # times the noise floor
KEPT = (
    "a refit to these rows predicts held-out ones no better, beyond what chance does: "
    "the model is written as it was given"
)
PARTS = 5
RUN = 8  # consecutive rows that are held out together
MANY = 2000  # rows from which one part is enough


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Errors on held-out rows.

    Attributes:
        rows: The rows, (m,).
        fitted: Rows that each of them was predicted from, typically.
        before, after: Errors that the given and the extended model leave, (m, 3) [m].
        pose: Number of the pose of each, (m,).
        part: Part of every row of the fit, (n,).
    """

    rows: NDArray[np.int64]
    fitted: int
    before: Floats
    after: Floats
    pose: NDArray[np.int64]
    part: NDArray[np.int64]

    def expect(self, fit: Fit, std: Floats | None = None) -> HeldOutError:
        """Put what a model leaves of new poses into figures.

        How sure the extended model is of a row, and what it leaves of regions without
        rows, follows from its fit without them, effects as they are.

        Args:
            fit: The fit of the model.
            std: Its standard deviations of all rows, (n, 3) [m], where others than
                those of the fit hold.
        """
        region = regions_of(fit.batch.states)
        far = mean_error_mm(predict_held_out_linearly(fit, region))
        every = predict_held_out_linearly(fit, self.part)
        stated = every.std if std is None else std
        left = HeldOutRows(
            self.after, stated[self.rows], self.part[self.rows],
            np.ones(len(self.rows), dtype=bool), self.pose, every.tracker[self.rows],
        )  # fmt: skip
        return summarise(left, far, chosen=True)

    @property
    def worse(self) -> bool:
        """Whether the extended model leaves more, beyond what chance does."""
        return PairedErrors.between(self.after, self.before, self.pose).better

    def keeping(self, given: Fit) -> HeldOut:
        """Return it with what the given model leaves, its set-up refitted.

        A probe point that the given model knows is where it has it, unless what the
        rows say of it predicts others better.
        """
        states = given.batch.states
        every = predict_held_out_linearly(given, self.part)
        refitted = states.across(every.error)[self.rows]
        better = _is_less(refitted, self.before, states.tool_id[self.rows])
        after = np.where(better[:, None], refitted, self.before)
        return replace(self, after=after)


def _is_less(one: Floats, other: Floats, group: Ints) -> Bools:
    """Return True for rows of groups in which the first errors, (m, 3), are smaller."""
    fall = np.linalg.norm(other, axis=1) - np.linalg.norm(one, axis=1)
    _, label = np.unique(group, return_inverse=True)
    return np.asarray((np.bincount(label, fall) > 0.0)[label])


def hold_out(
    found: Search,
    told: Floats,
    seed: int,
    progress: Progress,
    given: Floats | None = None,
) -> HeldOut:
    """Repeat the search without each part of the rows.

    Args:
        found: The search on all rows: its first fit, its library, its threshold.
        told: Directions of the file, (n, 6): held-out rows are predicted with these,
            whatever their own readings make likelier.
        seed: Of the parts.
        progress: Told what is being done.
        given: Errors that the given model leaves as it is, (n, 3) [m], where it has
            not seen the rows; else its effects are refitted without each part.
    """
    base = found.base
    used = base.rows.weight > 0
    part = whole_poses(deal(base.batch.states.order, PARTS, seed, RUN), base.pose)
    count = PARTS if len(base.batch) < MANY else 1
    rows, before, after, fitted = [], [], [], 0
    for k in range(count):
        progress(f"held-out rows, part {k + 1} of {count}", 0.6 + 0.4 * k / count)
        out = np.flatnonzero((part == k) & used)
        inside = np.flatnonzero(part != k)
        if len(out) == 0:
            continue
        batch = ArmStates(base.batch.arm, base.batch.states[inside])
        effects = base.combination.effects
        less = fit_effects(batch, base.position[inside], effects, base.noise.origin)
        causes = found.causes.at_rows(inside)
        more = investigate(less, causes, found.null, lambda *_: None).fit
        rows.append(out)
        before.append(
            predict_residuals(less, base, out, told)
            if given is None
            else np.asarray(given[out])
        )
        after.append(predict_residuals(more, base, out, told))
        fitted = len(inside)
    which = np.concatenate(rows)
    across = base.batch.states[which].across
    return HeldOut(
        which, fitted, across(np.concatenate(before)), across(np.concatenate(after)),
        base.pose[which], part,
    )  # fmt: skip


def predict_residuals(
    fit: Fit, every: Fit, rows: NDArray[np.int64], told: Floats
) -> Floats:
    """Return what a fit leaves of the errors of other rows, (m, 3) [m].

    Args:
        fit: The fit.
        every: A fit of all rows.
        rows: The other rows.
        told: Directions of all rows, (n, 6).
    """
    states = every.batch.states[rows].with_(direction=told[rows])
    batch = ArmStates(every.batch.arm, states)
    predicted = Combination(fit.combination.effects).error(batch, fit.values)
    left: Floats = every.error[rows] - predicted
    return left


# Close the loop: what a model leaves of fresh measurements, and why.

PLACES = 5
TELLING = 0.05  # nats that poses to tell two causes apart are worth at least
BY_ANGLE = ("joint", "lambda", "before", "travel", "loop")  # what drives at an angle


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

    @property
    def rejected(self) -> bool:
        """Whether the model must not be used: held-out rows are worse off with it."""
        return self.diagnosis.verdict == "rejected"

    def __str__(self) -> str:
        """Say in some lines what was found, and what it leaves of held-out rows."""
        found = self.diagnosis
        lines = [
            *found.headlines(),
            f"before {found.before.tell()}",
            f"after  {found.after.tell()}",
            *found.notes,
            *found.fixed_points,
        ]
        return "\n".join(lines)

    def save(self, path: str | Path) -> None:
        """Write the file of the extended model.

        Raises:
            ModelError: The model must not be used.
            OutputError: The place cannot be written to.
        """
        if self.rejected:
            problem = "is not written: held-out rows are worse off with this model"
            raise ModelError(path, problem, "Keep the given one, or measure more")
        self.model.save(path)

    def to_frame(self) -> DataFrame:
        """Return a data frame of what was found and added, one effect a row.

        Columns: effect, joint, source (what drives it), p_value, share (of the squared
        error) and peak_mm.
        """
        names = ("effect", "joint", "source", "p_value", "share", "peak_mm")
        found = self.diagnosis.findings
        return data_frame({name: [getattr(f, name) for f in found] for name in names})


@in_one_thread
def extend_model(
    survey: Measurements,
    arm: Arm,
    model: Model,
    *,
    tracker: Floats | None = None,
    setup: tuple[str, ...] = (),
    seed: int = 0,
    progress: Progress = no_progress,
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
    survey, reversals = split_reversals(pool_readings(survey), arm)
    bases = refit(survey, arm, model, tracker, setup)
    without, sides = exclude_effects(survey.motion), survey.states.direction
    tried = [trace(base, seed, progress, without) for base in bases]
    traced = max(tried, key=lambda each: each.search.fit.log_evidence)
    if not survey.inferred.all():
        traced = _with_mended_directions(traced, seed, progress, without)
    search = traced.search
    settled = attribute_drift(search.fit, survey.motion)
    traced = replace(traced, search=replace(search, fit=settled))
    given = None
    if is_fresh(survey, model):
        nominal = bases[0].batch.walk.tcp
        given = survey.position - nominal - model.error(arm, survey.states)
    held_out = hold_out(traced.search, sides, seed, progress, given)
    diagnosis = _conclude(survey, traced, held_out, tracker, seed)
    kept = None
    if given is not None and diagnosis.verdict == "noise" and not traced.findings:
        kept = _keep_given(traced.search, held_out, model)
    if kept is not None:
        notes = (*diagnosis.notes, KEPT)
        diagnosis = replace(diagnosis, notes=notes, expected=kept)
    elif not held_out.worse:
        expected = held_out.expect(traced.search.fit)
        diagnosis = replace(diagnosis, expected=expected)
    extended = _extend_model(model, survey, traced.search, diagnosis)
    widths = newer_widths(model.flank_widths, extended, arm, reversals)
    extended = replace(extended, flank_widths=widths)
    if reversals is not None:
        diagnosis = replace(diagnosis, flanks=tell_widths(widths))
    return Extension(diagnosis, extended, traced.search, held_out)


def _keep_given(found: Search, held_out: HeldOut, model: Model) -> HeldOutError | None:
    """Return what a given model is expected to leave where it is to be kept.

    Its set-up, such as where each probe point is, is found from the rows in any case.

    Returns:
        None where a refit predicts held-out rows better, beyond what chance does.
    """
    base = found.base
    first, *setup = base.combination.effects
    if not isinstance(first, Revision):
        return None
    given, kept = found.fit, replace(held_out, after=held_out.before)
    if setup:
        effects = (first.fix_model(), *setup)
        given = fit_effects(base.batch, base.position, effects, base.noise.origin)
        kept = held_out.keeping(given)
    if PairedErrors.between(kept.after, held_out.after, held_out.pose).better:
        return None
    std = model.reading(base.batch.arm, base.batch.states).std
    return kept.expect(given, std)


def _with_mended_directions(
    traced: Investigation, seed: int, progress: Progress, without: Collection[str]
) -> Investigation:
    """Search again with wrong directions the other way, where there are any.

    They are asked for last: what an effect does is not to be taken for them.
    """
    base, fit = traced.search.base, traced.search.fit
    mended = mend_directions(fit, base.position)
    if mended is fit:
        return traced
    states = base.batch.states.with_(direction=mended.batch.states.direction)
    batch, effects = ArmStates(base.batch.arm, states), base.combination.effects
    progress("directions mended: again", 0.0)
    again = fit_effects(batch, base.position, effects, base.noise.origin, start=base)
    return trace(again, seed, progress, without)


def _conclude(
    survey: Measurements,
    traced: Investigation,
    held_out: HeldOut,
    tracker: Floats | None,
    seed: int,
) -> Diagnosis:
    """Put everything together."""
    found = traced.search
    floor = noise_floor(found.fit, tracker is not None)
    batch = ArmStates(found.fit.batch.arm, found.fit.batch.states[held_out.rows])
    verdict = _judge(traced, held_out, floor)
    before = multi_directional(batch, held_out.before)
    after = multi_directional(batch, held_out.after)
    why, poses = _next(traced, seed)
    return Diagnosis(
        verdict=verdict,
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
        dropped=survey.dropped + list_downweighted(found.fit, survey),
        directions=report_directions(found.fit, survey),
        not_excluded=not_excluded(found.fit.batch),
        fixed_points=() if survey.motion is None else survey.motion.tell(),
        notes=tuple(w for w in survey.warnings if w.endswith(AVERAGED)),
        set_anew=FrameShift.of(found.fit),
        explained=_measure_explained(held_out, floor) if traced.findings else None,
    )


def _judge(traced: Investigation, held_out: HeldOut, floor: NoiseFloor) -> Verdict:
    """Decide on the verdict by what held-out rows are left.

    Structure in the residual is "unexplained" only where the residual exceeds the noise
    floor clearly, as far as that is known otherwise than from the same rows.
    """
    if held_out.worse:
        return "rejected"
    size = float(np.linalg.norm(held_out.after, axis=1).mean())
    names = [a.candidate.effect for a in traced.search.additions]
    small = floor.measured and size < CLEARLY_ABOVE * floor.size
    if traced.verdict == "unexplained" and names and small:
        nameless = any(e.naming_policy == NamingPolicy.UNEXPLAINED for e in names)
        return "unexplained" if nameless else "effect"
    return traced.verdict


def _measure_explained(held_out: HeldOut, floor: NoiseFloor) -> float:
    """Return the part of the squared error above the noise floor that is explained."""
    before, after = (
        (e**2).sum(axis=1).mean() for e in (held_out.before, held_out.after)
    )
    above = float(before) - (floor.size / LENGTH) ** 2
    return float(np.clip((before - after) / max(above, 1e-300), 0.0, 1.0))


def _places(found: Search) -> tuple[ResidualPlace, ...]:
    """Say where what is left lives, from the candidates that come closest."""
    out = []
    for score in found.ranking_under(found.fit)[:PLACES]:
        family = score.family
        at = family.along or family.effect
        direction = at if family.joint is None else f"joint {family.joint}"
        driver = family.driver or score.best.source
        p_value = found.null.p_of(score)
        out.append(ResidualPlace(direction, driver, score.evidence, p_value))
    return tuple(out)


def _next(traced: Investigation, seed: int) -> tuple[str, Floats]:
    """Propose poses that separate the closest rivals, or sharpen the model."""
    found = traced.search
    for number, standing in enumerate(traced.standings):
        if standing.confusable:
            rival = standing.confusable[0]
            own = found.additions[number].candidate.family
            nats, poses = poses_that_separate(
                found.fit, found.place(number), rival, seed
            )
            if nats < TELLING:
                continue
            rounds = int(np.ceil(NEAR / nats))
            worth = (
                f"about {rounds} {'round' if rounds == 1 else 'rounds'} of these poses"
            )
            return f"tell {own} from {rival.family} ({worth})", poses
    name, poses = poses_that_sharpen(found.fit, seed)
    if name.startswith(Revision.name):
        name = "the given model"
    return f"sharpen {name}, known worst for what it moves", poses


def _extend_model(
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
    if KEPT in diagnosis.notes:
        return replace(model, parent=model.id, history=(*model.history, record))
    fitted = fold_back(model_of(no_surer(found.fit), survey))
    if is_fresh(survey, model):
        fitted = replace(
            fitted,
            ranges=model.ranges.join(fitted.ranges, _unlike(found, diagnosis)),
            statistics=fitted.statistics | _worst(model, fitted),
        )
    return replace(
        fitted, parent=model.id, history=(*model.history, record),
        doubt=_keep_open(model, fitted),
    )  # fmt: skip


def _keep_open(model: Model, extended: Model) -> Doubt | None:
    """Keep what may be there besides a model, unless some of it is there by now."""
    doubt, names = model.doubt, {e.name for e in extended.effects.effects}
    old = {e.name for e in model.effects.effects}
    if doubt is None or (names - old) & {e.name for e in doubt.effects.effects}:
        return None
    return doubt.among(model.effects.names, extended.effects.names)


def _unlike(found: Search, diagnosis: Diagnosis) -> set[str]:
    """Name what a revised model knows from its fresh rows alone, see `Ranges.join`.

    What drives an effect that was added is one: nobody has seen it elsewhere. Where
    something is left without a name, every joint is.
    """
    only, every = set[str](), {*map(str, JOINTS), "payload"}
    for addition in found.additions:
        if addition.candidate.effect.everywhere:
            continue
        for source in addition.candidate.source.split(" x "):
            kind, _, joint = source.partition(" ")
            if kind in BY_ANGLE:
                only.add(joint)
            elif kind in ("payload", "temperature"):
                only.add(kind)
            elif kind not in ("time", "order", "speed"):
                only |= every
    if diagnosis.verdict == "unexplained":
        only |= every
    if diagnosis.set_anew is not None and diagnosis.set_anew.bent:
        only.add("tool")
    return only


def _worst(model: Model, fitted: Model) -> dict[str, float]:
    """Return the least sure that a model is where it has been, as it was revised."""
    given = model.statistics.get(WORST_STD, 0.0)
    return {WORST_STD: max(given, fitted.statistics[WORST_STD])}


# What a reader needs to judge a diagnosis: residuals, rivals, rows, the chain.

LISTED = 25  # candidates
SHOWN = 3000  # rows: more say nothing more


def evidence_of(found: Extension) -> dict[str, Any]:
    """Write a diagnosis with all that it rests on, as plain data.

    To the report come, of every effect, ``evidence``: its residual against its
    covariate, with and without it; ``candidates``: what the given model's residual
    calls for, best first; ``rows``: error vectors of held-out rows; ``history``: the
    chain of models.
    """
    report = found.diagnosis.to_dict()
    search = found.search
    effects = [
        effect
        | {
            "evidence": _describe_profile(
                profile(search.fit, search.place(k), a.candidate)
            )
        }
        for k, (effect, a) in enumerate(
            zip(report["effects"], search.additions, strict=True)
        )
    ]
    return report | {
        "effects": effects,
        "candidates": _candidates(found),
        "rows": _rows(found),
        "history": [dict(record) for record in found.model.history],
    }


def dump_json(report: Mapping[str, Any]) -> str:
    """Write a report as JSON text, a key a line, rows in one."""
    keys = [f" {json.dumps(k)}: {json.dumps(v)}" for k, v in report.items()]
    return "{\n" + ",\n".join(keys) + "\n}\n"


def _describe_profile(shown: Profile) -> Mapping[str, Any]:
    """Write a profile, in millimetres of the TCP."""
    some = thin_rows(len(shown.values))
    before, after = (
        (values * shown.lever)[some] for values in (shown.before, shown.after)
    )
    return {
        "covariate": shown.label,
        "unit": shown.unit,
        "direction": shown.direction.partition(" [")[0],
        "x": _plain(shown.values[some]),
        "before_mm": _plain(before),
        "after_mm": _plain(after),
    }


def _candidates(found: Extension) -> list[dict[str, Any]]:
    """List what the residual of the given model calls for."""
    search = found.search
    scores = search.ranking_under(search.base)
    scores = sorted(scores, key=lambda s: (search.null.p_of(s), -s.evidence))[:LISTED]
    return [
        {
            "effect": s.family.effect,
            "joint": s.family.joint,
            "source": s.best.source,
            "p_value": search.null.p_of(s),
            "evidence_nats": round(s.evidence, 3),
        }
        for s in scores
    ]


def _rows(found: Extension) -> dict[str, list[Any]]:
    """List error vectors of held-out rows [mm]."""
    rows = found.held_out
    some = thin_rows(len(rows.rows))
    return {
        "before_mm": _plain(rows.before[some] / MM),
        "after_mm": _plain(rows.after[some] / MM),
    }


def thin_rows(count: int) -> NDArray[np.int64]:
    """Choose at most so many rows, evenly.

    >>> len(thin_rows(10)), len(thin_rows(100_000))
    (10, 3000)
    """
    places = np.linspace(0, count - 1, min(count, SHOWN))
    return np.unique(places.astype(np.int64))


def _plain(values: Floats) -> list[Any]:
    """Write numbers as short as they deserve, unknown ones as none."""
    listed = np.round(values, 5).astype(object)
    listed[~np.isfinite(values)] = None
    plain: list[Any] = listed.tolist()
    return plain
