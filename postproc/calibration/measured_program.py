"""Measured points of a program: which visit each of them belongs to."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from postproc.calibration.measurements import (
    COVARIATES,
    POSITION,
    Measurements,
    read_points,
    read_stations,
)
from postproc.calibration.monuments import split_references
from postproc.calibration.tables import DETECT, TableFormat
from postproc.calibration.text_table import TextTable
from postproc.compensation.program import (
    plan_visits,
    read_program,
    states_of,
)
from postproc.compensation.program_files import read_files
from postproc.exceptions import MeasurementError, ProgramError
from postproc.files import NamedText
from postproc.language.languages import language_of
from postproc.robot.cell import Cell
from postproc.robot.pose import MM
from postproc.robot.state import States


def join_program(
    data: str | Path | NamedText,
    program: Path,
    cell: Cell,
    reading: TableFormat = DETECT,
) -> Measurements:
    """Give measured points the planned states of the visits they were taken at.

    A row belongs to the visit with its id in a MEASURE comment, else to the only visit
    of the variable with that name.

    Args:
        data: Columns id, x_mm, y_mm, z_mm and any recorded covariate, or a list of
            points as SpatialAnalyzer and Leica software write it.
        program: The program that ran.
        cell: Its cell.
        reading: What the user knows of the file.

    Raises:
        MeasurementError: An id that the program does not have, or has several times.
        ProgramError: The program cannot be read.
    """
    return join_table(read_points(data, reading), program, cell)


def plan_arrivals(program: Path, cell: Cell) -> States:
    """Plan a program, and return its arrivals as far as they are known.

    Raises:
        ProgramError: It cannot be read, or none of them is.
    """
    visits = read_program(read_files(program), cell).visits
    planned = plan_visits(visits, cell)
    states = states_of(planned.plan, cell, cell.temperature, visits)
    known = np.flatnonzero(~np.isnan(states.q).any(axis=1))
    if len(known) == 0:
        cure = "See `postproc explain` for what is known of its targets"
        raise ProgramError(program, "has no arrival that can be planned", cure)
    return states[known]


def join_table(points: TextTable, program: Path, cell: Cell) -> Measurements:
    """Give the rows of a table, with our columns, the states of their visits.

    Raises:
        MeasurementError, ProgramError: See `join_program`.
    """
    points.require("id", *POSITION)
    table, references = split_references(points)
    visits = read_program(read_files(program), cell).visits
    planned = plan_visits(visits, cell)
    places = _places(
        visits.place.measure_id, [visits.target.names[k] for k in visits.target.name]
    )
    ids = table.text("id")
    comment = language_of(program.name).comment
    rows = np.array([_visit_of(places, i, table.path, line, comment) for i, line in zip(
        ids, table.line.tolist(), strict=True)], dtype=np.int64)  # fmt: skip
    order = np.argsort(rows, kind="stable")
    states = states_of(planned.plan, cell, cell.temperature, visits)[rows[order]]
    recorded = {
        name: scale * table.numbers(column, empty=True)[order]
        for column, (name, scale) in COVARIATES.items()
        if table.has(column)
    }
    lost = np.flatnonzero(np.isnan(states.q).any(axis=1))
    if len(lost):
        row = order[lost[0]]
        why, cure = planned.reasons[rows[row]], "Mend the program or leave the row out"
        problem = f"the program's visit {ids[row]} cannot be planned: {why}"
        raise MeasurementError(table.path, problem, cure, line=int(table.line[row]))
    stations, station = read_stations(table)
    return Measurements(
        path=table.path,
        states=states.with_(**recorded, station=station[order]),
        stations=stations,
        position=table.block(POSITION)[order] * MM,
        ids=tuple(ids[k] for k in order),
        line=table.line[order],
        inferred=np.zeros(len(rows), dtype=bool),
        sha256=table.sha256,
        references=references,
    )


def _places(measured: tuple[str, ...], names: list[str]) -> dict[str, list[int]]:
    """List the visits of every id, and of every variable name."""
    places: dict[str, list[int]] = {}
    for visit, (mark, name) in enumerate(zip(measured, names, strict=True)):
        for key in {mark.lower(), name.lower()} - {""}:
            places.setdefault(key, []).append(visit)
    return places


def _visit_of(
    places: dict[str, list[int]], key: str, path: Path, line: int, comment: str
) -> int:
    found = places.get(key.lower(), [])
    if len(found) == 1:
        return found[0]
    problem = "has no visit" if not found else f"has {len(found)} visits"
    raise MeasurementError(
        path,
        f"id {key} {problem} in the program",
        f"Mark the move with a comment MEASURE <id>, such as {comment} MEASURE P12",
        line=line,
    )
