"""The first sentence: a program goes in, the same program lands where it says."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import asdict
from types import MappingProxyType, ModuleType

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.error_statistics import ErrorStatistics
from postproc.accuracy.model import Model
from postproc.arrivals import tell_arrivals
from postproc.clock import Clock, Progress, silent
from postproc.cloning import give_own_points
from postproc.exceptions import CellError, ProgramError
from postproc.flying import rounded_points
from postproc.language.source import Source
from postproc.language.stamp import is_stamped
from postproc.notes import (
    assumed_off,
    followed_pages,
    listing_cost,
    missing_file,
    overruled_strings,
    unsure_sides,
    untimed_runs,
)
from postproc.options import AS_USUAL, Options
from postproc.planning import (
    Planned,
    Reading,
    plan_visits,
    read_program,
    states_of,
    with_measured_play,
)
from postproc.report import Outcome
from postproc.robot.cell import Cell
from postproc.robot.state import States
from postproc.settling import Corrected, settle
from postproc.taught import correct_taught

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

NO_PAGES: Mapping[str, bytes] = MappingProxyType({})


def compensate(
    source: bytes,
    cell: Cell,
    model: Model,
    *,
    name: str = "program.pdl",
    variables: bytes | None = None,
    pages: Mapping[str, bytes] = NO_PAGES,
    options: Options = AS_USUAL,
    progress: Progress = silent,
) -> Outcome:
    """Move every target of a program against the error the arm would make there.

    Args:
        source: The program.
        cell: The robot's surroundings.
        model: The arm's error.
        name: File name of the program; its variable file is ``name.lsv``.
        variables: The variable file, where there is one.
        pages: Programs that it imports and that nobody else uses, by file name; they
            are followed and rewritten with it.
        options: What the user asked for.
        progress: Told the name of every stage as it begins.

    Raises:
        ProgramError: The source is no program text, or is compensated already.
        CellError: The controller compensates on its own.
        ModelError: The model was made for another arm.
    """
    clock = Clock(progress)
    files = name_files(name, source, variables, pages)
    refuse(files, cell, model)
    cell = with_measured_play(cell, model)
    with clock("parse"):
        reading = read_program(files, cell)
    with clock("plan"):
        planned = plan_visits(reading.visits, cell, timed="speed" in model.needs)
        planned = correct_taught(planned, reading.visits, cell, model)
    states = states_of(planned.plan, cell, _temperature(cell, options))
    corrected = settle(reading, planned, states, cell, model, options, clock)
    if options.clone:
        with clock("clone"):
            reading = give_own_points(reading, corrected.proposal, cell)
        if reading.cloned:
            corrected = settle(reading, planned, states, cell, model, options, clock)
    with clock("report"):
        return report(
            name, reading, planned, states, corrected, cell, model, options, clock
        )


def name_files(
    name: str,
    source: bytes,
    variables: bytes | None,
    pages: Mapping[str, bytes] = NO_PAGES,
) -> dict[str, bytes]:
    """Name a program, its pages and its variable file, the program first."""
    files = {name: source, **pages}
    if variables is not None:
        files[name.rpartition(".")[0] + ".lsv"] = variables
    return files


def refuse(files: Mapping[str, bytes], cell: Cell, model: Model) -> None:
    """Refuse what must not be compensated at all.

    Raises:
        ProgramError: A file is stamped.
        CellError: The controller's absolute accuracy is on.
        ModelError: The model was made for another arm.
    """
    for name, data in files.items():
        if is_stamped(Source(name, data)):
            raise ProgramError(
                name,
                "is compensated already",
                "Take the source, or give it back with postproc restore",
                line=1,
            )
    if cell.file.robot.absolute_accuracy:
        raise CellError(
            cell.path,
            "the controller compensates on its own: this would do it twice",
            "Switch that option off on the controller, then here",
            place="$.robot.absolute_accuracy",
        )
    model.check_arm(cell.arm)


def report(
    name: str,
    reading: Reading,
    planned: Planned,
    states: States,
    corrected: Corrected,
    cell: Cell,
    model: Model,
    options: Options,
    clock: Clock,
) -> Outcome:
    """Say what came of every visit, and what error the model expects now."""
    proposal, done = corrected.proposal, corrected.reached
    d, rows, visits = proposal.decisions, proposal.corrected, reading.visits
    output = corrected.output
    wanted = planned.wanted[rows, :3, 3]
    new = states.with_(q=np.array(done.q), direction=np.array(done.side))[rows]
    before = model.error(cell.arm, states[rows]) - planned.shift[rows]
    after = done.tcp[rows, :3, 3] + model.error(cell.arm, new) - wanted
    return Outcome(
        program=name,
        model=model.id,
        outputs=output.changed,
        record=output.sidecar(
            model.id, asdict(options), tell_arrivals(visits, d, tuple(output.records))
        ),
        visits=visits,
        decisions=d,
        before=ErrorStatistics.of(before),
        after=ErrorStatistics.of(after),
        diagnostics=(
            *reading.diagnostics,
            *followed_pages(visits),
            *missing_file(visits),
            *overruled_strings(visits, planned.targets, planned.plan),
            *untimed_runs(visits, planned.plan),
            *rounded_points(visits, planned.plan),
            *unsure_sides(visits, rows, d.side, d.std_error),
            *listing_cost(visits, rows, planned.plan, cell.arm),
            assumed_off(name, cell),
        ),
        stages=clock.stages,
        position=planned.wanted[:, :3, 3] - planned.plan.aside,
        sources={source.name: source.data for source, _ in reading.originals},
    )


def _temperature(cell: Cell, options: Options) -> float:
    """Choose the temperature to compensate for [deg C]."""
    return cell.temperature if options.temperature is None else options.temperature


class _Verb(ModuleType):
    """This module, which can be called: `postproc.compensate` is module and verb."""

    __call__ = staticmethod(compensate)


sys.modules[__name__].__class__ = _Verb
