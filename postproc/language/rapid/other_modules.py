"""Other modules of a folder that change data which all modules of a task share."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

from postproc import _native
from postproc.exceptions import ProgramError
from postproc.files import FolderListing, read_if_readable
from postproc.language.rapid.files import RapidFileName
from postproc.language.rapid.symbols import list_changes
from postproc.language.text.source import source_from_bytes
from postproc.language.text.stamp import read_stamp

READ_BEFORE = 8192  # modules of which is known what they change, or declare
_WORDS = (b"task", b"var", b"pers")  # what declares such data begins with one
_SHARED = re.compile(
    rb"[ \t]*(?:TASK[ \t]+)?(?:VAR|PERS)[ \t]+\w+[ \t]+(\w+)", re.IGNORECASE
)


def changing_modules(program: Path, listing: FolderListing) -> tuple[Path, ...]:
    """Return other modules beside a program that change what one there declares.

    They may be loaded with it, or have run before it. Outputs do not count.
    """
    found, own = listing.beside(program, _find_changing), program.name.lower()
    return tuple(one for one in found if one.name.lower() != own)


def _find_changing(folder: Path, listing: FolderListing, but: str) -> list[Path]:
    """Find the modules of a folder that change what other modules there declare."""
    modules = listing.ending(folder, RapidFileName.programs)
    others = [one for one in modules if one.name.lower() != but]
    if not others:
        return []
    lists = (_list_declared(one, *_version(one)) for one in modules)
    declared = frozenset[str]().union(*lists)
    return [one for one in others if _changes_any(one, *_version(one), declared)]


def _version(path: Path) -> tuple[int, int]:
    """Return what tells a file from what it was before."""
    status = path.stat()
    return status.st_mtime_ns, status.st_size


@lru_cache(READ_BEFORE)
def _list_declared(path: Path, changed: int, size: int) -> frozenset[str]:
    """Return the variables and persistents that a module declares, as it is now."""
    lines = _native.lines_beginning(read_if_readable(path), _WORDS)
    found = filter(None, (_SHARED.match(line) for _, line in lines))
    return frozenset(one[1].decode("latin-1").lower() for one in found)


@lru_cache(READ_BEFORE)
def _changes_any(path: Path, changed: int, size: int, declared: frozenset[str]) -> bool:
    """Tell whether a module may change some data that it does not declare."""
    data = read_if_readable(path)
    text, own = data.lower(), _list_declared(path, changed, size)
    if not any(name.encode("latin-1") in text for name in declared - own):
        return False
    if read_stamp(data) is not None:
        return False
    try:
        changes = list_changes(source_from_bytes(path.name, data))
    except ProgramError:
        return False
    return any(not one.name or one.name in declared for one in changes)
