"""What is done with a robot of the record: add, check, event, refresh, replace."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from postproc.compensation.output.sidecar import sha256
from postproc.exceptions import RecordError
from postproc.files import read_input
from postproc.model.effects.effect import EVENTS
from postproc.model.model import Model, load_model
from postproc.record.control import CheckVerdict
from postproc.record.database import Record
from postproc.record.events import OF_JOINTS
from postproc.record.life import Life, today
from postproc.record.refresh import Refresh, refresh
from postproc.record.rows import (
    CHECK,
    CURRENT,
    FITTED,
    OLD,
    REFRESHED,
    SURVEY,
    EventRow,
    ModelRow,
    ProgramRow,
    RobotRow,
    SurveyRow,
    VerdictRow,
)
from postproc.record.stale import StaleProgram, find_stale
from postproc.robot.cell import Cell, load_cell

UNTOLD = "no event is recorded"


@dataclass(frozen=True)
class CheckFile:
    """Readings as they are given to a command.

    Attributes:
        file: The readings.
        program: The program that was measured, None without.
        date: When, as the record writes it.
        operator: Who read them, "" where nobody says.
    """

    file: Path
    program: Path | None
    date: str
    operator: str


@dataclass(frozen=True, eq=False)
class NewModel:
    """A model of a survey that a robot begins with.

    Attributes:
        cell: The cell file.
        arm: Name of the arm.
        file: The model file.
        model: The model.
        content: Bytes of its file.
    """

    cell: Path
    arm: str
    file: Path
    model: Model
    content: bytes

    @classmethod
    def read(cls, serial: str, cell: Path, file: Path) -> NewModel:
        """Read the model of a robot.

        Raises:
            PostprocError: A file cannot be used, or the model is another robot's.
        """
        loaded, content = load_cell(cell), read_input(file)
        model = load_model(content, name=file.name)
        model.check_arm(loaded.arm, file)
        told = None if model.provenance is None else model.provenance.serial_number
        if told not in (None, serial):
            problem = f"is of the robot {told}, not of {serial}"
            raise RecordError(file, problem, "Give the model of this robot")
        return cls(cell, loaded.arm.name, file, model, content)


def add_robot(record: Record, serial: str, new: NewModel, line: str = "") -> None:
    """Add a robot with its model, or a model of a newer survey to a robot.

    Raises:
        RecordError: The record has this model already.
    """
    model, origin = new.model, new.model.provenance
    known = [r.serial for r in record.rows(RobotRow)]
    with record.writing():
        if serial not in known:
            place = _relative(record, new.cell)
            record.add(RobotRow(serial, new.arm, place, line, today()))
        survey = SurveyRow(
            None, serial, today() if origin is None else origin.date, SURVEY, "",
            (origin.instrument if origin else None) or "", new.file.name,
            model.data_sha256, b"",
        )  # fmt: skip
        number = record.add(survey)
        _retire_model(record, serial)
        row = ModelRow(
            model.id, serial, today(), model.parent or "", number, FITTED,
            new.file.name, None, CURRENT, new.content,
        )  # fmt: skip
        record.add(row)


def _relative(record: Record, place: Path) -> str:
    """Return a place relative to the record, as it is where that cannot be."""
    try:
        return Path(os.path.relpath(place, record.path.absolute().parent)).as_posix()
    except ValueError:  # another drive
        return str(place.absolute())


def _retire_model(record: Record, serial: str) -> None:
    for row in record.rows(ModelRow, serial):
        if row.state == CURRENT:
            record.set_state(row, state=OLD)


def check_robot(
    record: Record, serial: str, given: CheckFile
) -> tuple[CheckVerdict, bool]:
    """Judge the readings of a check, and record them with the verdict.

    Returns:
        The verdict, and whether the record had these readings already.

    Raises:
        PostprocError: The robot is not there, or the readings cannot be used.
    """
    life, content = Life.of(record, serial), read_input(given.file)
    life.check_moment(given.date)
    cell, digest = life.cell(), sha256(content)
    known = any(s.sha256 == digest and s.kind == CHECK for s in life.surveys)
    watch = life.watch(cell, given.date, digest)
    model = life.model(life.surveyed)
    rows = life.read_check(content, given.file.name, cell, model, _name(given))
    verdict, _ = watch.judge(rows)
    if not known:
        with record.writing():
            number = record.add(_survey_of(serial, given, content, cell))
            record.add(_row_of(serial, number, given.date, verdict))
    return verdict, known


def _name(given: CheckFile) -> str:
    return "" if given.program is None else str(given.program.absolute())


def _survey_of(serial: str, given: CheckFile, content: bytes, cell: Cell) -> SurveyRow:
    instrument = cell.measurements.instrument or ""
    return SurveyRow(
        None, serial, given.date, CHECK, given.operator, instrument, given.file.name,
        sha256(content), content, _name(given),
    )  # fmt: skip


def _row_of(serial: str, survey: int, date: str, verdict: CheckVerdict) -> VerdictRow:
    moved = "" if verdict.in_control else verdict.shown[0].describe()
    return VerdictRow(
        None, serial, survey, date, len(verdict.errors), verdict.mean_mm,
        verdict.within_mm, verdict.worst_mm, int(verdict.in_control),
        verdict.statistic, verdict.limit, verdict.drift, verdict.drift_limit, moved,
        verdict.shown[0].nats,
    )  # fmt: skip


def note_event(
    record: Record, serial: str, kind: str, joints: tuple[int, ...], date: str,
    note: str = "",
) -> EventRow:  # fmt: skip
    """Record what happened to a robot.

    Raises:
        RecordError: The robot is not there, or the event is none.
    """
    life = Life.of(record, serial)
    life.check_moment(date)
    if kind not in EVENTS:
        problem, cure = f"there is no event {kind!r}", f"One of {', '.join(EVENTS)}"
        raise RecordError(record.path, problem, cure)
    if joints and kind not in OF_JOINTS:
        cure = "Leave --joints out"
        raise RecordError(record.path, f"{kind} happens to no single joints", cure)
    if any(not 1 <= j <= 6 for j in joints):
        raise RecordError(record.path, "joints are numbered 1 to 6", "Correct --joints")
    text = ",".join(map(str, sorted(set(joints))))
    row = EventRow(None, life.robot.serial, date, kind, text, note)
    with record.writing():
        record.add(row)
    return row


@dataclass(frozen=True, eq=False)
class Refreshed:
    """What came of a refresh.

    Attributes:
        refresh: The new model, and what it leaves.
        why: What happened since the model before.
        stale: Programs that were compensated with older models, worst first.
    """

    refresh: Refresh
    why: str
    stale: tuple[StaleProgram, ...]


def refresh_robot(
    record: Record, serial: str, given: CheckFile, output: Path,
    progress: Callable[[str], None] = lambda _: None,
) -> Refreshed:  # fmt: skip
    """Make a robot's model new by the readings of a check, write and record it.

    Raises:
        PostprocError: The robot is not there, or a file cannot be used.
    """
    life, content = Life.of(record, serial), read_input(given.file)
    life.check_moment(given.date)
    cell, current = life.cell(), life.current
    model = life.model(life.surveyed)
    progress("follow the robot since its survey")
    known = life.watch(cell, given.date).knowledge
    rows = life.read_check(content, given.file.name, cell, model, _name(given))
    why = _events_since(life, current.date, given.date)
    found = refresh(known, rows, life.model(current), sha256(content), why)
    progress("by how much programs would move")
    stale = find_stale(life, cell, found.model)
    found.model.save(output)
    check = _survey_of(serial, given, content, cell)
    _record_refresh(record, check, output, found, stale)
    return Refreshed(found, why, tuple(stale))


def _events_since(life: Life, begin: str, until: str) -> str:
    own = [e for e in life.events if begin <= e.date <= until]
    told = [f"{e.kind} {e.joints}".strip() for e in own]
    return "; ".join(told) or UNTOLD


def _record_refresh(
    record: Record, check: SurveyRow, output: Path, found: Refresh,
    stale: list[StaleProgram],
) -> None:  # fmt: skip
    """Record the readings, the model that was made of them, and what it would move."""
    model, made = found.model, read_input(output)
    with record.writing():
        number = record.add(check)
        _retire_model(record, check.serial)
        row = ModelRow(
            model.id, check.serial, check.date, model.parent or "", number, REFRESHED,
            output.name, found.after.mean_mm, CURRENT, made,
        )  # fmt: skip
        record.add(row)
        for program in stale:
            known = program.moves_mm if program.moves_mm >= 0 else None
            record.set_state(program.row, moves_mm=known)


@dataclass(frozen=True)
class Release:
    """A program that was compensated.

    Attributes:
        serial: The robot.
        original, output: The program, and what was written of it.
        model: Id of the model.
        sha256: Hash of what was written.
    """

    serial: str
    original: Path
    output: Path
    model: str
    sha256: str


def note_releases(record: Record, releases: Iterable[Release]) -> int:
    """Record programs that were compensated, but for those that it has as they are.

    Returns:
        How many are new: robots that the record does not have do not count.
    """
    known = {r.serial for r in record.rows(RobotRow)}
    last = {(p.serial, p.path): p for p in record.rows(ProgramRow)}
    new, now = list[ProgramRow](), today()
    for one in releases:
        path = _relative(record, one.original)
        before = last.get((one.serial, path))
        same = before and (before.sha256, before.model) == (one.sha256, one.model)
        if one.serial in known and not same:
            output = _relative(record, one.output)
            new.append(
                ProgramRow(None, one.serial, path, output, one.model, one.sha256, now)
            )
    if new:
        with record.writing():
            for row in new:
                record.add(row)
    return len(new)


def tell_outdated(record: Record, releases: Iterable[Release]) -> list[str]:
    """Say which robots' programs were compensated with another model than the newest.

    Returns:
        A line for each robot and model.
    """
    current = {m.serial: m for m in record.rows(ModelRow) if m.state == CURRENT}
    pairs = sorted({(one.serial, one.model) for one in releases})
    return [
        f"{serial}: compensated with model {model}, but {current[serial].id} "
        f"({current[serial].file}) is the newest in {record.path}"
        for serial, model in pairs
        if serial in current and current[serial].id != model
    ]
