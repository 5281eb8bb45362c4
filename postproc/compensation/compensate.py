"""The first sentence: a program goes in, the same program lands where it says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from postproc.arrays import release_memory
from postproc.compensation.findings.base_frame_check import check_base
from postproc.compensation.findings.findings import (
    controller_unknown,
    flank_steps,
    list_followed_pages,
    list_overruled_strings,
    list_untimed_runs,
    listing_cost,
    missing_file,
    no_advice,
    report_averaged_points,
    report_controller_assumption,
    report_uncertain_frames,
    report_uncertain_sides,
    tool_in_metres,
)
from postproc.compensation.findings.first_cause import read_with_cause
from postproc.compensation.options import (
    DEFAULT_OPTIONS,
    Clock,
    Job,
    Options,
    Progress,
    no_progress,
)
from postproc.compensation.outcome import Outcome, find_judged, largest_motion
from postproc.compensation.output.line_outcomes import (
    list_uncorrected_elsewhere,
    tell_arrivals,
)
from postproc.compensation.output.rewrite import (
    Output,
    check_output,
    write_edits,
)
from postproc.compensation.output.sidecar import Sidecar
from postproc.compensation.pipeline import correct
from postproc.compensation.program import (
    ParsedProgram,
    prepare_cell,
    read_program,
)
from postproc.compensation.program_files import (
    NO_PAGES,
    ProgramFiles,
    program_files,
)
from postproc.compensation.scale.workers import in_worker
from postproc.compensation.solver.arrivals import ArrivalStates
from postproc.compensation.solver.expected_error import expect_errors
from postproc.compensation.solver.targets import report_rounded_points, unknown_blends
from postproc.compensation.window_result import CompensatedProgram, WindowResult
from postproc.diagnostics import Code
from postproc.exceptions import CellError, ProgramError
from postproc.language.language import Language
from postproc.language.languages import UNNAMED, file_named, language_of
from postproc.language.text.source import Source
from postproc.language.text.stamp import is_stamped
from postproc.language.visits import Diagnostic, Visits, deduplicate
from postproc.model.model import Model, as_model
from postproc.model.statistics import ErrorStatistics
from postproc.robot.cell import Cell, as_cell
from postproc.threads import in_one_thread
from postproc.verify.extra import load

# All of it: what is given, checked, corrected, written and told.


@in_one_thread
def compensate(
    program: str | Path | bytes | ProgramFiles,
    cell: Cell | str | Path,
    model: Model | str | Path,
    *,
    name: str = UNNAMED,
    variables: bytes | str | Path | None = None,
    pages: Mapping[str, bytes] = NO_PAGES,
    options: Options = DEFAULT_OPTIONS,
    progress: Progress = no_progress,
    processes: int = 1,
) -> Outcome:
    """Move every target of a program against the error the arm would make there.

    Nothing is written: `Outcome.save` does that.

    Args:
        program: The program: a path, beside which its pages and its variable file are
            found, or its bytes.
        cell: The robot's surroundings, or where they are described.
        model: The arm's error, or its file.
        name: File name of a program that is given as bytes.
        variables: The variable file, where there is one: a path, or bytes.
        pages: Programs that bytes import and that nobody else uses, by file name; they
            are followed and rewritten with it.
        options: What the user asked for.
        progress: Told the name of every stage as it begins.
        processes: How many may work at once on a long program; the result is the same.

    Raises:
        ProgramError: The source is no program text, or is compensated already.
        CellError: The controller compensates on its own.
        ModelError: The model was made for another arm.
        PostprocError: The cell asks for a second opinion, and libraries for it are
            missing.
    """
    cell = as_cell(cell)
    model = as_model(model, cell.arm)
    given = program_files(program, name, variables, pages)
    judged = cell.file.verify.second_opinion
    if judged:
        load()
    outcome = compensate_files(given, cell, model, options, progress, processes)
    told = (*outcome.diagnostics, *given.report_omissions(cell))
    record = replace(outcome.record, read=given.digests)
    outcome = replace(outcome, diagnostics=told, inputs=given.inputs, record=record)
    if not judged:
        return outcome
    from postproc.compensation.findings.second_opinion import second_opinion

    output = {**outcome.sources, **outcome.outputs}
    own = prepare_cell(cell, model, options)
    opinion = second_opinion(outcome.sources, output, own, outcome.record)
    return replace(outcome, opinion=opinion)


def compensate_files(
    given: ProgramFiles,
    cell: Cell,
    model: Model,
    options: Options = DEFAULT_OPTIONS,
    progress: Progress = no_progress,
    processes: int = 1,
) -> Outcome:
    """Compensate a program that was read, without a second opinion: see `compensate`.

    Raises:
        PostprocError: As there.
    """
    files = given.by_name
    if given.path is not None:
        file = file_named(given.path)
        file.refuse_other_arm(cell.arm_number, str(cell.path))
    check_preconditions(files, cell, model)
    cell = prepare_cell(cell, model, options)
    setting = Job(cell, model, options, Clock(progress), processes)
    with setting.clock("parse"):
        reading = read_with_cause(files, cell)
        release_memory(len(reading.visits))
    reading, kept = correct(reading, setting)
    return finish(given.name, reading, kept, setting)


def check_preconditions(files: Mapping[str, bytes], cell: Cell, model: Model) -> None:
    """Refuse what must not be compensated at all.

    Raises:
        ProgramError: A file is stamped.
        CellError: The controller's absolute accuracy is on, or nothing is said of it.
        ModelError: The model was made for another arm.
    """
    own = {name: files[name] for name in files if not file_named(name).is_apart}
    for name, data in own.items():
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
    language = language_of(next(iter(files)))
    check_controller(cell, language)
    said = "absolute_accuracy" in cell.file.robot.model_fields_set
    if not (language.tells_accuracy or said):
        raise CellError(
            cell.path,
            f"{language.name} programs do not show whether the controller compensates "
            "on its own (Absolute Accuracy)",
            "Write absolute_accuracy = false under [robot] once it is off",
            place="$.robot.absolute_accuracy",
        )
    model.check_arm(cell.arm)


def check_controller(cell: Cell, language: Language) -> None:
    """Refuse a program that the controller of the arm does not run.

    Raises:
        CellError: Arm file or cell name another controller.
    """
    if not cell.controllers or language.controller in cell.controllers:
        return
    own = " or ".join(cell.controllers)
    raise CellError(
        cell.path,
        f"the controller of {cell.arm.name} is of {own}, and {language.name} programs "
        f"run on those of {language.controller}",
        "Give the cell of the arm that runs the program; if this one does, write "
        f'controller = "{language.controller}" under [robot]',
        place="$.robot.controller" if cell.file.robot.controller else "$.robot.arm",
    )


def finish(
    name: str, reading: ParsedProgram, kept: WindowResult, setting: Job
) -> Outcome:
    """Write what was corrected, verify it, and say what came of it.

    What runs a program in time, and puts points on its ways, takes a tenth of a short
    run to load: it is loaded where it is used.

    Raises:
        VerificationError: The output is not what was meant.
    """
    if setting.options.inserts:
        from postproc.compensation.paths.insertion_loop import correct_paths

        draft = correct_paths(reading, kept, setting, write_and_verify)
        return _report(name, reading, draft, setting)
    if setting.options.times(len(reading.visits)):
        return _report(name, reading, _write_timed(reading, kept, setting), setting)
    output = _write(reading, kept, setting)
    draft = CompensatedProgram(reading, kept, output, None)
    with _verify_beside(reading, kept, output, setting):
        return _report(name, reading, draft, setting)


def _report(
    name: str, reading: ParsedProgram, draft: CompensatedProgram, setting: Job
) -> Outcome:
    """Say what came of a program, in the time that this stage is given."""
    release_memory(len(reading.visits))
    with setting.clock("report"):
        outcome = report(name, reading, draft, setting)
    release_memory(len(reading.visits))
    return outcome


def _write_timed(
    reading: ParsedProgram, kept: WindowResult, setting: Job
) -> CompensatedProgram:
    """Write a program without points, and run it in time."""
    from postproc.compensation.findings.timing_comparison import run_in_time

    output, again = write_and_verify(reading, kept, setting)
    with setting.clock("time"):
        in_time = run_in_time(reading, again, kept.position, setting)
    return CompensatedProgram(reading, kept, output, in_time)


def write_and_verify(
    reading: ParsedProgram, kept: WindowResult, setting: Job
) -> tuple[Output, ParsedProgram]:
    """Write the numbers, and read what was written; return both.

    Raises:
        VerificationError: The output is not what was meant.
    """
    output = _write(reading, kept, setting)
    with setting.clock("verify"):
        return output, _verify(reading, kept, output, setting)


def _write(reading: ParsedProgram, kept: WindowResult, setting: Job) -> Output:
    """Write the numbers."""
    with setting.clock("rewrite"):
        output = write_edits(reading, kept.edits, setting.model.id)
        release_memory(len(reading.visits))
    return output


def _verify(
    reading: ParsedProgram, kept: WindowResult, output: Output, setting: Job
) -> ParsedProgram:
    """Read what was written; return it.

    Raises:
        VerificationError: The output is not what was meant.
    """
    again = read_program(output.files, setting.cell, reading.parsed)
    release_memory(len(reading.visits))
    check_output(reading, again, output, kept.edited, kept.decisions.corrected)
    return again


LONG = 40_000  # visits that are verified in a process of their own


@contextmanager
def _verify_beside(
    reading: ParsedProgram, kept: WindowResult, output: Output, setting: Job
) -> Iterator[None]:
    """Verify what was written beside other work, in another process where it is long.

    Raises:
        VerificationError: The output is not what was meant.
    """

    def verify() -> Iterator[dict[str, float]]:
        clock = Clock(no_progress)
        with clock("verify"):
            _verify(reading, kept, output, setting)
        yield clock.stages

    if setting.processes == 1 or len(reading.visits) < LONG:
        for stages in verify():
            setting.clock.add(stages)
        yield
        return
    with in_worker(verify) as found:
        yield
        for stages in found:
            setting.clock.add(stages)


def report(
    name: str,
    reading: ParsedProgram,
    draft: CompensatedProgram,
    setting: Job,
) -> Outcome:
    """Say what came of every visit, and what error the model expects now.

    Args:
        name: The program's.
        reading: The program, without points on its ways.
        draft: What is to be written.
        setting: What it was compensated with.
    """
    kept, output, visits = draft.kept, draft.output, reading.visits
    off = (
        report_controller_assumption(name, setting.cell),
        *controller_unknown(name, setting.cell),
    )
    return Outcome(
        program=name,
        model=setting.model.id,
        outputs=output.changed,
        record=_record(reading, draft, setting),
        visits=visits,
        decisions=kept.decisions,
        before=ErrorStatistics.of_sizes(kept.before[kept.corrected]),
        after=ErrorStatistics.of_sizes(kept.after[kept.corrected]),
        diagnostics=deduplicate((*_findings(reading, draft, setting), *off)),
        stages=setting.clock.stages,
        motion=largest_motion(kept.departure),
        position=kept.position,
        sources={source.name: source.data for source, _ in reading.originals},
        arrivals=_arrivals(visits, kept, setting),
        expected=expect_errors(kept.laws, find_judged(visits, kept.decisions)),
        in_time=draft.in_time,
    )


def _record(reading: ParsedProgram, draft: CompensatedProgram, setting: Job) -> Sidecar:
    """Keep what was changed, what was assumed, and what was left for other files."""
    output, visits, d = draft.output, reading.visits, draft.kept.decisions
    files = tuple(output.stamps)
    arrivals = tell_arrivals(visits, d, files)
    told = setting.options.to_dict()
    return replace(
        output.sidecar(setting.model.id, told, arrivals),
        assumed=tuple(
            (x.file, x.line, x.message)
            for x in reading.diagnostics
            if x.code == Code.ROUTINE_ASSUMED_MOTIONLESS
        ),
        left=list_uncorrected_elsewhere(
            visits, d, files, reading.missed, reading.diagnostics
        ),
    )


def _findings(
    reading: ParsedProgram, draft: CompensatedProgram, setting: Job
) -> tuple[Diagnostic, ...]:
    """Say what was found: in the program, in the plan, and in what came of it."""
    kept, in_time, visits = draft.kept, draft.in_time, reading.visits
    d, rows, cell = kept.decisions, kept.corrected, setting.cell
    advice = no_advice if in_time is None else in_time.advice
    return (
        *reading.diagnostics,
        *list_followed_pages(visits, reading.untouched),
        *missing_file(visits),
        *check_base(visits, cell),
        *tool_in_metres(visits),
        *list_overruled_strings(visits, kept.overruled),
        *list_untimed_runs(visits, kept.untimed),
        *report_rounded_points(visits, kept.away),
        *unknown_blends(visits, rows),
        *report_uncertain_sides(visits, rows, d.side, d.std_error, advice),
        *report_uncertain_frames(visits, rows, d.std_error, cell),
        *report_averaged_points(visits, d.why, d.reasons),
        *flank_steps(visits, rows, kept.position, d.side, setting.gap, cell.arm),
        *listing_cost(visits, rows, d.q, cell.arm),
        *(in_time.findings(visits) if in_time is not None else ()),
    )


def _arrivals(visits: Visits, kept: WindowResult, setting: Job) -> ArrivalStates:
    """Describe the states that the visits are corrected for."""
    return ArrivalStates(
        visits,
        q=kept.decisions.q,
        side=kept.decisions.side,
        travel=kept.travel,
        speed=kept.speed,
        temperature=setting.temperature,
        cell=setting.cell,
        model=setting.model,
    )
