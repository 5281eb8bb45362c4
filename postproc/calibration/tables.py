"""Measurement files of every layout: tables to columns to measurements."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from postproc.arrays import Bools, Floats
from postproc.calibration.recognise import (
    DEGREES,
    DEGREES_PER,
    MM_PER,
    UNSTATED,
    Recognised,
    recognise,
)
from postproc.calibration.text_table import (
    BLANKS,
    NUMBER,
    TextTable,
    read_headed,
)
from postproc.exceptions import MeasurementError, PostprocError
from postproc.files import NamedText
from postproc.robot.arm import Arm
from postproc.robot.arm_file import load_toml
from postproc.robot.cell import Cell
from postproc.robot.direction import arrivals_of_rows
from postproc.robot.pose import MM

# Single columns of a measurement file: ids, directions, probe points.

SIDES = tuple(f"lambda{j}" for j in range(1, 7))
TRAVELS = tuple(f"travel{j}_deg" for j in range(1, 7))
ROTATION = ("rx_deg", "ry_deg", "rz_deg")
JOINTS = tuple(f"q{j}_deg" for j in range(1, 7))
JOINT = re.compile(r"^q\d+_deg$")
DETOURS = 0.05  # share of other sides from which rows do not follow straight ways
MOST_RESTARTS = 4  # of a clock in one file: rows that step back more often are sorted
OPPOSED = 60  # directions that are opposite to the rows by no accident
MANY = 20  # rows that are in order of a column by no accident
TOOL = ("tool_x_mm", "tool_y_mm", "tool_z_mm")


def row_names(table: TextTable) -> tuple[str, ...]:
    """Read the ids; one that has been there before is named with its line.

    A point that is read several times often has one id.
    """
    seen: set[str] = set()
    names = []
    for name, line in zip(table.text("id"), table.line.tolist(), strict=True):
        names.append(f"{name} (line {line})" if name in seen else name)
        seen.add(name)
    return tuple(names)


CLOCKS = ("order", "time_s")  # columns that put rows in the order of visits


def in_visit_order(table: TextTable) -> TextTable:
    """Sort rows by column order, else by time_s, where all of them have it.

    Raises:
        MeasurementError: Both are there and disagree, or the times of two parts of the
            file overlap: then the clock began again, and nothing says which came first.
    """
    clocks = {name: table.numbers(name, empty=True) for name in _clocks_of(table)}
    order = clocks.get("order")
    if order is not None:
        _check_order(table, order)
    clocks = {name: c for name, c in clocks.items() if _runs(c)}
    if len(clocks) == len(CLOCKS):
        _check_clash(table, **clocks)
    if not clocks:
        return table
    name, passed = next(iter(clocks.items()))
    if name == "time_s":
        _check_restart(table, passed)
    rows = np.argsort(passed, kind="stable")
    return replace(table, cells=table.cells[rows], line=table.line[rows])


def clock_of(table: TextTable) -> str:
    """Name the column that gives the order of visits, "" where it is that of rows."""
    for name in _clocks_of(table):
        if _runs(table.numbers(name, empty=True)):
            return name
    return ""


def _clocks_of(table: TextTable) -> tuple[str, ...]:
    """Name the columns of the table that tell the moment of a row."""
    return tuple(name for name in CLOCKS if table.has(name))


def _runs(clock: Floats) -> bool:
    """Return True if every row has a moment, and not all the same."""
    return bool(len(clock) > 1 and not np.isnan(clock).any() and np.ptp(clock) > 0)


def _check_order(table: TextTable, order: Floats) -> None:
    """Refuse a column order that puts two rows at one place, or has gaps in it."""
    lost = np.isnan(order)
    if lost.any():
        cure = "Number all rows, also those on monuments, or omit the column"
        line = int(table.line[np.argmax(lost)])
        raise MeasurementError(table.path, "has no order", cure, line=line)
    place = np.argsort(order, kind="stable")
    same = np.flatnonzero(np.diff(order[place]) == 0)
    if len(same):
        line, other = table.line[place[same[0] + 1]], table.line[place[same[0]]]
        raise MeasurementError(
            table.path,
            f"order {order[place[same[0]]]:g} is also in line {other}",
            "Give every row its own place in the order of visits",
            line=int(line),
        )


def _check_clash(table: TextTable, order: Floats, time_s: Floats) -> None:
    """Refuse an order that times contradict."""
    place = np.argsort(order, kind="stable")
    back = np.flatnonzero(np.diff(time_s[place]) < 0)
    if len(back):
        first, second = place[back[0]], place[back[0] + 1]
        raise MeasurementError(
            table.path,
            f"order and time_s disagree: line {table.line[second]} follows line "
            f"{table.line[first]} by order, but is {np.ptp(time_s[[first, second]]):g} "
            f"s earlier ({len(back)} such pairs)",
            "Keep the column that is the order of visits, and remove the other",
            line=int(table.line[second]),
        )


def _check_restart(table: TextTable, time: Floats) -> None:
    """Refuse times of a clock that began again within the file.

    Rows that are sorted by another column step back often, rows newest first always;
    parts that were put together step back once for each, and cover the same times.
    """
    forward = time if (np.diff(time) > 0).sum() >= (np.diff(time) < 0).sum() else -time
    back = np.flatnonzero(np.diff(forward) < 0)
    if len(back) == 0 or len(back) > MOST_RESTARTS or len(time) < MANY:
        return
    ends = [0, *(back + 1).tolist(), len(time)]
    parts = sorted(
        (float(forward[a:b].min()), float(forward[a:b].max()))
        for a, b in itertools.pairwise(ends)
    )
    for (_, high), (low, _) in itertools.pairwise(parts):
        if low < high:
            raise MeasurementError(
                table.path,
                f"time_s goes back in line {table.line[back[0] + 1]}, and rows before "
                "and after it cover the same times",
                "Did the clock begin again? Then split the file there. Were rows "
                "sorted? Then add a column order",
                line=int(table.line[back[0] + 1]),
            )


def read_directions(
    table: TextTable, arm: Arm, q: Floats
) -> tuple[Floats, Floats, Bools, tuple[str, ...]]:
    """Read the arrival directions and travels, or infer them from the order of visits.

    Args:
        table: Rows in the order of visits.
        arm: The arm.
        q: Joint angles, (n, 6) [rad].
    """
    arrived = arrivals_of_rows(arm, q)
    travel = arrived.travel
    if table.has(*TRAVELS):
        travel = np.deg2rad(table.block(TRAVELS))
    if not table.has(*SIDES):
        clock = clock_of(table)
        by, doubt = (
            (clock, "") if clock else ("the order of the rows", _describe_order(table))
        )
        warnings = (
            f"{table.path}: no lambda columns; directions inferred from {by}, as JOINT "
            f"moves{doubt}",
        )
        return arrived.direction, travel, np.ones(len(q), dtype=bool), warnings
    side = table.block(SIDES)
    if not table.has(*TRAVELS):
        travel = _of_straight_ways(travel, side, arrived.direction)
    wrong = ~np.isin(side, (-1.0, 0.0, 1.0)).all(axis=1)
    if wrong.any():
        line = int(table.line[np.argmax(wrong)])
        cure = "lambda is 1 (positive direction), -1, or 0 where not known"
        raise MeasurementError(table.path, "wrong lambda", cure, line=line)
    told = _against_the_rows(table, side, arrived.direction)
    return side, travel, np.zeros(len(q), dtype=bool), told


def _against_the_rows(
    table: TextTable, side: Floats, straight: Floats
) -> tuple[str, ...]:
    """Ask about directions that are all opposite to those of straight ways.

    Args:
        table: The rows.
        side: Of the file, (n, 6).
        straight: Inferred from row to row, (n, 6).
    """
    both = (side != 0) & (straight != 0)
    count, opposite = int(both.sum()), int((both & (side != straight)).sum())
    if count < OPPOSED or opposite < (1.0 - DETOURS) * count:
        return ()
    return (
        f"{table.path}: {opposite} of {count} directions (lambda) are opposite to the "
        "motion from row to row. That is right if the arm goes beyond each pose and "
        "returns. Otherwise change the sign: lambda is 1 for the positive direction",
    )


def _of_straight_ways(travel: Floats, side: Floats, straight: Floats) -> Floats:
    """Keep inferred travels (n, 6) where the sides told are those of straight ways.

    Where many are not, the arm went from row to row by way of points that the file
    does not hold, and nothing is known of its travels.

    Args:
        travel: As inferred from row to row [rad].
        side: Told by the file, (n, 6).
        straight: Inferred from row to row, (n, 6).
    """
    both = (side != 0) & (straight != 0)
    other = both & (side != straight)
    if other.sum() > DETOURS * both.sum():
        return np.full_like(travel, np.nan)
    return np.where(other, np.nan, travel)


Nests = Floats | Mapping[int, Floats] | Mapping[str, Floats]


def read_tools(table: TextTable, tools: Nests) -> tuple[Floats, NDArray[np.int64]]:
    """Look up every row's probe point, by a column tool_id or nest.

    Args:
        table: The rows.
        tools: Probe points in the flange frame [m]: by number from 0, or by name.

    Raises:
        MeasurementError: A tool_id that no probe point is known for, or that may mean
            two of them.
    """
    named = isinstance(tools, Mapping) and any(isinstance(k, str) for k in tools)
    found = [name for name in ("nest", "tool_id") if table.has(name)]
    if len(found) > 1:
        cure = "Remove one of them: both name the probe point"
        problem = "has columns nest and tool_id"
        raise MeasurementError(table.path, problem, cure, line=1)
    column = found[0] if found else ""
    if column:
        _check_filled(table, column)
    if column and table.has(*TOOL) and _all_numbers(table, column):
        named = named and set(table.text(column)) <= set(map(str, tools))
    if column and (named or not _all_numbers(table, column)):
        return _read_named(table, column, tools if named else {})  # type: ignore[arg-type]
    if named and not table.has(*TOOL):
        return _read_named(table, column, tools)  # type: ignore[arg-type]
    numbers = table.numbers(column) if column else np.zeros(len(table))
    tool_id = np.asarray(np.round(numbers), dtype=np.int64)
    if table.has(*TOOL):
        return table.block(TOOL) * MM, tool_id
    known: dict[int, Floats] = (
        {int(k): v for k, v in tools.items()}
        if isinstance(tools, Mapping)
        else dict(enumerate(np.atleast_2d(tools)))
    )
    tool_id = _from_zero(table, tool_id, known)
    for i, one in enumerate(tool_id):
        if int(one) not in known:
            raise MeasurementError(
                table.path,
                f"{column} {int(numbers[i])} is not one of the cell's probe points",
                "Add the point to the cell file, or columns tool_x_mm, tool_y_mm, "
                "tool_z_mm",
                line=int(table.line[i]),
            )
    return np.stack([np.asarray(known[int(one)], float) for one in tool_id]), tool_id


def _check_filled(table: TextTable, column: str) -> None:
    """Refuse a row that names no probe point, where others do.

    Raises:
        MeasurementError: With the line.
    """
    texts = table.text(column)
    if "" in texts:
        cure = "Name the probe point of every row, or omit the column"
        line = int(table.line[texts.index("")])
        raise MeasurementError(table.path, f"has no {column}", cure, line=line)


def _all_numbers(table: TextTable, column: str) -> bool:
    """Return True if a column holds nothing but numbers."""
    return all(NUMBER.match(text) for text in table.text(column))


def _from_zero(
    table: TextTable, tool_id: NDArray[np.int64], known: Mapping[int, Floats]
) -> NDArray[np.int64]:
    """Count tools from 0, where the file counts them from 1.

    Raises:
        MeasurementError: Both readings fit the cell's points.
    """
    count = len(known)
    if len(tool_id) == 0 or set(known) != set(range(count)) or tool_id.min() < 1:
        return tool_id
    if tool_id.max() == count:
        return tool_id - 1
    if tool_id.max() > count:
        return tool_id
    ids = np.unique(tool_id)

    def points(numbers: NDArray[np.int64]) -> str:
        return ", ".join(
            "(" + ", ".join(f"{v / MM:g}" for v in known[int(k)]) + ")" for k in numbers
        )

    raise MeasurementError(
        table.path,
        f"tool_id {', '.join(map(str, ids))} may count the cell's {count} points from "
        f"0, which is {points(ids)} mm, or from 1, which is {points(ids - 1)} mm",
        "Name the points in [survey.points] of the cell and write the names, or add "
        "columns tool_x_mm, tool_y_mm, tool_z_mm",
        line=int(table.line[0]),
    )


def _read_named(
    table: TextTable, column: str, tools: Mapping[str, Floats]
) -> tuple[Floats, NDArray[np.int64]]:
    """Look up probe points by name.

    Raises:
        MeasurementError: A name that the cell does not have, or no column.
    """
    names = {name.strip().lower(): k for k, name in enumerate(tools)}
    listed = ", ".join(tools) or "none"
    if not column:
        if len(tools) == 1:
            texts = list(tools) * len(table)
        else:
            cure = f"Add it. The cell's points are {listed}"
            problem = "has no column nest"
            raise MeasurementError(table.path, problem, cure, line=1)
    else:
        texts = table.text(column)
    numbers = np.zeros(len(table), dtype=np.int64)
    for i, text in enumerate(texts):
        number = names.get(text.lower())
        if number is None:
            raise MeasurementError(
                table.path,
                f"{column} {text!r} is not one of the cell's probe points: {listed}",
                "Correct the name, or add the point to [survey.points] in the cell "
                "file",
                line=int(table.line[i]),
            )
        numbers[i] = number
    if table.has(*TOOL):
        return table.block(TOOL) * MM, numbers
    points = np.array([np.asarray(v, float) for v in tools.values()])
    return points[numbers], numbers


def check_axes(table: TextTable) -> None:
    """Refuse a table whose joints are not those of an arm of six axes.

    Raises:
        MeasurementError: Saying how an arm with more or fewer is written.
    """
    found = [name for name in table.columns if JOINT.match(name)]
    in_a_row = all(f"q{k + 1}_deg" in found for k in range(len(found)))
    if not found or set(found) == set(JOINTS) or not in_a_row:
        return
    if len(found) > len(JOINTS):
        cure = (
            "Of an arm with seven axes keep one joint locked: write the other six as "
            "q1_deg .. q6_deg, and the locked angle into the D-H rows of the arm file. "
            "Omit the columns of a track or positioner that stood still"
        )
    else:
        cure = (
            "Add the missing column. If the arm has fewer axes, write the axes that it "
            "lacks as columns of 0, with D-H rows of their own in the arm file"
        )
    raise MeasurementError(
        table.path,
        f"has {len(found)} joint columns ({', '.join(found)}); arms have six, q1_deg "
        "to q6_deg",
        cure,
        line=1,
    )


def read_rotation(table: TextTable) -> Floats | None:
    """Read measured orientations, (n, 3, 3): R = Rx Ry Rz (intrinsic x, y', z'')."""
    if not table.has(*ROTATION):
        return None
    angles = table.block(ROTATION)
    return np.asarray(Rotation.from_euler("XYZ", angles, degrees=True).as_matrix())


def read_visits(table: TextTable) -> NDArray[np.int64] | None:
    """Number the visits by their names in the column `visit`, (n,), None without it.

    A row whose cell is empty has number -1: its visit is not known.
    """
    if not table.has("visit"):
        return None
    names = table.text("visit")
    _, number = np.unique(names, return_inverse=True)
    known = np.array([name != "" for name in names])
    return np.asarray(np.where(known, number.reshape(-1), -1), dtype=np.int64)


def _describe_order(table: TextTable) -> str:
    """Say whether the rows still are in the order in which they were measured."""
    for name in (*JOINTS, "x_mm", "y_mm", "z_mm"):
        step = np.diff(table.numbers(name)) if table.has(name) else np.zeros(0)
        one_way = (step >= 0).all() or (step <= 0).all()
        if len(step) > MANY and one_way and step.any():
            return (
                f". The rows are sorted by {name}, so that the order of visits, and "
                "with it the directions, are lost. Use the file as it was measured, or "
                "add a column time_s or order"
            )
    return ". If the rows were sorted, that is wrong: add a column time_s or order"


# The table that RoboDK's calibration project saves (SaveTable): 18 columns.
#
# Joints 1 to 6 [deg]; measured x, y, z [mm] and w, p, r; the TCP's x, y, z [mm] and w,
# p, r. Turns are R = Rx(w) Ry(p) Rz(r), in radians or in degrees. The layout is that of
# the vendor's own macro for these files (RoboDK API examples: extracting the poses of a
# calibration project), which reads them by position; so do we, whatever the header.

WIDTH = 18
MEASURED = ("x_mm", "y_mm", "z_mm")
TURNS = ("rx_deg", "ry_deg", "rz_deg")
TCP = ("tool_x_mm", "tool_y_mm", "tool_z_mm")
FULL_TURN = 2 * np.pi + 1e-3  # angles all below it are radians


def is_robodk(table: TextTable) -> bool:
    """Tell whether a table has 18 columns of numbers, none of them named as ours."""
    ours = any(table.has(name) for name in ("id", *JOINTS, *MEASURED))
    if table.cells.shape[1] != WIDTH or ours:
        return False
    cells = "\n".join(str(c) for c in table.cells.reshape(-1)).replace(",", ".")
    try:
        return bool(np.isfinite([float(c) for c in cells.split("\n")]).all())
    except ValueError:
        return False


def from_robodk(table: TextTable) -> TextTable:
    """Name the columns as ours. Every TCP becomes a tool; ids are the row numbers."""
    values = table.block(table.columns)
    turns = values[:, 9:12]
    small = np.abs(values[:, [9, 10, 11, 15, 16, 17]]).max() < FULL_TURN
    tcps, which = np.unique(values[:, 12:15].round(4), axis=0, return_inverse=True)
    columns = {
        "id": np.arange(1, len(values) + 1),
        **dict(zip(JOINTS, values[:, :6].T, strict=True)),
        **dict(zip(MEASURED, values[:, 6:9].T, strict=True)),
        **dict(zip(TCP, values[:, 12:15].T, strict=True)),
    }
    if len(tcps) > 1:
        columns["tool_id"] = which.reshape(-1) + 1
    if np.abs(turns).max() > 0:  # else only points were measured
        degrees = np.rad2deg(turns) if small else turns
        columns |= dict(zip(TURNS, degrees.T, strict=True))
    cells = np.array([[str(v) for v in c.tolist()] for c in columns.values()], object).T
    return replace(table, columns=tuple(columns), cells=cells, decimal=".")


# How to read a measurement file, where what is detected would be wrong.

UNITS = {unit: MM_PER[unit] for unit in UNSTATED}  # mm per unit
NAMED = {"tab": "\t", "space": BLANKS, "comma": ",", "semicolon": ";"}


@dataclass(frozen=True)
class TableFormat:
    """What a user knows of a file; None is as the cell says, else it is detected.

    Attributes:
        columns: A column-map file, see `postproc.calibration.tables`, or its content.
        delimiter: Between cells, itself or by name (tab, space, comma, semicolon).
        decimal: "." or ",".
        encoding: Name of a Python codec.
        unit: Of coordinates in files that do not state it: mm, m, inch or ft.
        angle_unit: Of joint angles in files that do not state it: deg or rad.
        sheet: Of a workbook: the sheet with the measurements.
    """

    columns: Path | Format | None = None
    delimiter: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    unit: str | None = None
    angle_unit: str | None = None
    sheet: str | None = None

    def __post_init__(self) -> None:
        if self.decimal not in (None, ".", ","):
            raise PostprocError(f"decimal {self.decimal!r}: write . or ,")
        if self.unit not in (None, *UNITS):
            raise PostprocError(f"unit {self.unit!r}: write {', '.join(UNITS)}")
        if self.angle_unit not in (None, *DEGREES_PER):
            raise PostprocError(f"angle_unit {self.angle_unit!r}: write deg or rad")

    def within(self, cell: Cell) -> TableFormat:
        """Return it with what [measurements] of the cell says of all that is None."""
        own = cell.measurements
        return TableFormat(
            columns=self.columns or (Path(own.columns) if own.columns else None),
            delimiter=self.delimiter or own.delimiter,
            decimal=self.decimal or own.decimal,
            encoding=self.encoding or own.encoding,
            unit=self.unit or own.unit,
            angle_unit=self.angle_unit or own.angle_unit,
            sheet=self.sheet or own.sheet,
        )

    @property
    def given(self) -> dict[str, Any]:
        """Options of `read_table` that a user has given."""
        delimiter = self.delimiter and NAMED.get(self.delimiter, self.delimiter)
        options = {
            "delimiter": delimiter,
            "decimal": self.decimal,
            "encoding": self.encoding,
            "sheet": self.sheet,
        }
        return {name: value for name, value in options.items() if value}


DETECT = TableFormat()

# Measurement files as other tools write them, turned into our columns.
#
# A format is a map from our columns to the file's, with the factor between the units.
# The formats that are known by their header are detected; any other file needs a map:
#
#     [columns]
#     q1_deg = "A1"                                 # the same unit
#     x_mm = { column = "X measured", factor = 1000.0 }
#     y_mm = [ "Y target", { column = "Y difference", factor = -1.0 } ]   # their sum
#     [file]
#     delimiter = ";"                               # optional, as are the next three
#     decimal = ","
#     encoding = "latin-1"
#     comment = "//"
#     header = false                                # columns are "1", "2", ..

# Columns of ours that hold no numbers; tool_id may hold numbers or names.
TEXTS = ("id", "reference", "station", "nest", "visit")
MAP_KEYS = ("columns", "file")
FILE_KEYS = ("delimiter", "decimal", "encoding", "comment", "header", "sheet")


@dataclass(frozen=True)
class Format:
    """How a foreign file's columns become ours.

    Attributes:
        columns: Our column: the sum of the file's columns, each times its factor.
        reading: Options of `read_table`.
    """

    columns: Mapping[str, tuple[tuple[str, float], ...]]
    reading: Mapping[str, Any] = field(default_factory=dict)

    def fits(self, table: TextTable) -> bool:
        """Tell whether a table has all columns of the format."""
        return table.has(*self.sources)

    @property
    def sources(self) -> tuple[str, ...]:
        """The file's columns."""
        return tuple(name for terms in self.columns.values() for name, _ in terms)


UR_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
IPA = Format(  # Fraunhofer IPA, UR10 series: joints in rad, T-Mac positions in mm
    {
        **{f"q{j + 1}_deg": ((name, DEGREES),) for j, name in enumerate(UR_JOINTS)},
        **{f"{a}_mm": ((f"measurement_{a}", 1.0),) for a in "xyz"},
        **{f"r{a}_deg": ((f"measurement_r{a}", 1.0),) for a in "xyz"},
        "temperature_c": (("measurement_temperature", 1.0),),
    }
)
KNOWN = (IPA,)


def read_foreign(
    path: str | Path | NamedText, reading: TableFormat = DETECT
) -> TextTable:
    """Read a measurement file in our columns, whatever tool wrote it.

    Args:
        path: The file.
        reading: What the user knows of it.

    Raises:
        MeasurementError: The file or the column map cannot be used.
    """
    if reading.columns is not None:
        form = reading.columns
        if not isinstance(form, Format):
            form = read_column_map(form)
        table = read_headed(path, **{**form.reading, **reading.given})
        table.require(*form.sources)
        return translate(table, form)
    table = read_headed(path, **reading.given)
    for form in KNOWN:
        if form.fits(table):
            return translate(table, form)
    if is_robodk(table):
        return from_robodk(table)
    return by_headers(table, reading)


def by_headers(table: TextTable, reading: TableFormat = DETECT) -> TextTable:
    """Turn a foreign table into ours by its headers; columns with other ones stay.

    Raises:
        MeasurementError: Two readings fit; both are named.
    """
    if not table.headed:
        return table
    found = recognise(table, reading.unit, reading.angle_unit)
    if not found.is_measured:
        return table
    check_clear(table, found)
    if all(terms == ((ours, 1.0),) for ours, terms in found.columns.items()):
        return table
    ours = translate(table, Format(found.columns))
    rest = [name for name in found.unused if name not in ours.columns]
    cells = np.array([table.text(name) for name in rest], dtype=object)
    cells = np.hstack([ours.cells, cells.reshape(len(rest), len(table)).T])
    return replace(ours, columns=(*ours.columns, *rest), cells=cells)


def check_clear(table: TextTable, found: Recognised) -> None:
    """Refuse a table of which two readings fit.

    Raises:
        MeasurementError: With both, and how to say which is meant.
    """
    for one in found.questions:
        raise MeasurementError(table.path, one.problem, one.cure, line=table.top)


def translate(table: TextTable, form: Format) -> TextTable:
    """Rename and scale columns; a file without ids gets its line numbers."""
    cells = []
    for column, terms in form.columns.items():
        named = column == "tool_id" and not _all_numbers(table, terms[0][0])
        if named or column in TEXTS:
            cells.append([text.strip("'\" ") for text in table.text(terms[0][0])])
        else:
            added = [
                table.numbers(source, empty=True) * factor for source, factor in terms
            ]
            cells.append([_plain(float(v)) for v in np.sum(added, axis=0)])
    names = tuple(form.columns)
    if "id" not in names:
        names = ("id", *names)
        cells.insert(0, [str(line) for line in table.line])
    block = np.array(cells, dtype=object).T
    return replace(table, columns=names, cells=block, decimal=".")


def _plain(value: float) -> str:
    """Write a number, nothing for none."""
    return "" if np.isnan(value) else repr(value)


def read_column_map(path: str | Path) -> Format:
    """Read a column-map file.

    Raises:
        MeasurementError: It cannot be read, or a key or value is wrong.
    """
    path = Path(path)
    try:
        raw = path.read_bytes()
    except OSError as exc:
        problem = f"cannot be read ({exc.strerror})"
        raise MeasurementError(path, problem, "Check the path") from None
    return column_map(path, load_toml(path, raw, MeasurementError))


def column_map(path: str | Path, data: Mapping[str, Any]) -> Format:
    """Interpret what a file says of columns.

    Args:
        path: The file, for messages.
        data: Its tables ``columns`` and ``file``.

    Raises:
        MeasurementError: A key or value is wrong, or no column is mapped.
    """
    _refuse_unknown(path, data, MAP_KEYS, "$")
    reading = data.get("file", {})
    _refuse_unknown(path, reading, FILE_KEYS, "$.file")
    columns = {
        ours: _terms(path, ours, given)
        for ours, given in data.get("columns", {}).items()
    }
    if not columns:
        cure = 'Write [columns] with lines as q1_deg = "A1"'
        raise MeasurementError(path, "maps no column", cure, place="$.columns")
    if not isinstance(reading.get("header", True), bool):
        place = "$.file.header"
        raise MeasurementError(path, "not true or false", "Correct it", place=place)
    named = reading.get("delimiter")
    if isinstance(named, str):
        reading = {**reading, "delimiter": NAMED.get(named, named)}
    return Format(columns, reading)


def _terms(path: str | Path, ours: str, given: Any) -> tuple[tuple[str, float], ...]:
    """Read one entry of a map: a column, or several that are added."""
    several = isinstance(given, list) and len(given) > 0 and ours not in TEXTS
    terms = [_term(one) for one in (given if several else [given])]
    found = tuple(term for term in terms if term is not None)
    if len(found) == len(terms):
        return found
    raise MeasurementError(
        path,
        "neither a column name nor { column = .., factor = .. }, nor a list of them",
        "Correct the entry",
        place=f"$.columns.{ours}",
    )


def _term(given: Any) -> tuple[str, float] | None:
    """Read one column with its factor, or None."""
    if isinstance(given, str):
        return given, 1.0
    if isinstance(given, dict) and isinstance(given.get("column"), str):
        factor = given.get("factor", 1.0)
        if set(given) <= {"column", "factor"} and isinstance(factor, int | float):
            return given["column"], float(factor)
    return None


def _refuse_unknown(
    path: str | Path, data: Any, known: tuple[str, ...], place: str
) -> None:
    """Refuse keys that mean nothing."""
    for key in data if isinstance(data, dict) else ():
        if key not in known:
            cure = f"Known here: {', '.join(known)}"
            raise MeasurementError(path, "unknown key", cure, place=f"{place}.{key}")
