"""Offline-programming post-processor for industrial robots.

    import postproc

    cell = postproc.load_cell("cell.toml")
    found = postproc.fit("survey.csv", cell=cell)
    outcome = postproc.compensate("job.pdl", cell, found.model)
    outcome.save("compensated")

Ten functions, and the classes of what they return. ``str`` and ``Path`` are paths,
``bytes`` are the text of a file, with ``name=`` for its name. What is printed of a
result is a summary; ``to_frame`` makes a data frame of it. Nothing is written but by
``save``. Everything is loaded when it is first asked for.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from postproc.batch.check import Checked, check
    from postproc.calibration.diagnosis.diagnose import Extension
    from postproc.calibration.diagnosis.files import diagnose
    from postproc.calibration.fit import Calibration, fit
    from postproc.calibration.measurements import Measurements
    from postproc.calibration.predict import PredictedRows, predict
    from postproc.calibration.survey_files import read_measurements
    from postproc.calibration.tables import TableFormat
    from postproc.compensation.compensate import compensate
    from postproc.compensation.explanation import Explanation, explain
    from postproc.compensation.options import Options
    from postproc.compensation.outcome import Outcome
    from postproc.exceptions import PostprocError
    from postproc.model.model import Model, load_model
    from postproc.model.statistics import ErrorStatistics
    from postproc.report.diff import Difference, diff
    from postproc.robot.cell import Cell, load_cell

__version__ = "0.3.0"

# Where every public name is: functions first, then what their annotations name.
_PLACES = {
    "load_cell": "robot.cell",
    "load_model": "model.model",
    "read_measurements": "calibration.survey_files",
    "fit": "calibration.fit",
    "predict": "calibration.predict",
    "diagnose": "calibration.diagnosis.files",
    "compensate": "compensation.compensate",
    "explain": "compensation.explanation",
    "diff": "report.diff",
    "check": "batch.check",
    "PostprocError": "exceptions",
    "Calibration": "calibration.fit",
    "Cell": "robot.cell",
    "Checked": "batch.check",
    "Difference": "report.diff",
    "ErrorStatistics": "model.statistics",
    "Explanation": "compensation.explanation",
    "Extension": "calibration.diagnosis.diagnose",
    "Measurements": "calibration.measurements",
    "Model": "model.model",
    "Options": "compensation.options",
    "Outcome": "compensation.outcome",
    "PredictedRows": "calibration.predict",
    "TableFormat": "calibration.tables",
}

__all__ = [
    "Calibration",
    "Cell",
    "Checked",
    "Difference",
    "ErrorStatistics",
    "Explanation",
    "Extension",
    "Measurements",
    "Model",
    "Options",
    "Outcome",
    "PostprocError",
    "PredictedRows",
    "TableFormat",
    "__version__",
    "check",
    "compensate",
    "diagnose",
    "diff",
    "explain",
    "fit",
    "load_cell",
    "load_model",
    "predict",
    "read_measurements",
]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)


def __dir__() -> list[str]:
    """List what is public."""
    return list(__all__)
