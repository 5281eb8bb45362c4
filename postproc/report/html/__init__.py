"""Reports to look at: each one HTML file that needs no network."""

from __future__ import annotations

from postproc.report.html.batch import batch_report
from postproc.report.html.diagnosis import diagnosis_report
from postproc.report.html.model import calibration_report, comparison_report
from postproc.report.html.program import program_report, program_report_from_json
from postproc.report.html.read import report_file

__all__ = [
    "batch_report",
    "calibration_report",
    "comparison_report",
    "diagnosis_report",
    "program_report",
    "program_report_from_json",
    "report_file",
]
