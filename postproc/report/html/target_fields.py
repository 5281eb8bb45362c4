"""The columns of the table of targets: of the page, its sheets, and `--table`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from postproc.arrays import Floats
from postproc.compensation.outcome import Status
from postproc.report.html.page_columns import MOVES, VERDICTS, PageColumns
from postproc.report.sheets import Cell, Sheet

DECIMALS = 3
ARROWS = ("↓", "·", "↑")  # a joint arrives downwards, unknown, upwards
NUMBER = "number"
Cells = Callable[[PageColumns], Sequence[Cell]]


@dataclass(frozen=True)
class TargetField:
    """A column of the table of targets.

    Attributes:
        key: By which the page's scripts know it.
        label: Its heading.
        title: What it holds, "" where the heading says so.
        kind: How the page aligns it.
        down: Whether the page sorts it downwards first.
    """

    key: str
    label: str
    title: str = ""
    kind: str = ""
    down: bool = False

    @property
    def heading(self) -> str:
        """Return the heading on a sheet."""
        told = self.title and self.kind == NUMBER
        return f"{self.label} ({self.title})" if told else self.label


def _length(key: str, label: str, title: str, down: bool = True) -> TargetField:
    return TargetField(key, label, f"{title} [mm]", NUMBER, down)


def _of(values: Floats) -> list[Cell]:
    """Round numbers; what is not known is empty."""
    rounded = np.round(values, DECIMALS).tolist()
    return ["" if x != x else x for x in rounded]


def _correction(c: PageColumns, values: Floats) -> list[Cell]:
    """Write something of a correction where there is one."""
    return _of(np.where(c.size_mm > 0.0, values, np.nan))


def _axis(k: int) -> tuple[TargetField, Cells]:
    name = f"d{'xyz'[k]}"
    field = _length(name, name, f"{name} of the correction, base frame", down=False)
    return field, lambda c: _correction(c, c.correction_mm[:, k])


def _texts(texts: Sequence[str], index: Any) -> list[Cell]:
    return [texts[k] for k in index.tolist()]


def _places(c: PageColumns) -> list[Cell]:
    lines: list[Cell] = c.line.tolist()
    if len(set(c.file.tolist())) < 2:
        return lines
    return [f"{c.files[f]}:{n}" for f, n in zip(c.file.tolist(), lines, strict=True)]


COLUMNS: tuple[tuple[TargetField, Cells], ...] = (
    (
        TargetField("visit", "#", "Number of the visit, in program order", NUMBER),
        lambda c: c.visit.tolist(),
    ),
    (TargetField("line", "line", "Line of the move in the source", NUMBER), _places),
    (TargetField("name", "target"), lambda c: _texts(c.names, c.name)),
    (TargetField("move", "move"), lambda c: _texts(MOVES, c.move)),
    (
        TargetField("status", "status", kind="status"),
        lambda c: [Status(k).name.lower() for k in c.status.tolist()],
    ),
    (
        _length("expected", "error mm", "Expected true error with the correction"),
        lambda c: _of(c.expected_mm[:, 1]),
    ),
    (
        _length("bound", "95 % mm", "The error is below this with 95 % probability"),
        lambda c: _of(c.expected_mm[:, 2]),
    ),
    (
        TargetField("verdict", "verdict", "Against the tolerance of the job"),
        lambda c: _texts(VERDICTS, c.verdict),
    ),
    (
        _length("before", "before mm", "Expected true error without any correction"),
        lambda c: _of(c.expected_mm[:, 0]),
    ),
    (
        _length("size", "|c| mm", "Length of the correction"),
        lambda c: _correction(c, c.size_mm),
    ),
    *map(_axis, range(3)),
    (
        _length("sigma", "± mm", "Standard error of the model, length over the axes"),
        lambda c: _of(np.linalg.norm(c.std_mm, axis=1)),
    ),
    (
        TargetField(
            "sides", "J1–6", "Direction of each joint: ↑ +, ↓ −, · unknown", "sides"
        ),
        lambda c: [
            "".join(ARROWS[d + 1] for d in row) for row in np.sign(c.direction).tolist()
        ],
    ),
    (TargetField("why", "reason", kind="why"), lambda c: _texts(c.reasons, c.why)),
)
FIELDS = [asdict(field) for field, _ in COLUMNS]  # what the page's scripts are told


def target_sheet(columns: PageColumns) -> Sheet:
    """Return all targets as a sheet, in program order."""
    head: tuple[Cell, ...] = tuple(field.heading for field, _ in COLUMNS)
    body = zip(*(cells(columns) for _, cells in COLUMNS), strict=True)
    return Sheet("targets", (head, *body))
