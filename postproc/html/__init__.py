"""Reports to look at: each one HTML file that needs no network."""

from postproc.html.batch import batch_report
from postproc.html.calibration import calibration_report
from postproc.html.comparison import comparison_report
from postproc.html.diagnosis import diagnosis_report
from postproc.html.program import program_report, program_report_from_json
from postproc.html.reading import report_file

__all__ = [
    "batch_report",
    "calibration_report",
    "comparison_report",
    "diagnosis_report",
    "program_report",
    "program_report_from_json",
    "report_file",
]
