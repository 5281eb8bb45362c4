"""Other modules of a folder that change data which all modules of a task share."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

from postproc.exceptions import ProgramError
from postproc.files import FolderListing, read_if_readable
from postproc.language.analysis.shared_changes import list_shared_changes
from postproc.language.rapid.files import RapidFileName
from postproc.language.rapid.program import read_rapid
from postproc.language.rapid.symbols import RapidTask
from postproc.language.text.source import source_from_bytes
from postproc.language.text.stamp import read_stamp

READ_BEFORE = 8192  # modules of which is known what they change, or declare
_SHARED = re.compile(
    rb"^[ \t]*(?:TASK[ \t]+)?(?:VAR|PERS)[ \t]+\w+[ \t]+(\w+)",
    re.IGNORECASE | re.MULTILINE,
)


def changing_modules(program: Path, listing: FolderListing) -> tuple[Path, ...]:
    """Return other modules beside a program that change what one there declares.

    They may be loaded with it, or have run before it. Outputs do not count.
    """
    found = listing.once(program.absolute().parent, _find_changing)
    return tuple(one for one in found if one.name.lower() != program.name.lower())


def _find_changing(folder: Path, listing: FolderListing) -> list[Path]:
    """Find the modules of a folder that change what other modules there declare."""
    modules = listing.ending(folder, RapidFileName.programs)
    versions = [(one, one.stat()) for one in modules]
    known = [(one, at.st_mtime_ns, at.st_size) for one, at in versions]
    declared = frozenset[str]().union(*(_list_declared(*one) for one in known))
    return [one[0] for one in known if _changes_any(*one, declared)]


@lru_cache(READ_BEFORE)
def _list_declared(path: Path, changed: int, size: int) -> frozenset[str]:
    """Return the variables and persistents that a module declares, as it is now."""
    found = _SHARED.findall(read_if_readable(path))
    return frozenset(name.decode("latin-1").lower() for name in found)


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
        task = RapidTask([read_rapid(source_from_bytes(path.name, data))])
    except ProgramError:
        return False
    changes = (one.name for one in list_shared_changes(task))
    return task.sets_by_string or not declared.isdisjoint(changes)
