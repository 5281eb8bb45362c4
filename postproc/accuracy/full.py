"""The product's own method: a survey becomes a fit of named effects, and a model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.accuracy.fit import fit_effects
from postproc.accuracy.fitted import Fit
from postproc.accuracy.measurement import Measurements
from postproc.accuracy.selection import fit_best
from postproc.accuracy.turns import Turns
from postproc.arrays import Floats
from postproc.model.effects import propose
from postproc.model.effects.probe_turn import ProbeTurn
from postproc.model.kinematics import Batch
from postproc.model.model import COMPENSATED, Model, Ranges
from postproc.robot.arm import Arm
from postproc.robot.pose import MM


def fit_survey(
    survey: Measurements,
    arm: Arm,
    effects: Sequence[str] | None,
    tracker: Floats | None,
    setup: tuple[str, ...] = (),
) -> Fit:
    """Fit effects to a survey in the base frame.

    Args:
        survey: The measurements.
        arm: The arm.
        effects: Names of effects; None: those that the survey gives evidence for.
        tracker: Tracker position in the base frame, (3,) [m], or None.
        setup: Names of effects of the set-up, fitted besides.

    Raises:
        PostprocError: An unknown effect, or one whose covariate was not recorded.
    """
    origin = None if tracker is None else (tracker[0], tracker[1], tracker[2])
    states, position, batch = survey.states, survey.position, Batch(arm, survey.states)
    turns = None
    if survey.rotation is not None and survey.mounting is not None:
        turns = Turns.of(batch, survey.rotation, survey.mounting)
        setup = (*setup, ProbeTurn.name)
    if effects is None:
        return fit_best(arm, states, position, origin, setup, turns)
    chosen = propose((*effects, *setup), arm, states)
    return fit_effects(batch, position, chosen, origin, turns=turns)


def model_of(fitted: Fit, survey: Measurements) -> Model:
    """Keep what a fit found as a model."""
    used = fitted.rows.weight > 0
    left = np.linalg.norm(fitted.residual[used], axis=1) / MM
    covariance = fitted.stated
    told = fitted.combination.where(*COMPENSATED)
    X = fitted.columns[:, :, told]  # of predictions: the set-up is no part of them
    known = np.sqrt(np.einsum("nip,nip->ni", X @ covariance[np.ix_(told, told)], X))
    arm = fitted.batch.arm
    statistics = {
        "residual_mean_mm": float(left.mean()),
        "residual_max_mm": float(left.max()),
        "worst_std_mm": float(known.max(initial=0.0) / MM),
        "effective_parameters": fitted.effective,
        "log_evidence": fitted.log_evidence,
        "rows_dropped": float((~used).sum() + len(survey.dropped)),
    }
    if fitted.turns is not None:
        statistics["orientation_std_mrad"] = fitted.turns.std * 1e3
    return Model(
        method="full",
        arm_name=arm.name,
        arm_id=arm.id,
        effects=fitted.combination,
        values=fitted.values,
        covariance=covariance,
        prior_std=fitted.prior_std,
        noise=fitted.noise,
        ranges=Ranges.of(survey.states[used], fitted.turns is not None),
        rows=int(used.sum()),
        data_sha256=survey.sha256,
        statistics=statistics,
    )
