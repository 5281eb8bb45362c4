"""Other programs of a folder or an archive that change what all programs share."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

from postproc.exceptions import ProgramError
from postproc.files import FolderListing, read_if_readable
from postproc.language.krl.files import (
    SHARED_LIST,
    USER_SOURCES,
    KrlFileName,
    find_in_archive,
)
from postproc.language.krl.imports import list_imports
from postproc.language.krl.symbols import HELD, list_changes
from postproc.language.text.source import source_from_bytes
from postproc.language.text.stamp import read_stamp

READ_BEFORE = 8192  # files of which is known what they change, or declare
_WORD = re.compile(rb"[A-Za-z_$]\w*")
_GLOBAL = re.compile(rb"^[^;\n]*\bGLOBAL\b[^;\n]*", re.IGNORECASE | re.MULTILINE)


def changing_programs(program: Path, listing: FolderListing) -> tuple[Path, ...]:
    """Return other programs that change shared data, each with its data list.

    Outputs and sources of the controller do not count.
    """
    found = listing.beside(program, _find_changing)
    own = program.stem.lower()
    return tuple(one for one in found if one.stem.lower() != own)


def _find_changing(folder: Path, listing: FolderListing, but: str) -> list[Path]:
    """Find programs of a folder, or of its archive, that change what all share."""
    sources = find_in_archive(folder, KrlFileName.programs, listing)
    others = [one for one in sources if one.name.lower() not in (but, *USER_SOURCES)]
    if not others:
        return []
    lists = find_in_archive(folder, (KrlFileName.data_lists,), listing)
    shared = HELD.union(*(_list_shared(one, *_version(one)) for one in lists))
    found: list[Path] = []
    for other in others:
        values = listing.named(other.parent, f"{other.stem}{KrlFileName.data_lists}")
        own = [other] if values is None else [other, values]
        changed, imports = _read_changes(*((one, *_version(one)) for one in own))
        if imports or not shared.isdisjoint(changed):
            found += own
    return found


def _version(path: Path) -> tuple[int, int]:
    """Return what tells a file from what it was before."""
    status = path.stat()
    return status.st_mtime_ns, status.st_size


@lru_cache(READ_BEFORE)
def _list_shared(path: Path, changed: int, size: int) -> frozenset[str]:
    """Return the words of a list with which it may declare data for all programs."""
    text = read_if_readable(path)
    if path.name.lower() != SHARED_LIST:
        some = _GLOBAL.findall(text) if b"global" in text.lower() else ()
        text = b"\n".join(some)
    return frozenset(word.decode("latin-1").lower() for word in _WORD.findall(text))


@lru_cache(READ_BEFORE)
def _read_changes(*versions: tuple[Path, int, int]) -> tuple[frozenset[str], bool]:
    """Return what a program may change of others' data, and whether it imports any.

    Args:
        versions: The program and its data list, each as it is now.
    """
    texts = {path.name: read_if_readable(path) for path, _, _ in versions}
    name, text = next(iter(texts.items()))
    if KrlFileName(name).is_system_source(text) or read_stamp(text) is not None:
        return frozenset(), False
    try:
        sources = [source_from_bytes(*one) for one in texts.items()]
        changes = list_changes(*sources)
    except ProgramError:
        return frozenset(), False
    return frozenset(one.name for one in changes), bool(list_imports(sources))
