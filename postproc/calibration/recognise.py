"""Which columns of a foreign table are ours, in which units, and what is not clear."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.headers import ANGLES, LENGTHS, find_columns, units_in
from postproc.calibration.text_table import TextTable, number_of

DEGREES = float(np.rad2deg(1.0))  # per radian
MM_PER = {
    "mm": 1.0, "m": 1000.0, "inch": 25.4, "ft": 304.8, "cm": 10.0, "um": 1e-3
}  # fmt: skip
DEGREES_PER = {"deg": 1.0, "rad": DEGREES}
UNSTATED = ("mm", "m", "inch", "ft")  # units of lengths that a file may not state
NEAR, FAR = 250.0, 12_000.0  # [mm] where the farthest reading of a survey lies
LIKELY_MM = 300.0  # a coordinate from which on mm are assumed
TURNS = 4 * np.pi  # [rad] no joint turns so far
TELLING = 3  # coordinates, or joints, that make a table one of measurements
JOINT = re.compile(r"^q\d_deg$")
PLACE = re.compile(r"^[xyz]_mm$")

Terms = tuple[tuple[str, float], ...]  # columns of the file that are added, and factors


@dataclass(frozen=True)
class Question:
    """What two readings of a table fit.

    Attributes:
        about: A column of ours, "unit" (of lengths) or "angle_unit".
        readings: What fits: columns of the file, or units.
        problem: As a message states it.
        cure: How to answer.
    """

    about: str
    readings: tuple[str, ...]
    problem: str
    cure: str


@dataclass(frozen=True)
class Recognised:
    """What the headers of a table say.

    Attributes:
        columns: By column of ours: columns of the file, with factors.
        length, angle: The units of places and joints, "" where there are none.
        grounds: By "unit" and "angle_unit": what states the unit.
        questions: What is not clear.
        unused: Columns of the file that are none of ours.
    """

    columns: Mapping[str, Terms]
    length: str
    angle: str
    grounds: Mapping[str, str]
    questions: tuple[Question, ...]
    unused: tuple[str, ...]

    @property
    def is_measured(self) -> bool:
        """Whether the table has joints or places."""
        places = [
            name for name in self.columns if JOINT.match(name) or PLACE.match(name)
        ]
        asked = {q.about for q in self.questions}
        return len(places) + len([a for a in asked if a[-3:] == "_mm"]) >= TELLING


def recognise(
    table: TextTable,
    unit: str | None = None,
    angle_unit: str | None = None,
    choices: Mapping[str, str] | None = None,
) -> Recognised:
    """Find our columns by the headers of a table.

    Args:
        table: With headers.
        unit: Of lengths, where the file does not state it.
        angle_unit: Of joint angles, likewise.
        choices: Columns of the file, by ours, that a user chose.
    """
    chosen = dict(choices or {})
    found = find_columns(table.columns)
    sources = {k: v for k, v in found.sources.items() if v[0] not in chosen.values()}
    sources |= {ours: (name, _unit_of(name)) for ours, name in chosen.items()}
    rivals = {k: v for k, v in found.rivals.items() if k not in chosen}
    if "id" in rivals and sum(bool(JOINT.match(k)) for k in sources) >= TELLING:
        sources["id"] = (rivals.pop("id")[0], "")  # it only names the rows
    notes = units_in(table.notes)
    places = {k: v for k, v in sources.items() if PLACE.match(k)}
    joints = {k: v for k, v in sources.items() if JOINT.match(k)}
    length = _length(table, places, notes & {*LENGTHS}, unit)
    angle = _angle(table, joints, notes & {*ANGLES}, angle_unit)
    columns: dict[str, Terms] = {}
    for ours, (name, stated) in sources.items():
        columns[ours] = ((name, _factor(ours, stated, length.unit, angle.unit)),)
    questions = [_which(ours, names) for ours, names in rivals.items()]
    questions += [q for q in (length.question, angle.question) if q is not None]
    used = {name for name, _ in sources.values()}
    unused = tuple(n for n in found.unused if n not in used)
    grounds = {"unit": length.ground, "angle_unit": angle.ground}
    return Recognised(
        columns, length.unit, angle.unit, grounds, tuple(questions), unused
    )


def _unit_of(header: str) -> str:
    """Return the unit that a header states, whatever else it says."""
    return next((u for _, u in find_columns([header]).sources.values()), "")


def _factor(ours: str, stated: str, length: str, angle: str) -> float:
    """Return what a column of the file is multiplied by."""
    if PLACE.match(ours) or (ours.startswith("tool_") and ours.endswith("_mm")):
        return MM_PER.get(stated or length, 1.0)
    if JOINT.match(ours):
        return DEGREES_PER.get(stated or angle, 1.0)
    return {"ms": 1e-3, "min": 60.0}.get(stated, 1.0)


def _which(ours: str, names: tuple[str, ...]) -> Question:
    """Ask which of several columns is one of ours."""
    listed = " or ".join(map(repr, names))
    return Question(
        ours,
        names,
        f"{ours} may be column {listed}",
        f"Choose one: postproc read .. --column '{ours}={names[0]}' -o map.toml",
    )


@dataclass(frozen=True)
class UnitFound:
    """A unit, what states it, and a question where nothing does."""

    unit: str
    ground: str
    question: Question | None = None


Sources = Mapping[str, tuple[str, str]]  # by ours: the file's column and its unit


def _length(
    table: TextTable, places: Sources, notes: set[str], given: str | None
) -> UnitFound:
    """Find the unit of places."""
    if not places:
        return UnitFound("", "")
    if (known := _find_statement(places, notes, given)) is not None:
        return known
    largest = _largest(table, [name for name, _ in places.values()])
    if not np.isfinite(largest) or largest >= LIKELY_MM:
        return UnitFound("mm", "assumed, as the file does not state it")
    fits = [u for u in UNSTATED[1:] if NEAR <= largest * MM_PER[u] <= FAR]
    readings = ("mm", *(fits or UNSTATED[1:]))
    return UnitFound("mm", "", _ask_unit("unit", readings, "x, y, z", largest))


def _angle(
    table: TextTable, joints: Sources, notes: set[str], given: str | None
) -> UnitFound:
    """Find the unit of joint angles."""
    if not joints:
        return UnitFound("", "")
    if (known := _find_statement(joints, notes, given)) is not None:
        return known
    largest = _largest(table, [name for name, _ in joints.values()])
    if not np.isfinite(largest) or largest > TURNS:
        return UnitFound("deg", f"no joint turns by {largest:.4g} rad")
    question = _ask_unit("angle_unit", ("deg", "rad"), "joint angles", largest)
    return UnitFound("deg", "", question)


def _find_statement(
    sources: Sources, notes: set[str], given: str | None
) -> UnitFound | None:
    """Return the unit that headers, comments or the user state."""
    units = {unit for _, unit in sources.values()}
    if len(units) == 1 and "" not in units:
        return UnitFound(units.pop(), "stated by the headers")
    if "" not in units:
        return UnitFound("mixed", "stated by the headers")
    if len(notes) == 1:
        return UnitFound(next(iter(notes)), "stated above the table")
    return UnitFound(given, "given") if given else None


def _ask_unit(
    about: str, readings: tuple[str, ...], what: str, largest: float
) -> Question:
    """Ask for a unit."""
    listed = ", ".join(readings[:-1]) + " or " + readings[-1]
    return Question(
        about,
        readings,
        f"{what} have no unit: values up to {largest:.4g} may be {listed}",
        f"State it: --set measurements.{about}={readings[0]}, or compare the file with "
        "the arm: postproc read",
    )


def _largest(table: TextTable, names: Iterable[str]) -> float:
    """Return the largest absolute value of columns, NaN where none holds a number."""
    every = numbers_in(table, names)
    return float(np.nanmax(np.abs(every))) if np.isfinite(every).any() else float("nan")


def numbers_in(table: TextTable, names: Iterable[str]) -> Floats:
    """Return columns as numbers, (n, k), NaN where a cell holds none."""
    return np.array(
        [[number_of(t, table.decimal) for t in table.text(name)] for name in names]
    ).T
