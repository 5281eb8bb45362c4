"""What is understood of a measurement file, as lines for a person."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from postproc.calibration.measurements import POSITION
from postproc.calibration.recognise import Terms
from postproc.calibration.table_reading import FileReading
from postproc.calibration.tables import JOINTS, clock_of
from postproc.robot.cell import PointFrame
from postproc.robot.pose import MM

SIGNS = {"\t": "tab", r"\s+": "blanks", ",": "comma", ";": "semicolon", "|": "stroke"}
UNITS = {"deg": "degrees", "rad": "radians"}
COMPARED = "only this reading fits the arm"


def print_reading(
    one: FileReading, stated: PointFrame | None, program: Path | None
) -> str:
    """Write what is understood of a file, a line for each of its parts.

    Args:
        one: What is understood.
        stated: The frame of places that the cell or the command states.
        program: The program whose poses the rows have.
    """
    lines = {
        "cells": _cells(one),
        **_columns(one),
        "not used": ", ".join(map(repr, one.found.unused if one.found else ())),
        "poses": _poses(one, program),
        "directions": _directions(one, program),
        "probe points": _tools(one, program),
        "frame": _frame(one, stated),
        "not counted": _list_dropped(one),
    }
    width = max(map(len, lines))
    body = [f"  {name:{width}}  {text}" for name, text in lines.items() if text]
    return "\n".join([f"{one.table.path}: {len(one.table)} rows", *body])


def _cells(one: FileReading) -> str:
    """Say how cells are parted and numbers written."""
    table = one.table
    sign = SIGNS.get(table.delimiter, repr(table.delimiter))
    place = f"sheet {table.sheet!r}" if table.sheet else f"separator {sign}"
    header = "" if table.headed else ", no header"
    layout = f"; {one.layout}" if one.layout else ""
    return f"{place}, decimal sign {table.decimal!r}{header}{layout}"


def _columns(one: FileReading) -> dict[str, str]:
    """Say which columns are ours."""
    if one.form is None:
        return {"columns": "by their places"}
    columns = dict(one.form.columns)
    rows: dict[str, str] = {}
    for title, group in (("joints", JOINTS), ("x, y, z", POSITION)):
        own = {name: columns.pop(name) for name in group if name in columns}
        if own:
            unit = _unit(one, "angle_unit" if group is JOINTS else "unit")
            rows[title] = ", ".join(map(_terms, own.values())) + unit
    same = [name for name, terms in columns.items() if terms == ((name, 1.0),)]
    for name in (name for name in columns if name not in same):
        rows[name] = _terms(columns[name])
    return rows | {"as named": ", ".join(same)}


def _terms(terms: Terms) -> str:
    """Name columns of a file."""
    return " + ".join(repr(name) for name, _ in terms)


def _unit(one: FileReading, which: str) -> str:
    """Say in which unit a group of columns is, and why."""
    decided = [text for text in one.compared if text.startswith(f"{which} ")]
    if decided:
        unit = decided[0].removeprefix(f"{which} ")
        return f"; {UNITS.get(unit, unit)} ({COMPARED})"
    if one.found is None:
        return ""
    unit = one.found.angle if which == "angle_unit" else one.found.length
    return f"; {UNITS.get(unit, unit)} ({one.found.grounds[which]})"


def _poses(one: FileReading, program: Path | None) -> str:
    """Say how rows are joined to poses."""
    if program is not None:
        return f"of {program.name}, joined by id: {len(one.rows)} rows"
    if "columns" in one.compared:
        return f"joint angles of the file ({COMPARED})"
    return "joint angles of the file"


def _directions(one: FileReading, program: Path | None) -> str:
    """Say where the directions of arrivals come from."""
    if program is not None:
        return "planned, as the program arrives"
    if not one.rows.inferred.any():
        return "of the file (lambda1 to lambda6)"
    clock = clock_of(one.table) or "the order of the rows"
    return f"inferred from {clock}, as joint moves"


def _tools(one: FileReading, program: Path | None) -> str:
    """Say how many rows each probe point has; a program mounts them by their places."""
    states = one.rows.states
    if program is not None:
        _, count = np.unique(states.tool.round(9), axis=0, return_counts=True)
        rows = ", ".join(map(str, count.tolist()))
        return f"{len(count)}, as the program mounts them: {rows} rows"
    tools = Counter(states.tool_id.tolist())
    return ", ".join(f"{tool}: {rows} rows" for tool, rows in sorted(tools.items()))


def _frame(one: FileReading, stated: PointFrame | None) -> str:
    """Say in which frame the places are, and whether that is what is stated."""
    far = f"{one.distance / MM:.1f} mm (median) from the poses of the nominal arm"
    given = stated or "base"
    if one.frame is None:
        return f"{given}, not checked: {one.advice or 'too few rows'} ({far})"
    if one.frame == given:
        return f"{given}, {far}"
    if one.frame == "base":
        return f"base, {far}, while the cell states {given}: state base"
    return f"tracker, {far} once moved. State it: --set measurements.frame=tracker"


def _list_dropped(one: FileReading) -> str:
    """List rows that do not count."""
    rows = one.rows.dropped
    return "; ".join(f"row {row.id} (line {row.line}): {row.why}" for row in rows)
