"""The given model's effects, fitted to the rows that are to be diagnosed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.design import DesignMatrix
from postproc.calibration.measurements import Measurements
from postproc.calibration.regression import Fit, fit_effects
from postproc.exceptions import PostprocError
from postproc.model.combination import Combination
from postproc.model.effects import propose
from postproc.model.effects.effect import Effect, Parameter
from postproc.model.kinematics import Batch
from postproc.model.model import Model
from postproc.robot.arm import Arm

# A model that few fresh points may revise but cannot replace.
#
# A handful of points of a production part cannot determine an arm's geometry again.
# What the given model says is then the prior: its parameters may move as far as its
# covariance lets them, times a factor that the points choose.

ROWS_PER_PARAMETER = 2  # rows from which a model is refitted rather than revised
NOTHING = 1e-6  # share of the largest variance below which a direction is known
UNSEEN = 1e-7  # [m rms] a direction that moves the rows by less is not revised


@dataclass(frozen=True, eq=False)
class Revision(Effect):
    """The given model's uncertainty as an effect: its own columns times L eta.

    Attributes:
        model: The given model, effects of the set-up left out.
        factor: L with L L^T its covariance as far as it moves the rows, (p, r).
        unseen: What is left of its covariance: nothing that the rows tell of, (p, p).
    """

    name: ClassVar[str] = "revision"

    model: Model
    factor: Floats
    unseen: Floats

    @classmethod
    def of(cls, model: Model, batch: Batch) -> Revision:
        """Take a model's covariance apart into what rows tell of and what not.

        A long survey leaves hundreds of uncertain directions, splines at angles where
        the rows never are for instance, which would be fitted in vain again and again.
        """
        value, vector = np.linalg.eigh(model.covariance)
        kept = value > NOTHING * float(value.max(initial=0.0))
        factor = vector[:, kept] * np.sqrt(value[kept])
        columns = model.effects.columns(model.effects.at(batch, model.values))
        moved = columns.reshape(-1, len(factor)) @ factor
        square, way = np.linalg.eigh(moved.T @ moved / len(batch))
        seen = square > UNSEEN**2
        aside = factor @ way[:, ~seen]
        return cls(model, factor @ way[:, seen], aside @ aside.T)

    def parameters(self) -> tuple[Parameter, ...]:
        """Number the directions of the uncertainty."""
        return tuple(
            Parameter(f"eta{k}", "1", 1.0, "model") for k in range(self.factor.shape[1])
        )

    def columns(self, batch: Batch) -> Floats:
        """Differentiate the TCP position, (n, 3, r), wherever others move it."""
        held = batch.known.get(self)
        if held is None or held[0] is not batch.states:
            effects = self.model.effects
            at = effects.at(batch, self.model.values)
            held = batch.known[self] = batch.states, effects.columns(at) @ self.factor
        columns: Floats = held[1]
        return columns

    def settings(self) -> dict[str, Any]:
        """Refuse: it is folded back into the model before anything is written."""
        raise TypeError("a revision is no part of a model file")


def only_arm(model: Model) -> Model:
    """Leave out what belongs to the survey's own set-up."""
    effects, values, covariance = model.compensable()
    keep = model.effects.where("arm", "state")
    return replace(
        model,
        effects=effects,
        values=values,
        covariance=covariance,
        prior_std=model.prior_std[keep],
    )


def few(survey: Measurements, model: Model) -> bool:
    """Tell whether rows are too few to fit the model's parameters again."""
    return len(survey) < ROWS_PER_PARAMETER * len(model.values)


def revise(
    survey: Measurements,
    model: Model,
    batch: Batch,
    origin: tuple[float, float, float] | None,
    setup: tuple[Effect, ...] = (),
) -> Fit:
    """Fit what a model leaves of a few rows, with its own uncertainty as an effect."""
    known = only_arm(model)
    left = survey.position - known.effects.error(batch, known.values)
    return fit_effects(batch, left, (Revision.of(known, batch), *setup), origin)


def fold_back(fit: Fit) -> Fit:
    """Write a revision and what was added as effects with parameters of their own."""
    first, *added = fit.combination.effects
    assert isinstance(first, Revision)
    effects = (*first.model.effects.effects, *added)
    count, rank = first.factor.shape
    spread = np.zeros((count + len(fit.values) - rank, len(fit.values)))
    spread[:count, :rank] = first.factor
    spread[count:, rank:] = np.eye(len(fit.values) - rank)
    values = spread @ fit.values
    values[:count] += first.model.values
    covariance = spread @ fit.covariance @ spread.T
    covariance[:count, :count] += first.unseen
    combination = Combination(effects)
    known = first.model.effects.error(fit.batch, first.model.values)
    groups = tuple(dict.fromkeys(combination.groups))
    scale = dict(zip(fit.groups, fit.log_scale, strict=True))
    return replace(
        fit,
        combination=combination,
        error=fit.error + known,
        values=values,
        covariance=covariance,
        groups=groups,
        log_scale=np.array([scale.get(g, 0.0) for g in groups]),
        design=DesignMatrix.of(combination, combination.at(fit.batch, values)),
    )


# The given model's effects, fitted to the rows that are to be diagnosed.

FEWEST = 12  # rows


def refit(
    survey: Measurements,
    arm: Arm,
    model: Model,
    tracker: Floats | None,
    setup: tuple[str, ...] = (),
) -> Fit:
    """Fit the given model's effects to the rows, or revise it where they are few.

    Raises:
        PostprocError: The model was not made by the full method, or there are hardly
            any rows.
    """
    model.check_arm(arm)
    if model.method != "full":
        raise PostprocError(
            f"a model of method {model.method} has no named effects to extend. "
            "Fit one with --method full and diagnose that"
        )
    if len(survey) < FEWEST:
        raise PostprocError(
            f"{survey.path} has {len(survey)} rows; tracing an effect takes at least "
            f"{FEWEST}. Measure more points"
        )
    origin = None if tracker is None else (tracker[0], tracker[1], tracker[2])
    batch = Batch(arm, survey.states)
    effects = model.effects.effects
    if model.data_sha256 != survey.sha256:
        effects = only_arm(model).effects.effects
    missing = [name for name in setup if name not in {e.name for e in effects}]
    placed = propose(missing, arm, survey.states)
    if model.data_sha256 != survey.sha256 and few(survey, model):
        return revise(survey, model, batch, origin, placed)
    return fit_effects(batch, survey.position, (*effects, *placed), origin)
