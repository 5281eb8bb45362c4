"""Measurements of where the tool really landed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Floats, Ints
from postproc.calibration.monuments import (
    APART,
    ONE_POINT,
    ReferenceRows,
    TrackerMotion,
    join_references,
    split_references,
    tracker_motion,
)
from postproc.calibration.recognise import recognise
from postproc.calibration.tables import (
    DETECT,
    JOINTS,
    Format,
    Nests,
    TableFormat,
    by_headers,
    check_axes,
    check_clear,
    in_visit_order,
    read_directions,
    read_foreign,
    read_rotation,
    read_tools,
    read_visits,
    row_names,
    translate,
)
from postproc.calibration.text_table import NUMBER, TextTable, read_headed
from postproc.exceptions import MeasurementError
from postproc.files import NamedText
from postproc.model.registration import rigid_fit
from postproc.robot.arm import Arm
from postproc.robot.pose import MM
from postproc.robot.state import States, make_states

# Measurements of where the tool really landed.

POSITION = ("x_mm", "y_mm", "z_mm")
COVARIATES = {  # column: field of States, SI units per unit of the column
    "time_s": ("time", 1.0),
    "temperature_c": ("temperature", 1.0),
    "payload_kg": ("payload", 1.0),
    "speed_mm_s": ("speed", MM),
}
NOWHERE = 1e-6  # [m] a position this close to zero is a lost beam


@dataclass(frozen=True)
class DroppedRow:
    """A row that was not used, and why."""

    id: str
    line: int
    why: str


@dataclass(frozen=True, eq=False)
class Measurements:
    """Measured positions with the states they were taken in, in visit order.

    Attributes:
        path: The file (the first of several).
        states: n states.
        position: Measured TCP, (n, 3) [m], NaN where the file has no positions.
        ids: Row ids.
        line: 1-based line of every row, (n,).
        inferred: True where the direction was inferred from the row order, (n,).
        sha256: Hash of the file(s).
        dropped: Rows left out.
        warnings: What a reader of the fit should know.
        rotation: Measured orientation of the tool or 6D probe, (n, 3, 3), or None; in
            the frame of the positions.
        mounting: Orientation of the tool or probe in the flange frame, (3, 3), or None
            where it is not known.
        references: Readings of fixed points between the rows, or None.
        motion: What they say of the tracker, whose drift is taken out of `position`;
            None without them.
        visit: Number of the visit of every row, as the file has it, (n,), -1 where it
            does not; or None.
        stations: Names of the places of the tracker, or of the files, by
            `states.station`.
    """

    path: Path
    states: States
    position: Floats
    ids: tuple[str, ...]
    line: NDArray[np.int64]
    inferred: Bools
    sha256: str
    dropped: tuple[DroppedRow, ...] = ()
    warnings: tuple[str, ...] = ()
    rotation: Floats | None = field(default=None, repr=False)
    mounting: Floats | None = field(default=None, repr=False)
    references: ReferenceRows | None = field(default=None, repr=False)
    motion: TrackerMotion | None = field(default=None, repr=False)
    visit: Ints | None = field(default=None, repr=False)
    stations: tuple[str, ...] = ("",)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.states)

    def with_states(self, states: States) -> Measurements:
        """Return a copy with other states of the same rows."""
        return replace(self, states=states)

    def __getitem__(self, rows: NDArray[np.int64] | Bools) -> Measurements:
        """Return some of the rows."""
        index = np.arange(len(self))[rows]
        return replace(
            self,
            states=self.states[index],
            position=self.position[index],
            ids=tuple(self.ids[i] for i in index),
            line=self.line[index],
            inferred=self.inferred[index],
            rotation=None if self.rotation is None else self.rotation[index],
            visit=None if self.visit is None else self.visit[index],
        )


def read_survey_file(
    path: str | Path | NamedText,
    arm: Arm,
    tools: Nests,
    *,
    positions: bool = True,
    reading: TableFormat = DETECT,
) -> Measurements:
    """Read a measurement file.

    Args:
        path: CSV with the columns of the documentation; rows in visit order, unless a
            column order or time_s tells another.
        arm: The arm, for directions that must be inferred.
        tools: Probe points in the flange frame, (k, 3) [m], by `tool_id` or by name.
            Columns tool_x_mm, tool_y_mm, tool_z_mm override them.
        positions: Whether the file must have measured positions.
        reading: What the user knows of the file.

    Raises:
        MeasurementError: Naming file, line, problem and cure.
    """
    table = read_foreign(path, reading)
    return from_table(table, arm, tools, positions=positions)


def from_table(
    table: TextTable,
    arm: Arm,
    tools: Nests,
    *,
    positions: bool = True,
) -> Measurements:
    """Interpret a table with the columns of the documentation."""
    check_axes(table)
    table.require("id", *JOINTS, *(POSITION if positions else ()))
    table = in_visit_order(table)
    table, references = split_references(table)
    ids = row_names(table)
    q = np.deg2rad(table.block(JOINTS))
    side, travel, inferred, warnings = read_directions(table, arm, q)
    covariates = {
        name: scale * table.numbers(column, empty=True)
        for column, (name, scale) in COVARIATES.items()
        if table.has(column)
    }
    if table.has("order"):
        covariates["order"] = table.numbers("order")
    stations, station = read_stations(table)
    tool, tool_id = read_tools(table, tools)
    states = make_states(
        q, side, tool, tool_id=tool_id, station=station, travel=travel, **covariates
    )
    read = table.has(*POSITION)
    position = table.block(POSITION) * MM if read else np.full((len(q), 3), np.nan)
    found = Measurements(
        table.path, states, position, ids, table.line, inferred, table.sha256,
        warnings=warnings, rotation=read_rotation(table), references=references,
        visit=read_visits(table),
        stations=stations,
    )  # fmt: skip
    return drop_lost_beams(found)


def read_stations(table: TextTable) -> tuple[tuple[str, ...], NDArray[np.int64]]:
    """Read the column station: names in the order of visits, and each row's number."""
    if not table.has("station"):
        return ("",), np.zeros(len(table), dtype=np.int64)
    texts = table.text("station")
    names = tuple(dict.fromkeys(texts)) or ("",)
    return names, np.array([names.index(t) for t in texts], dtype=np.int64)


def drop_lost_beams(measured: Measurements) -> Measurements:
    """Leave out rows whose position is zero: the tracker had lost the beam."""
    lost = _nowhere(measured.position)
    gone = tuple(
        DroppedRow(
            measured.ids[i], int(measured.line[i]), "position 0, 0, 0: beam lost"
        )
        for i in np.flatnonzero(lost)
    )
    fixed = measured.references
    if fixed is not None and (blind := _nowhere(fixed.position)).any():
        gone += tuple(
            DroppedRow(fixed.name[i], int(fixed.line[i]), "position 0, 0, 0: beam lost")
            for i in np.flatnonzero(blind)
        )
        fixed = fixed[~blind]
    kept = replace(measured[~lost], references=fixed)
    return replace(kept, dropped=measured.dropped + gone)


def _nowhere(position: Floats) -> Bools:
    """Tell which positions (n, 3) are those of a lost beam, (n,)."""
    return np.asarray((np.abs(position) < NOWHERE).all(axis=1))


def concatenate(parts: Sequence[Measurements]) -> Measurements:
    """Put several files one after the other, and take the tracker's own drift out.

    Fixed points that lie apart from file to file were read from another station: each
    file then has a drift of its own, and three points bring it into the first's frame.

    Raises:
        MeasurementError: A file is there twice, or readings of fixed points tell
            nothing.
    """
    if _has_moved_points(parts):
        return replace(_join_files(_tie_files([steady(p) for p in parts])), motion=None)
    return _remove_drift(_join_files(parts))


def _has_moved_points(parts: Sequence[Measurements]) -> bool:
    """Return True if a fixed point is elsewhere in another file."""
    places: dict[str, Floats] = {}
    for part in parts:
        fixed = part.references
        for name, xyz in (
            () if fixed is None else zip(fixed.name, fixed.position, strict=True)
        ):
            if np.linalg.norm(places.setdefault(name, xyz) - xyz) > ONE_POINT:
                return part is not parts[0]
    return False


def steady(survey: Measurements) -> Measurements:
    """Take the tracker's drift out of rows, where every fixed point was read twice."""
    fixed = survey.references
    if fixed is None or (np.bincount(fixed.which) < 2).any():
        return survey
    return _remove_drift(survey)


def _remove_drift(survey: Measurements) -> Measurements:
    """Take out of the positions what readings of fixed points say of the tracker."""
    if survey.references is None:
        return survey
    states = survey.states
    motion = tracker_motion(survey.references, states.time, states.order)
    passed = getattr(states, motion.drift.clock)
    return replace(
        survey,
        position=survey.position - motion.move(passed, survey.position),
        motion=motion,
        warnings=(*survey.warnings, *motion.tell()),
    )


# Stations that read the same fixed points.

TIES = 3  # fixed points, not on a line, that tell where another station stood
LOOSE = 2e-4  # [m] what they may be off by afterwards


def _tie_files(parts: Sequence[Measurements]) -> list[Measurements]:
    """Bring files into the frame of the first, where they share its fixed points."""
    name = parts[0].stations[0] or parts[0].path.name
    first = replace(parts[0], stations=(name, *parts[0].stations[1:]))
    known, out = places_of_points(first), [first]
    for part in parts[1:]:
        seen = places_of_points(part)
        names = sorted(set(seen) & set(known))
        there = np.array([known[n] for n in names]).reshape(-1, 3)
        here = np.array([seen[n] for n in names]).reshape(-1, 3)
        spread = there - there.mean(axis=0) if len(there) >= TIES else np.zeros((3, 3))
        flat = not np.linalg.svd(spread, compute_uv=False)[1] > APART
        if len(part.stations) > 1 or flat:  # they do not fix shift and turn of a frame
            out.append(part)
            continue
        T = rigid_fit(here, there)
        left = np.linalg.norm(here @ T[:3, :3].T + T[:3, 3] - there, axis=1)
        worst = f"{left.max() / MM:.3f} mm"
        if left.max() > LOOSE:
            note = (
                f"{part.path.name}: distances of monuments differ by up to {worst} "
                f"from {first.path.name}, so that the stations are not joined. Are "
                f"names exchanged, or was {names[int(left.argmax())]!r} moved?"
            )
            out.append(replace(part, warnings=(*part.warnings, note)))
            continue
        note = (
            f"{part.path.name}: registered to {first.path.name} by {len(names)} "
            f"monuments, largest residual {worst}"
        )
        moved = _in_frame(part, T, name)
        out.append(replace(moved, warnings=(*part.warnings, note)))
        known = places_of_points(out[-1]) | known
    return out


def places_of_points(rows: Measurements) -> dict[str, Floats]:
    """Return where each fixed point was read, the tracker's drift apart, (3,) [m]."""
    fixed, motion = rows.references, rows.motion
    if fixed is None:
        return {}
    position = fixed.position
    if motion is not None:
        passed = fixed.time if motion.drift.clock == "time" else fixed.order
        position = position - motion.move(passed, position)
    own = {n: [m == n for m in fixed.name] for n in set(fixed.name)}
    return {name: position[rows].mean(axis=0) for name, rows in own.items()}


def _in_frame(rows: Measurements, T: Floats, station: str) -> Measurements:
    """Convert rows and their fixed points by a transform, (4, 4), to a station's."""
    fixed, R = rows.references, T[:3, :3]
    assert fixed is not None
    zeros = np.zeros(len(rows), dtype=np.int64)
    return replace(
        rows,
        states=rows.states.with_(station=zeros), stations=(station,),
        position=rows.position @ R.T + T[:3, 3],
        rotation=None if rows.rotation is None else R @ rows.rotation,
        references=replace(fixed, position=fixed.position @ R.T + T[:3, 3]),
    )  # fmt: skip


def _join_files(parts: Sequence[Measurements]) -> Measurements:
    """Put several files one after the other."""
    first = parts[0]
    if len(parts) == 1:
        return first
    _check_given_once(parts)
    names, station = _join_stations(parts)
    joined = {
        name: np.concatenate([getattr(p.states, name) for p in parts])
        for name in first.states.__dataclass_fields__
        if name not in ("order", "station")
    }
    offsets = _offsets(parts)
    order = np.concatenate(
        [p.states.order + by for p, by in zip(parts, offsets, strict=True)]
    )
    rotations = [p.rotation for p in parts if p.rotation is not None]
    joint = Measurements(
        path=first.path,
        states=States(order=order, station=station, **joined),
        position=np.concatenate([p.position for p in parts]),
        ids=_join_ids(parts),
        line=np.concatenate([p.line for p in parts]),
        inferred=np.concatenate([p.inferred for p in parts]),
        sha256="+".join(p.sha256 for p in parts),
        dropped=tuple(d for p in parts for d in p.dropped),
        warnings=tuple(w for p in parts for w in p.warnings),
        rotation=np.concatenate(rotations) if len(rotations) == len(parts) else None,
        visit=_join_visits(parts),
        references=join_references(
            [(p.references, by) for p, by in zip(parts, offsets, strict=True)]
        ),
        stations=names,
    )
    if (np.diff(order) > 0).all():
        return joint
    return joint[np.argsort(order, kind="stable")]


def _check_given_once(parts: Sequence[Measurements]) -> None:
    """Refuse a file whose rows another one has.

    Raises:
        MeasurementError: They would count twice.
    """
    first: dict[tuple[object, ...], Path] = {}
    for part in parts:
        rows = part.ids, part.position.tobytes(), part.states.q.tobytes()
        if len(part) and rows in first:
            problem = f"holds the rows of {first[rows]}, which would count twice"
            raise MeasurementError(part.path, problem, "Give every file once")
        first[rows] = part.path


def _join_ids(parts: Sequence[Measurements]) -> tuple[str, ...]:
    """Name the rows of several files: ids of an earlier file get the file's name."""
    seen: set[str] = set()
    names: list[str] = []
    for part in parts:
        own = [f"{i} of {part.path.name}" if i in seen else i for i in part.ids]
        seen.update(part.ids)
        names += own
    return tuple(names)


def _join_visits(parts: Sequence[Measurements]) -> Ints | None:
    """Number the visits of several files, (n,): no two files share one."""
    if all(part.visit is None for part in parts):
        return None
    visits, following = [], 0
    for part in parts:
        own = np.full(len(part), -1) if part.visit is None else part.visit
        visits.append(np.where(own < 0, -1, following + own))
        following = max(following, int(visits[-1].max(initial=-1)) + 1)
    return np.concatenate(visits)


def _join_stations(
    parts: Sequence[Measurements],
) -> tuple[tuple[str, ...], NDArray[np.int64]]:
    """Number the stations of several files: one name is one station.

    A file that names none is a station of its own, by the file's name.
    """
    names: list[str] = []
    numbers = []
    for k, part in enumerate(parts):
        own = list(part.stations)
        if own == [""]:
            same = [p.path.name for p in parts].count(part.path.name) > 1
            own = [f"{part.path.name} ({k + 1})" if same else part.path.name]
        names += [name for name in own if name not in names]
        index = np.array([names.index(name) for name in own], dtype=np.int64)
        numbers.append(index[part.states.station])
    return tuple(names), np.concatenate(numbers)


def _offsets(parts: Sequence[Measurements]) -> list[float]:
    """Say by how much the order of every file moves, where one follows the other.

    Places that no two rows share were numbered through all files.
    """
    every = np.concatenate([p.states.order for p in parts])
    offsets, following = [0.0] * len(parts), -np.inf
    if len(np.unique(every)) == len(every):
        return offsets
    for k, part in enumerate(parts):
        if len(part):
            order = part.states.order
            offsets[k] = max(following - float(order.min()), 0.0) if k else 0.0
            following = float(order.max()) + offsets[k] + 1.0
    return offsets


# Lists of measured points that carry names but no joint angles.
#
# SpatialAnalyzer writes `//` header lines and `name, x, y, z` without units; Leica
# software writes Latin-1 text, times with apostrophes, and any order of columns. They
# are joined with the program that was measured.

WHOLE = re.compile(r"^\d+$")


def read_points(
    path: str | Path | NamedText, reading: TableFormat = DETECT
) -> TextTable:
    """Read names and positions as columns id, x_mm, y_mm, z_mm.

    A file that has these columns keeps its others, too.

    Raises:
        MeasurementError: No names or coordinates are found.
    """
    if reading.columns is not None:
        table = read_foreign(path, reading)
        table.require("id", *POSITION)
        return point_names(table)
    table = read_headed(path, **reading.given)
    if table.has("id", *POSITION):
        return table
    points = by_headers(table, reading) if table.headed else _by_places(table, reading)
    if not points.has("id", *POSITION):
        raise MeasurementError(
            table.path,
            "no columns for a name and x, y, z",
            f"The header has: {', '.join(table.columns)}. Name them id, x_mm, y_mm, "
            "z_mm",
            line=table.top,
        )
    return point_names(points)


def point_names(points: TextTable) -> TextTable:
    """Name points by their targets alone, without collection and group."""
    points.require("id")
    cells, column = points.cells.copy(), points.columns.index("id")
    cells[:, column] = [target_of(text) for text in points.text("id")]
    return replace(points, cells=cells)


def _by_places(table: TextTable, reading: TableFormat) -> TextTable:
    """Turn a list without a header into ours."""
    name, axes = places_of(table)
    sources = {"id": name, **dict(zip(POSITION, axes, strict=True))}
    found = recognise(table, reading.unit, choices=sources)
    check_clear(table, found)
    return translate(table, Format(found.columns))


def target_of(name: str) -> str:
    """Return the target of a name as SpatialAnalyzer writes it.

    >>> target_of("A::Main::1a")
    '1a'
    """
    return name.rpartition("::")[2].strip() or name


def places_of(table: TextTable) -> tuple[str, tuple[str, str, str]]:
    """Find name and coordinates by their cells, in a table without a header.

    The coordinates are the first three columns of numbers side by side; the name stands
    before them, after collection and group where there are any. A column of whole
    numbers before three others that are none is a name, too.

    Raises:
        MeasurementError: No name stands before three numbers.
    """
    cells = [[str(c) for c in column] for column in table.cells.T]
    number = [all(NUMBER.match(c) for c in column) for column in cells]
    whole = [all(WHOLE.match(c) for c in column) for column in cells]
    starts = [k for k in range(len(cells) - 2) if all(number[k : k + 3])]
    first = starts[0] if starts else None
    if first is not None and first + 1 in starts:
        if first == 0 or (whole[first] and not all(whole[first + 1 : first + 4])):
            first += 1
    if not first:
        raise MeasurementError(
            table.path,
            "has no header, and its rows are not a name followed by x, y, z",
            "Write a header with id, x_mm, y_mm, z_mm",
            line=int(table.line[0]),
        )
    x, y, z = table.columns[first : first + 3]
    return table.columns[first - 1], (x, y, z)
