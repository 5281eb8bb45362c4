"""The stamp: a line in front of an output says what made it, from what."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass

from postproc import _native
from postproc.language.text.source import UTF8_MARK, Source, Span

_INDENT = 400  # blanks before a stamp that an editor has moved
_STAMP = re.compile(
    rb"[ \t]*(?:--|!|;)[ \t]*postproc[ \t]+(?P<version>\S+)[ \t]+"
    rb"model[ \t]*=[ \t]*(?P<model>\S+)"
    rb"[ \t]+source[ \t]*=[ \t]*(?P<source>[0-9a-f]{64})\b(?P<rest>[^\r\n]*)"
    rb"(?:\r\n|\n|\r|\Z)",
    re.IGNORECASE,  # an editor may have changed the case, and blanks
)
_BEGINS = re.compile(  # "--", "!" or ";", said so that searching it is fast
    rb"[-!;](?:-|(?<=[!;]))[ \t]*postproc[ \t]+\S+[ \t]+model[ \t]*=", re.IGNORECASE
)
_HEADER = re.compile(  # of a module or a source: it stands before all else
    rb"(?:\xef\xbb\xbf)?(?:(?:\s|![^\r\n]*(?=[\r\n]))*%%%.*?%%%"
    rb"(?:[ \t]*(?:\r\n|\n|\r))?"
    rb"|(?:[ \t]*+(?:\r\n?+|\n))*+(?:[ \t]*+&[^\r\n]*+(?:\r\n?+|\n))++)",
    re.DOTALL,
)
_MODULE = re.compile(  # the whole line with which a module begins
    rb"(?:\xef\xbb\xbf)?(?:[ \t]*+(?:![^\r\n]*+)?(?:\r\n?+|\n))*+"
    rb"[ \t]*+MODULE[ \t]++\w++[ \t]*+(?:\([^()\r\n!]*+\)[ \t]*+)?(?:![^\r\n]*+)?"
    rb"(?:\r\n?+|\n)",
    re.IGNORECASE,
)


_ROUTINE = re.compile(  # .. and with which a source of KRL, or its data list, does
    rb"(?:\xef\xbb\xbf)?(?:[ \t]*+(?:;[^\r\n]*+)?(?:\r\n?+|\n))*+"
    rb"[ \t]*+(?:GLOBAL[ \t]++)?DEF(?:DAT[ \t]|FCT[ \t]|[ \t])[^\r\n;]*+(?:;[^\r\n]*+)?"
    rb"(?:\r\n?+|\n)",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Stamp:
    """What a stamp line says.

    Attributes:
        version: Version of the tool.
        model: Id of the model.
        source: SHA-256 of the original's bytes, hexadecimal. All are lower-case,
            whatever an editor has made of them.
    """

    version: str
    model: str
    source: str


def stamp_line(version: str, model: str, source: Source, comment: str) -> bytes:
    """Return the stamp of a source, in its own line ending, behind a comment's begin.

    It holds no date, so that the same input gives the same bytes.
    """
    text = f"{comment} postproc {version} model={model} source={source_hash(source)}"
    return text.encode("ascii", "replace") + source.newline


def source_hash(source: Source) -> str:
    """Return the SHA-256 of a source's bytes, hexadecimal."""
    return hashlib.sha256(source.data).hexdigest()


def stamp_place(data: bytes) -> int:
    """Return the offset at which a stamp goes into a text.

    It stands behind the line with which a module or a source begins, where controllers
    keep comments when they save; else behind a file header or a byte-order mark.
    """
    header = _header_end(data)
    found = _MODULE.match(data, header) or _ROUTINE.match(data, header)
    return found.end() if found else header


def _header_end(data: bytes) -> int:
    """Return where a file header ends, or a byte-order mark, 0 without both."""
    found = _HEADER.match(data)
    if found:
        return found.end()
    return len(UTF8_MARK) if data.startswith(UTF8_MARK) else 0


def read_stamp(data: bytes) -> Stamp | None:
    """Return the stamp on line 1 or behind a file header, None where there is none."""
    found = _find_stamp(data)
    if found is None:
        return None
    return Stamp(
        *(
            found[name].decode("ascii", "replace").lower()
            for name in ("version", "model", "source")
        )
    )


def is_stamped(source: Source) -> bool:
    """Tell whether a program is an output of this tool, stamp moved or not."""
    data = source.data
    if not _native.holds(data, b"postproc"):  # fast, and true of nearly no program
        return False
    for found in _BEGINS.finditer(data):
        # Nothing but blanks, or a header's end, may stand before it in its line.
        before = data[max(found.start() - _INDENT, 0) : found.start()]
        before = before.rstrip(b" \t").removesuffix(UTF8_MARK)
        if not before or before.endswith((b"\n", b"\r", b"%%%")):
            return True
    return False


def strip_stamp(data: bytes) -> bytes:
    """Return the bytes without the stamp line; all of them where there is none."""
    begin, end = stamp_span(data)
    return data[:begin] + data[end:]


def stamp_span(data: bytes) -> Span:
    """Return where the stamp line stands; nothing at 0 where there is none."""
    found = _find_stamp(data)
    return Span(*found.span()) if found else Span(0, 0)


def _find_stamp(data: bytes) -> re.Match[bytes] | None:
    """Find the stamp behind the line of a module or the file header, or on line 1."""
    places = stamp_place(data), _header_end(data), 0
    found = (_STAMP.match(data, place) for place in places)
    return next(filter(None, found), None)
