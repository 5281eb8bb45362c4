"""Outputs that lie beside their sources: they are none of the programs of a folder."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

from postproc.files import FolderListing, read_if_readable
from postproc.language.text.stamp import read_stamp

OUTPUT = ".compensated"  # ends the name of an output, before its suffix
HEAD = 1 << 14  # bytes: the stamp of an output stands near its first line
READ_BEFORE = 8192  # files of which is known what they hold


def is_beside_source(path: Path, listing: FolderListing) -> bool:
    """Tell whether a file is an output, and its source is a file of the same folder.

    An output alone is a program like any other: what it does to others, it does.
    """
    name = path.name.lower().replace(OUTPUT, "")
    if name != path.name.lower() and listing.named(path.parent, name):
        return True
    stamp = read_stamp(read_if_readable(path, HEAD))
    if stamp is None:
        return False
    others = listing.ending(path.parent, (path.suffix.lower(),))
    return any(_hash(one, *version_of(one)) == stamp.source for one in others)


def version_of(path: Path) -> tuple[int, int]:
    """Return what tells a file from what it was before."""
    status = path.stat()
    return status.st_mtime_ns, status.st_size


@lru_cache(READ_BEFORE)
def _hash(path: Path, changed: int, size: int) -> str:
    """Return the SHA-256 of a file as it is now, hexadecimal."""
    return hashlib.sha256(read_if_readable(path)).hexdigest()
