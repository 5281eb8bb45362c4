"""What the record knows of a robot: its model, and all that has come since."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime

from postproc.calibration.survey_files import read_measurements, survey_frame
from postproc.exceptions import RecordError
from postproc.model.model import Model, load_model
from postproc.record.check_rows import CheckRows, place_check
from postproc.record.control import Watch
from postproc.record.database import Record
from postproc.record.events import Event
from postproc.record.knowledge import Knowledge
from postproc.record.rows import (
    CHECK,
    CURRENT,
    FITTED,
    EventRow,
    ModelRow,
    RobotRow,
    SurveyRow,
    VerdictRow,
)
from postproc.robot.cell import Cell, load_cell

ADD = "Add it: postproc robot add SERIAL --cell CELL.toml --model MODEL.json"


def today() -> str:
    """Return this moment as the record writes it, UTC."""
    return datetime.now(UTC).replace(tzinfo=None).isoformat(timespec="seconds")


def moment(text: str | None) -> str:
    """Return a moment as the record writes it; None: now.

    >>> moment("2026-11-28")
    '2026-11-28T00:00:00'

    Raises:
        ValueError: It is no date.
    """
    if text is None:
        return today()
    at = datetime.fromisoformat(text)
    at = at if at.tzinfo is None else at.astimezone(UTC).replace(tzinfo=None)
    return at.isoformat(timespec="seconds")


@dataclass(frozen=True, eq=False)
class Life:
    """A robot with all that the record has of it.

    Attributes:
        record: The record.
        robot: The robot.
        models: Its models, as they were added.
        surveys: What was measured.
        events: What happened.
        verdicts: What checks said.
    """

    record: Record
    robot: RobotRow
    models: tuple[ModelRow, ...]
    surveys: tuple[SurveyRow, ...]
    events: tuple[EventRow, ...]
    verdicts: tuple[VerdictRow, ...]

    @classmethod
    def of(cls, record: Record, serial: str) -> Life:
        """Read all of a robot.

        Raises:
            RecordError: The record does not have it.
        """
        robots = record.rows(RobotRow, serial)
        if not robots:
            raise RecordError(record.path, f"has no robot {serial}", ADD)
        return cls(
            record,
            robots[0],
            tuple(record.rows(ModelRow, serial)),
            tuple(record.rows(SurveyRow, serial)),
            tuple(record.rows(EventRow, serial)),
            tuple(record.rows(VerdictRow, serial)),
        )

    @property
    def current(self) -> ModelRow:
        """The model that programs are compensated with.

        Raises:
            RecordError: It has none.
        """
        for row in reversed(self.models):
            if row.state == CURRENT:
                return row
        raise RecordError(self.record.path, f"{self.robot.serial} has no model", ADD)

    @property
    def surveyed(self) -> ModelRow:
        """The newest model that was fitted to a survey: checks count from there.

        Raises:
            RecordError: There is none.
        """
        for row in reversed(self.models):
            if row.origin == FITTED:
                return row
        raise RecordError(self.record.path, f"{self.robot.serial} has no model", ADD)

    def cell(self) -> Cell:
        """Load the cell of the robot.

        Raises:
            PostprocError: It cannot be read.
        """
        return load_cell(self.record.path.parent / self.robot.cell)

    def model(self, row: ModelRow) -> Model:
        """Read a model of the record."""
        return load_model(row.content, name=row.file)

    def check_moment(self, date: str) -> None:
        """Refuse what happened before the survey of the robot's model.

        Raises:
            RecordError: It did.
        """
        begun = self.surveyed.date
        if date < begun:
            problem = f"{date} is before the model of {begun}, from which on it counts"
            raise RecordError(self.record.path, problem, "Correct --at")

    def read_check(
        self, content: bytes, file: str, cell: Cell, model: Model, program: str = ""
    ) -> CheckRows:
        """Read the readings of a check.

        Args:
            content: Of the file.
            file: Its name.
            cell: Of the robot.
            model: Of its survey.
            program: That was measured, "" without.

        Raises:
            MeasurementError: They cannot be used.
        """
        rows = read_measurements(content, cell=cell, name=file, program=program or None)
        return place_check(rows, cell.arm, model, survey_frame(cell, None))

    def watch(self, cell: Cell, until: str, sha256: str = "") -> Watch:
        """Follow the robot from its survey through all checks and events.

        Args:
            cell: Of the robot.
            until: A moment.
            sha256: Hash of readings that do not count, because they are to be judged.
        """
        row = self.surveyed
        model = self.model(row)
        watch = Watch(Knowledge.of(model, cell.arm))
        for one in self._since(row.date, until):
            if isinstance(one, SurveyRow) and one.sha256 == sha256:
                continue
            if isinstance(one, EventRow):
                watch = watch.after(event_of(one))
            else:
                rows = self.read_check(one.content, one.file, cell, model, one.program)
                watch = watch.take_in(rows)
        return watch

    def _since(self, begin: str, until: str) -> Iterator[EventRow | SurveyRow]:
        """Yield events, and checks that were in control or read for a refresh."""
        told = {v.survey: v.in_control for v in self.verdicts}
        counted = [
            s for s in self.surveys if s.kind == CHECK and told.get(s.id or 0, 1)
        ]
        every: list[EventRow | SurveyRow] = [*self.events, *counted]
        every = [x for x in every if begin <= x.date <= until]
        yield from sorted(every, key=lambda x: (x.date, x.table != "event", x.id or 0))


def event_of(row: EventRow) -> Event:
    """Return what happened."""
    joints = tuple(int(j) for j in row.joints.split(",") if j)
    return Event(row.kind, joints)
