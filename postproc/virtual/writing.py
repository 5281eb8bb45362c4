"""Write a simulated campaign as a measurement file."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from postproc.arrays import Floats
from postproc.files import write_all
from postproc.virtual.measure import Campaign


def write_measurements(
    campaign: Campaign, path: str | Path, *, direction: bool = True
) -> None:
    """Write a measurement file, whole or not at all.

    Args:
        campaign: What was measured.
        path: The CSV file.
        direction: Whether the arrival directions and travels are written too.

    Raises:
        OutputError: The file cannot be written.
    """
    header, table = _table(campaign, direction)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(table)
    write_all({Path(path): text.getvalue().encode()})


def _table(campaign: Campaign, direction: bool) -> tuple[list[str], list[list[str]]]:
    """Return the header and the rows as text."""
    a, joints = campaign.arrivals, range(1, 7)
    columns: list[tuple[str, Sequence[object]]] = [("id", campaign.ids)]
    columns += _columns([f"q{j}_deg" for j in joints], np.degrees(a.q), 5)
    if direction:
        columns += _columns([f"lambda{j}" for j in joints], _signs(a.side), 0)
    columns += _columns(["x_mm", "y_mm", "z_mm"], campaign.measured * 1e3, 4)
    columns += _columns(["time_s"], a.time[:, None], 1)
    columns += _columns(["temperature_c"], a.temperature[:, None], 2)
    columns += _columns(["payload_kg"], a.payload[:, None], 1)
    columns += _columns(["speed_mm_s"], a.speed[:, None] * 1e3, 1)
    columns.append(("tool_id", [str(t) for t in campaign.tool_id]))
    tcp = ["tool_x_mm", "tool_y_mm", "tool_z_mm"]
    columns += _columns(tcp, a.tool[:, :3, 3] * 1e3, 4)
    if direction:
        names = [f"travel{j}_deg" for j in joints]
        columns += _columns(names, np.degrees(a.travel), 3)
    header = [name for name, _ in columns]
    table = [
        [str(cell) for cell in row]
        for row in zip(*(c for _, c in columns), strict=True)
    ]
    return header, table


def _columns(
    names: Sequence[str], values: Floats, digits: int
) -> list[tuple[str, Sequence[object]]]:
    texts = [[f"{v:.{digits}f}" for v in column] for column in values.T]
    return list(zip(names, texts, strict=True))


def _signs(side: Floats) -> Floats:
    """Return the directions that sides in the gap amount to: 0 in its middle half."""
    return np.asarray(np.where(np.abs(side) > 0.5, np.sign(side), 0.0)) + 0.0
