"""Measurement files as one survey, with what the cell and the program know of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from postproc.calibration.measured_program import join_program
from postproc.calibration.measurements import (
    Measurements,
    concatenate,
    read_survey_file,
)
from postproc.calibration.tables import DETECT, TableFormat
from postproc.exceptions import PostprocError
from postproc.files import open_text
from postproc.robot.cell import Cell, PointFrame, as_cell

MeasuredFrame = Literal["base", "tracker"]
MeasurementFile = str | Path | bytes | Measurements


def read_measurements(
    *files: MeasurementFile,
    cell: Cell | str | Path,
    program: str | Path | None = None,
    name: str = "measurements.csv",
    reading: TableFormat = DETECT,
) -> Measurements:
    """Read measurement files as one survey, with what the cell knows of the load.

    Args:
        files: Paths, in visit order, or texts as bytes; or one survey that was read.
        cell: The cell, or its file: arm, probe points, payload.
        program: The program that was measured, for files that hold ids and positions
            only: the states are those of its visits.
        name: File name of texts, for messages.
        reading: What the user knows of the files.

    Raises:
        MeasurementError: A file cannot be read, with the line and the cure.
    """
    cell = as_cell(cell)
    if len(files) == 1 and isinstance(files[0], Measurements):
        return files[0]
    places = [open_text(f, name) for f in files if not isinstance(f, Measurements)]
    if not places or len(places) < len(files):
        raise PostprocError("measurements: give files, or one survey that was read")
    reading = reading.within(cell)
    if program is not None:
        joined = [join_program(p, Path(program), cell, reading) for p in places]
        return concatenate(joined)
    parts = [read_survey_file(p, cell.arm, cell.nests, reading=reading) for p in places]
    rows = replace(concatenate(parts), mounting=cell.mounting)
    if cell.measurements.lambda_sign == -1:
        side = rows.states.direction * np.where(rows.inferred, 1.0, -1.0)[:, None]
        rows = rows.with_states(rows.states.with_(direction=side))
    return carrying_load(rows, cell)


def frame_of(cell: Cell, frame: PointFrame | None) -> PointFrame:
    """Return the frame of positions: the one given, the cell's, or the arm's base."""
    return frame or cell.measurements.frame or "base"


def survey_frame(cell: Cell, frame: PointFrame | None) -> MeasuredFrame:
    """Return the frame of a survey's positions, as `frame_of` does.

    Raises:
        PostprocError: It is the user frame, which a survey has no use for.
    """
    found = frame_of(cell, frame)
    if found == "uframe":
        raise PostprocError(
            "measurements.frame = uframe: only `diagnose` reads points in the user "
            "frame. Give base or tracker"
        )
    return found


def carrying_load(rows: Measurements, cell: Cell) -> Measurements:
    """Tell of every row where its payload has its weight, as the cell knows it.

    Where the file does not tell the payload either, it is the cell's: compensation
    takes that to hang there, and what joints yield by holds for one payload.
    """
    if cell.file.payload is None:
        return rows
    com = np.tile(cell.payload_com, (len(rows), 1))
    untold = np.isnan(rows.states.payload)
    mass = np.where(untold, cell.payload_mass, rows.states.payload)
    loaded = rows.with_states(rows.states.with_(payload=mass, payload_com=com))
    if not untold.any():
        return loaded
    which = "rows" if untold.all() else f"{untold.sum()} rows"
    told = f"no payload_kg: {which} assumed to be measured with the payload of the "
    told += f"cell, {cell.payload_mass:g} kg"
    return replace(loaded, warnings=(*rows.warnings, told))
