"""Two files line by line: which numbers differ, or what more."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from pathlib import Path

import numpy as np

from postproc.arrays import Ints
from postproc.changed_lines import changed_rows, shapes, target_name
from postproc.exceptions import ProgramError
from postproc.files import VARIABLES
from postproc.language.pdl2.names import entry_names
from postproc.language.stamp import read_stamp
from postproc.rows import Rows, joined_rows
from postproc.text_lines import TextLines


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
    lines: Sequence[bytes]
    rows: Rows
    stamped: bool

    def targets(self, lines: Ints) -> list[str]:
        """Name what the numbers on lines of the original, ascending, belong to."""
        if self.original.suffix.lower() == VARIABLES:
            return list(entry_names(self.lines, lines.tolist()))
        texts = (self.lines[line - 1].decode("latin-1") for line in lines.tolist())
        return [target_name(text) for text in texts]


def _read_lines(path: Path) -> tuple[TextLines, bool]:
    """Read a file's lines without their endings; the stamp line is dropped."""
    try:
        data = path.read_bytes()
    except OSError as exc:
        problem = f"cannot be read ({exc.strerror})"
        raise ProgramError(path, problem, "Check the path") from None
    stamped = read_stamp(data) is not None
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return TextLines.of(data, stamped), stamped


def compare_files(original: Path, compensated: Path) -> Compared:
    """Compare two files line by line.

    Raises:
        ProgramError: A file cannot be read.
    """
    before, _ = _read_lines(original)
    after, stamped = _read_lines(compensated)
    rows = joined_rows(original.name, list(_rows(original.name, before, after)))
    if original.suffix.lower() == VARIABLES:
        rows = _named_by_entries(rows, before)
    return Compared(original, compensated, before, rows, stamped)


def _rows(file: str, before: Sequence[bytes], after: Sequence[bytes]) -> Iterator[Rows]:
    """Describe the lines that differ, in order."""
    if len(before) == len(after):
        yield changed_rows(file, range(1, len(before) + 1), before, after)
        return
    masks = shapes(before), shapes(after)
    matcher = SequenceMatcher(None, *masks, autojunk=False)
    for kind, a0, a1, b0, b1 in matcher.get_opcodes():
        if kind == "equal":
            lines = range(a0 + 1, a1 + 1)
            yield changed_rows(file, lines, before[a0:a1], after[b0:b1])
            continue
        gone = np.arange(a0 + 1, a1 + 1)
        yield _text_rows(file, gone, "- ", before[a0:a1])
        yield _text_rows(file, np.zeros(b1 - b0, dtype=int), "+ ", after[b0:b1])


def _text_rows(file: str, lines: Ints, sign: str, texts: Sequence[bytes]) -> Rows:
    """Describe lines that only one of the files has."""
    told = {k: f"{sign}{text.decode('latin-1')}" for k, text in enumerate(texts)}
    return replace(Rows.bare(file, lines, [""] * len(lines)), texts=told)


def _named_by_entries(rows: Rows, lines: Sequence[bytes]) -> Rows:
    """Name rows of a variable file by their variables."""
    own = (rows.targets[k] for k in rows.target.tolist())
    entries = entry_names(lines, rows.line.tolist())
    names = [name or target for name, target in zip(entries, own, strict=True)]
    return replace(rows, targets=names, target=np.arange(len(names)))
