"""Several small programs compensated in one pass, each as if it were alone.

Arrays of a thousand rows cost little more than arrays of a hundred: what a small
program takes is mostly the way through the code, and side by side many go that way at
once. In `make plant-bench` a file of 100 targets takes 58 ms of a processor alone, 29
in passes of 2,000 visits and 23 in passes of 5,000; one of 1,000 targets 181 ms alone
and 134 beside four others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import ParamSpec, TypeVar

import numpy as np

from postproc.compensation.compensate import check_preconditions, finish
from postproc.compensation.findings.first_cause import read_with_cause
from postproc.compensation.options import Clock, Job, Options, no_progress
from postproc.compensation.outcome import Outcome
from postproc.compensation.pipeline import correct
from postproc.compensation.program import ParsedProgram, prepare_cell
from postproc.compensation.program_files import name_files
from postproc.compensation.scale.concatenate import concatenate, first_visits, offsets
from postproc.compensation.window_result import WindowResult
from postproc.model.model import Model
from postproc.robot.cell import Cell
from postproc.threads import in_one_thread

T = TypeVar("T")
P = ParamSpec("P")

PASS = 5_000  # visits of a pass: what a worker is given at once; more gain nothing


@dataclass(frozen=True)
class Given:
    """A program as it comes: the arguments of `compensate`."""

    name: str
    source: bytes
    variables: bytes | None
    pages: Mapping[str, bytes]


@in_one_thread
def compensate_batch(
    programs: Sequence[Given], cell: Cell, model: Model, options: Options
) -> list[Outcome | Exception]:
    """Compensate programs with the same cell and model.

    Args:
        programs: The programs.
        cell: The robot's surroundings.
        model: The arm's error.
        options: What the user asked for.

    Returns:
        For every program what `compensate` returns, or else what it raises. `stages` is
        the time of all programs that were worked on.
    """
    cell = prepare_cell(cell, model, options)
    setting = Job(cell, model, options, Clock(no_progress))
    readings = [_try(_read, program, setting) for program in programs]
    readable = [found for found in readings if isinstance(found, ParsedProgram)]
    passes = (_correct_programs(some, setting) for some in _passes(readable))
    corrected = chain.from_iterable(passes)
    out: list[Outcome | Exception] = []
    for program, reading in zip(programs, readings, strict=True):
        found = reading if isinstance(reading, Exception) else next(corrected)
        out.append(
            found
            if isinstance(found, Exception)
            else _try(finish, program.name, *found, setting)
        )
    return out


def _read(given: Given, setting: Job) -> ParsedProgram:
    """Read a program that may be compensated."""
    files = name_files(given.name, given.source, given.variables, given.pages)
    check_preconditions(files, setting.cell, setting.model)
    with setting.clock("parse"):
        return read_with_cause(files, setting.cell)


def _correct_programs(
    readings: Sequence[ParsedProgram], setting: Job
) -> list[tuple[ParsedProgram, WindowResult] | Exception]:
    """Correct the programs of a pass; one that fails leaves the others alone."""
    if len(readings) > 1 and setting.options.shared_points != "clone":
        found = _try(correct_batch, readings, setting)
        if not isinstance(found, Exception):
            return list(zip(readings, found, strict=True))
    return [_try(correct, reading, setting) for reading in readings]


def _try(work: Callable[P, T], *args: P.args, **named: P.kwargs) -> T | Exception:
    """Return what comes of it, an exception too: nothing may stop the others."""
    try:
        return work(*args, **named)
    except Exception as exc:
        return exc


def _passes(readings: Sequence[ParsedProgram]) -> Iterator[list[ParsedProgram]]:
    """Put programs of one language into passes; an empty one goes alone."""
    waiting: list[ParsedProgram] = []
    size = 0
    for reading in readings:
        n = len(reading.visits)
        full = n == 0 or size == 0 or size + n > PASS
        if waiting and (full or waiting[0].visits.dialect != reading.visits.dialect):
            yield waiting
            waiting, size = [], 0
        waiting.append(reading)
        size += n
    if waiting:
        yield waiting


def correct_batch(
    readings: Sequence[ParsedProgram], setting: Job
) -> list[WindowResult]:
    """Plan and correct programs side by side; what fails for one fails for all.

    Args:
        readings: The programs, none without visits.
        setting: What they are compensated with; no clones.

    Returns:
        What `correct` keeps of each alone.

    Raises:
        NotAloneError: They would not come out as each alone.
    """
    own = [reading.visits for reading in readings]
    texts = tuple(text for reading in readings for text in reading.texts)
    all_ = ParsedProgram(texts, concatenate(own), (), begins=first_visits(own))
    _, kept = correct(all_, setting)
    return list(_split(kept, readings))


def _split(
    kept: WindowResult, readings: Sequence[ParsedProgram]
) -> Iterator[WindowResult]:
    """Yield the result of every program."""
    visits = offsets([len(reading.visits) for reading in readings])
    literals = offsets([len(reading.visits.literals) for reading in readings])
    files = offsets([len(reading.texts) for reading in readings])
    edited = np.searchsorted(kept.edited, literals).tolist()
    for k in range(len(readings)):
        yield replace(
            kept.take(slice(*visits[k : k + 2])),
            edited=kept.edited[slice(*edited[k : k + 2])] - literals[k],
            edits=kept.edits[slice(*files[k : k + 2])],
        )
