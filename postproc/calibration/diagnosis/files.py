"""What a model lacks, by measurement files: read, in the base frame, diagnosed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from postproc.calibration.diagnosis.diagnose import Extension, extend_model
from postproc.calibration.diagnosis.investigate import no_progress
from postproc.calibration.diagnosis.search import Progress
from postproc.calibration.fit import file_shifts, several_points
from postproc.calibration.measurements import Measurements
from postproc.calibration.registration import register, station_of
from postproc.calibration.survey_checks import (
    check_against,
    check_own_registration,
    check_stops,
)
from postproc.calibration.survey_files import (
    MeasurementFile,
    frame_of,
    read_measurements,
)
from postproc.calibration.tables import DETECT, TableFormat
from postproc.model.effects.placement import Placement
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model, as_model
from postproc.model.provenance import Provenance
from postproc.model.registration import Registration
from postproc.robot.cell import Cell, PointFrame, as_cell
from postproc.robot.pose import MM, inverse
from postproc.threads import in_one_thread

REGISTERED = (Placement.name,)  # what is fitted besides where the tracker is found


@in_one_thread
def diagnose(
    *files: MeasurementFile,
    cell: Cell | str | Path,
    model: Model | str | Path,
    program: str | Path | None = None,
    frame: PointFrame | None = None,
    name: str = "measurements.csv",
    reading: TableFormat = DETECT,
    seed: int = 0,
    progress: Progress = no_progress,
) -> Extension:
    """Find what a model lacks by fresh measurements, and add it.

    Nothing is written: `Extension.save` does that.

    Args:
        files: Measurements, as `read_measurements` takes them.
        cell: The cell, or its file.
        model: The model that may lack something, or its file.
        program: The program whose points were measured, compensated or not.
        frame: What positions are given in: the arm's base frame, the cell's user
            frame, or the tracker's; default: as the cell says, else the base frame.
        name: File name of measurements that are given as bytes.
        reading: What the user knows of the files.
        seed: Of the bootstrap, the folds and the poses proposed.
        progress: Told what is being done, and how much of it is done.

    Raises:
        PostprocError: A file cannot be used, or the model cannot be extended.
    """
    cell = as_cell(cell)
    model, frame = as_model(model, cell.arm), frame_of(cell, frame)
    survey = read_measurements(
        *files, cell=cell, program=program, name=name, reading=reading
    )
    tracker, setup, placed = cell.tracker, several_points(survey), None
    notes: tuple[str, ...] = ()
    if frame == "uframe":
        survey = from_user_frame(survey, cell)
    elif frame == "tracker":
        seen = survey
        survey, placed = from_tracker_frame(survey, cell, model)
        notes = registrations(seen, survey, placed, cell, model)
        tracker, setup = placed.origin, REGISTERED
    if placed is None:
        setup = (*setup, *file_shifts(survey, cell.arm, cell.tracker))
    check_against(survey, cell.arm, model)
    found = extend_model(
        survey, cell.arm, model, tracker=tracker, setup=setup, seed=seed,
        progress=progress,
    )  # fmt: skip
    seen_fixed = (*found.diagnosis.fixed_points, *notes)
    return replace(
        found,
        model=replace(
            found.model, registration=placed, provenance=Provenance.today(cell)
        ),
        diagnosis=replace(found.diagnosis, fixed_points=seen_fixed),
    )


def from_user_frame(survey: Measurements, cell: Cell) -> Measurements:
    """Convert positions from the cell's user frame to the arm's base frame."""
    T = inverse(cell.base.pose) @ cell.uframe.pose
    return replace(survey, position=survey.position @ T[:3, :3].T + T[:3, 3])


def from_tracker_frame(
    survey: Measurements, cell: Cell, model: Model
) -> tuple[Measurements, Registration]:
    """Convert positions from the tracker's frame, found with the model's help.

    A model that was fitted in the tracker's frame has probe points of its own, which
    are then found again; else those of the cell hold.

    Returns:
        The measurements in the base frame, and where tracker and probes are.
    """
    effects, values, _ = model.compensable()
    check_own_registration(survey, cell.arm)
    check_stops(survey, cell.arm)
    states = survey.states
    placed = register(
        cell.arm, states, survey.position, effects, values, survey.stations
    )
    _, first, which = np.unique(states.tool_id, return_index=True, return_inverse=True)
    if any(isinstance(e, Placement) for e in model.effects.effects):
        states = states.with_(tool=placed.probes[which])
    placed = replace(placed, probes=states.tool[first])
    position = placed.to_base(survey.position, states.station)
    return replace(survey, states=states, position=position), placed


def registrations(
    seen: Measurements,
    base: Measurements,
    placed: Registration,
    cell: Cell,
    model: Model,
) -> tuple[str, ...]:
    """Say what the model leaves in its survey's set-up, and registered by these rows.

    Args:
        seen: The rows in the tracker's frame.
        base: The same in the base frame, by a registration of their own.
        placed: That registration.
        cell: The cell.
        model: The model.
    """

    def mean_gap(rows: Measurements) -> float:
        error = model.error(cell.arm, rows.states)
        gap = rows.position - ArmStates(cell.arm, rows.states).walk.tcp - error
        return float(np.linalg.norm(gap, axis=1).mean()) / MM

    spent = 6 * len(placed.transforms) + 3 * len(placed.probes)
    free = max(3 * len(seen) - spent, 1)
    own = mean_gap(base) * float(np.sqrt(3 * len(seen) / free))
    told = (
        f"mean error of the file, registered from its own rows: {own:.4f} mm "
        f"(corrected for {spent} fitted numbers of {3 * len(seen)} readings)"
    )
    survey = model.registration
    if survey is None or np.setdiff1d(seen.states.tool_id, survey.tool_ids).size:
        return (told,)
    there = station_of(survey, cell.arm, seen.states, seen.position, seen.stations)
    station = seen.states.station
    as_fitted = mean_gap(
        replace(
            seen,
            states=there.on_probes(seen.states),
            position=there.to_base(seen.position, station),
        )
    )
    return (told, f"in the set-up of the model's survey {as_fitted:.4f} mm")
