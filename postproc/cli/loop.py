"""Commands that close the loop and show it: diagnose, history, report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from postproc.cli.common import (
    CellOption,
    ModelOption,
    SetMeasured,
    app,
    changes_of,
    report_errors,
    say,
)
from postproc.cli.project import cell_file, model_file
from postproc.cli.reports import (
    PAGE,
    PLOTS,
    PlotOption,
    ReportOption,
    Reports,
    TableOption,
)
from postproc.exceptions import PostprocError
from postproc.files import check_places, schema

if TYPE_CHECKING:
    from postproc.calibration.diagnosis.diagnose import Extension
    from postproc.calibration.diagnosis.measured_path import PathDiagnosis


@app.command()
def diagnose(
    data: Annotated[
        list[Path] | None, typer.Argument(help="Fresh measurements (CSV).")
    ] = None,
    cell: CellOption = None,
    model: ModelOption = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Default: MODEL.extended.json beside it."),
    ] = None,
    report: PlotOption = None,
    table: TableOption = None,
    program: Annotated[
        Path | None,
        typer.Option(
            "--program",
            help="Program whose points were measured, or that ran with --path.",
        ),
    ] = None,
    path: Annotated[
        Path | None,
        typer.Option(
            "--path", help="Readings of a tracker that followed the tool (CSV)."
        ),
    ] = None,
    changes: SetMeasured = None,
) -> None:
    """Find the effects that a model lacks, and add them to the model."""
    from postproc.calibration.diagnosis.diagnose import dump_json, evidence_of
    from postproc.report.diagnosis import tell
    from postproc.report.measured_path import tell_path
    from postproc.report.terminal import stage_bar
    from postproc.robot.cell import load_cell

    with report_errors():
        files = data or []
        beside = program or path or next(iter(files), None)
        cell, model = cell_file(cell, beside), model_file(model, beside)
        inputs = [*files, cell, model, program, path]
        reports = Reports.of(report, PAGE, *PLOTS, tables=table)
        check_places([output, *reports.files], inputs)
        how = {"program": program}
        loaded = load_cell(cell, changes=changes_of(changes))
        with stage_bar() as progress:
            on_the_way, found = _diagnose_files(
                files, path, cell=loaded, model=model, progress=progress, **how
            )
            if not found.rejected:
                found.save(output or path_of_extension(model))
        evidence = evidence_of(found) if reports.files else {}
        measured = {} if on_the_way is None else {"path": on_the_way.to_dict()}
        reports.write_json(lambda: dump_json(schema("diagnosis") | evidence | measured))
        if reports.pages or reports.tables:
            from postproc.report.html import diagnosis_report

            reports.write_pages(lambda: diagnosis_report(evidence))
        if reports.plots:
            from postproc.report.plots import plot_diagnosis

            reports.write_plots(lambda path: plot_diagnosis(found, path))
        if not reports.on_stdout:
            if on_the_way is not None:
                typer.echo(tell_path(on_the_way))
            typer.echo(tell(found.diagnosis))
        if found.rejected:
            raise typer.Exit(2)


def _diagnose_files(
    files: list[Path], path: Path | None, **how: Any
) -> tuple[PathDiagnosis | None, Extension]:
    """Diagnose points, or a path."""
    from postproc.calibration.diagnosis.files import diagnose as diagnose_files
    from postproc.calibration.diagnosis.measured_path import diagnose_path

    if (path is None) == (not files):
        raise PostprocError("diagnose: give measurements, or --path and --program")
    if path is None:
        return None, diagnose_files(*files, **how)
    told = diagnose_path(path, **how)
    return told, told.extension


def path_of_extension(model_path: Path) -> Path:
    """Name the extended model's file when nobody did."""
    return model_path.with_name(f"{model_path.stem}.extended.json")


@app.command()
def history(model: Path, report: ReportOption = None) -> None:
    """List the effects added to a model, with the errors before and after."""
    from postproc.report.diagnosis import history_json, history_text

    with report_errors():
        reports = Reports.of(report)
        check_places(reports.files, [model])
        reports.write_json(lambda: history_json(model))
        if not reports.on_stdout:
            typer.echo(history_text(model))


@app.command()
def report(
    source: Annotated[
        Path, typer.Argument(help="A report, model, diagnosis or comparison (JSON).")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="REPORT.html")],
) -> None:
    """Write a self-contained HTML page of a report, model or diagnosis."""
    from postproc.report.html import report_file

    with report_errors():
        check_places([output], [source])
        report_file(source, output)
        say(f"{output}")
