"""The stamp: line 1 of an output says what made it, from what."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass

from postproc.language.source import Source

_STAMP = re.compile(
    rb"-- postproc (?P<version>\S+) model=(?P<model>\S+) "
    rb"source=(?P<source>[0-9a-f]{64})(?P<rest>[^\r\n]*)(?:\r\n|\n|\r|\Z)"
)
_MARK = b"-- postproc "  # looked for first: that is much faster
_ANY_STAMP = re.compile(rb"^[ \t]*-- postproc \S+ model=", re.M)


@dataclass(frozen=True)
class Stamp:
    """What a stamp line says.

    Attributes:
        version: Version of the tool.
        model: Id of the model.
        source: SHA-256 of the original's bytes, hexadecimal.
    """

    version: str
    model: str
    source: str


def stamp_line(version: str, model: str, source: Source) -> bytes:
    """Return the stamp of a source, in its own line ending.

    It holds no date, so that the same input gives the same bytes.
    """
    text = f"-- postproc {version} model={model} source={source_hash(source)}"
    return text.encode("ascii", "replace") + source.newline


def source_hash(source: Source) -> str:
    """Return the SHA-256 of a source's bytes, hexadecimal."""
    return hashlib.sha256(source.data).hexdigest()


def stamped(version: str, model: str, source: Source, data: bytes) -> bytes:
    """Put the stamp of a source before its rewritten bytes."""
    return stamp_line(version, model, source) + data


def read_stamp(data: bytes) -> Stamp | None:
    """Return the stamp on line 1, None where there is none."""
    found = _STAMP.match(data.removeprefix(b"\xef\xbb\xbf"))
    if found is None:
        return None
    return Stamp(
        *(found[name].decode("ascii") for name in ("version", "model", "source"))
    )


def is_stamped(source: Source) -> bool:
    """Tell whether a program is an output of this tool, stamp moved or not."""
    return _MARK in source.data and _ANY_STAMP.search(source.data) is not None


def strip_stamp(data: bytes) -> bytes:
    """Return the bytes after the stamp line; all of them where there is none."""
    return data[stamp_length(data) :]


def stamp_length(data: bytes) -> int:
    """Count the bytes of the stamp line; 0 where there is none."""
    found = _STAMP.match(data)
    return found.end() if found else 0
