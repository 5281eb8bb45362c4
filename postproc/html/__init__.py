"""Reports to look at: each one HTML file that needs no network."""

from postproc.html.program import program_report, program_report_from_json

__all__ = [
    "program_report",
    "program_report_from_json",
]
