"""Other programs of a folder or an archive that a program depends on."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from pathlib import Path

from postproc import _native
from postproc.exceptions import ProgramError
from postproc.files import FolderListing, read_if_readable
from postproc.language.file_name import list_led
from postproc.language.krl.files import (
    SHARED_LIST,
    USER_SOURCES,
    KrlFileName,
    find_in_archive,
)
from postproc.language.krl.imports import list_imports
from postproc.language.krl.symbols import HELD, find_modes, list_calls, list_changes
from postproc.language.outputs import is_beside_source, version_of
from postproc.language.text.source import source_from_bytes

READ_BEFORE = 8192  # files of which is known what they change, or declare
CALLERS = 3  # programs that are read of those that call a routine
_WORD = re.compile(rb"[A-Za-z_$]\w*")
_GLOBAL = re.compile(rb"^[^;\n]*\bGLOBAL\b[^;\n]*", re.IGNORECASE | re.MULTILINE)
_ROUTINE = re.compile(
    rb"[ \t]*GLOBAL[ \t]+(?:DEF|DEFFCT[ \t]+[\w\[\], ]+)[ \t]+(\w+)[ \t]*\(",
    re.IGNORECASE,
)
Files = tuple[Path, ...]  # a program, and its data list


@dataclass(frozen=True)
class OtherPrograms:
    """Programs of a folder, or of its archive, that others must know.

    Attributes:
        changing: Those that change what all share.
        calling: Those that call a routine which they do not hold, by its name.
        modal: Some of those that leave other modes than a program begins with.
    """

    changing: Sequence[Files]
    calling: Mapping[str, Sequence[Files]]
    modal: Sequence[Files]


def find_other_programs(program: Path, listing: FolderListing) -> tuple[Path, ...]:
    """Return other programs that change shared data, or call a program.

    Each is followed by its data list. Sources of the controller do not count, nor do
    outputs beside their sources.
    """
    if not program.absolute().parent.is_dir():
        return ()
    found = listing.beside(program, _find_others)
    if not (found.changing or found.calling):
        return ()
    led = list_led(KrlFileName(str(program)), listing) if found.calling else [program]
    own = {path.stem.lower() for path in led}
    calling = list[Files]()
    for path in led:
        for name in (path.stem.lower(), *_list_global(path, *version_of(path))):
            callers = found.calling.get(name, ())
            calling += [c for c in callers if c[0].stem.lower() not in own][:CALLERS]
    modal = found.modal if calling else ()
    every = dict.fromkeys((*found.changing, *calling, *modal))
    main = program.stem.lower()
    others = (files for files in every if files[0].stem.lower() != main)
    return tuple(chain.from_iterable(others))


def _find_others(folder: Path, listing: FolderListing, but: str) -> OtherPrograms:
    """Find programs of a folder, or of its archive, that others must know."""
    sources = find_in_archive(folder, KrlFileName.programs, listing)
    named = (one for one in sources if one.name.lower() not in (but, *USER_SOURCES))
    others = [one for one in named if not is_beside_source(one, listing)]
    changing, calling = list[Files](), defaultdict[str, list[Files]](list)
    modal = list[Files]()
    lists = find_in_archive(folder, (KrlFileName.data_lists,), listing)
    lists = lists if others else ()
    shared = HELD.union(*(_list_shared(one, *version_of(one)) for one in lists))
    for other in others:
        values = listing.named(other.parent, f"{other.stem}{KrlFileName.data_lists}")
        own = (other,) if values is None else (other, values)
        acts = _read_acts(*((one, *version_of(one)) for one in own))
        changing += [own] if acts.imports or acts.changes & shared else []
        modal += [own] if acts.modal and len(modal) < CALLERS else []
        for name in acts.calls:
            calling[name].append(own)
    return OtherPrograms(changing, calling, modal)


@lru_cache(READ_BEFORE)
def _list_global(path: Path, changed: int, size: int) -> tuple[str, ...]:
    """Return the names of the GLOBAL routines of a program, in lower case."""
    lines = _native.lines_beginning(read_if_readable(path), (b"global",))
    found = filter(None, (_ROUTINE.match(line) for _, line in lines))
    return tuple(one[1].decode("latin-1").lower() for one in found)


@lru_cache(READ_BEFORE)
def _list_shared(path: Path, changed: int, size: int) -> frozenset[str]:
    """Return the words of a list with which it may declare data for all programs."""
    text = read_if_readable(path)
    if path.name.lower() != SHARED_LIST:
        some = _GLOBAL.findall(text) if b"global" in text.lower() else ()
        text = b"\n".join(some)
    return frozenset(word.decode("latin-1").lower() for word in _WORD.findall(text))


@dataclass(frozen=True)
class _OutsideActs:
    """What a program does to others.

    Attributes:
        changes: Names of others' data that it may change.
        calls: Names of routines that it calls and does not hold.
        imports: It imports data of others.
        modal: It leaves other modes than a program begins with.
    """

    changes: frozenset[str] = frozenset()
    calls: frozenset[str] = frozenset()
    imports: bool = False
    modal: bool = False


@lru_cache(READ_BEFORE)
def _read_acts(*versions: tuple[Path, int, int]) -> _OutsideActs:
    """Return what a program may do to others.

    Args:
        versions: The program and its data list, each as it is now.
    """
    texts = {path.name: read_if_readable(path) for path, _, _ in versions}
    name, text = next(iter(texts.items()))
    if KrlFileName(name).is_system_source(text):
        return _OutsideActs()
    try:
        sources = [source_from_bytes(*one) for one in texts.items()]
        changes, calls = list_changes(*sources), list_calls(*sources)
    except ProgramError:
        return _OutsideActs()
    return _OutsideActs(
        frozenset(one.name for one in changes),
        frozenset(one.name for one in calls),
        bool(list_imports(sources)),
        any(map(find_modes, sources)),
    )
