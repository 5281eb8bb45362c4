"""How to read a measurement file, where what is detected would be wrong."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from postproc.exceptions import PostprocError

UNITS = {"mm": 1.0, "m": 1000.0, "inch": 25.4}  # mm per unit
NAMED = {"tab": "\t", "space": r"\s+", "comma": ",", "semicolon": ";"}


@dataclass(frozen=True)
class Reading:
    """What a user knows of a file; None is detected.

    Attributes:
        columns: A column-map file, see `postproc.accuracy.formats`.
        delimiter: Between cells, itself or by name (tab, space, comma, semicolon).
        decimal: "." or ",".
        encoding: Name of a Python codec.
        unit: Of coordinates in files that do not say it: mm, m or inch.
    """

    columns: Path | None = None
    delimiter: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    unit: str = "mm"

    def __post_init__(self) -> None:
        if self.decimal not in (None, ".", ","):
            raise PostprocError(f"decimal {self.decimal!r}: write . or ,")
        if self.unit not in UNITS:
            raise PostprocError(f"unit {self.unit!r}: write {', '.join(UNITS)}")

    @property
    def given(self) -> dict[str, str]:
        """Options of `read_table` that a user has given."""
        delimiter = self.delimiter and NAMED.get(self.delimiter, self.delimiter)
        options = {
            "delimiter": delimiter,
            "decimal": self.decimal,
            "encoding": self.encoding,
        }
        return {name: value for name, value in options.items() if value}

    @property
    def mm_per_unit(self) -> float:
        """Millimetres per unit of coordinates."""
        return UNITS[self.unit]


DETECT = Reading()
