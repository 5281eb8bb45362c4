"""What a model predicts of measured or wanted states, row by row."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from postproc.arrays import Floats, data_frame
from postproc.calibration.measurements import Measurements
from postproc.calibration.readings import (
    Readings,
    describe_missing_setup,
    read_setup,
    rows_of,
)
from postproc.calibration.report import FreeForms
from postproc.calibration.residuals import beside_all
from postproc.calibration.survey_checks import check_against
from postproc.calibration.survey_files import MeasuredFrame, survey_frame
from postproc.calibration.tables import DETECT, TableFormat, read_foreign
from postproc.calibration.text_table import TextTable
from postproc.files import open_text, spreadsheet_text
from postproc.model.model import (
    FreePart,
    Model,
    PredictedReading,
    Prediction,
    as_model,
)
from postproc.model.statistics import ErrorStatistics
from postproc.robot.cell import Cell, as_cell
from postproc.robot.pose import MM
from postproc.robot.state import States
from postproc.threads import in_one_thread

if TYPE_CHECKING:
    from postproc.arrays import DataFrame

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


@dataclass(frozen=True, eq=False)
class PredictedRows:
    """The rows of a file with what a model predicts there.

    Attributes:
        table: The file.
        rows: Its n rows that are no lost beams and no fixed points.
        predicted: The error of the arm there.
        free: Of it what no law predicts.
        read: What the set-up would read there; None where nobody asked.
        residual: What is left of the measured positions, (n, 3) [m]; None without them.
        placed: How rows were placed in space and time, lines for a terminal.
        warming: What the file's clock does, likewise.
    """

    table: TextTable
    rows: Measurements
    predicted: Prediction
    free: FreePart
    read: PredictedReading | None
    residual: Floats | None
    placed: str
    warming: str

    def __str__(self) -> str:
        """Say how many rows there are, and what is left of them; see `summary`."""
        return self.summary()

    def summary(self) -> str:
        """Count the rows, those outside of the survey, and what is left of them."""
        said = self._inside()
        if self.free.names:
            said += f"\nof it {FreeForms.of(self.free).tell()}"
        said += self.placed + self.warming
        if self.residual is None:
            return said
        said += f"\nresidual {ErrorStatistics.of(self.residual).tell()}"
        if self.read is not None:
            held = float((np.abs(self.residual) < WITHIN * self.read.std).mean())
            said += f"\n95 % intervals of a reading hold {held:.1%} of "
            said += f"{self.residual.size} coordinates"
            said += _apart(self.residual, self.read.std)
        return said + beside_all(self.rows, self.residual)

    def _inside(self) -> str:
        """Count states, and those outside the survey by what lies outside."""
        predicted = self.predicted
        outside = int(predicted.any_outside.sum())
        told = f"{len(predicted.error)} states, {outside} outside the survey"
        counts = {why: int(rows.sum()) for why, rows in predicted.outside.items()}
        most = sorted(counts, key=counts.__getitem__, reverse=True)
        return told + "".join(f"\n  {counts[why]}: {why}" for why in most)

    def columns(self) -> dict[str, Floats]:
        """Return the columns that a prediction adds, (n,) [mm], by name."""
        found = self.predicted
        parts: list[tuple[tuple[str, ...], tuple[Floats, ...]]] = [
            (PREDICTED, (found.error, found.std_model, found.std_arrival))
        ]
        if self.free.names:
            parts.append((FREE, (self.free.error, self.free.std)))
        if self.read is not None:
            parts.append((READINGS, (self.read.error, self.read.std)))
        if self.residual is not None:
            parts.append((RESIDUAL, (self.residual,)))
        names = [name for own, _ in parts for name in own]
        values = np.concatenate([v for _, some in parts for v in some], axis=1) / MM
        return {name: values[:, k] for k, name in enumerate(names)}

    def to_frame(self) -> DataFrame:
        """Return a data frame, one row a row of the file that was predicted.

        Columns: id, line, those that `to_csv` adds, all [mm], and outside: what lies
        outside of the survey there.
        """
        outside = ["; ".join(self.predicted.why(i)) for i in range(len(self.rows))]
        return data_frame(
            {
                "id": list(self.rows.ids),
                "line": self.rows.line,
                **self.columns(),
                "outside": outside,
            }
        )

    def to_csv(self) -> str:
        """Write the file with further columns; lost beams get empty cells."""
        table, added = self.table, self.columns()
        out = io.StringIO()
        writer = csv.writer(out, delimiter=";" if table.decimal == "," else ",")
        writer.writerow([*table.columns, *added, "outside"])
        writer.writerows(self._cells(np.stack([*added.values()], axis=1)))
        return out.getvalue().replace("\r\n", "\n")

    def _cells(self, numbers: Floats) -> Iterator[list[str]]:
        """Write the rows of the file, with (n, k) numbers."""
        table, rows = self.table, self.rows
        row_of = {int(line): i for i, line in enumerate(rows.line)}
        points = rows.references
        fixed = set() if points is None else set(points.line.tolist())
        for line, own in zip(table.line, table.cells, strict=True):
            cells = [spreadsheet_text(cell) for cell in own]
            i = row_of.get(int(line))
            if i is None:
                why = "monument" if int(line) in fixed else "beam lost"
                yield [*cells, *[""] * numbers.shape[1], why]
                continue
            told = [f"{v:.5f}".replace(".", table.decimal) for v in numbers[i]]
            yield [*cells, *told, "; ".join(self.predicted.why(i))]


@in_one_thread
def predict(
    states: str | Path | bytes,
    cell: Cell | str | Path,
    model: Model | str | Path,
    *,
    frame: MeasuredFrame | None = None,
    refit: str | None = None,
    after: bool = False,
    name: str = "states.csv",
    reading: TableFormat = DETECT,
) -> PredictedRows:
    """Predict the error of every row of a file; with positions, also the residual.

    Args:
        states: The file, or its text as bytes.
        cell: The cell, or its file.
        model: The model, or its file.
        frame: Frame of the positions, where the readings of the set-up are to be
            predicted, too; default: as the cell says.
        refit: "registration": find the set-up from these rows, as the cell may say.
        after: Take what passes with time as at the survey's end, likewise.
        name: File name of states that are given as bytes.
        reading: What the user knows of the file.

    Raises:
        PostprocError: A file cannot be used, the model is for another arm, or the
            set-up is not known, and not to be found from the rows.
    """
    cell = as_cell(cell)
    model = as_model(model, cell.arm)
    model.check_arm(cell.arm)
    table = read_foreign(open_text(states, name), reading.within(cell))
    measured = table.has(*POSITION)
    if frame is None and measured and cell.measurements.frame is not None:
        frame = survey_frame(cell, None)
    if cell.measurements.refit_registration:
        refit = refit or "registration"
    asked = Readings(frame, refit, after or cell.measurements.after_survey)
    if not asked.is_asked:
        rows, read, placed = rows_of(table, cell, positions=False), None, ""
        if measured:
            check_against(rows, cell.arm, model)
            placed = describe_missing_setup(model)
    else:
        found = read_setup(table, cell, model, asked)
        rows, read, placed = found.rows, found.read, found.note
    predicted = model.predict(cell.arm, rows.states)
    error = predicted.error if read is None else read.error
    left = rows.position - nominal_tcp(cell, rows.states) - error
    return PredictedRows(
        table, rows, predicted, model.free_part(cell.arm, rows.states), read,
        left if measured else None, placed, _warming(table, model),
    )  # fmt: skip


def _warming(table: TextTable, model: Model) -> str:
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


def _apart(left: Floats, std: Floats) -> str:
    """Tell what is between this campaign and the model's survey, where it shows.

    With a further standard deviation t of every coordinate, squared residuals are as
    large as expected: mean(r^2) = mean(s^2) + t^2.
    """
    more = float((left**2).mean() - (std**2).mean())
    if more <= 0.0:
        return ""
    return f"; a term of {np.sqrt(more) / MM:.4f} mm per axis would explain the rest"


def nominal_tcp(cell: Cell, states: States) -> Floats:
    """Place the nominal TCP, (n, 3) [m], base frame."""
    flange = cell.arm.flange(states.q)
    turned = np.einsum("nij,nj->ni", flange[:, :3, :3], states.tool)
    return np.asarray(turned + flange[:, :3, 3])
