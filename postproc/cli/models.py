"""Commands that measure and model: survey, simulate, fit, predict, compare."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from postproc.cli.common import (
    CellOption,
    ModelOption,
    SetMeasured,
    SetSimulated,
    SetSurvey,
    app,
    busy,
    changes_of,
    report_errors,
    say,
    split_names,
    stages,
    suggest,
    write_text,
)
from postproc.cli.project import cell_file, model_file, model_to_write
from postproc.cli.reports import (
    PAGE,
    PLOTS,
    PageOption,
    PlotOption,
    ReportOption,
    Reports,
    TableOption,
)
from postproc.exceptions import PostprocError
from postproc.files import check_places


class Method(StrEnum):
    """How a model is made from measurements."""

    FULL = "full"
    EJA_ELM = "eja-elm"
    ELM = "elm"
    INTERPOLATION = "interpolation"
    KINEMATIC_ELM = "kinematic-elm"
    KRIGING = "kriging"


@app.command()
def survey(
    output: Annotated[
        Path,
        typer.Option("-o", "--output", help="SURVEY.pdl, .mod or .src: its language."),
    ],
    cell: CellOption = None,
    poses: Annotated[int, typer.Option("--poses", help="Number of poses.")] = 300,
    job: Annotated[
        Path | None,
        typer.Option("--job", help="Program whose working volume is surveyed."),
    ] = None,
    checks: Annotated[
        int | None,
        typer.Option("--checks", help="Check the arm instead, by so many readings."),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option("--model", help="Model whose largest effects a check looks at."),
    ] = None,
    iso: Annotated[
        bool,
        typer.Option("--iso9283", help="Write a test after ISO 9283 instead."),
    ] = False,
    changes: SetSurvey = None,
) -> None:
    """Write a measurement program; every pose is approached from both sides."""
    from postproc.calibration.iso9283.program import write_iso_program
    from postproc.calibration.survey_program import write_check, write_survey
    from postproc.model.model import load_model
    from postproc.robot.cell import load_cell

    with report_errors():
        _refuse_both({"--checks": checks is not None, "--job": job is not None,
                      "--iso9283": iso})  # fmt: skip
        asked, cell = cell, cell_file(cell, output)
        check_places([output], [cell, job, model])
        loaded = load_cell(cell, changes=changes_of(changes))
        with busy("choose poses"):
            if iso:
                summary = write_iso_program(loaded, output)
            elif checks is None:
                summary = write_survey(loaded, output, poses, job)
            else:
                known = None if model is None else load_model(model)
                summary, design = write_check(loaded, output, checks, known)
                if known is not None:
                    from postproc.record.foresight import foresee
                    from postproc.report.record import tell_foreseen

                    summary += tell_foreseen(foresee(loaded, known, design))
        say(summary)
        suggest("read", "MEASURED.csv", "--program", output, cell=asked)


def _refuse_both(given: dict[str, bool]) -> None:
    """Refuse options of which each names other poses.

    Raises:
        PostprocError: There are several.
    """
    names = [name for name, is_there in given.items() if is_there]
    if len(names) > 1:
        problem = " and ".join(names)
        raise PostprocError(f"{problem}: each names other poses. Give one of them")


@app.command()
def simulate(
    program: Annotated[
        Path, typer.Argument(help="Program, survey program or SURVEY.csv")
    ],
    cell: CellOption = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="MEASURED.csv")
    ] = None,
    reference: Annotated[
        Path | None,
        typer.Option("--reference", help="Original program: print the true error."),
    ] = None,
    path: Annotated[
        bool, typer.Option("--path", help="Score the paths between targets as well.")
    ] = False,
    track: Annotated[
        Path | None,
        typer.Option("--track", help="Tracker readings while the arm moves (CSV)."),
    ] = None,
    changes: SetSimulated = None,
    report: ReportOption = None,
) -> None:
    """Run a program or a survey on the virtual arm, and measure it."""
    from postproc.report.simulation import simulate_file
    from postproc.robot.cell import load_cell

    with report_errors():
        cell = cell_file(cell, program)
        reports = Reports.of(report)
        check_places([output, track, *reports.files], [program, cell, reference])
        loaded = load_cell(cell, changes=changes_of(changes))
        arm = loaded.file.simulation
        with busy("run on the virtual arm"):
            often = arm.track_rate_hz if track is not None else 0.0
            found = simulate_file(
                program, loaded, arm.seed, arm.effects, reference, path, often,
                arm.backlash_model,
            )  # fmt: skip
        if output is not None:
            found.write(output)
        if track is not None and found.track is not None:
            found.track.write(track)
        reports.write_json(found.to_json)
        say(found.summary())


def _choices(given: list[str] | None) -> dict[str, str]:
    """Split OURS=COLUMN.

    Raises:
        PostprocError: One has no equals sign.
    """
    pairs = [text.partition("=") for text in given or ()]
    for ours, sign, name in pairs:
        if not (ours and sign and name):
            raise PostprocError(f"--column {ours}: write OURS=COLUMN, as x_mm=X actual")
    return {ours.strip(): name.strip() for ours, _, name in pairs}


@app.command()
def read(
    data: Annotated[list[Path], typer.Argument(help="Measurement files.")],
    cell: CellOption = None,
    program: Annotated[
        Path | None,
        typer.Option("--program", help="Survey program, for files of id, x, y, z."),
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            "--column",
            metavar="OURS=COLUMN",
            help="Column of the file for one of ours.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="MAP.toml: the column map to write."),
    ] = None,
    changes: SetMeasured = None,
) -> None:
    """Show what is understood of measurement files, and write their column map.

    Exit 2: a file cannot be read, or two readings fit; both are named.
    """
    from postproc.calibration.table_reading import map_text, read_file
    from postproc.calibration.tables import DETECT
    from postproc.report.table_reading import print_reading
    from postproc.robot.cell import load_cell

    with report_errors():
        cell = cell_file(cell, data[0])
        check_places([output], [*data, cell, program])
        loaded = load_cell(cell, changes=changes_of(changes))
        choices = _choices(column)
        with busy("read"):
            found = [read_file(p, loaded, DETECT, program, choices) for p in data]
        for one in found:
            typer.echo(print_reading(one, loaded.measurements.frame, program))
        if output is not None:
            write_text(str(output), map_text(found))
            say(f"written {output}: --set measurements.columns={output}")


@app.command()
def fit(
    data: Annotated[list[Path], typer.Argument(help="Measurement files (CSV).")],
    cell: CellOption = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="MODEL.json. Default: the project's, see --force."
        ),
    ] = None,
    method: Annotated[Method, typer.Option("--method")] = Method.FULL,
    effects: Annotated[
        str | None,
        typer.Option(
            "--effects",
            help="Effects to fit, comma separated. Default: those with evidence.",
        ),
    ] = None,
    program: Annotated[
        Path | None,
        typer.Option("--program", help="Survey program, for files of id, x, y, z."),
    ] = None,
    changes: SetMeasured = None,
    report: PageOption = None,
    table: TableOption = None,
    force: Annotated[
        bool, typer.Option("--force", help="Overwrite the model of the project.")
    ] = False,
) -> None:
    """Fit a model of the arm's error to laser-tracker measurements."""
    from postproc.calibration import fit as calibration
    from postproc.report.fit import fit_json, fit_page, tell_fit_files
    from postproc.robot.cell import load_cell

    names = None if effects is None else split_names(effects)
    with report_errors():
        asked, cell = cell, cell_file(cell, data[0])
        named, output = output, model_to_write(output, force, data[0])
        reports = Reports.of(report, PAGE, tables=table)
        check_places([output, *reports.files], [*data, cell, program])
        loaded = load_cell(cell, changes=changes_of(changes))
        with stages(log=True) as progress:
            found = calibration.fit(
                *data,
                cell=loaded,
                method=method.value,
                effects=names,
                program=program,
                progress=progress,
            )
            if not found.rejected:
                found.save(output)
                reports.write_pages(lambda: fit_page(found))
        reports.write_json(lambda: fit_json(found))
        if not reports.on_stdout:
            typer.echo(tell_fit_files(found, output))
            if not found.rejected:
                suggest("compensate", "PROGRAM", cell=asked, model=named)
        if found.rejected:
            raise typer.Exit(2)


@app.command()
def predict(
    states: Annotated[Path, typer.Argument(help="STATES.csv")],
    cell: CellOption = None,
    model: ModelOption = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="ERRORS.csv. Default: stdout."),
    ] = None,
    changes: SetMeasured = None,
) -> None:
    """Add the predicted error, and with positions the residual, to every row."""
    from postproc.calibration import predict as prediction
    from postproc.robot.cell import load_cell

    with report_errors():
        cell = cell_file(cell, states)
        model = model_file(model, states)
        check_places([output], [states, cell, model])
        loaded = load_cell(cell, changes=changes_of(changes))
        with busy("predict"):
            found = prediction.predict(states, loaded, model)
        write_text("-" if output is None else str(output), found.to_csv())
        say(found.summary())


@app.command()
def compare(
    data: Annotated[list[Path], typer.Argument(help="Measurement files (CSV).")],
    cell: CellOption = None,
    report: PlotOption = None,
    table: TableOption = None,
    test: Annotated[
        list[Path] | None,
        typer.Option("--test", help="Files to test on; default: a third of the rows."),
    ] = None,
    blocks: Annotated[
        int, typer.Option("--cv-blocks", min=0, help="Test on so many blocks in turn.")
    ] = 0,
    changes: SetMeasured = None,
) -> None:
    """Fit all methods to the same rows, and test them on held-out rows."""
    from postproc.calibration.comparison import Held, compare_files
    from postproc.report.fit import comparison_json, comparison_page, tell_comparison
    from postproc.robot.cell import load_cell

    with report_errors():
        cell = cell_file(cell, data[0])
        others = test or []
        reports = Reports.of(report, PAGE, *PLOTS, tables=table)
        check_places(reports.files, [*data, *others, cell])
        loaded = load_cell(cell, changes=changes_of(changes))
        held = Held(others, blocks)
        with busy("fit every method"):
            found = compare_files(data, loaded, None, held)
        reports.write_json(lambda: comparison_json(found))
        reports.write_pages(lambda: comparison_page(found))
        if reports.plots:
            from postproc.report.plots import plot_comparison

            reports.write_plots(lambda path: [plot_comparison(found, path)])
        if not reports.on_stdout:
            typer.echo(tell_comparison(found))
