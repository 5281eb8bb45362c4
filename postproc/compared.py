"""Two files line by line: which numbers differ, or what more."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from pathlib import Path

from postproc.changed_lines import Row, changed_rows, shapes, target_name
from postproc.exceptions import ProgramError
from postproc.language.stamp import read_stamp

VARIABLES = ".lsv"

_ENTRY = re.compile(r"([A-Za-z_]\w*(?:\[[\d, ]+\])?)\s+[A-Z]{3,4}\b")


@dataclass(frozen=True)
class Compared:
    """Two files, and how they differ.

    Attributes:
        original, compensated: The files.
        lines: Those of the original, without their endings.
        rows: Lines that differ.
        stamped: The second file carries a stamp.
    """

    original: Path
    compensated: Path
    lines: Sequence[str]
    rows: tuple[Row, ...]
    stamped: bool

    def target(self, line: int) -> str:
        """Name what the numbers on a line of the original belong to."""
        named = self.original.suffix.lower() == VARIABLES
        return (
            _entry_name(self.lines, line)
            if named
            else target_name(self.lines[line - 1])
        )


def _read_lines(path: Path) -> tuple[list[str], bool]:
    """Read a file's lines without their endings; the stamp line is dropped."""
    try:
        data = path.read_bytes()
    except OSError as exc:
        problem = f"cannot be read ({exc.strerror})"
        raise ProgramError(path, problem, "Check the path") from None
    text = data.decode("latin-1")
    lines = re.split(r"\r\n|\n|\r", text) if "\r" in text else text.split("\n")
    stamped = read_stamp(data) is not None
    return lines[stamped:], stamped


def compare_files(original: Path, compensated: Path) -> Compared:
    """Compare two files line by line.

    Raises:
        ProgramError: A file cannot be read.
    """
    before, _ = _read_lines(original)
    after, stamped = _read_lines(compensated)
    rows = list(_rows(original.name, before, after))
    if original.suffix.lower() == VARIABLES:
        rows = [
            r._replace(target=_entry_name(before, r.line) or r.target) for r in rows
        ]
    return Compared(original, compensated, before, tuple(rows), stamped)


def _rows(file: str, before: list[str], after: list[str]) -> Iterator[Row]:
    """Describe the lines that differ, in order."""
    if len(before) == len(after):
        yield from changed_rows(file, range(1, len(before) + 1), before, after)
        return
    masks = shapes(before), shapes(after)
    matcher = SequenceMatcher(None, *masks, autojunk=False)
    for kind, a0, a1, b0, b1 in matcher.get_opcodes():
        if kind == "equal":
            lines = range(a0 + 1, a1 + 1)
            yield from changed_rows(file, lines, before[a0:a1], after[b0:b1])
            continue
        for k in range(a0, a1):
            yield Row(file, k + 1, "", (), (), None, f"- {before[k]}")
        for text in after[b0:b1]:
            yield Row(file, 0, "", (), (), None, f"+ {text}")


def _entry_name(lines: Sequence[str], line: int) -> str:
    """Find the variable that a line of a variable file belongs to."""
    for k in range(max(line, 1) - 1, -1, -1):
        found = _ENTRY.match(lines[k])
        if found:
            return found.group(1)
    return ""
