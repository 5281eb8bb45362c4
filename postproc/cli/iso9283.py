"""The command that works out figures after ISO 9283."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from postproc.cli.common import (
    CellOption,
    SetMeasured,
    app,
    changes_of,
    report_errors,
)
from postproc.cli.project import cell_file
from postproc.cli.reports import PAGE, PageOption, Reports, TableOption
from postproc.exceptions import PostprocError
from postproc.files import check_places

if TYPE_CHECKING:
    from postproc.calibration.iso9283.readings import IsoReadings
    from postproc.robot.cell import Cell


@app.command("iso9283")
def iso9283(
    readings: Annotated[Path, typer.Argument(help="READINGS.csv")],
    before: Annotated[
        Path | None,
        typer.Option("--before", help="Readings before compensation, beside them."),
    ] = None,
    program: Annotated[
        Path | None,
        typer.Option(
            "--program", help="Program of `survey --iso9283`, for id, x, y, z."
        ),
    ] = None,
    cell: CellOption = None,
    best_fit: Annotated[
        bool,
        typer.Option("--best-fit", help="Register a frame on the same poses first."),
    ] = False,
    load: Annotated[
        str, typer.Option("--load", help="What the arm carried. Default: the cell's.")
    ] = "",
    speed: Annotated[
        str, typer.Option("--speed", help="How fast it went, as a text.")
    ] = "",
    changes: SetMeasured = None,
    report: PageOption = None,
    table: TableOption = None,
) -> None:
    """Compute accuracy and repeatability after ISO 9283 from readings of a test."""
    from postproc.calibration.iso9283.figures import iso_figures
    from postproc.report.iso9283 import IsoReport, iso_json, iso_page, tell_iso
    from postproc.robot.cell import load_cell

    with report_errors():
        reports = Reports.of(report, PAGE, tables=table)
        check_places(reports.files, [readings, before, program, cell])
        known = None
        if program is not None or cell is not None:
            known = load_cell(cell_file(cell, readings), changes=changes_of(changes))
        elif changes:
            raise PostprocError("--set: give the cell too, with --cell CELL.toml")
        found = [_read(one, program, known) for one in (readings, before) if one]
        figures = [
            iso_figures(f.poses, f.paths, best_fit or f.in_tracker) for f in found
        ]
        names = [str(one) for one in (readings, before) if one]
        made = IsoReport(
            figures[0],
            figures[1] if before else None,
            load or _load(known),
            speed,
            tuple(zip(names, (one.sha256 for one in found), strict=True)),
        )
        reports.write_json(lambda: iso_json(made))
        reports.write_pages(lambda: iso_page(made))
        if not reports.on_stdout:
            typer.echo(tell_iso(made))


def _read(path: Path, program: Path | None, cell: Cell | None) -> IsoReadings:
    from postproc.calibration.iso9283.readings import read_program_test, read_test

    if program is None or cell is None:
        return read_test(path)
    return read_program_test(path, program, cell)


def _load(cell: Cell | None) -> str:
    """Say what the arm carries, "" where the cell does not."""
    mass = float("nan") if cell is None else cell.payload_mass
    return f"{mass:g} kg" if mass == mass else ""
