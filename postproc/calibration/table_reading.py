"""What is understood of a measurement file, and the column map that says the same."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.likely_causes import cause_in_any_frame
from postproc.calibration.measured_program import join_table
from postproc.calibration.measurements import (
    POSITION,
    Measurements,
    from_table,
    places_of,
    point_names,
)
from postproc.calibration.recognise import (
    DEGREES_PER,
    MM_PER,
    UNSTATED,
    Recognised,
    Terms,
    numbers_in,
    recognise,
)
from postproc.calibration.registration import STOPS, register
from postproc.calibration.tables import (
    JOINTS,
    KNOWN,
    Format,
    TableFormat,
    check_clear,
    from_robodk,
    is_robodk,
    read_column_map,
    translate,
)
from postproc.calibration.text_table import TextTable, read_headed
from postproc.exceptions import MeasurementError, PostprocError
from postproc.files import toml_text
from postproc.model.effect_sum import Combination
from postproc.model.kinematics import ArmStates
from postproc.model.registration import rigid_fit
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell, PointFrame
from postproc.robot.pose import MM
from postproc.robot.state import make_states

NEAR = 0.05  # [m] from the nominal arm: no arm that works is off by more
ROUGH = 0.3  # of their spread by which places miss the poses, nests not known
CLEAR = 2.0  # times as much by which any other reading misses them
TURN = 400.0  # [deg] no joint of a list turns further
SHOWN = 60  # rows that tell columns apart


@dataclass(frozen=True)
class FileReading:
    """What is understood of a file.

    Attributes:
        table: Its cells.
        form: The map of its columns, None where no map can say it.
        found: What its headers say; None where a map or the layout says it.
        layout: The tool that writes such files, or "" for none in particular.
        rows: What is measured.
        frame: The frame in which the places fit the poses, None where neither does, or
            the rows are too few.
        distance: From the poses of the nominal arm in this frame, median [m].
        advice: What is likely wrong where the places do not fit.
        compared: What comparing with the arm decided.
    """

    table: TextTable
    form: Format | None
    found: Recognised | None
    layout: str
    rows: Measurements
    frame: PointFrame | None
    distance: float
    advice: str
    compared: tuple[str, ...]


def read_file(
    path: Path,
    cell: Cell,
    reading: TableFormat,
    program: Path | None = None,
    choices: Mapping[str, str] | None = None,
) -> FileReading:
    """Read a measurement file as `fit` does, and compare it with the arm.

    Args:
        path: The file.
        cell: The cell: arm, probe points.
        reading: What the user knows of the file.
        program: The program that was measured.
        choices: Columns of the file, by ours.

    Raises:
        MeasurementError: It cannot be read, or several readings fit; both are named.
    """
    reading = reading.within(cell)
    table, form, found, layout = _columns(path, reading, choices or {})
    compared: tuple[str, ...] = ()
    if found is None and form is None and not layout:
        form, compared = _by_arm(table, cell)
    elif found is not None:
        found, compared = _decide_units(table, found, cell, reading, choices or {})
        check_clear(table, found)
        form = Format(found.columns, _options(table))
    rows = _rows(table, form, cell, program)
    frame, distance, advice = _place(rows, cell.arm)
    return FileReading(
        table, form, found, layout, rows, frame, distance, advice, compared
    )


Understood = tuple[TextTable, Format | None, Recognised | None, str]


def _columns(
    path: Path, reading: TableFormat, choices: Mapping[str, str]
) -> Understood:
    """Find what names the columns: a map, the layout of a tool, or headers."""
    if reading.columns is not None:
        form = reading.columns
        form = form if isinstance(form, Format) else read_column_map(form)
        table = read_headed(path, **{**form.reading, **reading.given})
        table.require(*form.sources)
        return table, form, None, "column map"
    table = read_headed(path, **reading.given)
    for name in choices.values():
        table.require(name)
    for known in KNOWN:
        if known.fits(table) and not choices:
            return table, replace(known, reading=_options(table)), None, "IPA series"
    if is_robodk(table) and not choices:
        return table, None, None, "RoboDK calibration project"
    if table.headed or choices:
        found = recognise(table, reading.unit, reading.angle_unit, choices)
        return table, None, found, ""
    return (table, *_list_of_points(table, reading), "")


def _list_of_points(
    table: TextTable, reading: TableFormat
) -> tuple[Format | None, Recognised | None]:
    """Find names and places in a table without a header that holds no joints."""
    numeric = np.isfinite(numbers_in(table, table.columns)).all(axis=0)
    if numeric.sum() >= len(JOINTS) + len(POSITION):
        return None, None
    name, axes = places_of(table)
    sources = {"id": name, **dict(zip(POSITION, axes, strict=True))}
    return None, recognise(table, reading.unit, choices=sources)


def _options(table: TextTable) -> dict[str, object]:
    """Return how the cells of a table are read, as a column map states it."""
    options: dict[str, object] = {}
    if table.sheet:
        options["sheet"] = table.sheet
    else:
        options["delimiter"] = table.delimiter
    options["decimal"] = table.decimal
    if not table.headed:
        options["header"] = False
    return options


def _rows(
    table: TextTable, form: Format | None, cell: Cell, program: Path | None
) -> Measurements:
    """Interpret a table in our columns, joined with the program where one is given."""
    ours = from_robodk(table) if form is None else translate(table, form)
    if program is not None:
        return join_table(point_names(ours), program, cell)
    if not ours.has(*JOINTS) and ours.has("id", *POSITION):
        problem = "holds names and places, but no joint angles"
        cure = "Give the program that was measured: --program SURVEY"
        raise MeasurementError(table.path, problem, cure, line=table.top)
    if not ours.has("id", *JOINTS, *POSITION):
        table.require(*JOINTS, *POSITION)
    return from_table(ours, cell.arm, cell.nests)


def _place(rows: Measurements, arm: Arm) -> tuple[PointFrame | None, float, str]:
    """Find in which frame the places of rows fit the poses of the nominal arm."""
    tcp = ArmStates(arm, rows.states).walk.tcp
    near = float(np.median(np.linalg.norm(rows.position - tcp, axis=1)))
    if near <= NEAR or len(rows) < STOPS:
        return ("base" if near <= NEAR else None), near, ""
    placed = register(
        arm, rows.states, rows.position, Combination(()), np.zeros(0), rows.stations
    )
    moved = placed.to_base(rows.position, rows.states.station)
    probes = dict(zip(placed.tool_ids.tolist(), placed.probes, strict=True))
    tools = np.array([probes[k] for k in rows.states.tool_id.tolist()])
    there = ArmStates(arm, rows.states.with_(tool=tools)).walk.tcp
    distance = float(np.median(np.linalg.norm(moved - there, axis=1)))
    if distance <= NEAR:
        return "tracker", distance, ""
    return None, near, cause_in_any_frame(rows, arm)


# Which reading of a table fits the arm: poses and places have the same distances.


@dataclass(frozen=True)
class Attempt:
    """A reading of a table: columns of joints and places, and their units."""

    joints: tuple[str, ...]
    places: tuple[str, ...]
    angle: str
    length: str
    misfit: float

    @property
    def columns(self) -> dict[str, Terms]:
        """Return our columns, as a map has them."""
        angle, length = DEGREES_PER[self.angle], MM_PER[self.length]
        names = dict(
            zip((*JOINTS, *POSITION), (*self.joints, *self.places), strict=True)
        )
        return {
            ours: ((name, angle if ours in JOINTS else length),)
            for ours, name in names.items()
        }


def _decide_units(
    table: TextTable,
    found: Recognised,
    cell: Cell,
    reading: TableFormat,
    choices: Mapping[str, str],
) -> tuple[Recognised, tuple[str, ...]]:
    """Answer questions for units by what fits the arm, where one reading does."""
    asked = {q.about: q.readings for q in found.questions}
    whole = set(JOINTS) | set(POSITION) <= set(found.columns)
    if not asked or not set(asked) <= {"unit", "angle_unit"} or not whole:
        return found, ()
    joints, places = (
        tuple(found.columns[ours][0][0] for ours in group)
        for group in (JOINTS, POSITION)
    )
    angles = asked.get("angle_unit", (found.angle,))
    lengths = asked.get("unit", (found.length,))
    best = _only_one(
        _attempt(table, cell, joints, places, angle, length)
        for angle in angles
        for length in lengths
        if angle in DEGREES_PER and length in MM_PER
    )
    if best is None:
        return found, ()
    decided = recognise(
        table, reading.unit or best.length, reading.angle_unit or best.angle, choices
    )
    units = {"unit": best.length, "angle_unit": best.angle}
    return decided, tuple(f"{about} {units[about]}" for about in asked)


def _by_arm(table: TextTable, cell: Cell) -> tuple[Format, tuple[str, ...]]:
    """Find joints and places in a table without a header by what fits the arm.

    Raises:
        MeasurementError: No reading fits, or several do.
    """
    best = _only_one(_attempts(table, cell))
    if best is None:
        raise MeasurementError(
            table.path,
            "has no header, and no six columns of joint angles beside three of places "
            "fit the arm better than all others",
            'Write a column map with lines as q1_deg = "8", or a header',
            line=int(table.line[0]),
        )
    columns = best.columns
    used = {name for terms in columns.values() for name, _ in terms}
    free = [name for name in table.columns if name not in used]
    if free and len(set(table.text(free[0]))) == len(table):
        columns = {"id": ((free[0], 1.0),), **columns}
    form = Format(columns, _options(table))
    return form, ("columns", f"unit {best.length}", f"angle_unit {best.angle}")


def _attempts(table: TextTable, cell: Cell) -> Iterator[Attempt]:
    """Try all columns of numbers side by side as joints and as places."""
    numbers = numbers_in(table, table.columns)
    numeric = np.asarray(np.isfinite(numbers).all(axis=0))
    names, k = table.columns, len(table.columns)
    for a in range(k - 5):
        if not numeric[a : a + 6].all() or np.abs(numbers[:, a : a + 6]).max() > TURN:
            continue
        for b in (b for b in range(k - 2) if b + 3 <= a or b >= a + 6):
            if not numeric[b : b + 3].all() or not np.ptp(numbers[:, b : b + 3]) > 0:
                continue
            for angle in DEGREES_PER:
                for length in UNSTATED:
                    yield _attempt(
                        table, cell, names[a : a + 6], names[b : b + 3], angle, length
                    )


def _only_one(attempts: Iterator[Attempt]) -> Attempt | None:
    """Return the attempt that fits, None where none does or several do."""
    ranked = sorted(attempts, key=lambda one: one.misfit)
    if not ranked or not ranked[0].misfit <= ROUGH:
        return None
    if len(ranked) > 1 and ranked[1].misfit < CLEAR * ranked[0].misfit:
        return None
    return ranked[0]


def _attempt(
    table: TextTable,
    cell: Cell,
    joints: Sequence[str],
    places: Sequence[str],
    angle: str,
    length: str,
) -> Attempt:
    """Find by how much of their spread places miss the poses of the nominal arm."""
    rows = np.unique(np.linspace(0, len(table) - 1, SHOWN).astype(int))
    q = np.deg2rad(numbers_in(table, joints)[rows] * DEGREES_PER[angle])
    xyz = numbers_in(table, places)[rows] * MM_PER[length] * MM
    misfit = _misfit(cell, q, xyz) if len(rows) >= STOPS else np.inf
    return Attempt(tuple(joints), tuple(places), angle, length, misfit)


def _misfit(cell: Cell, q: Floats, xyz: Floats) -> float:
    """Return the median distance of places from poses, in parts of their spread."""
    if not np.isfinite(q).all() or not np.isfinite(xyz).all():
        return np.inf
    tool = np.tile(cell.probes.mean(axis=0), (len(q), 1))
    states = make_states(q, np.zeros_like(q), tool)
    tcp = ArmStates(cell.arm, states).walk.tcp
    spread = float(np.linalg.norm(tcp.std(axis=0)))
    own = float(np.linalg.norm(xyz.std(axis=0)))
    if not spread / 2 < own < 2 * spread:
        return np.inf
    T = rigid_fit(xyz, tcp)
    gap = xyz @ T[:3, :3].T + T[:3, 3] - tcp
    return float(np.median(np.linalg.norm(gap, axis=1))) / spread


# The map as a file.


def map_text(readings: Sequence[FileReading]) -> str:
    """Write the column map that reads files as they were understood.

    Raises:
        PostprocError: A file needs a map of its own, or none can describe it.
    """
    forms = [one.form for one in readings]
    for one in readings:
        if one.form is None:
            raise PostprocError(
                f"{one.table.path}: a {one.layout} needs no column map. Give it to "
                "`fit` as it is"
            )
    first = forms[0]
    assert first is not None
    for one, form in zip(readings, forms, strict=True):
        if form != first:
            raise PostprocError(
                f"{one.table.path}: needs another column map than "
                f"{readings[0].table.path}. Write one for each file"
            )
    lines = ["[columns]", *(f"{k} = {_terms(v)}" for k, v in first.columns.items())]
    options = [f"{k} = {_value(v)}" for k, v in first.reading.items()]
    return "\n".join([*lines, *(["", "[file]", *options] if options else []), ""])


def _terms(terms: Sequence[tuple[str, float]]) -> str:
    """Write an entry of a map."""
    several = [
        toml_text(name)
        if factor == 1.0
        else f"{{ column = {toml_text(name)}, factor = {factor!r} }}"
        for name, factor in terms
    ]
    return several[0] if len(several) == 1 else f"[{', '.join(several)}]"


def _value(value: object) -> str:
    """Write an option of a map."""
    if isinstance(value, bool):
        return str(value).lower()
    return toml_text({"\t": "tab", r"\s+": "space"}.get(str(value), str(value)))
