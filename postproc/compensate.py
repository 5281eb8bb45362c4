"""The first sentence: a program goes in, the same program lands where it says."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import asdict
from types import MappingProxyType, ModuleType

from postproc.arrivals import tell_arrivals
from postproc.clock import Clock, Progress, silent
from postproc.correcting import correct
from postproc.exceptions import CellError, ProgramError
from postproc.flying import rounded_points
from postproc.kept import Kept
from postproc.language.source import Source
from postproc.language.stamp import is_stamped
from postproc.model.model import Model
from postproc.model.statistics import ErrorStatistics
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
from postproc.output import Output, write_edits
from postproc.planning import Reading, read_program, with_measured_play
from postproc.report import Outcome
from postproc.robot.cell import Cell
from postproc.side_by_side import sharing
from postproc.verify import check_numbers, check_output

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
    processes: int = 1,
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
        processes: How many may work at once on a long program; the result is the same.

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
        reading = read_program(files, cell, each=sharing(processes))
    reading, kept = correct(reading, cell, model, options, clock, processes)
    return finish(name, reading, kept, cell, model, options, clock, processes)


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


def finish(
    name: str,
    reading: Reading,
    kept: Kept,
    cell: Cell,
    model: Model,
    options: Options,
    clock: Clock,
    processes: int = 1,
) -> Outcome:
    """Write what was corrected, verify it, and say what came of it.

    Raises:
        VerificationError: The output is not what was meant.
    """
    output = write_and_verify(reading, kept, cell, model, clock, processes)
    with clock("report"):
        return report(name, reading, kept, output, cell, model, options, clock)


def write_and_verify(
    reading: Reading,
    kept: Kept,
    cell: Cell,
    model: Model,
    clock: Clock,
    processes: int = 1,
) -> Output:
    """Write the numbers, and read what was written.

    Raises:
        VerificationError: The output is not what was meant.
    """
    with clock("rewrite"):
        output = write_edits(reading, kept.edits, model.id)
    with clock("verify"):
        each = sharing(processes)
        again = read_program(output.files, cell, reading.programs, each)
        check_output(reading, again, output, kept.edited, processes)
        check_numbers(reading.visits, kept.decisions.corrected, again.visits)
    return output


def report(
    name: str,
    reading: Reading,
    kept: Kept,
    output: Output,
    cell: Cell,
    model: Model,
    options: Options,
    clock: Clock,
) -> Outcome:
    """Say what came of every visit, and what error the model expects now."""
    d, rows, visits = kept.decisions, kept.corrected, reading.visits
    return Outcome(
        program=name,
        model=model.id,
        outputs=output.changed,
        record=output.sidecar(
            model.id, asdict(options), tell_arrivals(visits, d, tuple(output.records))
        ),
        visits=visits,
        decisions=d,
        before=ErrorStatistics.of_sizes(kept.before),
        after=ErrorStatistics.of_sizes(kept.after),
        diagnostics=(
            *reading.diagnostics,
            *followed_pages(visits),
            *missing_file(visits),
            *overruled_strings(visits, kept.overruled),
            *untimed_runs(visits, kept.untimed),
            *rounded_points(visits, kept.away),
            *unsure_sides(visits, rows, d.side, d.std_error),
            *listing_cost(visits, rows, d.q, cell.arm),
            assumed_off(name, cell),
        ),
        stages=clock.stages,
        position=kept.position,
        sources={source.name: source.data for source, _ in reading.originals},
    )


class _Verb(ModuleType):
    """This module, which can be called: `postproc.compensate` is module and verb."""

    __call__ = staticmethod(compensate)


sys.modules[__name__].__class__ = _Verb
