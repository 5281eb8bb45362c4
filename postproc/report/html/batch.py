"""The page of a batch: every program of a tree, what came of it, and why."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from postproc.report.html.figure import BINS, Figure, bars, figure
from postproc.report.html.page import render

SCRIPTS = ("page.js", "sheets.js", "figures.js")
Entry = tuple[str, str, Mapping[str, Any]]  # path, status and facts of a file

PROGRAM = (
    "done",
    "uncorrected",
    "failed",
)  # statuses of programs, the others are of files
SAID = {
    "done": "compensated",
    "uncorrected": "targets not corrected",
    "failed": "absent",
}
CLASS = {
    "done": "corrected",
    "uncorrected": "rejected",
    "failed": "conflict",
}  # of the style sheet


@dataclass(frozen=True)
class BatchRow:
    """What the page says of a program; mm are None where nothing came of it.

    Attributes:
        place: Its path below the trees, with ``/``.
        status: ``done``, ``left`` or ``failed``.
        facts: What the log holds of it.
    """

    place: str
    status: str
    facts: Mapping[str, Any]

    @property
    def said(self) -> str:
        """Say its status."""
        return SAID[self.status]

    @property
    def style(self) -> str:
        """Name the style of its status."""
        return CLASS[self.status]

    def count(self, name: str) -> int | None:
        """Return a number of visits."""
        value = self.facts.get(name)
        return value if isinstance(value, int) else None

    def mm(self, name: str, figure: str | None = None) -> float | None:
        """Return a length [mm], of a statistic one of its figures."""
        value = self.facts.get(name)
        if figure is not None:
            value = value.get(figure) if isinstance(value, dict) else None
        return float(value) if isinstance(value, int | float) else None

    @property
    def remarks(self) -> list[str]:
        """List why it is absent, what was left alone, and what else was found."""
        error = self.facts.get("error")
        lists = (self.facts.get("uncorrected_lines"), self.facts.get("findings"))
        found = [str(line) for part in lists for line in part or ()]
        if worst := self.facts.get("worst"):
            found.insert(0, str(worst))
        return [str(error), *found] if error else found


def batch_report(title: str, entries: Iterable[Entry]) -> str:
    """Make the page of a batch.

    Args:
        title: What was compensated.
        entries: Path, status and facts of every file, as in the log of the batch.
    """
    found = list(entries)
    rows = [BatchRow(*entry) for entry in found if entry[1] in PROGRAM]
    worst = {"failed": 0, "uncorrected": 1, "done": 2}
    rows.sort(key=lambda row: (worst[row.status], row.place))
    largest = [mm for row in rows if (mm := row.mm("largest_mm")) is not None]
    return render(
        "batch.html.j2",
        title,
        {"figures": {"largest": corrections(largest)} if largest else {}},
        SCRIPTS,
        heading=title,
        rows=rows,
        counts={name: sum(row.status == name for row in rows) for name in PROGRAM},
        others=sum(entry[1] == "copied" for entry in found),
        visits=sum(row.count("visits") or 0 for row in rows),
        alone=sum(row.count("uncorrected") or 0 for row in rows),
        largest=max(largest, default=None),
    )


def corrections(largest: list[float]) -> Figure:
    """Show how large the largest corrections of programs are."""
    counts, edges = np.histogram(largest, bins=min(BINS, len(set(largest)) + 1))
    middle = (edges[1:] + edges[:-1]) / 2
    shown = bars("programs", np.round(middle, 4).tolist(), counts.tolist())
    return figure([shown], "largest correction of a program [mm]", "programs")
