"""Other programs of a folder or an archive that change what all programs share."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

from postproc.exceptions import ProgramError
from postproc.files import FolderListing, find_beside, read_if_readable
from postproc.language.krl.files import (
    SHARED_LIST,
    USER_SOURCES,
    KrlFileName,
    find_in_archive,
)
from postproc.language.krl.program import read_krl
from postproc.language.krl.shared_changes import list_imports, list_shared_changes
from postproc.language.krl.symbols import HELD, KrlTask
from postproc.language.text.source import source_from_bytes
from postproc.language.text.stamp import read_stamp

READ_BEFORE = 8192  # files of which is known what they change, or declare
_WORD = re.compile(rb"[A-Za-z_$]\w*")
_GLOBAL = re.compile(rb"^[^;\n]*\bGLOBAL\b[^;\n]*", re.IGNORECASE | re.MULTILINE)


def changing_programs(program: Path, listing: FolderListing) -> tuple[Path, ...]:
    """Return other programs that change shared data, each with its data list.

    Outputs and sources of the controller do not count.
    """
    folder = program.absolute().parent
    if not folder.is_dir():
        return ()
    lists = find_in_archive(folder, (KrlFileName.data_lists,), listing)
    shared = HELD.union(*(_list_shared(one, *_version(one)) for one in lists))
    found: list[Path] = []
    for other in find_in_archive(folder, KrlFileName.programs, listing):
        if other.name.lower() in (program.name.lower(), *USER_SOURCES):
            continue
        changed, imports = _read_changes(other, *_version(other))
        if imports or not shared.isdisjoint(changed):
            values = KrlFileName(str(other)).find_values()
            found += [other] if values is None else [other, values]
    return tuple(found)


def _version(path: Path) -> tuple[int, int]:
    """Return what tells a file from what it was before."""
    status = path.stat()
    return status.st_mtime_ns, status.st_size


@lru_cache(READ_BEFORE)
def _list_shared(path: Path, changed: int, size: int) -> frozenset[str]:
    """Return the words of a list with which it may declare data for all programs."""
    text = read_if_readable(path)
    if path.name.lower() != SHARED_LIST:
        text = b"\n".join(_GLOBAL.findall(text))
    return frozenset(word.decode("latin-1").lower() for word in _WORD.findall(text))


@lru_cache(READ_BEFORE)
def _read_changes(path: Path, changed: int, size: int) -> tuple[frozenset[str], bool]:
    """Return what a program may change of others' data, and whether it imports any."""
    text = read_if_readable(path)
    if KrlFileName(path.name).is_system_source(text) or read_stamp(text) is not None:
        return frozenset(), False
    values = find_beside(path, f"{path.stem}{KrlFileName.data_lists}")
    try:
        files = [
            read_krl(source_from_bytes(one.name, read_if_readable(one)))
            for one in (path, values) if one
        ]  # fmt: skip
    except ProgramError:
        return frozenset(), False
    changes = list_shared_changes(files, KrlTask(files).new_uses)
    return frozenset(one.name for one in changes), bool(list_imports(files))
