"""A page for whatever JSON this program wrote."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from postproc.exceptions import ProgramError
from postproc.files import write_all
from postproc.html.calibration import calibration_report
from postproc.html.comparison import comparison_report
from postproc.html.diagnosis import diagnosis_report
from postproc.html.program import program_report_from_json
from postproc.html.sources import find_sources

CURE = "Give the JSON of compensate, diagnose or compare, or a model file"


def report_file(
    path: str | Path, out: str | Path, sources: Mapping[str, bytes] | None = None
) -> None:
    """Make the page of a JSON file.

    Args:
        path: A report of compensate, diagnose or compare, or a model file.
        out: Where to write the page.
        sources: Bytes of the source files by name, for a program's page; default: those
            that lie beside the report.

    Raises:
        ProgramError: It is no JSON of this program.
        OutputError: The page cannot be written.
    """
    data = _read(Path(path))
    try:
        if sources is None and "targets" in data:
            sources = find_sources(data, Path(path).parent)
        page = _page(data, sources)
    except (KeyError, ValueError, TypeError, AttributeError, IndexError) as exc:
        problem = f"is not complete ({type(exc).__name__}: {exc})"
        raise ProgramError(path, problem, "Write it again") from None
    write_all({Path(out): page.encode()})


def _read(path: Path) -> dict[str, Any]:
    """Read a JSON object."""
    try:
        data = json.loads(path.read_bytes())
    except OSError as exc:
        raise ProgramError(path, f"cannot be read ({exc.strerror})", CURE) from None
    except (ValueError, RecursionError):
        raise ProgramError(path, "is not valid JSON", CURE) from None
    if not isinstance(data, dict):
        raise ProgramError(path, "holds no report", CURE)
    return data


def _page(data: dict[str, Any], sources: Mapping[str, bytes] | None) -> str:
    """Choose the page by what the file holds."""
    if "targets" in data:
        return program_report_from_json(data, sources)
    if "verdict" in data:
        return diagnosis_report(data)
    if "rows" in data and "split" in data:
        return comparison_report(data)
    if "parameters" in data and "ranges" in data:
        return calibration_report(data)
    raise ValueError("no report of a program, a diagnosis or a comparison, no model")
