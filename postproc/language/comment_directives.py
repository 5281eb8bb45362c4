"""Comments that mark moves and points, in each language's own sign.

``-- MEASURE P12``: the move is measured, under that id; ``-- TAUGHT``: a point that was
taught with the arm.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from postproc import _native
from postproc.language.source import Source

MEASURE, TAUGHT = "MEASURE", "TAUGHT"


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
