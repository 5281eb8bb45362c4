"""Commands on programs: compensate, diff, restore, explain."""

from __future__ import annotations

from collections import Counter
from difflib import get_close_matches
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from postproc.cli.common import (
    CellOption,
    EveryOption,
    ModelOption,
    OrientationOption,
    PathToleranceOption,
    SetOption,
    SharedPointsOption,
    VariablesOption,
    app,
    busy,
    changes_of,
    report_errors,
    say,
    suggest,
    write_text,
)
from postproc.cli.project import cell_file, find_project, model_file
from postproc.cli.reports import PAGE, PageOption, ReportOption, Reports, TableOption
from postproc.cli.robot import release
from postproc.exceptions import PostprocError
from postproc.files import STREAM, check_places, is_stream

if TYPE_CHECKING:
    from postproc.compensation.outcome import Outcome
    from postproc.compensation.program_files import ProgramFiles
    from postproc.record.robots import Release


def _explain_code(code: str | None) -> None:
    """Print what a code of findings means, and end.

    Raises:
        PostprocError: There is no such code.
    """
    from postproc.diagnostics import Code

    if code is None:
        return
    with report_errors():
        known = {one.value: one for one in Code}
        if code not in known:
            close = get_close_matches(code, known, n=3, cutoff=0.4)
            near = f"Is it {' or '.join(close)}? " if close else ""
            cure = f"{near}docs/findings.md lists all {len(known)} codes"
            raise PostprocError(f"--code {code}: no such code. {cure}")
        found = known[code]
        print(f"{found} ({found.severity})", found.meaning, found.cure, sep="\n")
    raise typer.Exit


CodeOption = Annotated[
    str | None,
    typer.Option(
        "--code",
        help="Print what a finding's code means, and end.",
        is_eager=True,
        callback=_explain_code,
    ),
]
CROWD = 8  # processes, each with a window of its own in memory
SHOWN = 20  # targets left alone whose source lines are shown


@app.command()
def compensate(
    program: Annotated[
        str, typer.Argument(help="PROGRAM.pdl, .mod or .src; - for stdin.")
    ],
    cell: CellOption = None,
    model: ModelOption = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Default: the project's folder, or PROGRAM.compensated.pdl beside it.",
        ),
    ] = None,
    variables: VariablesOption = None,
    variables_out: Annotated[
        Path | None,
        typer.Option("--variables-out", help="Where to write it, even unchanged."),
    ] = None,
    report: PageOption = None,
    table: TableOption = None,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict", help="Fail, and write nothing, if a target is not corrected."
        ),
    ] = False,
    orientation: OrientationOption = False,
    shared_points: SharedPointsOption = None,
    path_tolerance: PathToleranceOption = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            "--tolerance",
            metavar="MM",
            help="Exit 0 only if every target is expected within it. "
            "Default: job.tolerance_mm.",
        ),
    ] = None,
    changes: SetOption = None,
    every: EveryOption = False,
) -> None:
    """Correct the targets of a program, so that the tool lands on them.

    Exit 0: every target that can be corrected is; 1: some are not, each is listed with
    the reason; 2: nothing is written.
    """
    from postproc.cli.common import stages
    from postproc.cli.job_files import Destination, default_output
    from postproc.compensation.compensate import compensate as run
    from postproc.compensation.findings.tolerance import JobTolerance
    from postproc.compensation.options import Options
    from postproc.compensation.program_files import ProgramFiles
    from postproc.compensation.scale import workers
    from postproc.model.model import as_model
    from postproc.report.json import report_text
    from postproc.robot.cell import load_cell

    given = None if is_stream(program) else Path(program)
    with report_errors(given, variables):
        cell, model = cell_file(cell, program), model_file(model, program)
        reports = Reports.of(report, PAGE, tables=table)
        if reports.on_stdout and given is None and output is None:
            raise PostprocError("--report -: stdout holds the program. Name a file")
        outputs = [output, *reports.files, variables_out]
        check_places(outputs, [given, variables, cell, model])
        place = None if output is not None else _project_place(given)
        asked = changes_of(changes, orientation, shared_points, path_tolerance)
        loaded = load_cell(cell, changes=asked)
        wanted = JobTolerance.of_cell(loaded, tolerance)
        options = Options(timing=loaded.compensation.timing)
        fitted = as_model(model, loaded.arm)
        files = ProgramFiles.open(program, variables)
        if variables_out is not None:
            _check_values(variables_out, files)
        crowd = min(workers.available(), CROWD)
        with stages() as progress:
            outcome = run(
                files, loaded, fitted, options=options, progress=progress,
                processes=crowd,
            )  # fmt: skip
        outcome = outcome.with_tolerance(wanted)
        if strict and outcome.exit_code:
            _print_outcome(outcome, every)
            raise PostprocError(f"--strict: {_why_nothing(outcome)}")
        places = Destination(files, (cell, model))
        if place is not None:
            place.parent.mkdir(parents=True, exist_ok=True)
        written = places.write(outcome, output or place, reports, variables_out)
        _release(
            loaded.file.robot.serial_number, files.path, output or place, fitted.id
        )
        _print_outcome(outcome, every)
        if reports.on_stdout:
            write_text(STREAM, report_text(outcome))
        for path in written:
            say(f"written {path}")
        target = output or place or (given and default_output(given))
        if given is not None and target is not None and not is_stream(target):
            suggest("diff", given, target)
    raise typer.Exit(outcome.exit_code)


def _release(
    serial: str | None, program: Path | None, output: Path | None, model: str
) -> None:
    """Record a program of a robot that the project keeps a record of."""
    if serial is None or program is None:
        return
    from postproc.cli.job_files import default_output

    target = output or default_output(program)
    if is_stream(target):
        return

    def list_releases() -> list[Release]:
        from postproc.compensation.output.sidecar import file_sha256
        from postproc.record.robots import Release

        return [Release(serial, program, target, model, file_sha256(target))]

    release(program, list_releases)


def _model_of_project(program: Path) -> Path | None:
    """Return the model of the project, None where there is none yet."""
    project = find_project(program)
    model = None if project is None else project.model
    return model if model is not None and model.exists() else None


def _project_place(program: Path | None) -> Path | None:
    """Return where a program of a project goes."""
    project = None if program is None else find_project(program)
    if program is None or project is None:
        return None
    return project.output_of(program)


def _why_nothing(outcome: Outcome) -> str:
    """Return why a strict run writes nothing, and what to do."""
    if outcome.opinion is not None and not outcome.opinion.agrees:
        return (
            "the second opinion disagrees (listed above), nothing is written. "
            "Please report it with the program"
        )
    what = "targets are not corrected"
    if outcome.tolerance is not None and not outcome.tolerance.passes:
        what = "targets do not pass the tolerance"
    return (
        f"{what} (listed above), nothing is written. Change them, or run without "
        "--strict"
    )


def _check_values(place: Path, files: ProgramFiles) -> None:
    """Refuse a place that is none, or one for a variable file that is not there."""
    if place == Path(STREAM):
        raise PostprocError("--variables-out -: stdout holds the program. Name a file")
    if files.variables is None:
        raise PostprocError(
            "--variables-out: the program has no variable file. Give one with "
            "--variables"
        )


def _print_outcome(outcome: Outcome, every: bool) -> None:
    """Print what a person needs to know, on stderr."""
    from postproc.cli.source_excerpt import point_at_visits
    from postproc.report.findings import list_findings

    for line in list_findings(outcome.diagnostics, every):
        say(line)
    excerpts = point_at_visits(outcome, outcome.list_uncorrected_rows()[:SHOWN])
    left = Counter(zip_longest(outcome.list_uncorrected(), excerpts, fillvalue=""))
    for (line, source), times in left.items():
        say(line if times == 1 else f"{line} ({times} times)")
        if source:
            say(source)
    say(outcome.summary())
    if outcome.tolerance is not None:
        from postproc.report.tolerance import tell_tolerance

        say(tell_tolerance(outcome, outcome.tolerance))
    if outcome.in_time is not None:
        say(outcome.in_time.summary(outcome.visits))
    if outcome.opinion is not None:
        from postproc.report.second_opinion import print_opinion

        print_opinion(outcome.opinion)


@app.command()
def diff(
    original: Path,
    compensated: Path,
    report: ReportOption = None,
) -> None:
    """Compare the targets of two programs: exit 0 same, 1 different, 2 error."""
    from postproc.report import diff as differ
    from postproc.report.diff_output import difference_pieces, print_difference

    with report_errors():
        reports = Reports.of(report)
        check_places(reports.files, [original, compensated])
        with busy("compare"):
            found = differ.diff(original, compensated)
        reports.write_json(lambda: difference_pieces(found))
        if not reports.on_stdout:
            print_difference(found)
    raise typer.Exit(1 if found else 0)


@app.command()
def restore(
    compensated: Path,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Default: over the program.")
    ] = None,
) -> None:
    """Restore the original program, byte for byte, from its record."""
    from postproc.compensation.output.sidecar import restore_file

    with report_errors():
        for path in restore_file(compensated, output):
            say(f"restored {path}")


@app.command()
def explain(
    program: Path,
    cell: CellOption = None,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model",
            help="Model file (JSON). Default: the project's, or show the plan only.",
        ),
    ] = None,
    line: Annotated[
        int | None,
        typer.Option("--line", help="Only this line, with the share of each effect."),
    ] = None,
    changes: SetOption = None,
    code: CodeOption = None,
    report: ReportOption = None,
) -> None:
    """Show the approach, joint angles and correction of every target."""
    from postproc.compensation.explanation import explain as tell
    from postproc.compensation.options import Options
    from postproc.compensation.program_files import ProgramFiles
    from postproc.model.model import load_model
    from postproc.report.explanation import explanation_json, print_explanation
    from postproc.report.findings import list_findings
    from postproc.robot.cell import load_cell

    with report_errors(program):
        cell, model = cell_file(cell, program), model or _model_of_project(program)
        reports = Reports.of(report)
        check_places(reports.files, [program, cell, model])
        with busy("plan"):
            files = ProgramFiles.open(program)
            loaded = load_cell(cell, changes=changes_of(changes))
            options = Options(timing=loaded.compensation.timing)
            fitted = None if model is None else load_model(model)
            found = tell(files, loaded, fitted, options=options)
        for text in list_findings(found.findings(line), every=False):
            say(text)
        reports.write_json(lambda: explanation_json(found, line))
        if not reports.on_stdout:
            print_explanation(found, line)
