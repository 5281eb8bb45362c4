"""What a worker does with a task: the same on this machine and on a cluster."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from time import perf_counter
from typing import Any

import numpy as np

from postproc import __version__
from postproc.batch.setup import Setup
from postproc.batch.task import Result, Task, Unit, failed
from postproc.compensate import compensate
from postproc.exceptions import PostprocError
from postproc.pose import MM
from postproc.report import Outcome
from postproc.sidecar import SUFFIX

LISTED = 50  # findings of a program that the log lists; the rest is counted


def run_tasks(tasks: Sequence[Task], setup: Setup, version: str) -> list[Result]:
    """Compensate programs one after the other; one that fails stops no other.

    Args:
        tasks: The programs.
        setup: What they are compensated with.
        version: Version of this tool where the run was started.
    """
    if version != __version__:
        text = f"the worker has postproc {__version__}, the run {version}: make equal"
        return [failed(task.unit, text) for task in tasks]
    return [run_task(task, setup) for task in tasks]


def run_task(task: Task, setup: Setup) -> Result:
    """Compensate a program with its pages and variables.

    Whatever goes wrong is a result too: in a batch nothing may stop the rest.
    """
    start = perf_counter()
    try:
        result = _compensated(task, setup)
    except PostprocError as exc:
        result = failed(task.unit, str(exc))
    except RecursionError:
        result = failed(task.unit, "is nested too deeply")
    except MemoryError:
        result = failed(task.unit, "needs more memory than there is")
    except Exception as exc:  # a defect of ours, or of a library
        what = f"internal error: {type(exc).__name__}: {exc}"
        result = failed(task.unit, f"{what}; please report it with the program")
    seconds = perf_counter() - start
    return Result(result.unit, result.exit_code, result.outputs, result.facts, seconds)


def _compensated(task: Task, setup: Setup) -> Result:
    """Compensate, and name everything that belongs into the target tree."""
    unit = task.unit
    sources = dict(zip(unit.files, task.sources, strict=True))
    outcome = compensate(
        task.sources[0],
        setup.cell,
        setup.model,
        name=_file_name(unit.program),
        variables=None if unit.variables is None else sources[unit.variables],
        pages={_file_name(page): sources[page] for page in unit.pages},
        options=setup.options,
    )
    outputs = _outputs(unit, sources, outcome)
    return Result(unit, outcome.exit_code, outputs, facts_of(outcome))


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
