"""Source text as bytes, places in it, and edits that leave every other byte alone."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from postproc.exceptions import FileError, ProgramError
from postproc.language.edits import Edit, Replacements, Span

__all__ = [
    "Edit",
    "Source",
    "Span",
    "apply",
    "compose",
    "read_source",
    "source_from_bytes",
]

_LINE_END = re.compile(rb"\r\n|\n|\r")
UTF8_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class Source:
    """A text file as it lies on disk.

    Attributes:
        name: The file as the user named it (``-`` for standard input).
        data: Its bytes, never normalised.
    """

    name: str
    data: bytes

    @cached_property
    def text(self) -> str:
        """Return the bytes as Latin-1, so that text offsets are byte offsets."""
        return self.data.decode("latin-1")

    @cached_property
    def line_starts(self) -> NDArray[np.int64]:
        """Return the offsets at which lines start, (n,); CR, LF and CRLF end a line."""
        a = np.frombuffer(self.data, dtype=np.uint8)
        feeds, returns = np.flatnonzero(a == 10), np.flatnonzero(a == 13)
        following = a[np.minimum(returns + 1, len(a) - 1)]
        ends = np.concatenate([feeds, returns[following != 10]])
        ends.sort()
        return np.concatenate([[0], ends[ends < len(a) - 1] + 1]).astype(np.int64)

    @cached_property
    def newline(self) -> bytes:
        """Return the line ending of the first line (CRLF where there is none)."""
        found = _LINE_END.search(self.data)
        return found.group() if found else b"\r\n"

    def line_of(self, offset: int) -> int:
        """Return the 1-based line that holds an offset."""
        return int(np.searchsorted(self.line_starts, offset, side="right"))

    def line_text(self, line: int) -> str:
        """Return a 1-based line without its line ending."""
        start = int(self.line_starts[line - 1])
        end = _LINE_END.search(self.data, start)
        return self.text[start : end.start() if end else len(self.data)]


def source_from_bytes(name: str, data: bytes) -> Source:
    """Take bytes as a program, or refuse what can be none.

    Raises:
        ProgramError: The file is empty or binary.
    """
    if not data.removeprefix(UTF8_MARK).strip():
        raise ProgramError(name, "the file is empty", "Give a PDL2 program text.")
    nul = data.find(b"\0")
    if nul >= 0:
        line = len(_LINE_END.findall(data, 0, nul)) + 1
        raise ProgramError(
            name,
            "the file is binary (it holds NUL bytes)",
            "Give the text form (.pdl, .lsv), not the compiled one (.cod, .var), "
            "in an 8-bit encoding.",
            line=line,
        )
    return Source(name, data)


def read_source(path: str | Path) -> Source:
    """Read a program or variable file.

    Raises:
        FileError: The file cannot be read.
        ProgramError: The file is empty or binary.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as problem:
        why = problem.strerror or str(problem)
        raise FileError(path, f"cannot be read: {why}", "Check the name.") from None
    return source_from_bytes(str(path), data)


def apply(data: bytes, edits: Iterable[Edit]) -> bytes:
    """Apply edits and keep every other byte.

    Raises:
        ValueError: Edits overlap or lie outside of the data.

    >>> apply(b"MOVE TO {1.0}", [Edit(Span(9, 12), b"1.00025")])
    b'MOVE TO {1.00025}'
    """
    if isinstance(edits, Replacements):
        return edits.apply(data)
    parts: list[bytes] = []
    done = 0
    for (start, end), new in sorted(edits, key=lambda edit: edit.span):
        if not done <= start <= end <= len(data):
            raise ValueError(f"edit of bytes {start} to {end} overlaps or lies outside")
        parts += (data[done:start], new)
        done = end
    parts.append(data[done:])
    return b"".join(parts)


def compose(first: Iterable[Edit], second: Iterable[Edit]) -> list[Edit]:
    """Make one list of edits of two that follow each other.

    Args:
        first: Edits of a text.
        second: Edits of what comes out, each inside or outside of a new piece.

    Raises:
        ValueError: An edit of the second list reaches over the border of a new piece.

    >>> data, first = b"p := 1", [Edit(Span(6, 6), b" q := 1")]
    >>> second = [Edit(Span(5, 6), b"2.0"), Edit(Span(12, 13), b"3.0")]
    >>> apply(data, compose(first, second))
    b'p := 2.0 q := 3.0'
    """
    later = sorted(second, key=lambda edit: edit.span)
    found: list[Edit] = []
    at, shift = 0, 0  # of `later`; from the first text to what comes out
    for (start, end), new in sorted(first, key=lambda edit: edit.span):
        begin = start + shift
        at += _take_over(later, at, begin, shift, found)
        inside = []
        while at < len(later) and later[at].span.start < begin + len(new):
            (a, b), text = later[at]
            if a < begin or b > begin + len(new):
                raise ValueError("an edit reaches over the border of another")
            inside.append(Edit(Span(a - begin, b - begin), text))
            at += 1
        found.append(Edit(Span(start, end), apply(new, inside)))
        shift += len(new) - (end - start)
    _take_over(later, at, None, shift, found)
    return found


def _take_over(
    edits: list[Edit], at: int, until: int | None, shift: int, found: list[Edit]
) -> int:
    """Take over the edits that end before an offset; return how many."""
    count = 0
    for (start, end), new in edits[at:]:
        if until is not None and end > until:
            break
        found.append(Edit(Span(start - shift, end - shift), new))
        count += 1
    return count
