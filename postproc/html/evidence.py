"""What a calibration page shows beyond the model file: the rows and the report."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.measurements import Measurements
from postproc.calibration.report import FitReport
from postproc.html.summary import finite
from postproc.model.kinematics import Batch
from postproc.model.model import Model
from postproc.robot.arm import Arm
from postproc.robot.pose import MM


def fit_evidence(
    report: FitReport, model: Model, survey: Measurements, arm: Arm
) -> dict[str, Any]:
    """Put the report of a fit and its rows into JSON values.

    Returns:
        The fields of the report, ``unseen`` in words, and ``rows``: lists of ``id``,
        ``q_deg``, ``lambda``, ``position_mm``, ``before_mm`` (measured error) and
        ``after_mm`` (what the model leaves of it), in visit order, base frame.
    """
    states = survey.states
    before = survey.position - Batch(arm, states).walk.tcp
    after = before - model.measured_error(arm, states)
    told = asdict(report) | {"unseen": [str(u) for u in report.unseen]}
    rows = {
        "id": list(survey.ids),
        "q_deg": _lists(np.rad2deg(states.q), 6),
        "lambda": np.asarray(states.direction, dtype=int).tolist(),
        "position_mm": _lists(survey.position / MM, 4),
        "before_mm": _lists(before / MM, 5),
        "after_mm": _lists(after / MM, 5),
    }
    evidence: dict[str, Any] = finite(told | {"rows": rows})
    return evidence


def _lists(values: Floats, digits: int) -> list[list[float]]:
    """Round, as nested lists."""
    lists: list[list[float]] = np.round(values, digits).tolist()
    return lists
