"""Single columns of a measurement file: ids, directions, probe points."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from postproc.accuracy.table import Table
from postproc.arrays import Bools, Floats
from postproc.exceptions import MeasurementError
from postproc.robot.arm import Arm
from postproc.robot.direction import arrivals_of_rows
from postproc.robot.pose import MM

SIDES = tuple(f"lambda{j}" for j in range(1, 7))
TRAVELS = tuple(f"travel{j}_deg" for j in range(1, 7))
ROTATION = ("rx_deg", "ry_deg", "rz_deg")
JOINTS = tuple(f"q{j}_deg" for j in range(1, 7))
MANY = 20  # rows that are in order of a column by no accident
TOOL = ("tool_x_mm", "tool_y_mm", "tool_z_mm")


def unique_ids(table: Table) -> tuple[str, ...]:
    """Read the ids and refuse duplicates.

    Raises:
        MeasurementError: An id appears twice.
    """
    ids = table.text("id")
    first: dict[str, int] = {}
    for i, name in enumerate(ids):
        if name in first:
            raise MeasurementError(
                table.path,
                f"id {name!r} appears twice (first in line {table.line[first[name]]})",
                "Give every row its own id",
                line=int(table.line[i]),
            )
        first[name] = i
    return tuple(ids)


def read_directions(
    table: Table, arm: Arm, q: Floats
) -> tuple[Floats, Floats, Bools, tuple[str, ...]]:
    """Read the arrival directions and travels, or infer them from the row order."""
    arrived = arrivals_of_rows(arm, q)
    travel = arrived.travel
    if table.has(*TRAVELS):
        travel = np.deg2rad(table.block(TRAVELS))
    if not table.has(*SIDES):
        warnings = (
            f"{table.path}: no lambda columns; directions inferred from the order of "
            f"the rows, as JOINT moves. {_sorted(table)}",
        )
        return arrived.direction, travel, np.ones(len(q), dtype=bool), warnings
    side = table.block(SIDES)
    wrong = ~np.isin(side, (-1.0, 0.0, 1.0)).all(axis=1)
    if wrong.any():
        line = int(table.line[np.argmax(wrong)])
        cure = "lambda is 1 (positive direction), -1, or 0 where not known"
        raise MeasurementError(table.path, "wrong lambda", cure, line=line)
    return side, travel, np.zeros(len(q), dtype=bool), ()


def read_tools(
    table: Table, tools: Floats | Mapping[int, Floats]
) -> tuple[Floats, NDArray[np.int64]]:
    """Look up every row's tool.

    Raises:
        MeasurementError: A tool_id that no probe point is known for.
    """
    n = len(table)
    known = (
        tools if isinstance(tools, Mapping) else dict(enumerate(np.atleast_2d(tools)))
    )
    numbers = table.numbers("tool_id") if table.has("tool_id") else np.zeros(n)
    tool_id = np.asarray(np.round(numbers), dtype=np.int64)
    if table.has(*TOOL):
        return table.block(TOOL) * MM, tool_id
    if min(tool_id, default=0) > 0 and 0 in known and max(tool_id) == len(known):
        tool_id = tool_id - 1  # numbered from 1
    for i, one in enumerate(tool_id):
        if int(one) not in known:
            raise MeasurementError(
                table.path,
                f"tool_id {int(numbers[i])} is not one of the cell's probe points",
                "Add the point to the cell file, or columns tool_x_mm, tool_y_mm, "
                "tool_z_mm",
                line=int(table.line[i]),
            )
    return np.stack([np.asarray(known[int(one)], float) for one in tool_id]), tool_id


def read_rotation(table: Table) -> Floats | None:
    """Read measured orientations, (n, 3, 3): R = Rx Ry Rz (intrinsic x, y', z'')."""
    if not table.has(*ROTATION):
        return None
    angles = table.block(ROTATION)
    return np.asarray(Rotation.from_euler("XYZ", angles, degrees=True).as_matrix())


def _sorted(table: Table) -> str:
    """Say whether the rows still are in the order in which they were measured."""
    for name in (*JOINTS, "x_mm", "y_mm", "z_mm"):
        step = np.diff(table.numbers(name)) if table.has(name) else np.zeros(0)
        if len(step) > MANY and ((step >= 0).all() or (step <= 0).all()):
            return (
                f"The rows are sorted by {name}: the order of visits is lost, and "
                "backlash with it. Use the file as it was measured"
            )
    return "Wrong if the rows were sorted"
