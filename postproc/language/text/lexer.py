"""Lines of a file, but for their numbers, comments and numbered names."""

from __future__ import annotations

from dataclasses import dataclass

from postproc import _native
from postproc.arrays import Floats, Indices
from postproc.language.text.source import NumberSpans
from postproc.language.text.symbol_column import NameColumn

# A *mask* is the code of a line in which every number is one NUL (no program holds
# any), the comment is gone and idle blanks are dropped. In its *form* every numbered
# name (``WP_12``, ``p1``) is one mark, too: lines of one form are parsed once.

NAME_MARK = "\x01"  # a numbered name; a string has CR for it, which no grammar reads

BLANKS = "".join(chr(c) for c in (*range(1, 33), 127) if chr(c) not in "\r\n")


@dataclass(frozen=True)
class ScannedLines:
    """The n physical lines of a file with m numbers and p numbered names.

    Attributes:
        masks: Their distinct masks, names taken out.
        shape: Index into `masks`, (n,).
        comment: Byte offset of each line's comment, (n,), -1 where there is none.
        first: CSR offsets into the numbers, (n + 1,).
        name_first: CSR offsets into the names, (n + 1,).
        numbers: Where each number stands, its sign included, (m,).
        value: What it is worth, NaN where it cannot be read, (m,).
        names: The distinct names, in the order of appearance.
        name: Index into `names`, (p,).
        unterminated: Lines (from 0) with a string that does not end.
    """

    masks: tuple[bytes, ...]
    shape: Indices
    comment: Indices
    first: Indices
    name_first: Indices
    numbers: NumberSpans
    value: Floats
    names: NameColumn
    name: Indices
    unterminated: tuple[int, ...]


def scan_lines(data: bytes, line_starts: Indices) -> ScannedLines:
    """Mask every physical line of a text and take its numbered names out.

    Args:
        data: The text; a byte order mark is as good as blanks.
        line_starts: Offset of every line, ascending from 0, (n,).
    """
    masks, by_line, numbers, names, unterminated = _native.scan_lines(data, line_starts)
    places, value = numbers
    return ScannedLines(
        tuple(masks), *by_line, NumberSpans(*places), value, *names, tuple(unterminated)
    )


def mask_of(form: str, names: tuple[str, ...]) -> str:
    """Fill the names into a form again."""
    parts = form.split(NAME_MARK)
    pairs = zip(parts, names, strict=False)
    return "".join([text for pair in pairs for text in pair]) + parts[-1]
