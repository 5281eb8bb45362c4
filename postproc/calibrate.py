"""The second sentence: measurements become a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from postproc.accuracy.fit_report import FitReport, report_fit, report_method
from postproc.accuracy.full import fit_survey, model_of
from postproc.accuracy.library import BASE_EFFECTS
from postproc.accuracy.measurement import (
    Measurements,
    concatenate,
    read_measurements,
)
from postproc.accuracy.methods import fit_method
from postproc.accuracy.model import Model
from postproc.accuracy.plausibility import check_survey
from postproc.accuracy.schema import Method
from postproc.robot.cell import Cell


@dataclass(frozen=True, eq=False)
class Calibration:
    """A model, and what the fit found."""

    model: Model
    report: FitReport


def fit(
    files: Sequence[str | Path],
    cell: Cell,
    *,
    method: Method = "full",
    effects: Sequence[str] = BASE_EFFECTS,
    seed: int = 0,
) -> Calibration:
    """Fit a model to measurement files in the base frame.

    Args:
        files: Measurement files, in visit order.
        cell: The cell: arm, probe points, tracker.
        method: "full" or one of the source's methods.
        effects: Names of the effects that "full" fits.
        seed: Of random layers, for methods that have one.

    Raises:
        MeasurementError: A file that cannot be read or cannot determine the geometry.
        PostprocError: An unknown effect, or one whose covariate was not recorded.
    """
    survey = read_surveys(files, cell)
    return fit_measurements(survey, cell, method=method, effects=effects, seed=seed)


def fit_measurements(
    survey: Measurements,
    cell: Cell,
    *,
    method: Method = "full",
    effects: Sequence[str] = BASE_EFFECTS,
    seed: int = 0,
) -> Calibration:
    """Fit a model to measurements in the base frame, see `fit`."""
    check_survey(survey, cell.arm)
    if method != "full":
        model = fit_method(method, survey, cell.arm, seed)
        return Calibration(model, report_method(model, survey, cell.arm))
    fitted = fit_survey(survey, cell.arm, effects, cell.tracker)
    return Calibration(model_of(fitted, survey), report_fit(fitted, survey))


def read_surveys(files: Sequence[str | Path], cell: Cell) -> Measurements:
    """Read measurement files as one survey, with what the cell knows of the load."""
    parts = [read_measurements(path, cell.arm, cell.probes) for path in files]
    survey = concatenate(parts)
    if cell.file.payload is None:
        return survey
    com = np.tile(cell.payload_com, (len(survey), 1))
    return survey.with_states(survey.states.with_(payload_com=com))
