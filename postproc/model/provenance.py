"""Where a model comes from: no part of what it says, so no part of its id."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime

from postproc import __version__
from postproc.robot.cell import Cell


@dataclass(frozen=True)
class Provenance:
    """Where a model comes from.

    Attributes:
        date: Of the fit, as 2026-11-27 (UTC).
        arm: Name of the arm.
        serial_number: Of the robot, None where the cell states none.
        instrument: What measured, None where the cell states none.
        software: Name and version of what fitted the model.
    """

    date: str
    arm: str
    serial_number: str | None
    instrument: str | None
    software: str

    @classmethod
    def today(cls, cell: Cell) -> Provenance:
        """Return that of a model that is fitted now, for the arm of a cell."""
        return cls(
            date=datetime.now(UTC).date().isoformat(),
            arm=cell.arm.name,
            serial_number=cell.file.robot.serial_number,
            instrument=cell.measurements.instrument,
            software=f"postproc {__version__}",
        )

    def __str__(self) -> str:
        """Return it as a line."""
        serial, instrument = self.serial_number, self.instrument
        parts = [
            f"fitted on {self.date} by {self.software} for {self.arm}",
            "" if serial is None else f"serial number {serial}",
            "" if instrument is None else f"measured by {instrument}",
        ]
        return ", ".join(filter(None, parts))
