"""Lists of measured points that carry names but no joint angles.

SpatialAnalyzer writes `//` header lines and `name, x, y, z` without units; Leica
software writes Latin-1 text, times with apostrophes, and any order of columns. They are
joined with the program that was measured.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.table import Table, read_table
from postproc.exceptions import MeasurementError
from postproc.pose import MM

Array = NDArray[np.float64]

NAMES = ("id", "name", "point", "point name", "point id", "target")
AXIS = {a: re.compile(rf"^{a}(\s*[\[(]?\s*mm\s*[\])]?|_mm)?$", re.I) for a in "xyz"}
NUMBER = re.compile(r"^\s*[-+]?\d+([.,]\d+)?([eE][-+]?\d+)?\s*$")


@dataclass(frozen=True, eq=False)
class Points:
    """Measured points by name.

    Attributes:
        ids: Their names.
        position: (n, 3) [m].
        line: 1-based lines, (n,).
        sha256: Hash of the file.
    """

    ids: tuple[str, ...]
    position: Array
    line: NDArray[np.int64]
    sha256: str


def read_points(path: str | Path, mm_per_unit: float = 1.0) -> Points:
    """Read names and positions.

    Args:
        path: The file.
        mm_per_unit: Unit of the coordinates, for files that do not say it.

    Raises:
        MeasurementError: No names or coordinates are found.
    """
    table = read_table(path, comment="//", header=_has_header(path))
    name, axes = _columns(table)
    position = np.stack([table.numbers(axis) for axis in axes], axis=1)
    ids = tuple(text.strip("'\" ") for text in table.text(name))
    return Points(ids, position * mm_per_unit * MM, table.line, table.sha256)


def _has_header(path: str | Path) -> bool:
    """Tell whether the first line that is no comment holds names, not numbers."""
    first = read_table(path, comment="//", header=False).cells[0]
    return sum(bool(NUMBER.match(str(cell))) for cell in first) < 3


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
