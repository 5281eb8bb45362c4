"""The log of a run, one JSON object a line; its summary; where the next run resumes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from postproc.exceptions import OutputError
from postproc.files import disk_error, write_all

# The log of a run, one JSON object a line, from which a later run resumes.

FORMAT = 1


@dataclass(frozen=True)
class JournalEntry:
    """What came of one unit, or of one other file.

    Attributes:
        place: The main program, or the file, below the source tree.
        status: ``done``, ``uncorrected`` (not all targets are corrected), ``failed``,
            ``copied``, ``removed`` or ``known`` (written by an earlier run).
        exit_code: 0, 1 or 2.
        digest: Hash of all that decided it.
        outputs: SHA-256 of what was written, by path below the target tree.
        facts: Counts, figures and findings, or ``error``.
        skipped: Nothing had changed since an earlier run; not in the log.
    """

    place: str
    status: str
    exit_code: int = 0
    digest: str = ""
    outputs: Mapping[str, str] = field(default_factory=dict)
    facts: Mapping[str, Any] = field(default_factory=dict)
    skipped: bool = False

    def line(self) -> str:
        """Return it as a line of the log: ASCII, control characters escaped."""
        head = {"file": self.place, "status": self.status, "exit": self.exit_code}
        tail: dict[str, Any] = {"digest": self.digest} if self.digest else {}
        tail |= {"outputs": dict(self.outputs)} if self.outputs else {}
        return json.dumps({**head, **self.facts, **tail}) + "\n"


_OWN = ("file", "status", "exit", "digest", "outputs")
_BEFORE = {
    "safe": "corrected",
    "left": "uncorrected",
    "left_alone": "uncorrected_lines",
}  # words of version 0.1.0


def read_entries(path: Path) -> dict[str, JournalEntry]:
    """Read the last entry of every file; a torn or foreign line does not count."""
    entries: dict[str, JournalEntry] = {}
    try:
        lines = path.read_bytes().splitlines()
    except OSError:
        return entries
    for line in lines:
        try:
            data = json.loads(line)
            outputs = {str(k): str(v) for k, v in data.get("outputs", {}).items()}
            facts = {_BEFORE.get(k, k): v for k, v in data.items() if k not in _OWN}
            entry = JournalEntry(
                str(data["file"]),
                _BEFORE.get(data["status"], str(data["status"])),
                int(data["exit"]),
                str(data.get("digest", "")),
                outputs,
                facts,
            )
        except (KeyError, TypeError, ValueError, AttributeError, RecursionError):
            continue
        entries[entry.place] = entry
    return entries


class Journal:
    """The log of the run that is on.

    It begins with what earlier runs have written, so that nothing of theirs is
    forgotten when this one is cut short.
    """

    def __init__(self, path: Path, known: Iterable[JournalEntry]) -> None:
        """Replace the log of the run before.

        Raises:
            OutputError: It cannot be written.
        """
        self.path = path
        head = json.dumps({"postproc-batch": FORMAT}) + "\n"
        write_all({path: (head + "".join(e.line() for e in known)).encode()})
        self._file: IO[bytes] = path.open("ab")

    def add(self, entry: JournalEntry) -> None:
        """Write an entry; it is in the hands of the system when this returns.

        Raises:
            OutputError: It cannot be written.
        """
        try:
            self._file.write(entry.line().encode())
            self._file.flush()
        except OSError as exc:
            raise disk_error(exc, self.path) from None

    def close(self) -> None:
        """Close the log."""
        try:
            self._file.close()
        except OSError as exc:
            raise OutputError(self.path, str(exc), "Make room for the log") from None


# What came of a run: the table, the lists, the exit code.

LEFT_OTHERWISE = "moves or calls that are not followed, see its findings"
LISTED = 20  # programs that are listed on the terminal; the log lists all

ROWS = {
    "done": "compensated",
    "uncorrected": "compensated, targets not corrected",
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
        stopped: The signal with which the user stopped the run before its end, or 0.
    """

    counts: dict[str, Count] = field(default_factory=dict)
    problems: list[tuple[str, str]] = field(default_factory=list)
    left: list[tuple[str, int]] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    notes: tuple[tuple[str, str], ...] = ()
    stopped: int = 0
    worst: int = 0

    def add(self, entry: JournalEntry) -> None:
        """Take in what came of a unit or a file."""
        count = self.counts.setdefault(entry.status, Count())
        count.files += 1
        count.skipped += entry.skipped
        count.visits += entry.facts.get("visits", 0)
        count.left += entry.facts.get("uncorrected", 0)
        self.worst = max(self.worst, entry.exit_code)
        if entry.status == "failed":
            self.problems.append((entry.place, entry.facts.get("error", "")))
        if entry.status == "uncorrected":
            self.left.append((entry.place, entry.facts.get("uncorrected", 0)))

    @property
    def files(self) -> int:
        """Return the number of units and files that are done."""
        return sum(count.files for count in self.counts.values())

    @property
    def exit_code(self) -> int:
        """Return that of the worst file; 128 + signal for a run that was stopped."""
        return 128 + self.stopped if self.stopped else self.worst

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
        """Return which programs are absent, have uncorrected targets, were removed."""
        left = (
            (place, f"{n} visits" if n else LEFT_OTHERWISE) for place, n in self.left
        )
        return [
            *_some("absent", (f"{place}: {why}" for place, why in self.problems)),
            *_some("not corrected", (f"{place}: {why}" for place, why in left)),
            *_some("note", (f"{place}: {why}" for place, why in self.notes)),
            *_some("removed, its source is gone", self.removed),
        ]


TITLES = ("programs and files", "files", "unchanged", "visits", "not corrected")


def _some(title: str, items: Iterable[str]) -> list[str]:
    """List the first items, and say how many more there are."""
    found = list(items)
    lines = [f"{title}: {item}" for item in found[:LISTED]]
    if len(found) > LISTED:
        lines.append(f"{title}: .. and {len(found) - LISTED} more (in the log)")
    return lines
