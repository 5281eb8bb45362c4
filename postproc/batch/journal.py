"""The log of a run, one JSON object a line, from which a later run resumes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from postproc.exceptions import OutputError
from postproc.files import disk_error, write_all

FORMAT = 1


@dataclass(frozen=True)
class Entry:
    """What came of one unit, or of one other file.

    Attributes:
        place: The main program, or the file, below the source tree.
        status: ``done``, ``left`` (not all targets), ``failed``, ``copied``,
            ``removed`` or ``known`` (written by an earlier run).
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


def entry_from(data: Mapping[str, Any]) -> Entry:
    """Take a line of the log apart.

    Raises:
        KeyError, TypeError, ValueError, AttributeError: It is no such line.
    """
    outputs = {str(k): str(v) for k, v in data.get("outputs", {}).items()}
    facts = {k: v for k, v in data.items() if k not in _OWN}
    return Entry(
        str(data["file"]),
        str(data["status"]),
        int(data["exit"]),
        str(data.get("digest", "")),
        outputs,
        facts,
    )


def read_entries(path: Path) -> dict[str, Entry]:
    """Read the last entry of every file; a torn or foreign line does not count."""
    entries: dict[str, Entry] = {}
    try:
        lines = path.read_bytes().splitlines()
    except OSError:
        return entries
    for line in lines:
        try:
            entry = entry_from(json.loads(line))
        except (KeyError, TypeError, ValueError, AttributeError, RecursionError):
            continue
        entries[entry.place] = entry
    return entries


class Journal:
    """The log of the run that is on.

    It begins with what earlier runs have written, so that nothing of theirs is
    forgotten when this one is cut short.
    """

    def __init__(self, path: Path, known: Iterable[Entry]) -> None:
        """Replace the log of the run before.

        Raises:
            OutputError: It cannot be written.
        """
        self.path = path
        head = json.dumps({"postproc-batch": FORMAT}) + "\n"
        write_all({path: (head + "".join(e.line() for e in known)).encode()})
        self._file: IO[bytes] = path.open("ab")

    def add(self, entry: Entry) -> None:
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
