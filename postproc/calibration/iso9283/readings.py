"""Readings of a test after ISO 9283, from a table or by the program that ran."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.calibration.iso9283.figures import PathReadings, PoseReadings
from postproc.calibration.measured_program import join_program
from postproc.calibration.survey_files import survey_frame
from postproc.calibration.tables import DETECT
from postproc.calibration.text_table import TextTable, read_table
from postproc.exceptions import MeasurementError, ProgramError
from postproc.files import read_input
from postproc.language.text.source import Source
from postproc.language.text.stamp import is_stamped
from postproc.robot.cell import Cell
from postproc.robot.pose import MM

COMMAND = ("x_cmd_mm", "y_cmd_mm", "z_cmd_mm")
POSITION = ("x_mm", "y_mm", "z_mm")
SAME = 1e-6  # [m] commands that differ by less are the same
ID = re.compile(r"^(?P<pose>P\d+)(?:\.(?P<direction>[a-z]+))?\.(?P<cycle>\d+)$", re.I)


@dataclass(frozen=True, eq=False)
class IsoReadings:
    """What was read of a test.

    Attributes:
        poses: Readings at poses, None where there are none.
        paths: Readings of paths.
        in_tracker: The positions are in the tracker's frame, which nothing ties to the
            base but the poses themselves.
        sha256: Hash of the file.
    """

    poses: PoseReadings | None
    paths: tuple[PathReadings, ...]
    in_tracker: bool
    sha256: str


def read_test(path: Path) -> IsoReadings:
    """Read a table with one row a reading.

    Args:
        path: The table. Columns cycle, x_cmd_mm .. z_cmd_mm, x_mm .. z_mm; pose, with
            direction and time_s where they are known; for rows of paths path and s_mm.

    Raises:
        MeasurementError: A column is missing, or a row is wrong, with its line.
    """
    table = read_table(path)
    table.require("cycle", *COMMAND, *POSITION)
    if not table.has("pose"):
        table.require("path", "s_mm")
    rows = _TestRows.of(table)
    ways = np.array([bool(name) for name in rows.path])
    _check_named(table, rows, ways)
    poses = None if ways.all() else _poses(table, rows, np.flatnonzero(~ways))
    paths = tuple(_path(table, rows, name) for name in dict.fromkeys(rows.path) if name)
    return IsoReadings(poses, paths, False, table.sha256)


def read_program_test(path: Path, program: Path, cell: Cell) -> IsoReadings:
    """Read points with ids that `survey --iso9283` gave them in its program.

    Args:
        path: Columns id, x_mm, y_mm, z_mm and time_s where it is known.
        program: The program as it was written: its targets are the commands.
        cell: Its cell.

    Raises:
        MeasurementError: An id is none of such a program, or there twice.
        ProgramError: The program cannot be read, or was compensated.
    """
    if is_stamped(Source(program.name, read_input(program))):
        problem = "was compensated: its targets are not the commands of the test"
        raise ProgramError(program, problem, "Give the program that was compensated")
    survey = join_program(path, program, cell, DETECT.within(cell))
    names = [ID.match(name) for name in survey.ids]
    for name, line, found in zip(survey.ids, survey.line, names, strict=True):
        if found is None:
            problem = f"id {name} names no pose and cycle"
            cure = "Give the readings of a program of `survey --iso9283`, as P1.7"
            raise MeasurementError(path, problem, cure, line=int(line))
    texts = [(m["pose"].upper(), (m["direction"] or "").lower()) for m in names if m]
    states = survey.states
    poses = PoseReadings(
        tuple(pose for pose, _ in texts),
        tuple(direction for _, direction in texts),
        np.array([int(m["cycle"]) for m in names if m], dtype=np.int64),
        cell.arm.tcp(states.q, states.tool),
        survey.position,
        states.time,
    )
    _check_unique(path, poses, survey.line)
    in_tracker = survey_frame(cell, None) == "tracker"
    return IsoReadings(poses, (), in_tracker, survey.sha256)


@dataclass(frozen=True, eq=False)
class _TestRows:
    """Columns of a table, of n rows; lengths in metres."""

    pose: list[str]
    path: list[str]
    direction: list[str]
    cycle: Ints
    command: Floats
    position: Floats
    time: Floats

    @classmethod
    def of(cls, table: TextTable) -> _TestRows:
        blank = [""] * len(table)
        pose, path, direction = (
            table.text(name) if table.has(name) else blank
            for name in ("pose", "path", "direction")
        )
        unknown = np.full(len(table), np.nan)
        time = table.numbers("time_s", empty=True) if table.has("time_s") else unknown
        return cls(
            pose, path, direction, _cycles(table), table.block(COMMAND) * MM,
            table.block(POSITION) * MM, time,
        )  # fmt: skip


def _cycles(table: TextTable) -> Ints:
    """Return the numbers of cycles.

    Raises:
        MeasurementError: One is no whole number.
    """
    cycle = table.numbers("cycle")
    wrong = np.flatnonzero(cycle != np.round(cycle))
    if len(wrong):
        problem = f"cycle {cycle[wrong[0]]:g} is no whole number"
        raise _wrong(table, int(wrong[0]), problem, "Number the cycles 1, 2, ..")
    return cycle.astype(np.int64)


def _wrong(table: TextTable, row: int, problem: str, cure: str) -> MeasurementError:
    return MeasurementError(table.path, problem, cure, line=int(table.line[row]))


def _check_named(table: TextTable, rows: _TestRows, ways: Bools) -> None:
    """Check that every row names a pose or a path.

    Raises:
        MeasurementError: One names neither.
    """
    for row in np.flatnonzero(np.logical_not(ways)).tolist():
        if not rows.pose[row]:
            problem = "the row names no pose" + (" and no path" * table.has("path"))
            raise _wrong(table, row, problem, "Name its pose, as P1, or remove the row")


def _poses(table: TextTable, rows: _TestRows, own: Ints) -> PoseReadings:
    """Return the readings at poses.

    Raises:
        MeasurementError: A pose has two commands, or a cycle is there twice.
    """
    found = PoseReadings(
        tuple(rows.pose[k] for k in own),
        tuple(rows.direction[k] for k in own),
        rows.cycle[own],
        rows.command[own],
        rows.position[own],
        rows.time[own],
    )
    _check_same(table, own, found.pose, found.command)
    _check_unique(table.path, found, table.line[own])
    return found


def _check_unique(path: Path, poses: PoseReadings, line: Ints) -> None:
    """Check that every cycle of a pose from a direction is there once.

    Raises:
        MeasurementError: One is there twice.
    """
    seen: dict[tuple[str, str, int], int] = {}
    keys = zip(poses.pose, poses.direction, poses.cycle.tolist(), strict=True)
    for key, at in zip(keys, line.tolist(), strict=True):
        if key in seen:
            side = f" from {key[1]}" if key[1] else ""
            problem = f"cycle {key[2]} of {key[0]}{side} is on line {seen[key]} already"
            cure = "Number the cycles of a pose on, or remove the row"
            raise MeasurementError(path, problem, cure, line=at)
        seen[key] = at


def _check_same(
    table: TextTable, own: Ints, names: tuple[object, ...], command: Floats
) -> None:
    """Check that rows of one name have one command.

    Raises:
        MeasurementError: Two differ.
    """
    first: dict[object, int] = {}
    for k, name in enumerate(names):
        other = first.setdefault(name, k)
        if np.abs(command[k] - command[other]).max() > SAME:
            line = int(table.line[own[other]])
            problem = f"the command of {name} is another than on line {line}"
            cure = "A pose has one command: correct it, or name another pose"
            raise _wrong(table, int(own[k]), problem, cure)


def _path(table: TextTable, rows: _TestRows, name: str) -> PathReadings:
    """Return the readings of a path.

    The stations are those of its first cycle.

    Raises:
        MeasurementError: A cell of s_mm is empty, a station has two commands, or a
            cycle has fewer than two readings.
    """
    own = np.flatnonzero([path == name for path in rows.path])
    table.require("s_mm")
    s = table.numbers("s_mm", empty=True)[own] * MM
    if len(lost := np.flatnonzero(np.isnan(s))):
        problem = "s_mm is empty in a row of a path"
        cure = "Give the arc length along the command path"
        raise _wrong(table, int(own[lost[0]]), problem, cure)
    cycle = rows.cycle[own]
    places = tuple(f"path {name} at {v / MM:.3f} mm" for v in s.tolist())
    _check_same(table, own, places, rows.command[own])
    cycles = tuple(
        _follow(table, rows, own, s, cycle, int(n)) for n in np.unique(cycle)
    )
    first = own[cycle == cycle.min()]
    at, which = np.unique(np.round(s[cycle == cycle.min()] / SAME), return_index=True)
    return PathReadings(name, at * SAME, rows.command[first[which]], cycles)


def _follow(
    table: TextTable, rows: _TestRows, own: Ints, s: Floats, cycle: Ints, number: int
) -> tuple[Floats, Floats]:
    """Return arc length and attained positions of one cycle, in their order."""
    here = np.flatnonzero(cycle == number)
    here = here[np.argsort(s[here], kind="stable")]
    if len(np.unique(s[here])) < 2:
        problem = f"cycle {number} of path {rows.path[own[here[0]]]} has one reading"
        cure = "Give its readings along the whole path"
        raise _wrong(table, int(own[here[0]]), problem, cure)
    return s[here], rows.position[own[here]]


def describe_rows(readings: IsoReadings) -> Iterator[str]:
    """Say how many readings there are of what."""
    if readings.poses is not None:
        poses = len(set(readings.poses.pose))
        yield f"{len(readings.poses.pose)} readings at {poses} poses"
    for path in readings.paths:
        yield f"path {path.path}: {len(path.cycles)} cycles"
