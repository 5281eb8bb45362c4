"""What differs between two programs: the numbers of targets, or more."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass
from difflib import SequenceMatcher
from pathlib import Path

import numpy as np

from postproc.console import Column, print_table
from postproc.exceptions import ProgramError
from postproc.language.lexis import MaskedLine, mask_line, number_value
from postproc.language.stamp import read_stamp

DECIMALS = 4  # shown of a number
COLUMNS = (
    Column("file", "left"),
    Column("line"),
    Column("target", "left"),
    Column("original", fold=True),
    Column("compensated", fold=True),
    Column("change [mm]"),
)
VARIABLES = ".lsv"


@dataclass(frozen=True)
class Row:
    """One line that differs.

    Attributes:
        file: Name of the original file.
        line: 1-based line in the original; 0 for a line that it does not have.
        target: What the numbers belong to: a variable, or the statement's first word.
        original, compensated: The numbers on the line; empty where the text differs.
        change_mm: Length of the change of the first three of six numbers or more, for
            a position; None for joint angles and text.
        text: The line's two texts where more than numbers differ, else "".
    """

    file: str
    line: int
    target: str
    original: tuple[float, ...]
    compensated: tuple[float, ...]
    change_mm: float | None
    text: str = ""

    def cells(self) -> list[str]:
        """Write the row for a table."""
        size = "" if self.change_mm is None else f"{self.change_mm:.3f}"
        head = [self.file, str(self.line or ""), self.target]
        if self.text:
            return [*head, self.text, "", size]
        moved = [i for i, old in enumerate(self.original) if old != self.compensated[i]]
        pairs = [
            ", ".join(f"{values[i]:.{DECIMALS}f}" for i in moved)
            for values in (self.original, self.compensated)
        ]
        return [*head, *pairs, size]


@dataclass(frozen=True)
class Difference:
    """All rows in which two programs (and their variable files) differ."""

    rows: tuple[Row, ...]
    stamped: bool

    def to_json(self) -> str:
        """Return the rows as JSON text."""
        rows = [asdict(row) for row in self.rows]
        return json.dumps({"stamped": self.stamped, "rows": rows}, indent=1) + "\n"

    def print(self) -> None:
        """Print one row per line that differs, then a summary."""
        if self.rows:
            print_table(COLUMNS, (row.cells() for row in self.rows))
        print(self.summary())

    def summary(self) -> str:
        """Say in one line what differs."""
        if not self.rows:
            return "the targets are the same"
        sizes = [r.change_mm for r in self.rows if r.change_mm is not None]
        texts = sum(bool(r.text) for r in self.rows)
        said = f"{len(self.rows) - texts} lines with other numbers"
        if sizes:
            said += f", change mean {np.mean(sizes):.3f} mm, max {max(sizes):.3f} mm"
        return said + (f"; {texts} lines with other text" if texts else "")


def diff(original: Path, compensated: Path) -> Difference:
    """Compare two programs, and the variable files beside them.

    Raises:
        ProgramError: A file cannot be read.
    """
    rows, stamped = _diff_files(original, compensated)
    values = original.with_suffix(VARIABLES), compensated.with_suffix(VARIABLES)
    if original.suffix.lower() != VARIABLES and all(v.is_file() for v in values):
        rows += _diff_files(*values)[0]
    return Difference(tuple(rows), stamped)


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


def _diff_files(original: Path, compensated: Path) -> tuple[list[Row], bool]:
    """Compare two files line by line."""
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
        rows.append(row if not name else Row(**{**asdict(row), "target": name}))
    return rows, stamped


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


def _entry_name(lines: list[str], line: int) -> str:
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
