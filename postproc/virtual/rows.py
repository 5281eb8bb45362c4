"""Read the joint targets of a campaign from a CSV file."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.exceptions import MeasurementError

TOOL = ("tool_x_mm", "tool_y_mm", "tool_z_mm")


@dataclass(frozen=True)
class Rows:
    """n joint targets in visit order, SI units, NaN where a column is missing.

    Attributes:
        ids: Name of every row.
        q: (n, 6) [rad].
        side: Arrival directions -1, 0, 1, (n, 6), or None where the file has none.
        travel: Since the last reversal, (n, 6) [rad].
        time: (n,) [s].
        temperature: (n,) [deg C].
        payload: (n,) [kg].
        speed: (n,) [m/s].
        tool_id: (n,) from 0.
        tool: TCP in the flange frame, (n, 3) [m], where the file has it itself.
    """

    ids: tuple[str, ...]
    q: Floats
    side: Floats | None
    travel: Floats
    time: Floats
    temperature: Floats
    payload: Floats
    speed: Floats
    tool_id: Ints
    tool: Floats


def read_rows(path: str | Path) -> Rows:
    """Read a file with `q1_deg` .. `q6_deg` and any further measurement columns.

    Raises:
        MeasurementError: No such file, no joint columns, or a cell that is no number.
    """
    table = _Table.read(Path(path))
    joints = range(1, 7)
    missing = [f"q{j}_deg" for j in joints if f"q{j}_deg" not in table.header]
    if missing:
        raise MeasurementError(
            path, f"no column {', '.join(missing)}", "Name them in the first line"
        )
    q = table.block([f"q{j}_deg" for j in joints])
    if np.isnan(q).any():
        row = int(np.flatnonzero(np.isnan(q).any(axis=1))[0])
        raise MeasurementError(path, "a joint angle is missing", line=row + 2)
    has_side = all(f"lambda{j}" in table.header for j in joints)
    sides = table.block([f"lambda{j}" for j in joints])
    numbers = [str(k + 1) for k in range(len(table.cells))]
    return Rows(
        ids=tuple(table.texts("id") or numbers),
        q=np.radians(q),
        side=np.nan_to_num(sides) if has_side else None,
        travel=np.radians(table.block([f"travel{j}_deg" for j in joints])),
        time=table.block(["time_s"])[:, 0],
        temperature=table.block(["temperature_c"])[:, 0],
        payload=table.block(["payload_kg"])[:, 0],
        speed=table.block(["speed_mm_s"])[:, 0] * 1e-3,
        tool_id=np.nan_to_num(table.block(["tool_id"])[:, 0]).astype(np.int64),
        tool=table.block(list(TOOL)) * 1e-3,
    )


@dataclass(frozen=True)
class _Table:
    path: Path
    header: dict[str, int]
    cells: list[list[str]]
    comma: bool  # decimal comma

    @classmethod
    def read(cls, path: Path) -> _Table:
        try:
            text = path.read_text(encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            raise MeasurementError(path, f"cannot be read: {error}") from error
        lines = [line for line in text.splitlines() if line.strip()]
        if len(lines) < 2:
            raise MeasurementError(path, "no rows", "Give a header and at least one")
        delimiter = ";" if ";" in lines[0] else ","
        cells = list(csv.reader(lines, delimiter=delimiter))
        header = {name.strip().lower(): k for k, name in enumerate(cells[0])}
        return cls(path, header, cells[1:], delimiter == ";")

    def texts(self, name: str) -> list[str]:
        """Return a column as text; empty where the file has none."""
        if name not in self.header:
            return []
        return [row[self.header[name]].strip() for row in self.cells]

    def block(self, names: list[str]) -> Floats:
        """Return columns as numbers, (n, len(names)); NaN where there is none."""
        out = np.full((len(self.cells), len(names)), np.nan)
        for k, name in enumerate(names):
            for i, text in enumerate(self.texts(name)):
                out[i, k] = self._number(text, i, name)
        return out

    def _number(self, text: str, row: int, name: str) -> float:
        if not text:
            return float("nan")
        try:
            return float(text.replace(",", ".") if self.comma else text)
        except ValueError as error:
            problem = f"'{text}' in column {name} is no number"
            raise MeasurementError(self.path, problem, line=row + 2) from error
