"""What `diff` says, worked out line by line from the definitions: slow and simple."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import TextIO

from postproc.exceptions import printable
from postproc.report.diff import DiffRow, target_name
from postproc.report.terminal import MEASURED, arrows
from tests.reference.text import mask_line, number_value

ASSIGNED = re.compile(r"\s*([A-Za-z_$][\w$.\[\]]*)\s*(?::=|:)")
LED = re.compile(r"(?:ELSE\s*:|CASE\s*\([^()]*\)\s*:|\w+\s*::)(.*)", re.S)
TWO_WORDS = re.compile(r"\s*([A-Za-z_]+)\s+([A-Za-z_]+)")


def rows_of(file: str, before: Sequence[str], after: Sequence[str]) -> list[DiffRow]:
    """Describe those of equally many lines that differ."""
    pairs = enumerate(zip(before, after, strict=True), 1)
    return [row_of(file, line, old, new) for line, (old, new) in pairs if old != new]


def row_of(file: str, line: int, old: str, new: str) -> DiffRow:
    """Describe one pair of lines."""
    a, b = mask_line(old), mask_line(new)
    numbers = [
        tuple(number_value(text[s:e]) for s, e in zip(m.start, m.end, strict=True))
        for m, text in ((a, old), (b, new))
    ]
    comments = [
        text[m.comment :] if m.comment >= 0 else "" for m, text in ((a, old), (b, new))
    ]
    bare = a.unterminated or b.unterminated or a.mask != b.mask
    if bare or comments[0] != comments[1] or numbers[0] == numbers[1]:
        return DiffRow(file, line, "", (), (), None, f"{old} -> {new}")
    change = None
    if len(numbers[0]) >= 3 and "{" not in old:
        x, y, z = (n - o for o, n in zip(*(own[:3] for own in numbers), strict=True))
        # Not by sum(): from Python 3.12 on it rounds once, at the end.
        change = math.sqrt(x * x + y * y + z * z)
    return DiffRow(file, line, name_of(a.mask, old), *numbers, change)


def name_of(mask: str, line: str) -> str:
    """Name what the numbers of a line belong to, by what is before the first."""
    if led := LED.match(line):
        line = led[1]
        mask = mask_line(line).mask
    begin = mask.partition("\0")[0]
    if words := TWO_WORDS.match(begin):
        return f"{words[1]} {words[2]}"
    assigned = ASSIGNED.match(begin)
    return assigned[1] if assigned else target_name(line)


def json_of(
    stamped: bool,
    counts: dict[str, int],
    rows: Sequence[DiffRow],
    left: Sequence[DiffRow],
) -> str:
    """Write all of it as JSON."""
    told = {
        "rows": [r._asdict() for r in rows],
        "uncorrected": [r._asdict() for r in left],
    }
    head = {"schema": "postproc-difference", "version": 2}
    found = {**head, "stamped": stamped, "counts": counts, **told}
    return json.dumps(found, indent=1) + "\n"


def list_rows(rows: Sequence[DiffRow], skip: int, told: bool, out: TextIO) -> None:
    """List rows that differ, one by one."""
    titles = ["file", "line", "target", "original", "", "compensated"]
    titles += ["|c| mm", "J1-6", "status"] if told else ["change mm"]
    left = ("file", "target", "", "J1-6", "status")
    cells = [cells_of(row, told)[skip:] for row in rows]
    print_aligned(titles[skip:], left, cells, out)


def print_aligned(
    titles: Sequence[str],
    left: Sequence[str],
    rows: Sequence[Sequence[str]],
    out: TextIO,
) -> None:
    """Print a table; a cell that sticks out widens its column from the next row on."""
    first = [titles, *rows[:MEASURED]]
    widths = [max(map(len, column)) for column in zip(*first, strict=True)]
    for row in (titles, *rows):
        shown = [*map(printable, row)]
        cells = [
            cell.ljust(width) if title in left else cell.rjust(width)
            for cell, width, title in zip(shown[:-1], widths, titles, strict=False)
        ]
        print("  ".join([*cells, shown[-1]]).rstrip(), file=out)
        widths = [max(w, len(c)) for w, c in zip(widths, shown, strict=True)]


def cells_of(row: DiffRow, told: bool) -> list[str]:
    """Write the cells of a row."""
    size = row.correction_mm if told and row.status else row.change_mm
    old, new = row.text, ""
    if row.original and not row.text:
        pairs = zip(row.original, row.compensated, strict=True)
        moved = [pair for pair in pairs if pair[0] != pair[1]]
        old, new = (", ".join(f"{p[k]:.4f}" for p in moved) for k in (0, 1))
    cells = [row.file, str(row.line or ""), row.target, old, "->" if new else "", new]
    cells.append("" if size is None else f"{size:.3f}")
    others = ", ".join(f"{n} {name}" for name, n in row.visits.items())
    why = f"{row.reason} ({others})" if row.reason and others else row.reason or others
    status = f"{row.status}: {why}" if why else row.status
    return [*cells, arrows(row.direction), status] if told else cells
