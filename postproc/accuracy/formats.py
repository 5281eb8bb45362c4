"""Measurement files as other tools write them, turned into our columns.

A format is a map from our columns to the file's, with the factor between the units. The
formats that are known by their header are detected; any other file needs a map:

    [columns]
    q1_deg = "A1"                                 # the same unit
    x_mm = { column = "X measured", factor = 1000.0 }
    [file]
    delimiter = ";"                               # optional, as are the next three
    decimal = ","
    encoding = "latin-1"
    comment = "//"
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from postproc.accuracy.reading import DETECT, Reading
from postproc.accuracy.robodk import from_robodk, is_robodk
from postproc.accuracy.table import Table, read_headed, read_table
from postproc.exceptions import MeasurementError

DEGREES = float(np.rad2deg(1.0))  # per radian
MAP_KEYS = ("columns", "file")
FILE_KEYS = ("delimiter", "decimal", "encoding", "comment")


@dataclass(frozen=True)
class Format:
    """How a foreign file's columns become ours.

    Attributes:
        columns: Our column: (the file's column, factor).
        reading: Options of `read_table`.
    """

    columns: Mapping[str, tuple[str, float]]
    reading: Mapping[str, str] = field(default_factory=dict)

    def fits(self, table: Table) -> bool:
        """Tell whether a table has all columns of the format."""
        return table.has(*(name for name, _ in self.columns.values()))


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
        **{f"q{j + 1}_deg": (name, DEGREES) for j, name in enumerate(UR_JOINTS)},
        **{f"{a}_mm": (f"measurement_{a}", 1.0) for a in "xyz"},
        **{f"r{a}_deg": (f"measurement_r{a}", 1.0) for a in "xyz"},
        "temperature_c": ("measurement_temperature", 1.0),
    }
)
KNOWN = (IPA,)


def read_foreign(path: str | Path, reading: Reading = DETECT) -> Table:
    """Read a measurement file in our columns, whatever tool wrote it.

    Args:
        path: The file.
        reading: What the user knows of it.

    Raises:
        MeasurementError: The file or the column map cannot be used.
    """
    if reading.columns is not None:
        form = read_column_map(reading.columns)
        table = read_table(path, **{**form.reading, **reading.given})  # type: ignore[arg-type]
        table.require(*(name for name, _ in form.columns.values()))
        return translate(table, form)
    table = read_headed(path, **reading.given)
    for form in KNOWN:
        if form.fits(table):
            return translate(table, form)
    return from_robodk(table) if is_robodk(table) else table


def translate(table: Table, form: Format) -> Table:
    """Rename and scale columns; a file without ids gets its line numbers."""
    cells = []
    for column, (source, factor) in form.columns.items():
        if column == "id":
            cells.append([text.strip("'\" ") for text in table.text(source)])
        else:
            values = table.numbers(source) * factor
            cells.append([repr(float(v)) for v in values])
    names = tuple(form.columns)
    if "id" not in names:
        names = ("id", *names)
        cells.insert(0, [str(line) for line in table.line])
    block = np.array(cells, dtype=object).T
    return replace(table, columns=names, cells=block, decimal=".")


def read_column_map(path: str | Path) -> Format:
    """Read a column-map file.

    Raises:
        MeasurementError: It cannot be read, or a key or value is wrong.
    """
    try:
        data = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as exc:
        problem = f"cannot be read as TOML ({exc})"
        raise MeasurementError(path, problem, "Correct the column map") from None
    _refuse_unknown(path, data, MAP_KEYS, "$")
    reading = data.get("file", {})
    _refuse_unknown(path, reading, FILE_KEYS, "$.file")
    columns = {
        ours: _source(path, ours, given)
        for ours, given in data.get("columns", {}).items()
    }
    if not columns:
        cure = 'Write [columns] with lines as q1_deg = "A1"'
        raise MeasurementError(path, "maps no column", cure, place="$.columns")
    return Format(columns, reading)


def _source(path: str | Path, ours: str, given: Any) -> tuple[str, float]:
    """Read one entry of a map."""
    if isinstance(given, str):
        return given, 1.0
    if isinstance(given, dict) and isinstance(given.get("column"), str):
        factor = given.get("factor", 1.0)
        if set(given) <= {"column", "factor"} and isinstance(factor, int | float):
            return given["column"], float(factor)
    raise MeasurementError(
        path,
        "neither a column name nor { column = .., factor = .. }",
        "Correct the entry",
        place=f"$.columns.{ours}",
    )


def _refuse_unknown(
    path: str | Path, data: Any, known: tuple[str, ...], place: str
) -> None:
    """Refuse keys that mean nothing."""
    for key in data if isinstance(data, dict) else ():
        if key not in known:
            cure = f"Known here: {', '.join(known)}"
            raise MeasurementError(path, "unknown key", cure, place=f"{place}.{key}")
