"""What the record of robots holds: a row of each of its tables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

CURRENT, OLD, REJECTED = "current", "superseded", "rejected"
SURVEY, CHECK = "survey", "check"
FITTED, REFRESHED = "fitted", "refreshed"


@dataclass(frozen=True)
class RobotRow:
    """A robot.

    Attributes:
        serial: Its serial number.
        arm: Name of the arm.
        cell: The cell file, relative to the record.
        line: The line that it stands in, "" where nobody said.
        added: When, as 2026-11-28T07:00:00 (UTC).
        state: "in use", or "replaced by" another serial number.
    """

    table: ClassVar[str] = "robot"
    serial: str
    arm: str
    cell: str
    line: str
    added: str
    state: str = "in use"


@dataclass(frozen=True)
class SurveyRow:
    """Measurements that were read: a survey or a check.

    Attributes:
        id: Number.
        serial: The robot.
        date: When they were measured.
        kind: SURVEY or CHECK.
        operator, instrument: Who read them, with what; "" where nobody said.
        file: Name of the file.
        sha256: Its hash.
        content: Its bytes; none of a survey.
        program: Name of the program that was measured, "" without.
    """

    table: ClassVar[str] = "survey"
    id: int | None
    serial: str
    date: str
    kind: str
    operator: str
    instrument: str
    file: str
    sha256: str
    content: bytes
    program: str = ""


@dataclass(frozen=True)
class EventRow:
    """Something that happened to a robot, see `postproc.record.events.Event`.

    Attributes:
        id: Number.
        serial: The robot.
        date: When.
        kind: What.
        joints: Its joints, as "2,3".
        note: What else is to be said.
    """

    table: ClassVar[str] = "event"
    id: int | None
    serial: str
    date: str
    kind: str
    joints: str
    note: str


@dataclass(frozen=True)
class ModelRow:
    """A model of a robot.

    Attributes:
        id: Of the model.
        serial: The robot.
        date: Since when it is known.
        parent: The model that it revises, "" for none.
        survey: Number of the measurements that it was made from, None if not known.
        origin: FITTED or REFRESHED.
        file: Name of its file.
        left_mm: Error that it leaves of readings that it has not seen, None if unknown.
        state: CURRENT, OLD or REJECTED.
        content: Its file.
    """

    table: ClassVar[str] = "model"
    id: str
    serial: str
    date: str
    parent: str
    survey: int | None
    origin: str
    file: str
    left_mm: float | None
    state: str
    content: bytes


@dataclass(frozen=True)
class VerdictRow:
    """What a check said of a robot.

    Attributes:
        id: Number.
        serial: The robot.
        survey: Number of the check.
        date: When it was read.
        n: Readings of the arm.
        mean_mm, within_mm, worst_mm: Of the lengths of their errors: mean, 95 %, most.
        in_control: 1 where neither test raised an alarm.
        statistic, statistic_limit: Hotelling's T2 and its limit.
        drift, drift_limit: Of the moving average.
        moved: What moved, in words, "" for nothing.
        nats: Evidence for it.
    """

    table: ClassVar[str] = "verdict"
    id: int | None
    serial: str
    survey: int
    date: str
    n: int
    mean_mm: float
    within_mm: float
    worst_mm: float
    in_control: int
    statistic: float
    statistic_limit: float
    drift: float
    drift_limit: float
    moved: str
    nats: float


@dataclass(frozen=True)
class ProgramRow:
    """A program that was compensated for a robot.

    Attributes:
        id: Number.
        serial: The robot.
        path: The original, relative to the record.
        output: What was written of it, likewise.
        model: The model that it was compensated with.
        sha256: Hash of what was written.
        released: When.
        moves_mm: By how much its targets would move now at the most, None if nobody has
            asked since.
    """

    table: ClassVar[str] = "program"
    id: int | None
    serial: str
    path: str
    output: str
    model: str
    sha256: str
    released: str
    moves_mm: float | None = None


Row = RobotRow | SurveyRow | EventRow | ModelRow | VerdictRow | ProgramRow
STATES = {"robot": ("state",), "model": ("state",), "program": ("moves_mm",)}
"""Columns that may change; all else of the record is only ever added to."""
