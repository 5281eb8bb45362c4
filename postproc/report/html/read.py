"""A page for whatever JSON this program wrote."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from postproc.compensation.output.sidecar import (
    FileRecord,
    read_sidecar,
    restore,
    sidecar_path,
)
from postproc.exceptions import ProgramError
from postproc.files import schema, write_all
from postproc.language.text.source import Source
from postproc.language.text.stamp import is_stamped
from postproc.report.html.diagnosis import diagnosis_report
from postproc.report.html.model import calibration_report, comparison_report
from postproc.report.html.program import program_report_from_json

# The source files of a report, where they lie beside it.


def find_sources(report: Mapping[str, Any], folder: Path) -> dict[str, bytes]:
    """Find the files that a report names; a compensated one is given back first.

    A file that is missing, or that its record no longer fits, is left out: the page
    then shows line numbers without their text.

    Args:
        report: A report of ``compensate``.
        folder: Where to look.
    """
    targets = report["targets"]
    named = {str(t["file"]) for t in targets}
    named |= {str(t["literal"]["file"]) for t in targets if t["literal"]}
    names = {Path(name).name for name in named}
    records = _records(folder, str(report["program"]))
    found = {}
    for name in sorted(names):
        data = None
        with suppress(OSError):
            data = (folder / name).read_bytes()
        if data is not None and is_stamped(Source(name, data)):
            data = _restore_bytes(data, records.get(name), name)
        if data is not None:
            found[name] = data
    return found


def _records(folder: Path, program: str) -> dict[str, FileRecord]:
    """Read the record beside the compensated program, where there is one."""
    try:
        record = read_sidecar(sidecar_path(folder / Path(program).name))
    except ProgramError:
        return {}
    return {Path(name).name: file for name, file in record.files.items()}


def _restore_bytes(data: bytes, record: FileRecord | None, name: str) -> bytes | None:
    """Give a compensated file back, if its record fits."""
    if record is None:
        return None
    try:
        return restore(data, record, name)
    except ProgramError:
        return None


# A page for whatever JSON this program wrote.

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
    return {key: told for key, told in data.items() if key not in schema("report")}


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
