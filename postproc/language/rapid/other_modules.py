"""Other modules of a folder that name data which all modules of a task share."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

from postproc import _native
from postproc.files import FolderListing, read_if_readable
from postproc.language.outputs import is_beside_source, version_of
from postproc.language.rapid.backup import system_modules
from postproc.language.rapid.files import RapidFileName
from postproc.language.rapid.instructions import BY_STRING
from postproc.language.rapid.symbols import find_words

READ_BEFORE = 8192  # modules of which is known what they change, or declare
_WORDS = (b"local", b"task", b"var", b"pers", b"const")  # that begin declarations
_ROUTINE = re.compile(
    rb"^[ \t]*(?:LOCAL[ \t]+)?(?:PROC|FUNC|TRAP)[ \t]", re.IGNORECASE | re.MULTILINE
)
_SHARED = re.compile(
    rb"[ \t]*(?:TASK[ \t]+)?(?:VAR|PERS|CONST)[ \t]+\w+[ \t]+(\w+)", re.IGNORECASE
)


def find_other_modules(program: Path, listing: FolderListing) -> tuple[Path, ...]:
    """Return other modules beside a program that name data which they do not declare.

    They may be loaded with it, or have run before it. Outputs beside their sources do
    not count.
    """
    found, own = listing.beside(program, _find_naming), program.name.lower()
    return tuple(one for one in found if one.name.lower() != own)


def _find_naming(folder: Path, listing: FolderListing, but: str) -> list[Path]:
    """Find the modules of a folder that name data which other modules declare."""
    modules = listing.ending(folder, RapidFileName.programs)
    named = (one for one in modules if one.name.lower() != but)
    others = [one for one in named if not is_beside_source(one, listing)]
    if not others:
        return []
    shared = (*modules, *system_modules(folder / "program", listing))
    lists = (_list_declared(one, *version_of(one)) for one in shared)
    declared = frozenset[str]().union(*lists)
    return [one for one in others if _names_any(one, *version_of(one), declared)]


@lru_cache(READ_BEFORE)
def _list_declared(path: Path, changed: int, size: int) -> frozenset[str]:
    """Return the data that a module declares for all, as it is now."""
    text = read_if_readable(path)
    routine = _ROUTINE.search(text)  # data stand before all routines
    lines = _native.lines_beginning(text[: routine and routine.start()], _WORDS)
    found = filter(None, (_SHARED.match(line) for _, line in lines))
    return frozenset(one[1].decode("latin-1").lower() for one in found)


@lru_cache(READ_BEFORE)
def _names_any(path: Path, changed: int, size: int, declared: frozenset[str]) -> bool:
    """Tell whether a module names some data that it does not declare.

    One that sets data by their names in texts may mean any.
    """
    words = find_words(read_if_readable(path))
    names = words & declared - _list_declared(path, changed, size)
    return bool(names) or not words.isdisjoint(BY_STRING)
