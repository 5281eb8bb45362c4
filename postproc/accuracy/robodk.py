"""The table that RoboDK's calibration project saves (SaveTable): 18 columns.

Joints 1 to 6 [deg]; measured x, y, z [mm] and w, p, r; the TCP's x, y, z [mm] and
w, p, r. Turns are R = Rx(w) Ry(p) Rz(r), in radians or in degrees. The layout is that
of the vendor's own macro for these files (RoboDK API examples: extracting the poses of
a calibration project), which reads them by position; so do we, whatever the header.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.accuracy.columns import JOINTS
from postproc.accuracy.table import Table

WIDTH = 18
MEASURED = ("x_mm", "y_mm", "z_mm")
TURNS = ("rx_deg", "ry_deg", "rz_deg")
TCP = ("tool_x_mm", "tool_y_mm", "tool_z_mm")
FULL_TURN = 2 * np.pi + 1e-3  # angles all below it are radians


def is_robodk(table: Table) -> bool:
    """Tell whether a table has 18 columns, all of numbers."""
    if table.cells.shape[1] != WIDTH or table.has("id"):
        return False
    cells = "\n".join(str(c) for c in table.cells.reshape(-1)).replace(",", ".")
    try:
        return bool(np.isfinite([float(c) for c in cells.split("\n")]).all())
    except ValueError:
        return False


def from_robodk(table: Table) -> Table:
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
