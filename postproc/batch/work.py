"""What a worker does with a task: the same on this machine and on a cluster."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from time import perf_counter
from typing import Any

import numpy as np

from postproc import __version__
from postproc.batch.setup import Setup
from postproc.batch.task import Result, Task, Unit, failed
from postproc.compensation.outcome import Outcome
from postproc.compensation.record import SUFFIX
from postproc.compensation.together import Given, compensate_together
from postproc.exceptions import PostprocError
from postproc.robot.pose import MM

LISTED = 50  # findings of a program that the log lists; the rest is counted


def run_tasks(tasks: Sequence[Task], setup: Setup, version: str) -> list[Result]:
    """Compensate programs; one that fails stops no other.

    Args:
        tasks: The programs.
        setup: What they are compensated with.
        version: Version of this tool where the run was started.
    """
    if version != __version__:
        text = f"the worker has postproc {__version__}, the run {version}: make equal"
        return [failed(task.unit, text) for task in tasks]
    start = perf_counter()
    found = _compensated(tasks, setup)
    results = [_result(*pair) for pair in zip(tasks, found, strict=True)]
    seconds = (perf_counter() - start) / max(len(tasks), 1)
    return [replace(result, seconds=seconds) for result in results]


def _compensated(tasks: Sequence[Task], setup: Setup) -> list[Outcome | Exception]:
    """Compensate the programs of tasks; what fails for all of them is told of each."""
    given = [_given(task) for task in tasks]
    try:
        return compensate_together(given, setup.cell, setup.model, setup.options)
    except Exception as exc:
        return [exc for _ in tasks]


def _given(task: Task) -> Given:
    """Name the files of a task as its programs name each other."""
    unit, sources = task.unit, task.files
    return Given(
        name=_file_name(unit.program),
        source=task.sources[0],
        variables=None if unit.variables is None else sources[unit.variables],
        pages={_file_name(page): sources[page] for page in unit.pages},
    )


def _result(task: Task, found: Outcome | Exception) -> Result:
    """Say what came of a task; whatever went wrong is a result too."""
    unit = task.unit
    match found:
        case Outcome():
            outputs = _outputs(unit, task.files, found)
            return Result(unit, found.exit_code, outputs, facts_of(found))
        case PostprocError():
            return failed(unit, str(found))
        case RecursionError():
            return failed(unit, "is nested too deeply")
        case MemoryError():
            return failed(unit, "needs more memory than there is")
    # A defect of ours, or of a library.
    what = f"internal error: {type(found).__name__}: {found}"
    return failed(unit, f"{what}; please report it with the program")


def _outputs(
    unit: Unit, sources: Mapping[str, bytes], outcome: Outcome
) -> dict[str, bytes]:
    """Name all files of the target tree, each program behind its own record.

    What did not change comes out as it went in.
    """
    place_of = {_file_name(place): place for place in unit.files}
    if unit.variables is not None:
        stem = _file_name(unit.program).rpartition(".")[0]
        place_of[f"{stem}.lsv"] = unit.variables
    new = {place_of[name]: data for name, data in outcome.outputs.items()}
    outputs: dict[str, bytes] = {}
    for place in reversed(unit.programs):
        belongs = [place]
        if place == unit.program and unit.variables is not None:
            belongs.insert(0, unit.variables)
        own = {n: _file_name(b) for n, b in place_of.items() if b in belongs}
        record = outcome.record.renamed(own)
        outputs[place + SUFFIX] = "".join(record.to_json()).encode()
        outputs |= {b: new.get(b, sources[b]) for b in belongs}
    return outputs


def facts_of(outcome: Outcome) -> dict[str, Any]:
    """Sum up an outcome for the log."""
    statuses = outcome.decisions.status
    left = outcome.left_alone()
    findings = [
        f"{d.file}:{d.line}: {d.code}: {d.message}" for d in outcome.diagnostics
    ]
    return {
        "version": __version__,
        "model": outcome.model,
        "visits": len(statuses),
        "safe": int((statuses == 0).sum()),
        "left": len(left),
        "left_alone": left[:LISTED],
        "findings": findings[:LISTED],
        "largest_mm": _largest(outcome),
        "before_mm": _figures(asdict(outcome.before)),
        "after_mm": _figures(asdict(outcome.after)),
    }


def _largest(outcome: Outcome) -> float | None:
    """Return the largest correction [mm], None where nothing was corrected."""
    lengths = np.linalg.norm(outcome.decisions.correction, axis=1) / MM
    known = lengths[np.isfinite(lengths)]
    return round(float(known.max()), 5) if len(known) else None


def _figures(statistics: Mapping[str, float]) -> dict[str, float | None]:
    """Round figures for a person; JSON has no NaN."""
    return {
        name.removesuffix("_mm"): None if value != value else round(value, 5)
        for name, value in statistics.items()
    }


def _file_name(place: str) -> str:
    """Return the last part of a path with ``/``."""
    return place.rpartition("/")[2]
