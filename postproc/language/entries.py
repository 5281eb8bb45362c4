"""Copy an entry of a variable file under another name."""

from __future__ import annotations

import re

import numpy as np

from postproc.language.edits import Edit
from postproc.language.forms import formed
from postproc.language.layout import CloneError, inserted_after
from postproc.language.lines import read_lines
from postproc.language.parser import parse_value_form
from postproc.language.records import is_nested, last_head
from postproc.language.source import Source

_XPORT = re.compile(r"\bXport\b(?P<other>\s+from\b)?", re.I)


def copied_entry(
    values: Source, line: int, old: str, name: str, starts: list[int]
) -> Edit:
    """Enter the value of a variable once more, behind its entry.

    Args:
        values: The variable file.
        line: A line of the entry.
        old: The name that it has.
        name: That of the copy.
        starts: Offsets of its numbers.

    Raises:
        CloneError: The entry is not one of this variable alone.
    """
    lines = read_lines(values)
    said = formed(lines.shapes, parse_value_form)
    heads = last_head(lines, said)
    row = int(np.searchsorted(lines.line, line, side="right")) - 1
    at = int(heads[row]) if row >= 0 else -1
    head = said[int(lines.shape[at])] if at >= 0 else None
    if head is None or head.name.lower() != old.lower() or head.element:
        raise CloneError(f"line {line} of {values.name} is no entry of {old}")
    if is_nested(head):
        raise CloneError(f"{old} is a record or a path: its parts are not cloned")
    after = int(np.searchsorted(heads, at, side="right"))
    first, last = int(lines.line[at]), int(lines.line[after - 1])
    end = [*values.line_starts.tolist(), len(values.data)][last]
    begin = int(values.line_starts[first - 1])
    if not all(begin <= start < end for start in starts):
        raise CloneError(f"the entry of {old} in {values.name} is cut")
    text = values.text[begin:end].rstrip("\r\n")
    renamed = re.sub(
        rf"\A(\s*){re.escape(old)}\b", rf"\g<1>{name}", text, count=1, flags=re.I
    )
    title, rest = re.split(r"(?=[\r\n]|\Z)", renamed, maxsplit=1)
    if renamed == text:
        raise CloneError(f"the entry of {old} in {values.name} is not understood")
    return inserted_after(values, last, _own(title, old) + rest)


def _own(title: str, old: str) -> str:
    """Let a copy be the program's own, where the original is exported."""
    found = _XPORT.search(title)
    if found is None:
        return title
    if found["other"]:
        raise CloneError(f"{old} belongs to another program")
    return title[: found.start()] + "Priv" + title[found.end() :]
