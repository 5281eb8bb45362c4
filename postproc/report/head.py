"""The head of a report: which robot, which program, when, with what, by whom."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import date
from typing import Any, Self

from postproc import __version__
from postproc.compensation.outcome import Outcome


@dataclass(frozen=True)
class ReportHead:
    """What somebody must know who signs a report; None where it is not known.

    Attributes:
        arm: Name of the arm.
        serial_number: Of the robot.
        operator: Who is responsible, as the cell has it.
        date: Day on which the report was written, ISO 8601.
        software: What wrote it.
        model: Id of the model.
        model_date: Day on which it was fitted.
        instrument: What measured for the model.
        files: SHA-256 of every file of the program by name: ``source`` and ``output``.
    """

    arm: str | None = None
    serial_number: str | None = None
    operator: str | None = None
    date: str | None = None
    software: str | None = None
    model: str | None = None
    model_date: str | None = None
    instrument: str | None = None
    files: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    @classmethod
    def of_outcome(cls, outcome: Outcome) -> Self:
        """Describe a compensation."""
        hashes = {
            name: {"source": file.source_sha256, "output": file.output_sha256}
            for name, file in outcome.record.files.items()
        }
        head = cls(
            date=date.today().isoformat(), software=f"postproc {__version__}",
            model=outcome.model, files=hashes,
        )  # fmt: skip
        if outcome.arrivals is None:
            return head
        robot, made = outcome.arrivals.cell.file, outcome.arrivals.model.provenance
        return head.with_robot(
            arm=outcome.arrivals.cell.arm.name, operator=robot.job.operator,
            serial_number=robot.robot.serial_number,
            model_date=None if made is None else made.date,
            instrument=None if made is None else made.instrument,
        )  # fmt: skip

    @classmethod
    def of_model(cls, model: str, data: str, made: Mapping[str, Any]) -> Self:
        """Describe a model.

        Args:
            model: Its id.
            data: SHA-256 of its measurements.
            made: Its provenance, as the model file has it; empty where not known.
        """
        names = ("arm", "serial_number", "software", "instrument")
        return cls(
            model=model, model_date=made.get("date"),
            files={"measurements": {"source": data}},
            **{name: made.get(name) for name in names},
        )  # fmt: skip

    @classmethod
    def from_json(cls, given: Mapping[str, Any]) -> Self:
        """Take the head out of a report; what it lacks is not known."""
        known = cls.__dataclass_fields__
        return cls(**{name: value for name, value in given.items() if name in known})

    def with_robot(self, **known: str | None) -> Self:
        """Return it with further entries."""
        return type(self)(**{**vars(self), **known})

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON values."""
        return asdict(self)

    def rows(self) -> list[tuple[str, str]]:
        """Return its entries as people read them; "" is to be filled in by hand."""
        made = f", fitted on {self.model_date}" if self.model_date else ""
        entries = {
            "robot": self.arm,
            "serial number": self.serial_number,
            "model": f"{self.model}{made}" if self.model else None,
            "instrument": self.instrument,
            "operator": self.operator,
            "date": self.date,
            "software": self.software,
        }
        rows = [(name, value or "") for name, value in entries.items()]
        for name, hashes in self.files.items():
            for what, digest in hashes.items():
                rows.append((f"SHA-256 of {name}, {what}", digest))
        return rows
