"""New text in a file's own layout: line ends and lengths."""

from __future__ import annotations

import re

import numpy as np

from postproc.exceptions import PostprocError
from postproc.language.edits import Edit, Span
from postproc.language.source import Source

LONGEST_LINE = 254  # characters of a line (likely), unless the file has longer ones
_LINE_END = re.compile(rb"\r\n|\n|\r")


class CloneError(PostprocError):
    """A variable cannot be cloned safely; the text says why."""


def inserted_after(source: Source, line: int, text: str) -> Edit:
    """Insert a line (or several) behind another, with the line ending that it has.

    Raises:
        CloneError: A line would get too long.
    """
    for part in re.split(r"\r\n|\n|\r", text):
        check_length(source, len(part))
    new = text.encode("latin-1")
    found = _LINE_END.search(source.data, int(source.line_starts[line - 1]))
    if found is None:
        at = len(source.data)
        return Edit(Span(at, at), source.newline + new)
    return Edit(Span(found.end(), found.end()), new + found.group())


def check_length(source: Source, length: int) -> None:
    """Refuse a line that is longer than lines of the language, and of its file, are.

    Raises:
        CloneError: It is.
    """
    if length <= LONGEST_LINE:
        return
    longest = int(np.diff(source.line_starts, append=len(source.data)).max())
    if length > longest:
        raise CloneError(f"a line would be longer than {LONGEST_LINE} characters")
