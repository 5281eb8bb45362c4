"""What a fit found, for people."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.measurements import DroppedRow, Measurements
from postproc.calibration.regression import Fit, Unseen, observe
from postproc.model.kinematics import Batch
from postproc.model.model import Model
from postproc.model.statistics import ErrorStatistics
from postproc.robot.arm import Arm
from postproc.robot.pose import MM

CORRELATED = 0.9
SHOWN_UNITS = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "rad/(N m)": ("urad/(N m)", 1e6)}


@dataclass(frozen=True)
class ParameterRow:
    """One line of the parameter table, in the unit that people use.

    Attributes:
        share: Part of the squared error that it explains; shares add up.
        determined: 0 (at its prior) .. 1 (by the data alone).
    """

    name: str
    value: float
    std_error: float
    unit: str
    share: float
    determined: float


@dataclass(frozen=True)
class FitReport:
    """Everything worth telling about a fit.

    Attributes:
        parameters: The table.
        shares: Part of the squared error explained, by effect.
        correlated: Pairs of parameters with their correlation, above 0.9.
        dropped: Rows left out or down-weighted, and why.
        spared: Ids of rows that stand out, as their neighbours do: kept.
        unseen: Directions that the rows do not determine.
        before, after: Measured errors, and what the fit leaves of them.
        tracker_mm: Estimated standard deviation of the tracker, typical, per axis.
        repeatability_mm: Estimated scatter of arrivals, typical, per axis.
        effective: Effective number of parameters.
        warnings: What else to know.
        orientation_mrad: Estimated scatter of orientations about each axis, or None.
    """

    parameters: tuple[ParameterRow, ...]
    shares: dict[str, float]
    correlated: tuple[tuple[str, str, float], ...]
    dropped: tuple[DroppedRow, ...]
    spared: tuple[str, ...]
    unseen: tuple[Unseen, ...]
    before: ErrorStatistics
    after: ErrorStatistics
    tracker_mm: float
    repeatability_mm: float
    effective: float
    warnings: tuple[str, ...]
    orientation_mrad: float | None = None


def report_fit(fit: Fit, survey: Measurements) -> FitReport:
    """Put a fit into words and numbers."""
    used = fit.rows.weight > 0
    shares = _shares(fit)
    effects = {
        effect.name: float(shares[part].sum())
        for effect, part in zip(
            fit.combination.effects, fit.combination.slices, strict=True
        )
    }
    arrival = np.sqrt(fit.noise.arrival_variance(fit.batch.jacobian).mean())
    tracker = fit.noise.tracker_std(survey.position).mean()
    return FitReport(
        parameters=_table(fit, shares),
        shares=effects,
        correlated=_correlated(fit),
        dropped=survey.dropped + weighed_down(fit, survey),
        spared=tuple(survey.ids[i] for i in np.flatnonzero(fit.rows.spared)),
        unseen=observe(fit.normal().root(), fit.combination.names, floor=1.0).unseen,
        before=ErrorStatistics.of(fit.error[used]),
        after=ErrorStatistics.of(fit.residual[used]),
        tracker_mm=float(tracker / MM),
        repeatability_mm=float(arrival / MM),
        effective=fit.effective,
        warnings=survey.warnings,
        orientation_mrad=None if fit.turns is None else fit.turns.std * 1e3,
    )


def report_method(model: Model, survey: Measurements, arm: Arm) -> FitReport:
    """Report a method that has no named parameters."""
    error = survey.position - Batch(arm, survey.states).walk.tcp
    left = error - model.measured_error(arm, survey.states)
    return FitReport(
        parameters=(),
        shares={},
        correlated=(),
        dropped=survey.dropped,
        spared=(),
        unseen=(),
        before=ErrorStatistics.of(error),
        after=ErrorStatistics.of(left),
        tracker_mm=0.0,
        repeatability_mm=0.0,
        effective=float(len(model.values)),
        warnings=survey.warnings,
    )


def _shares(fit: Fit) -> Floats:
    """Part of the squared error that each parameter explains, (p,)."""
    total = float((fit.error**2).sum())
    shares: Floats = fit.design.moment(fit.error) * fit.values / max(total, 1e-300)
    return shares


def _table(fit: Fit, shares: Floats) -> tuple[ParameterRow, ...]:
    """Make the parameter table."""
    rows, std = [], np.sqrt(np.diag(fit.stated))
    for k, (name, p) in enumerate(
        zip(fit.combination.names, fit.combination.parameters, strict=True)
    ):
        unit, factor = SHOWN_UNITS.get(p.unit, (p.unit, 1.0))
        known = 1.0 - (fit.std[k] / fit.prior_std[k]) ** 2
        rows.append(
            ParameterRow(
                name, float(fit.values[k] * factor), float(std[k] * factor), unit,
                float(shares[k]), float(np.clip(known, 0.0, 1.0)),
            )
        )  # fmt: skip
    return tuple(rows)


def _correlated(fit: Fit) -> tuple[tuple[str, str, float], ...]:
    """List pairs of parameters that the data cannot tell apart well."""
    C = fit.covariance / np.outer(fit.std, fit.std)
    pairs = np.argwhere(np.triu(np.abs(C) > CORRELATED, 1))
    names = fit.combination.names
    return tuple((names[i], names[j], float(C[i, j])) for i, j in pairs)


def weighed_down(fit: Fit, survey: Measurements) -> tuple[DroppedRow, ...]:
    """List the rows that count less than fully, and why."""
    out = []
    for i in np.flatnonzero(fit.rows.weight < 1.0):
        w, d = fit.rows.weight[i], fit.rows.distance[i]
        size = np.linalg.norm(fit.residual[i]) / MM
        what = "dropped" if w == 0 else f"weight {w:.2f}"
        why = f"{what}: off by {size:.3f} mm, {d:.1f} sigma; its neighbours disagree"
        out.append(DroppedRow(survey.ids[i], int(survey.line[i]), why))
    return (*out, *_turned_down(fit, survey))


def _turned_down(fit: Fit, survey: Measurements) -> Iterator[DroppedRow]:
    """List the rows whose position counts more than their orientation."""
    if fit.turns is None:
        return
    size = np.linalg.norm(fit.turns.residual, axis=1)
    for i in np.flatnonzero((fit.turns.weight < 1.0) & (fit.rows.weight > 0)):
        w = fit.turns.weight[i]
        what = "orientation " + ("dropped" if w == 0 else f"weight {w:.2f}")
        sigma = size[i] / fit.turns.std
        why = f"{what}: off by {size[i] * 1e3:.2f} mrad, {sigma:.1f} sigma"
        yield DroppedRow(survey.ids[i], int(survey.line[i]), why)
