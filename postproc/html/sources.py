"""The source files of a report, where they lie beside it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from postproc.compensation.record import FileRecord, read_sidecar, restore, sidecar_path
from postproc.exceptions import ProgramError
from postproc.language.source import Source
from postproc.language.stamp import is_stamped


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
    records = _records(folder, str(report["program"]), names)
    found = {}
    for name in sorted(names):
        data = _read(folder / name)
        if data is not None and is_stamped(Source(name, data)):
            data = _restored(data, records.get(name), name)
        if data is not None:
            found[name] = data
    return found


def _records(folder: Path, program: str, names: Iterable[str]) -> dict[str, FileRecord]:
    """Read the record beside the compensated program, where there is one."""
    try:
        record = read_sidecar(sidecar_path(folder / Path(program).name))
    except ProgramError:
        return {}
    return {Path(name).name: file for name, file in record.files.items()}


def _read(path: Path) -> bytes | None:
    """Read a file that may be missing."""
    try:
        return path.read_bytes()
    except OSError:
        return None


def _restored(data: bytes, record: FileRecord | None, name: str) -> bytes | None:
    """Give a compensated file back, if its record fits."""
    if record is None:
        return None
    try:
        return restore(data, record, name)
    except ProgramError:
        return None
