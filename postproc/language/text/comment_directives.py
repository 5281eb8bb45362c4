"""Comments that mark moves and points, in each language's own sign.

``-- MEASURE P12``: the move is measured, under that id; ``-- TAUGHT``: a point that was
taught with the arm; ``-- postproc: inserted``: a line that postproc has inserted.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from postproc import _native
from postproc.language.text.source import Source

MEASURE, TAUGHT = "MEASURE", "TAUGHT"
INSERTED = "postproc: inserted"  # ends a line with a point on the way of a move
AT_VIA = " (via)"  # .. where it leads to the point on the way of an arc
AT_APPROACH = " (approach)"  # .. where it is a stop from which a target is reached


@dataclass(frozen=True)
class Comments:
    """How a language writes comments.

    Attributes:
        sign: What they begin with, up to the end of the line; it may be repeated.
        quote: What strings, which end on their line, begin and end with.
    """

    sign: str
    quote: str

    def marks(self, source: Source, word: str) -> Iterator[tuple[int, str]]:
        """Yield (line, next word) of the comments that begin with a word.

        Args:
            source: The text.
            word: `MEASURE` or `TAUGHT`.
        """
        sign, quote, said = (x.encode() for x in (self.sign, self.quote, word))
        if not _native.holds(source.data, said.lower()):
            return
        pattern = rb"%b+[ \t]*%b\b[ \t]*([^\s]*)" % (re.escape(sign), said)
        strings = re.compile(rb"%b[^%b]*%b" % (quote, quote, quote))
        for found in re.finditer(pattern, source.data, re.IGNORECASE):
            line = source.line_of(found.start())
            begin = int(source.line_starts[line - 1])
            code = strings.sub(b"", source.data[begin : found.start()])
            if sign not in code and quote not in code:
                yield line, found.group(1).decode("latin-1")

    def list_taught(self, source: Source) -> frozenset[int]:
        """Return the lines of points that are marked as taught."""
        return frozenset(line for line, _ in self.marks(source, TAUGHT))


def insertion_mark(line: bytes, sign: str) -> str | None:
    """Return what an inserted line is for, None for any other line.

    Args:
        line: The line.
        sign: What comments begin with.

    >>> insertion_mark(b"MOVE TO p -- postproc: inserted (via)", "--")
    ' (via)'
    >>> insertion_mark(b"MoveL p,v100,z0,t; ! postproc: inserted", "!")
    ''
    """
    found = _INSERTED.search(line)
    if found is None or found[1] != sign.encode():
        return None
    return (found[2] or b"").decode()


_INSERTED = re.compile(
    rb"(--|!|;) postproc: inserted( \((?:via|approach)\))?[ \t]*\r?\n?$"
)
