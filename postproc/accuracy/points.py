"""Lists of measured points that carry names but no joint angles.

SpatialAnalyzer writes `//` header lines and `name, x, y, z` without units; Leica
software writes Latin-1 text, times with apostrophes, and any order of columns. They are
joined with the program that was measured.
"""

from __future__ import annotations

import re
from pathlib import Path

from postproc.accuracy.formats import Format, translate
from postproc.accuracy.reading import DETECT, Reading
from postproc.accuracy.table import NUMBER, Table, read_headed
from postproc.exceptions import MeasurementError

NAMES = ("id", "name", "point", "point name", "point id", "target")
AXIS = {a: re.compile(rf"^{a}(\s*[\[(]?\s*mm\s*[\])]?|_mm)?$", re.I) for a in "xyz"}
POSITION = ("x_mm", "y_mm", "z_mm")


def read_points(path: str | Path, reading: Reading = DETECT) -> Table:
    """Read names and positions as columns id, x_mm, y_mm, z_mm.

    A file that has these columns keeps its others, too.

    Raises:
        MeasurementError: No names or coordinates are found.
    """
    table = read_headed(path, comment="//", **reading.given)
    if table.has("id", *POSITION):
        return table
    name, axes = _columns(table)
    scaled = {ours: (axis, reading.mm_per_unit)
              for ours, axis in zip(POSITION, axes, strict=True)}  # fmt: skip
    return translate(table, Format({"id": (name, 1.0), **scaled}))


def _columns(table: Table) -> tuple[str, tuple[str, str, str]]:
    """Find the columns of name and coordinates.

    Raises:
        MeasurementError: They are not there.
    """
    if table.columns[0] == "1":  # no header: name first, then the first three numbers
        row = [bool(NUMBER.match(str(cell))) for cell in table.cells[0]]
        numbers = [k for k, is_number in enumerate(row) if is_number and k > 0][:3]
        if len(numbers) == 3:
            x, y, z = (table.columns[k] for k in numbers)
            return table.columns[0], (x, y, z)
    name = next((c for c in table.columns if c.lower() in NAMES), None)
    axes = [next((c for c in table.columns if AXIS[a].match(c)), None) for a in "xyz"]
    if name is None or None in axes:
        raise MeasurementError(
            table.path,
            "no columns for a name and x, y, z",
            f"The header has: {', '.join(table.columns)}. Name them id, x_mm, y_mm, "
            "z_mm",
            line=1,
        )
    x, y, z = (str(axis) for axis in axes)
    return name, (x, y, z)
