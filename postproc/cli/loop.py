"""Commands that close the loop and show it: diagnose, history, report."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from postproc.cli.common import (
    CellOption,
    HtmlOption,
    JsonOption,
    ModelOption,
    SeedOption,
    app,
    as_path,
    explained,
    say,
    write_text,
)
from postproc.files import check_places


class PointFrame(StrEnum):
    """The frame that points were measured in."""

    BASE = "base"
    UFRAME = "uframe"
    TRACKER = "tracker"


@app.command()
def diagnose(
    data: Annotated[list[Path], typer.Argument(help="Fresh measurements (CSV).")],
    cell: CellOption,
    model: ModelOption,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Default: MODEL.extended.json beside it."),
    ] = None,
    json: JsonOption = None,
    html: HtmlOption = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Plots (.png or .svg), by this name.")
    ] = None,
    program: Annotated[
        Path | None,
        typer.Option("--program", help="The program whose points were measured."),
    ] = None,
    frame: Annotated[
        PointFrame, typer.Option("--measured-frame", "--frame")
    ] = PointFrame.BASE,
    seed: SeedOption = 0,
) -> None:
    """Find what the model lacks, trace it to an effect, and add that effect."""
    from postproc.calibration.diagnosis.diagnose import dumped, evidence_of
    from postproc.cli import diagnose
    from postproc.report.terminal import stage_bar

    with explained():
        check_places([output, as_path(json), html, plot], [*data, cell, model, program])
        with stage_bar() as progress:
            found = diagnose.diagnose_files(
                data,
                cell,
                model,
                output=output,
                program=program,
                measured_frame=frame.value,
                seed=seed,
                progress=progress,
            )
        if json:
            write_text(json, dumped(evidence_of(found)))
        if html is not None:
            from postproc.report.html import diagnosis_report

            write_text(str(html), diagnosis_report(evidence_of(found)))
        if plot is not None:
            from postproc.report.plots import plot_diagnosis

            for path in plot_diagnosis(found, plot):
                say(f"plot {path}")
        if json != "-":
            typer.echo(diagnose.tell(found.diagnosis))


@app.command()
def history(model: Path, json: JsonOption = None) -> None:
    """Print what was added to a model and its parents, with before and after."""
    from postproc.cli import diagnose

    with explained():
        check_places([as_path(json)], [model])
        if json:
            write_text(json, diagnose.history_json(model))
        if json != "-":
            typer.echo(diagnose.history_text(model))


@app.command()
def report(
    source: Annotated[
        Path, typer.Argument(help="A report, model, diagnosis or comparison (JSON).")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="REPORT.html")],
) -> None:
    """Make one self-contained page (HTML) of a report, model or diagnosis."""
    from postproc.report.html import report_file

    with explained():
        check_places([output], [source])
        report_file(source, output)
        say(f"{output}")
