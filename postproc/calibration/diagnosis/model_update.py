"""The given model's effects, fitted to the rows that are to be diagnosed."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.backward_elimination import ENOUGH
from postproc.calibration.evidence import posterior
from postproc.calibration.measurements import Measurements
from postproc.calibration.regression import Fit, fit_effects
from postproc.exceptions import PostprocError
from postproc.model.effect_sum import Combination
from postproc.model.effects import propose
from postproc.model.effects.effect import Effect, Parameter
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.robot.arm import Arm
from postproc.robot.pose import MM

# A model that fresh rows revise and do not replace.
#
# What the given model says is the prior: its parameters may move as far as its
# covariance lets them, times a factor that the rows choose. Rows of one job tell little
# of the rest of an arm's range, and what a survey has told of that is not thrown away
# for them. Base and tool may be others since: they may move besides, as far as the
# rows ask for.

NOTHING = 1e-6  # share of the largest variance below which a direction is known
UNSEEN = 1e-7  # [m rms] a direction that moves the rows by less is not revised
GIVEN = "model"  # group of the given model's own uncertainty
TRACKER = "tracker"  # group of a set-up's parameters that place the base
CLEARLY = 3.0  # standard errors
ZERO = "zero"  # groups of zeros of joints that are open again
OPEN = 3e-4  # [rad] by which the zero of a joint differs beside what a model lacks
MOVED = 3e-3  # [rad] .. beside what moved it
SET_ANEW = ("base shift", "base turn", "tool")  # groups of what may be others since


@dataclass(frozen=True, eq=False)
class Revision(Effect):
    """The given model's uncertainty as an effect: its own columns times F eta.

    Attributes:
        model: The given model, effects of the set-up left out.
        factor: F, (p, r): first L with L L^T its covariance as far as it moves the
            rows, then what may be others since, one parameter a column.
        groups: Prior group of every column, (r,).
        unseen: What is left of its covariance: nothing that the rows tell of, (p, p).
    """

    name: ClassVar[str] = "revision"

    model: Model
    factor: Floats
    groups: tuple[str, ...]
    unseen: Floats

    @classmethod
    def of(cls, model: Model, batch: ArmStates, anew: tuple[str, ...] = ()) -> Revision:
        """Take a model's covariance apart into what rows tell of and what not.

        A long survey leaves hundreds of uncertain directions, splines at angles where
        the rows never are for instance, which would be fitted in vain again and again.

        Args:
            model: The model.
            batch: States of the rows.
            anew: Groups of parameters that may be others since.
        """
        value, vector = np.linalg.eigh(model.covariance)
        kept = value > NOTHING * float(value.max(initial=0.0))
        factor = vector[:, kept] * np.sqrt(value[kept])
        columns = model.effects.columns(model.effects.at(batch, model.values))
        moved = columns.reshape(-1, len(factor)) @ factor
        square, way = np.linalg.eigh(moved.T @ moved / len(batch))
        seen = square > UNSEEN**2
        aside = factor @ way[:, ~seen]
        free = [k for k, p in enumerate(model.effects.parameters) if p.group in anew]
        more = np.diag(model.effects.scales)[:, free]
        groups = [model.effects.parameters[k].group for k in free]
        return cls(
            model,
            np.concatenate([factor @ way[:, seen], more], axis=1),
            (*(int(seen.sum()) * [GIVEN]), *groups),
            aside @ aside.T,
        )

    def beside(self, others: Sequence[Effect]) -> Revision:
        """Return the revision as it is fitted beside laws that the model lacks.

        The model's zero of a joint holds the mean of what the model lacks there: a law
        that is added has that mean too, and the zero is open again. It stays known
        beside a `joint_offset`, which is the change of the zero itself.
        """
        offsets = {j for e in others if e.everywhere for j in joints_of(e)}
        lacking = {j for e in others if e.has_mean() for j in joints_of(e)}
        known = [k for k, g in enumerate(self.groups) if not g.startswith(ZERO)]
        closed = replace(
            self,
            factor=self.factor[:, known],
            groups=tuple(self.groups[k] for k in known),
        )
        moved = {j for e in others if e.sets_zero for j in joints_of(e)} - offsets
        return closed.free_zeros(moved, moved=True).free_zeros(lacking - offsets)

    def fix_model(self) -> Revision:
        """Return the given model as it is, nothing of it to be fitted."""
        return replace(self, factor=self.factor[:, :0], groups=())

    def free_zeros(self, joints: Collection[int], moved: bool = False) -> Revision:
        """Return the revision with the zeros of joints to be fitted again."""
        names = self.model.effects.names
        zeros = {f"{ZERO}{j}": f"geometry.theta{j}" for j in sorted(joints)}
        added = {
            group: names.index(name) for group, name in zeros.items()
            if name in names and group not in self.groups
        }  # fmt: skip
        if not added:
            return self
        more = np.zeros((len(names), len(added)))
        more[list(added.values()), range(len(added))] = MOVED if moved else OPEN
        return replace(
            self,
            factor=np.concatenate([self.factor, more], axis=1),
            groups=(*self.groups, *added),
        )

    def parameters(self) -> tuple[Parameter, ...]:
        """Number the directions of the uncertainty, and name open zeros."""
        return tuple(
            Parameter(g if g.startswith(ZERO) else f"eta{k}", "1", 1.0, g)
            for k, g in enumerate(self.groups)
        )

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position, (n, 3, r), wherever others move it."""
        held = batch.known.get(self.name, (None, None, None))
        if held[0] is not self.factor or held[1] is not batch.states:
            effects = self.model.effects
            at = effects.at(batch, self.model.values)
            held = self.factor, batch.states, effects.columns(at) @ self.factor
            batch.known[self.name] = held
        columns: Floats = held[2]
        return columns

    def settings(self) -> dict[str, Any]:
        """Refuse: it is folded back into the model before anything is written."""
        raise TypeError("a revision is no part of a model file")


def revises(fit: Fit) -> bool:
    """Tell whether a fit revises a given model."""
    effects = fit.combination.effects
    return bool(effects) and isinstance(effects[0], Revision)


def joints_of(effect: Effect) -> set[int]:
    """Return the joints that the parameters of an effect act on."""
    return {p.joint for p in effect.parameters() if p.joint is not None}


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
        doubt=None if model.doubt is None else model.doubt.get_settings(keep),
    )


def revise(
    survey: Measurements,
    model: Model,
    batch: ArmStates,
    origin: tuple[float, float, float] | None,
    setup: tuple[Effect, ...] = (),
) -> tuple[Fit, ...]:
    """Fit what a model leaves of fresh rows, with its own uncertainty as an effect.

    Returns:
        The fit; where the rows speak for it, a second one in which base and tool may
        be others than the given model's.
    """
    known = only_arm(model)
    left = survey.position - known.effects.error(batch, known.values)

    def fit(*anew: str) -> Fit:
        revision = Revision.of(known, batch, anew)
        return fit_effects(batch, left, (revision, *setup), origin)

    same = fit()
    if any(p.group == TRACKER for e in setup for p in e.parameters()):
        return (same,)  # it places both
    other = fit(*SET_ANEW)
    return (same, other) if other.log_evidence > same.log_evidence + ENOUGH else (same,)


@dataclass(frozen=True)
class FrameShift:
    """How base and tool lie beside where the given model has them, base and flange.

    Attributes:
        base: Shift of the base, (3,) [m].
        turn: Turn of the base about its axes, (3,) [rad].
        tool: Shift of the TCP on the flange, (3,) [m].
        bent: Whether that of the tool is none of noise.
    """

    base: Floats
    turn: Floats
    tool: Floats
    bent: bool

    @classmethod
    def of(cls, fit: Fit) -> FrameShift | None:
        """Read it from a revision, None where both are the same as far as rows tell."""
        first = fit.combination.effects[0]
        if not isinstance(first, Revision):
            return None
        (base, shifted), (turn, turned), (tool, bent) = (
            cls._measure_shift(fit, first, name) for name in SET_ANEW
        )
        if not (shifted or turned or bent):
            return None
        return cls(base, turn, tool, bent)

    @staticmethod
    def _measure_shift(fit: Fit, first: Revision, group: str) -> tuple[Floats, bool]:
        """Return by what one group moved, (3,), and whether that is none of noise."""
        own = np.flatnonzero([g == group for g in first.groups])
        if not len(own):
            return np.zeros(3), False
        scale = first.factor[:, own].sum(axis=0)  # a column is one parameter
        moved = scale * fit.values[own]
        return moved, bool((np.abs(moved) > CLEARLY * scale * fit.std[own]).any())

    def tell(self) -> str:
        """Say it in a line."""
        base, tool = (float(np.linalg.norm(v)) / MM for v in (self.base, self.tool))
        turn = 1e3 * float(np.linalg.norm(self.turn))
        return (
            f"since the survey of the given model the base has moved by {base:.3f} mm "
            f"and turned by {turn:.3f} mrad, the tool has moved by {tool:.3f} mm: both "
            "are compensated. If it was the tracker that moved, give its readings "
            "with --set measurements.frame=tracker"
        )

    def to_dict(self) -> dict[str, list[float]]:
        """Return it as plain data, in mm and mrad."""
        parts = ("base_mm", self.base), ("turn_mrad", self.turn), ("tool_mm", self.tool)
        return {name: [round(1e3 * float(v), 5) for v in part] for name, part in parts}


def no_surer(fit: Fit) -> Fit:
    """Solve a revision again whose rows make the given model surer than it says.

    A few rows that it happens to predict well are no proof of that.
    """
    group = f"{Revision.name}.{GIVEN}"
    if group not in fit.groups or fit.log_scale[fit.groups.index(group)] >= 0.0:
        return fit
    log_scale = np.where([g == group for g in fit.groups], 0.0, fit.log_scale)
    solved, scales = (
        posterior(fit.normal(), fit.group, log_scale),
        fit.combination.scales,
    )
    values = scales * solved.mean
    return replace(
        fit,
        values=values,
        covariance=solved.covariance * np.outer(scales, scales),
        log_scale=log_scale,
        residual=fit.residual - fit.design.times(values - fit.values),
    )


def fold_back(model: Model) -> Model:
    """Write a revised model as effects with parameters of their own.

    Directions that the rows tell nothing of are as unsure as before, and more so where
    the rows found the given model less sure than it said.
    """
    first, *added = model.effects.effects
    if not isinstance(first, Revision):
        return model
    count, rank = first.factor.shape
    spread = np.zeros((count + len(model.values) - rank, len(model.values)))
    spread[:count, :rank] = first.factor
    spread[count:, rank:] = np.eye(len(model.values) - rank)
    values = spread @ model.values
    values[:count] += first.model.values
    covariance = spread @ model.covariance @ spread.T
    unsure = float(model.prior_std[0]) if GIVEN in first.groups else 1.0
    covariance[:count, :count] += max(unsure, 1.0) ** 2 * first.unseen
    return replace(
        model,
        effects=Combination((*first.model.effects.effects, *added)),
        values=values,
        covariance=covariance,
        prior_std=np.append(first.model.prior_std, model.prior_std[rank:]),
    )


# The given model's effects, fitted to the rows that are to be diagnosed.

FEWEST = 12  # rows


def is_fresh(survey: Measurements, model: Model) -> bool:
    """Tell whether rows are others than those that a model was fitted to."""
    return model.data_sha256 != survey.sha256


def refit(
    survey: Measurements,
    arm: Arm,
    model: Model,
    tracker: Floats | None,
    setup: tuple[str, ...] = (),
) -> tuple[Fit, ...]:
    """Fit the given model's effects to its own rows, or revise it by fresh ones.

    Returns:
        The fit, or two of which the rows must tell which is right, see `revise`.

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
            f"{survey.path}: has {len(survey)} rows once the readings of every stop "
            f"are averaged, and a diagnosis needs at least {FEWEST}. Measure more poses"
        )
    origin = None if tracker is None else (tracker[0], tracker[1], tracker[2])
    batch = ArmStates(arm, survey.states)
    fresh = is_fresh(survey, model)
    effects = (only_arm(model) if fresh else model).effects.effects
    missing = [name for name in setup if name not in {e.name for e in effects}]
    placed = propose(missing, arm, survey.states)
    if fresh:
        return revise(survey, model, batch, origin, placed)
    return (fit_effects(batch, survey.position, (*effects, *placed), origin),)
