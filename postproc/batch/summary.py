"""What came of a run: the table, the lists, the exit code."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from postproc.batch.journal import Entry

LISTED = 20  # programs that are listed on the terminal; the log lists all

ROWS = {
    "done": "compensated",
    "left": "compensated, targets left alone",
    "failed": "not compensated, absent",
    "copied": "copied",
}


@dataclass
class Count:
    """Sums over the files of one row of the table."""

    files: int = 0
    skipped: int = 0
    visits: int = 0
    left: int = 0


@dataclass
class Summary:
    """What came of a run.

    Attributes:
        counts: By status.
        problems: Files that are absent from the target tree, and why.
        left: Programs with targets left alone, and how many.
        removed: Files of earlier runs that no source stands for any more.
        notes: What a person should know: path and text.
        stopped: The user stopped the run before its end.
    """

    counts: dict[str, Count] = field(default_factory=dict)
    problems: list[tuple[str, str]] = field(default_factory=list)
    left: list[tuple[str, int]] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    notes: tuple[tuple[str, str], ...] = ()
    stopped: bool = False
    worst: int = 0

    def add(self, entry: Entry) -> None:
        """Take in what came of a unit or a file."""
        count = self.counts.setdefault(entry.status, Count())
        count.files += 1
        count.skipped += entry.skipped
        count.visits += entry.facts.get("visits", 0)
        count.left += entry.facts.get("left", 0)
        self.worst = max(self.worst, entry.exit_code)
        if entry.status == "failed":
            self.problems.append((entry.place, entry.facts.get("error", "")))
        if entry.status == "left":
            self.left.append((entry.place, entry.facts.get("left", 0)))

    @property
    def files(self) -> int:
        """Return the number of units and files that are done."""
        return sum(count.files for count in self.counts.values())

    @property
    def exit_code(self) -> int:
        """Return that of the worst file; a run that was stopped could not."""
        return 2 if self.stopped else self.worst

    def rows(self) -> list[tuple[str, ...]]:
        """Return the cells of the table, one row for every status there is."""
        rows = []
        for status, title in ROWS.items():
            count = self.counts.get(status)
            if count is None:
                continue
            figures = (count.files, count.skipped, count.visits, count.left)
            rows.append((title, *(str(n) if n else "-" for n in figures)))
        return rows

    def lists(self) -> list[str]:
        """Say which programs are absent, have targets left alone, were removed."""
        return [
            *_some("absent", (f"{place}: {why}" for place, why in self.problems)),
            *_some("left alone", (f"{p}: {_left(n)}" for p, n in self.left)),
            *_some("note", (f"{place}: {why}" for place, why in self.notes)),
            *_some("removed, no source any more", self.removed),
        ]


TITLES = ("programs and files", "files", "unchanged", "visits", "left alone")


def _left(visits: int) -> str:
    """Say what of a program was left alone."""
    return f"{visits} visits" if visits else "moves that are never reached"


def _some(title: str, items: Iterable[str]) -> list[str]:
    """List the first items, and say how many more there are."""
    found = list(items)
    lines = [f"{title}: {item}" for item in found[:LISTED]]
    if len(found) > LISTED:
        lines.append(f"{title}: .. and {len(found) - LISTED} more (in the log)")
    return lines
