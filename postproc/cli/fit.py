"""Fitting and predicting files: what is read, written and told."""

from __future__ import annotations

import csv
import io
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
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
from postproc.calibration.measurements import Measurements, concatenate
from postproc.calibration.plausibility import check_against, check_survey
from postproc.calibration.published import (
    VOLUME_DEG,
    Comparison,
    Trial,
    blocks_of,
    compare_in,
    random_said,
    random_split,
    span_of,
)
from postproc.calibration.report import FitReport, Found, FreeForms
from postproc.calibration.reversals import split_reversals
from postproc.calibration.stops import pool_readings
from postproc.calibration.tables import DETECT, TableFormat, read_foreign
from postproc.calibration.tables import TextTable as Cells
from postproc.cli.diagnose import join_program, tell_directions
from postproc.cli.readings import Readings, read_setup, rows_of
from postproc.cli.residuals import beside_all
from postproc.exceptions import PostprocError
from postproc.files import spreadsheet_text, write_all
from postproc.model.model import (
    FreePart,
    Model,
    Prediction,
    load_model,
)
from postproc.model.noise import poses_of
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
FOUND = (
    Column("found", "left"),
    Column("joint"),
    Column("rms mm"),
    Column("max mm"),
    Column("evidence nats"),
    Column("", "left"),
)
MOST, FEW = 20, 8  # findings, and rows, that a short report lists
ROWS = 10**6  # directions that a long report lists
SHOWN_MM = 0.0005  # of poses: less is not listed
ENOUGH = 3.0  # nats from which a finding is listed: 20 to 1
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
FREE = (
    *("free_dx_mm", "free_dy_mm", "free_dz_mm"),  # of it what no law predicts
    *("free_sx_mm", "free_sy_mm", "free_sz_mm"),  # its standard error
)
READINGS = (
    *("reading_dx_mm", "reading_dy_mm", "reading_dz_mm"),  # less the nominal TCP
    *("reading_sx_mm", "reading_sy_mm", "reading_sz_mm"),  # of one reading
)
WITHIN = 1.96  # standard deviations that hold 95 % of the readings
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
) -> Calibration:
    """Fit measurement files and write the model, unless the fit rejects it.

    Args:
        data: Measurement files.
        cell_path: The cell.
        output: The model file to write.
        program: The survey program, for files that hold ids and positions only.
        html: A page about the fit to write.
        reading: What the user knows of the measurement files.
        how: Arguments of `postproc.calibration.fit.fit`; None stands for the default.

    Returns:
        The fit.

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
    if found.rejected:
        return found
    found.model.save(output)
    if html is not None:
        write_page(html, found, cell)
    return found


def tell_fit_files(found: Calibration, output: Path, everything: bool = False) -> str:
    """Write the report of a fit, and where its model is, for a terminal.

    Args:
        found: The fit.
        output: The file its model was written to.
        everything: Whether the report lists all parameters and rows.
    """
    report = tell_fit(found.report, everything)
    if found.rejected:
        return f"{report}\nno model is written: {found.rejected}"
    return f"{report}\nmodel {found.model.id} written to {output}"


def fit_json(found: Calibration) -> str:
    """Return the whole report of a fit, parameters and findings, as JSON text.

    A figure that is not known is null: JSON has no word for it.
    """
    from postproc.report.json import finite

    verdict = "rejected" if found.rejected else "accepted"
    said = {"model": found.model.id, "verdict": verdict, **asdict(found.report)}
    return json.dumps(finite(said), indent=1, allow_nan=False) + "\n"


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


def tell_fit(report: FitReport, everything: bool = False) -> str:
    """Write the report of a fit for a terminal.

    Args:
        report: The report.
        everything: Whether to list every parameter, pair, direction and row.
    """
    if everything:
        lines = [_tell_parameters(report), _tell_found(report.found)]
        lines += [
            f"{k}: {share:.1%} of the error" for k, share in report.shares.items()
        ]
        lines += [f"correlated {r:+.3f}: {a} and {b}" for a, b, r in report.correlated]
        lines += [f"not determined by these rows: {d}" for d in report.unseen]
    else:
        lines = [_tell_found(_large(report.found)), *_tell_rest(report)]
    if report.held_out is not None:
        lines.insert(0, report.held_out.describe())
    lines += _tell_rows(report, len(report.dropped) if everything else FEW)
    lines += tell_directions(report.directions, ROWS if everything else FEW)
    lines += [report.flanks, *(f"warning: {warning}" for warning in report.warnings)]
    lines += _tell_free(report.free)
    lines += _tell_scatter(report)
    return "\n".join(line for line in lines if line)


def _tell_found(found: Sequence[Found]) -> str:
    """Write what effects do, as a table; no line where nothing has a name."""
    if not found:
        return ""
    cells = (
        (
            f.effect, str(f.joint or ""), f"{f.size_mm:.3f}", f"{f.max_mm:.3f}",
            str(round(f.evidence)), _remark(f),
        )
        for f in found
    )  # fmt: skip
    return table_text(FOUND, cells)


def _remark(found: Found) -> str:
    """Say what is special about a finding."""
    told = [f"IMPOSSIBLE: {text}" for text in found.impossible]
    if found.wave is not None:
        order, size, error = found.wave
        told.append(f"order {order:.4g}, {size:.3f} +- {error:.3f} mrad")
    if found.setup:
        told.append("of the set-up: not compensated")
    return "; ".join(told)


def _large(found: Sequence[Found]) -> list[Found]:
    """Take the largest findings for which there is evidence, and impossible ones."""
    shown = [f for f in found if f.evidence > ENOUGH]
    few = shown[:MOST]
    return few + [f for f in found if f.impossible and f not in few]


def _tell_rest(report: FitReport) -> list[str]:
    """Say in a line each what is small, alike, or not determined."""
    lines, found = [], report.found
    shown = _large(found)
    rest = [f for f in found if f not in shown]
    if rest:
        size = float(np.sqrt(sum(f.size_mm**2 for f in rest)))
        names = _counted(f.effect for f in rest)
        lines.append(f"smaller or without evidence, {size:.3f} mm together: {names}")
    if report.unseen:
        names = _grouped(u.name for u in report.unseen)
        count = len(report.unseen)
        lines.append(f"not determined, left at the prior, {count} directions: {names}")
    if report.correlated:
        names = _counted(a.partition(".")[0] for a, _, _ in report.correlated)
        lines.append(f"hardly told apart, {len(report.correlated)} pairs: {names}")
    if lines:
        lines.append("all parameters, directions and rows: --all")
    return lines


def _counted(names: Iterable[str]) -> str:
    """Count names, the most frequent first.

    >>> _counted(["a", "b", "b"])
    'b 2, a 1'
    """
    return ", ".join(f"{name} {n}" for name, n in Counter(names).most_common())


def _grouped(names: Iterable[str]) -> str:
    """Name parameters by their effects; where there are more than a few, count them.

    >>> _grouped(["geometry.a2", "backlash.b1", "geometry.d2"])
    'geometry a2 d2, backlash b1'
    """
    groups: dict[str, list[str]] = {}
    for name in names:
        effect, _, own = name.partition(".")
        groups.setdefault(effect, []).append(own)
    return ", ".join(
        f"{effect} {' '.join(own) if len(own) < FEW else len(own)}"
        for effect, own in sorted(groups.items(), key=lambda g: -len(g[1]))
    )


def _tell_rows(report: FitReport, most: int) -> list[str]:
    """List rows that count less, and those that stand out and count all the same."""
    rows = report.dropped
    lines = [f"row {row.id} (line {row.line}): {row.why}" for row in rows[:most]]
    if len(rows) > most:
        lines.append(f"and {len(rows) - most} more rows that count less (--all)")
    if report.spared:
        ids = ", ".join(report.spared[: max(most, FEW)])
        more = len(report.spared) - max(most, FEW)
        ids += f" and {more} more" if more > 0 else ""
        lines.append(f"suspect, but kept, for rows beside them agree: row {ids}")
    return lines


def _tell_free(free: FreeForms | None) -> list[str]:
    """Tell what functions without a law have in the predicted errors."""
    if free is None:
        return []
    if not free.names:
        return ["free forms: none, the named effects predict every correction"]
    names = ", ".join(free.names)
    return [f"free forms ({names}): {free.rms_mm:.3f} +- {free.std_mm:.3f} mm rms"]


def _tell_scatter(report: FitReport) -> list[str]:
    """Tell of the noise, which published methods do not know, and of the errors."""
    lines = []
    if report.tracker_mm or report.repeatability_mm:
        lines.append(
            f"tracker {report.tracker_mm:.4f} mm, repeatability "
            f"{report.repeatability_mm:.4f} mm per axis ({report.repeated})"
        )
    if report.pose_mm > SHOWN_MM:
        lines.append(
            f"errors of poses that no effect describes {report.pose_mm:.4f} mm per "
            f"axis (estimated; {report.split})"
        )
    if report.orientation_mrad is not None:
        lines.append(f"orientation {report.orientation_mrad:.4f} mrad (estimated)")
    lines.append(f"measured error  {_tell(report.before)}")
    lines.append(f"left by the fit {_tell(report.after)}")
    return lines


def _tell_parameters(report: FitReport) -> str:
    """Write the table of all parameters."""
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
    return table_text(COLUMNS, cells)


def _tell(spread: ErrorStatistics) -> str:
    """Write error statistics in one line."""
    return (
        f"mean {spread.mean_mm:.4f} mm, std {spread.std_mm:.4f}, "
        f"95 % {spread.p95_mm:.4f}, max {spread.max_mm:.4f} ({spread.n} rows)"
    )


@dataclass(frozen=True)
class Held:
    """Which rows methods are tested on: a random third, unless something else is said.

    Attributes:
        files: Measurement files of their own.
        blocks: Or so many blocks of the rows in their order, one after the other.
        seed: Of the random split and of the random layers.
    """

    files: Sequence[Path] = ()
    blocks: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        if self.files and self.blocks:
            raise PostprocError("--test and --blocks: say one of them")

    def pairs(
        self, survey: Measurements, cell: Cell, reading: TableFormat
    ) -> tuple[list[tuple[Measurements, Measurements]], str]:
        """Return the rows to fit and to test, and in words what they are.

        Raises:
            PostprocError: A file cannot be used, or there are not as many rows.
        """
        if self.files:
            test = pool_readings(read_surveys(self.files, cell, reading))
            names = ", ".join(path.name for path in self.files)
            return [(survey, test)], (
                f"{len(survey)} rows to fit, {len(test)} of {names} to test"
            )
        if not self.blocks:
            train, held = random_split(poses_of(survey.states), self.seed)
            pairs = [(survey[train], survey[held])]
            return pairs, random_said(train, held, self.seed)
        if not 2 <= self.blocks <= len(survey) // 2:
            raise PostprocError(
                f"--blocks {self.blocks}: {len(survey)} rows can be cut into 2 to "
                f"{len(survey) // 2} blocks"
            )
        cut = blocks_of(len(survey), self.blocks)
        return [(survey[train], survey[held]) for train, held in cut], (
            f"{len(survey)} rows in {self.blocks} blocks in their order, each tested "
            "by a fit of the others"
        )


def compare_files(
    data: Sequence[Path],
    cell_path: Path,
    frame: str,
    held: Held,
    reading: TableFormat = DETECT,
) -> Comparison:
    """Fit and test every method on measurement files.

    Rows in the tracker's frame are registered by those that are fitted alone.

    Raises:
        PostprocError: A file cannot be used.
    """
    cell = load_cell(cell_path)
    survey = pool_readings(read_surveys(data, cell, reading))
    survey, _ = split_reversals(survey, cell.arm)
    pairs, said = held.pairs(survey, cell, reading)
    trials = [_trial(train, test, cell, frame) for train, test in pairs]
    for trial in trials:
        check_survey(trial.train, cell.arm)
    rows = compare_in(trials, cell.arm, held.seed)
    return Comparison(rows, said, span_of(survey.states))


def _trial(train: Measurements, test: Measurements, cell: Cell, frame: str) -> Trial:
    """Take rows into the base frame."""
    if frame != "tracker":
        return Trial(train, test, cell.tracker)
    train, found = into_base_frame(train, cell.arm)
    states = found.on_probes(test.states)
    position = found.to_base(test.position, states.station)
    test = replace(test, states=states, position=position)
    return Trial(train, test, found.origin)


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
    span = ", ".join(f"{v:.0f}" for v in found.span_deg)
    told = f"joints 1 to 6 span {span} deg"
    if max(found.span_deg) > VOLUME_DEG:
        told += f"; the ELMs follow about {VOLUME_DEG:.0f}"
    return f"{table_text(COMPARED, rows)}\n{found.split}\n{told}"


def predict_file(
    path: Path,
    cell_path: Path,
    model_path: Path,
    readings: Readings,
    reading: TableFormat = DETECT,
) -> tuple[str, str]:
    """Add predicted errors to the rows of a file.

    Args:
        path: The file.
        cell_path: The cell.
        model_path: The model.
        readings: What is asked of the readings of the set-up.
        reading: What the user knows of the file.

    Returns:
        The new file's text, and in words the residual where positions are given.

    Raises:
        PostprocError: A file cannot be used, or the model is for another arm.
    """
    cell, model = load_cell(cell_path), load_model(model_path)
    model.check_arm(cell.arm, model_path)
    table = read_foreign(path, reading)
    if not readings.asked:
        return predict_table(table, cell, model)
    return predict_readings(table, cell, model, readings)


def predict_table(table: Cells, cell: Cell, model: Model) -> tuple[str, str]:
    """Add predicted errors to the rows of a table; lost beams get empty cells."""
    measured = rows_of(table, cell, positions=False)
    if table.has(*POSITION):
        check_against(measured, cell.arm, model)
    predicted = model.predict(cell.arm, measured.states)
    header, parts, told = _told(predicted, model.free_part(cell.arm, measured.states))
    summary = _inside(predicted) + told + _warming(table, model)
    if table.has(*POSITION):
        left = measured.position - nominal_tcp(cell, measured.states) - predicted.error
        parts.append(left)
        header += RESIDUAL
        summary += f"\nresidual {_tell(ErrorStatistics.of(left))}"
        summary += beside_all(measured, left)
    return written(table, measured, header, parts, predicted), summary


def _warming(table: Cells, model: Model) -> str:
    """Say that predictions follow the clock of a file, where the arm warms up by it."""
    states = [
        effect.refers_to()
        for effect in model.compensable()[0].effects
        if effect.driven_by == "temperature" and effect.refers_to()
    ]
    if not states or not table.has("time_s"):
        return ""
    return (
        "\nthe arm warms up with time_s, cold where the survey's clock began: leave "
        f"the column out for {states[0]}"
    )


def predict_readings(
    table: Cells, cell: Cell, model: Model, readings: Readings
) -> tuple[str, str]:
    """Add predicted errors and what the set-up reads; lost beams get empty cells.

    Raises:
        PostprocError: The set-up is not known, and not to be found from the rows.
    """
    found = read_setup(table, cell, model, readings)
    rows, read, placed = found.rows, found.read, found.note
    predicted = model.predict(cell.arm, rows.states)
    header, parts, told = _told(predicted, model.free_part(cell.arm, rows.states))
    header, parts = [*header, *READINGS], [*parts, read.error, read.std]
    summary = _inside(predicted) + told + placed + _warming(table, model)
    if table.has(*POSITION):
        left = rows.position - nominal_tcp(cell, rows.states) - read.error
        parts.append(left)
        header += RESIDUAL
        held = float((np.abs(left) < WITHIN * read.std).mean())
        summary += f"\nresidual {_tell(ErrorStatistics.of(left))}"
        summary += f"\n95 % intervals of a reading hold {held:.1%} of {left.size} "
        summary += "coordinates" + _apart(left, read.std) + beside_all(rows, left)
    return written(table, rows, header, parts, predicted), summary


def _apart(left: Floats, std: Floats) -> str:
    """Tell what is between this campaign and the model's survey, where it shows.

    With a further standard deviation t of every coordinate, squared residuals are as
    large as expected: mean(r^2) = mean(s^2) + t^2.
    """
    more = float((left**2).mean() - (std**2).mean())
    if more <= 0.0:
        return ""
    return f"; a term of {np.sqrt(more) / MM:.4f} mm per axis would explain the rest"


def _told(predicted: Prediction, free: FreePart) -> tuple[list[str], list[Floats], str]:
    """List the columns of a prediction, and tell of free forms if there are any."""
    columns = [predicted.error, predicted.std_model, predicted.std_arrival]
    if not free.names:
        return [*PREDICTED], columns, ""
    (told,) = _tell_free(FreeForms.of(free))
    return [*PREDICTED, *FREE], [*columns, free.error, free.std], f"\nof it {told}"


def _inside(predicted: Prediction) -> str:
    """Count states, and those outside the survey by what lies outside."""
    outside = int(predicted.any_outside.sum())
    told = f"{len(predicted.error)} states, {outside} outside the survey"
    counts = {why: int(rows.sum()) for why, rows in predicted.outside.items()}
    most = sorted(counts, key=counts.__getitem__, reverse=True)
    return told + "".join(f"\n  {counts[why]}: {why}" for why in most)


def written(
    table: Cells,
    rows: Measurements,
    header: Sequence[str],
    parts: Sequence[Floats],
    predicted: Prediction,
) -> str:
    """Write a table with further columns, (n, 3) [m] each three of the header."""
    numbers = np.concatenate(parts, axis=1) / MM
    row_of = {int(line): i for i, line in enumerate(rows.line)}
    fixed = set() if rows.references is None else set(rows.references.line.tolist())
    out = io.StringIO()
    writer = csv.writer(out, delimiter=";" if table.decimal == "," else ",")
    writer.writerow([*table.columns, *header, "outside"])
    for line, own in zip(table.line, table.cells, strict=True):
        cells = [spreadsheet_text(cell) for cell in own]
        i = row_of.get(int(line))
        if i is None:
            why = "fixed point" if int(line) in fixed else "beam lost"
            writer.writerow([*cells, *[""] * len(header), why])
            continue
        told = [f"{v:.5f}".replace(".", table.decimal) for v in numbers[i]]
        writer.writerow([*cells, *told, "; ".join(predicted.why(i))])
    return out.getvalue().replace("\r\n", "\n")


def nominal_tcp(cell: Cell, states: States) -> Floats:
    """Place the nominal TCP, (n, 3) [m], base frame."""
    flange = cell.arm.flange(states.q)
    turned = np.einsum("nij,nj->ni", flange[:, :3, :3], states.tool)
    return np.asarray(turned + flange[:, :3, 3])
