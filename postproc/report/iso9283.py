"""Figures after ISO 9283 as text, JSON and a page, of one test or before and after."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from postproc.calibration.iso9283.figures import IsoFigures, IsoValue
from postproc.files import schema
from postproc.report.json import finite
from postproc.report.terminal import Column, table_text
from postproc.robot.pose import MM

UNSTATED = "not stated"
NOTES = (
    "after ISO 9283:1998: the formulas are those of the literature, the norm's text "
    "could not be read",
    "+- is 95 % by the scatter of the cycles; the uncertainty of the instrument is "
    "not in it",
)
LARGEST = "largest"


@dataclass(frozen=True)
class IsoReport:
    """A test, and the one before the arm was compensated where there is one.

    Attributes:
        after: The figures.
        before: Those of the test before, or None.
        load: What the arm carried, in words, "" where that is not known.
        speed: How fast it went, likewise.
        files: The files that were read, with their hashes.
    """

    after: IsoFigures
    before: IsoFigures | None
    load: str
    speed: str
    files: tuple[tuple[str, str], ...]

    @property
    def rows(self) -> Iterator[tuple[IsoValue, IsoValue | None]]:
        """Pair every figure with that of the test before."""
        for part in ("values", "largest"):
            known = {} if self.before is None else _by_place(self.before, part)
            for value in getattr(self.after, part):
                yield _as_shown(value, part), known.get(_key(value, part))

    @property
    def conditions(self) -> tuple[str, ...]:
        """State the conditions of the test, as a value after the norm needs them."""
        told = [f"load {self.load or UNSTATED}, speed {self.speed or UNSTATED}"]
        for name, xyz in self.after.positions.items():
            place = np.round(np.array(xyz) / MM, 3) + 0.0  # no -0.000
            told.append(f"{name} at {', '.join(f'{v:.3f}' for v in place)} mm")
        if self.after.best_fit:
            told.append(f"after best fit: {self.after.best_fit}; it makes AP smaller")
        elif self.before is not None and self.before.best_fit:
            told.append(f"before: after best fit: {self.before.best_fit}")
        return (*told, *NOTES)


def _by_place(figures: IsoFigures, part: str) -> dict[tuple[str, str], IsoValue]:
    return {_key(value, part): value for value in getattr(figures, part)}


def _key(value: IsoValue, part: str) -> tuple[str, str]:
    """Tell figures apart; of the largest one the place may be another one."""
    return value.name, value.place if part == "values" else ""


def _as_shown(value: IsoValue, part: str) -> IsoValue:
    place = value.place if part == "values" else f"{LARGEST}: {value.place}"
    return IsoValue(
        value.name, place, value.size, value.uncertainty, value.count, value.remark
    )


def tell_iso(report: IsoReport) -> str:
    """Write the report for a terminal."""
    now = (Column("mm"), Column("+- mm"), Column("n"), Column("", "left"))
    was = () if report.before is None else (Column("before mm"), Column("+- mm"))
    columns = (Column("figure", "left"), Column("of", "left"), *was, *now)
    rows = [_cells(*pair, report.before is not None) for pair in report.rows]
    return "\n".join([table_text(columns, rows), *report.conditions])


def _cells(value: IsoValue, before: IsoValue | None, paired: bool) -> tuple[str, ...]:
    was = () if before is None else (mm(before.size), mm(before.uncertainty))
    was = ("-", "-") if paired and not was else was
    now = (mm(value.size), mm(value.uncertainty), str(value.count), value.remark)
    return (value.name, value.place, *was, *now)


def mm(size: float) -> str:
    """Write a length [m] in mm, - where it is not known."""
    return "-" if np.isnan(size) else f"{size / MM:.4f}"


def iso_json(report: IsoReport) -> str:
    """Return the report as JSON text; lengths in mm."""
    said = {
        **schema("iso9283"),
        "after": _figures(report.after),
        "before": None if report.before is None else _figures(report.before),
        "load": report.load or None,
        "speed": report.speed or None,
        "notes": list(NOTES),
        "files": [
            {"path": Path(f).name, "sha256": digest} for f, digest in report.files
        ],
    }
    return json.dumps(finite(said), indent=1, allow_nan=False) + "\n"


def _figures(figures: IsoFigures) -> dict[str, Any]:
    return {
        "values": [_value(value) for value in figures.values],
        "largest": [_value(value) for value in figures.largest],
        "positions_mm": {
            name: [v / MM for v in xyz] for name, xyz in figures.positions.items()
        },
        "best_fit": figures.best_fit or None,
    }


def _value(value: IsoValue) -> dict[str, Any]:
    said = asdict(value)
    size, spread = said.pop("size"), said.pop("uncertainty")
    return {**said, "mm": size / MM, "uncertainty_mm": spread / MM,
            "iso": not value.remark}  # fmt: skip


def iso_page(report: IsoReport) -> str:
    """Return the page (HTML) of the report."""
    from postproc.report.html.page import render  # loads plotly

    return render(
        "iso9283.html.j2",
        "Figures after ISO 9283",
        {"figures": {}},
        ("page.js", "sheets.js", "figures.js"),
        rows=list(report.rows),
        paired=report.before is not None,
        conditions=report.conditions,
        files=[(Path(name).name, digest) for name, digest in report.files],
        mm_text=mm,
    )
