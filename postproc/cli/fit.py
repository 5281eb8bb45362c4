"""Fitting and predicting files: what is read, written and told."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.fit import (
    Calibration,
    fit,
    fit_measurements,
    into_base_frame,
    read_surveys,
)
from postproc.calibration.measurements import concatenate, from_table
from postproc.calibration.plausibility import check_survey
from postproc.calibration.published import Comparison, compare
from postproc.calibration.report import FitReport
from postproc.calibration.tables import DETECT, TableFormat, read_table
from postproc.calibration.tables import TextTable as Cells
from postproc.cli.diagnose import join_program
from postproc.files import write_all
from postproc.model.model import Model, load_model
from postproc.model.statistics import ErrorStatistics
from postproc.report.terminal import Column, table_text
from postproc.robot.cell import Cell, load_cell
from postproc.robot.pose import MM
from postproc.robot.state import States

COLUMNS = (
    Column("parameter", "left"),
    Column("value"),
    Column("std error"),
    Column("unit", "left"),
    Column("share"),
    Column("seen"),
)
COMPARED = (
    Column("method", "left"),
    Column("range mm"),
    Column("mean mm"),
    Column("std mm"),
)
PREDICTED = (
    *("dx_mm", "dy_mm", "dz_mm"),  # predicted error
    *("sx_mm", "sy_mm", "sz_mm"),  # its standard error
    *("arrival_sx_mm", "arrival_sy_mm", "arrival_sz_mm"),  # of one arrival
)
RESIDUAL = ("rx_mm", "ry_mm", "rz_mm")
POSITION = ("x_mm", "y_mm", "z_mm")


def fit_files(
    data: Sequence[Path],
    cell_path: Path,
    output: Path,
    program: Path | None = None,
    html: Path | None = None,
    reading: TableFormat = DETECT,
    **how: Any,
) -> str:
    """Fit measurement files and write the model.

    Args:
        data: Measurement files.
        cell_path: The cell.
        output: The model file to write.
        program: The survey program, for files that hold ids and positions only.
        html: A page about the fit to write.
        reading: What the user knows of the measurement files.
        how: Arguments of `postproc.calibration.fit.fit`; None stands for the default.

    Returns:
        The report of the fit, in words.

    Raises:
        PostprocError: A file cannot be used, or the rows cannot determine the model.
    """
    cell = load_cell(cell_path)
    chosen = {name: value for name, value in how.items() if value is not None}
    if program is None:
        found = fit(data, cell, reading=reading, **chosen)
    else:
        parts = [join_program(path, program, cell, reading) for path in data]
        survey = concatenate(parts)
        found = fit_measurements(survey, cell, **chosen)
    found.model.save(output)
    if html is not None:
        write_page(html, found, cell)
    return tell_fit(found.report) + f"\nmodel {found.model.id} written to {output}"


def write_page(path: Path, found: Calibration, cell: Cell) -> None:
    """Write a page about a fit.

    Raises:
        OutputError: The place cannot be written to.
    """
    from postproc.report.html import calibration_report
    from postproc.report.html.model import fit_evidence

    rows = fit_evidence(found.report, found.model, found.survey, cell.arm)
    page = calibration_report(found.model.to_dict(), rows)
    write_all({path: page.encode()})


def tell_fit(report: FitReport) -> str:
    """Write the report of a fit for a terminal."""
    cells = (
        (
            p.name,
            f"{p.value:.4f}",
            f"{p.std_error:.4f}",
            p.unit,
            f"{p.share:.1%}",
            f"{p.determined:.0%}",
        )
        for p in report.parameters
    )
    lines = [table_text(COLUMNS, cells)]
    for name, share in report.shares.items():
        lines.append(f"{name}: {share:.1%} of the error")
    for a, b, value in report.correlated:
        lines.append(f"correlated {value:+.3f}: {a} and {b}")
    for direction in report.unseen:
        lines.append(f"not determined by these rows: {direction}")
    for row in report.dropped:
        lines.append(f"row {row.id} (line {row.line}): {row.why}")
    for warning in report.warnings:
        lines.append(f"warning: {warning}")
    lines.append(
        f"tracker {report.tracker_mm:.4f} mm, repeatability "
        f"{report.repeatability_mm:.4f} mm per axis (estimated)"
    )
    if report.orientation_mrad is not None:
        lines.append(f"orientation {report.orientation_mrad:.4f} mrad (estimated)")
    lines.append(f"measured error  {_tell(report.before)}")
    lines.append(f"left by the fit {_tell(report.after)}")
    return "\n".join(lines)


def _tell(spread: ErrorStatistics) -> str:
    """Write error statistics in one line."""
    return (
        f"mean {spread.mean_mm:.4f} mm, std {spread.std_mm:.4f}, "
        f"95 % {spread.p95_mm:.4f}, max {spread.max_mm:.4f} ({spread.n} rows)"
    )


def compare_files(
    data: Sequence[Path],
    cell_path: Path,
    frame: str,
    seed: int,
    reading: TableFormat = DETECT,
) -> Comparison:
    """Fit and test every method on measurement files.

    Raises:
        PostprocError: A file cannot be used.
    """
    cell = load_cell(cell_path)
    survey, tracker = read_surveys(data, cell, reading), cell.tracker
    if frame == "tracker":
        survey, placed = into_base_frame(survey, cell.arm)
        tracker = placed.tracker
    check_survey(survey, cell.arm)
    return compare(survey, cell.arm, tracker, seed)


def comparison_json(found: Comparison) -> str:
    """Return a comparison as JSON text."""
    return json.dumps(asdict(found), indent=1) + "\n"


def tell_comparison(found: Comparison) -> str:
    """Write a comparison for a terminal."""
    rows = (
        (
            r.method,
            f"{r.min_mm:.4f} .. {r.max_mm:.4f}",
            f"{r.mean_mm:.4f}",
            f"{r.std_mm:.4f}",
        )
        for r in found.rows
    )
    return f"{table_text(COMPARED, rows)}\n{found.split}"


def predict_file(path: Path, cell_path: Path, model_path: Path) -> tuple[str, str]:
    """Add predicted errors to the rows of a file.

    Returns:
        The new file's text, and in words the residual where positions are given.

    Raises:
        PostprocError: A file cannot be used, or the model is for another arm.
    """
    cell, model = load_cell(cell_path), load_model(model_path)
    model.check_arm(cell.arm, model_path)
    table = read_table(path)
    return predict_table(table, cell, model)


def predict_table(table: Cells, cell: Cell, model: Model) -> tuple[str, str]:
    """Add predicted errors to the rows of a table; lost beams get empty cells."""
    measured = from_table(table, cell.arm, cell.probes, positions=False)
    predicted = model.predict(cell.arm, measured.states)
    parts = [predicted.error, predicted.std_model, predicted.std_arrival]
    header, summary = list(PREDICTED), f"{len(measured)} states"
    summary += f", {int(predicted.any_outside.sum())} outside the survey"
    if table.has(*POSITION):
        left = measured.position - nominal_tcp(cell, measured.states) - predicted.error
        parts.append(left)
        header += RESIDUAL
        summary += f"\nresidual {_tell(ErrorStatistics.of(left))}"
    numbers = np.concatenate(parts, axis=1) / MM
    row_of = {int(line): i for i, line in enumerate(measured.line)}
    out = io.StringIO()
    writer = csv.writer(out, delimiter=";" if table.decimal == "," else ",")
    writer.writerow([*table.columns, *header, "outside"])
    for line, cells in zip(table.line, table.cells, strict=True):
        i = row_of.get(int(line))
        if i is None:
            writer.writerow([*cells, *[""] * len(header), "beam lost"])
            continue
        told = [f"{v:.5f}".replace(".", table.decimal) for v in numbers[i]]
        writer.writerow([*cells, *told, "; ".join(predicted.why(i))])
    return out.getvalue().replace("\r\n", "\n"), summary


def nominal_tcp(cell: Cell, states: States) -> Floats:
    """Place the nominal TCP, (n, 3) [m], base frame."""
    flange = cell.arm.flange(states.q)
    turned = np.einsum("nij,nj->ni", flange[:, :3, :3], states.tool)
    return np.asarray(turned + flange[:, :3, 3])
