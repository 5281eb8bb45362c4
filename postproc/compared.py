"""Two files line by line: which numbers differ, or what more."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from pathlib import Path

import numpy as np

from postproc.exceptions import ProgramError
from postproc.language.lexis import MaskedLine, mask_line, number_value
from postproc.language.stamp import read_stamp

VARIABLES = ".lsv"


@dataclass(frozen=True)
class Row:
    """One line that differs, or whose target was left alone.

    Attributes:
        file: Name of the original file.
        line: 1-based line in the original; 0 for a line that it does not have.
        target: What the numbers belong to: a variable, or the statement's first word.
        original, compensated: The numbers on the line; empty where the text differs.
        change_mm: Length of the change of the first three of six numbers or more, for
            a position; None for joint angles and text.
        text: The line's two texts where more than numbers differ, else "".
        status, why: What came of the line's target, "" where no record tells.
        direction: In which every joint arrives, see `postproc.arrivals`; or ().
        correction_mm: How far the TCP is moved there, or None.
    """

    file: str
    line: int
    target: str
    original: tuple[float, ...]
    compensated: tuple[float, ...]
    change_mm: float | None
    text: str = ""
    status: str = ""
    why: str = ""
    direction: tuple[int, ...] = ()
    correction_mm: float | None = None


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
        return _entry_name(self.lines, line) if named else _target(self.lines[line - 1])


def _read_lines(path: Path) -> tuple[list[str], bool]:
    """Read a file's lines without their endings; the stamp line is dropped."""
    try:
        data = path.read_bytes()
    except OSError as exc:
        problem = f"cannot be read ({exc.strerror})"
        raise ProgramError(path, problem, "Check the path") from None
    lines = re.split(r"\r\n|\n|\r", data.decode("latin-1"))
    stamped = read_stamp(data) is not None
    return lines[stamped:], stamped


def compare_files(original: Path, compensated: Path) -> Compared:
    """Compare two files line by line.

    Raises:
        ProgramError: A file cannot be read.
    """
    before, _ = _read_lines(original)
    after, stamped = _read_lines(compensated)
    if len(before) == len(after):
        pairs = zip(range(1, len(before) + 1), before, after, strict=True)
        found = [_compare(original.name, *p) for p in pairs if p[1] != p[2]]
    else:
        found = _align(original.name, before, after)
    name = ""
    rows = []
    for row in found:
        if original.suffix.lower() == VARIABLES:
            name = _entry_name(before, row.line)
        rows.append(replace(row, target=name) if name else row)
    return Compared(original, compensated, before, tuple(rows), stamped)


def _compare(file: str, line: int, before: str, after: str) -> Row:
    """Describe how two lines differ."""
    a, b = mask_line(before), mask_line(after)
    same_text = a.mask == b.mask and _comment(before, a) == _comment(after, b)
    old = tuple(number_value(before[s:e]) for s, e in zip(a.start, a.end, strict=True))
    new = tuple(number_value(after[s:e]) for s, e in zip(b.start, b.end, strict=True))
    if not same_text or a.unterminated or old == new:
        return Row(file, line, "", (), (), None, f"{before} -> {after}")
    joints = "{" in before
    moved = np.linalg.norm(np.subtract(new[:3], old[:3])) if len(old) >= 3 else None
    change = None if joints or moved is None else float(moved)
    return Row(file, line, _target(before), old, new, change)


def _comment(line: str, masked: MaskedLine) -> str:
    """Return the comment of a line."""
    return line[masked.comment :] if masked.comment >= 0 else ""


def _target(line: str) -> str:
    """Name what a line's numbers belong to."""
    assigned = re.match(r"\s*([A-Za-z_$][\w$.\[\]]*)\s*(?::=|:)", line)
    if assigned:
        return assigned.group(1)
    words = re.findall(r"[A-Za-z_]+", line)
    return " ".join(words[:2]) if words else ""


def _entry_name(lines: Sequence[str], line: int) -> str:
    """Find the variable that a line of a variable file belongs to."""
    for text in reversed(lines[: max(line, 1)]):
        found = re.match(r"([A-Za-z_]\w*(?:\[[\d, ]+\])?)\s+[A-Z]{3,4}\b", text)
        if found:
            return found.group(1)
    return ""


def _align(file: str, before: list[str], after: list[str]) -> list[Row]:
    """Compare files of different length: match lines by their shape."""
    shapes = [mask_line(t).mask for t in before], [mask_line(t).mask for t in after]
    rows: list[Row] = []
    matcher = SequenceMatcher(None, *shapes, autojunk=False)
    for kind, a0, a1, b0, b1 in matcher.get_opcodes():
        if kind == "equal":
            lines = zip(range(a0 + 1, a1 + 1), before[a0:a1], after[b0:b1], strict=True)
            rows += [_compare(file, *p) for p in lines if p[1] != p[2]]
            continue
        gone = [
            Row(file, k + 1, "", (), (), None, f"- {before[k]}") for k in range(a0, a1)
        ]
        rows += gone + [Row(file, 0, "", (), (), None, f"+ {t}") for t in after[b0:b1]]
    return rows
