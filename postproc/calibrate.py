"""The second sentence: measurements become a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from postproc.accuracy.batch import Batch
from postproc.accuracy.fit import Fit, fit_effects
from postproc.accuracy.fit_report import FitReport, report_fit
from postproc.accuracy.library import BASE_EFFECTS, propose
from postproc.accuracy.measurement import (
    Measurements,
    concatenate,
    read_measurements,
)
from postproc.accuracy.model import Model
from postproc.accuracy.plausibility import check_survey
from postproc.accuracy.ranges import Ranges
from postproc.pose import MM
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell


@dataclass(frozen=True, eq=False)
class Calibration:
    """A model, what the fit found, and the fit itself for further tests."""

    model: Model
    report: FitReport
    fit: Fit


def fit(
    files: Sequence[str | Path],
    cell: Cell,
    *,
    effects: Sequence[str] = BASE_EFFECTS,
) -> Calibration:
    """Fit a model to measurement files.

    Args:
        files: Measurement files, in visit order.
        cell: The cell: arm, probe points, tracker.
        effects: Names of the effects to fit.

    Raises:
        MeasurementError: A file that cannot be read or cannot determine the geometry.
        PostprocError: An unknown effect, or one whose covariate was not recorded.
    """
    survey = read_surveys(files, cell)
    check_survey(survey, cell.arm)
    fitted = fit_survey(survey, cell, effects)
    report = report_fit(fitted, survey)
    return Calibration(model_of(fitted, survey, cell.arm), report, fitted)


def read_surveys(files: Sequence[str | Path], cell: Cell) -> Measurements:
    """Read measurement files as one survey, with what the cell knows of the load."""
    parts = [read_measurements(path, cell.arm, cell.probes) for path in files]
    survey = concatenate(parts)
    if cell.file.payload is None:
        return survey
    com = np.tile(cell.payload_com, (len(survey), 1))
    return survey.with_states(survey.states.with_(payload_com=com))


def fit_survey(survey: Measurements, cell: Cell, effects: Sequence[str]) -> Fit:
    """Fit effects to a survey in the base frame."""
    chosen = propose(effects, cell.arm, survey.states)
    origin = None if cell.tracker is None else tuple(map(float, cell.tracker))
    batch = Batch(cell.arm, survey.states)
    return fit_effects(batch, survey.position, chosen, origin)  # type: ignore[arg-type]


def model_of(fitted: Fit, survey: Measurements, arm: Arm) -> Model:
    """Keep what a fit found as a model."""
    used = fitted.rows.weight > 0
    residual = np.linalg.norm(fitted.residual[used], axis=1) / MM
    X = fitted.columns
    known = np.sqrt(np.einsum("nip,nip->ni", X @ fitted.covariance, X))
    statistics = {
        "residual_mean_mm": float(residual.mean()),
        "residual_max_mm": float(residual.max()),
        "worst_std_mm": float(known.max() / MM),
        "effective_parameters": fitted.effective,
        "log_evidence": fitted.log_evidence,
        "rows_dropped": float((~used).sum() + len(survey.dropped)),
    }
    return Model(
        method="full",
        arm_name=arm.name,
        arm_id=arm.id,
        effects=fitted.combination,
        values=fitted.values,
        covariance=fitted.covariance,
        prior_std=fitted.prior_std,
        noise=fitted.noise,
        ranges=Ranges.of(survey.states[used]),
        rows=int(used.sum()),
        data_sha256=survey.sha256,
        statistics=statistics,
    )
