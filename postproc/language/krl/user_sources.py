"""Sources of packages that people write in: what they move or set is theirs."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from postproc.exceptions import ProgramError
from postproc.files import FolderListing, read_input
from postproc.language.krl.files import ARCHIVE_DEPTH, USER_SOURCES, KrlFileName
from postproc.language.krl.interpreter import KrlMachine
from postproc.language.krl.program import read_krl
from postproc.language.krl.symbols import KrlTask
from postproc.language.text.source import source_from_bytes

FOLDERS = ("System", "TP", "Program")  # of an archive
READ_BEFORE = 64  # sources of which is known what they do


def acting_sources(program: Path, listing: FolderListing) -> tuple[Path, ...]:
    """Return sources of packages that move the arm, or set what moves need.

    The list of routines that are known to be still does not hold for them. They stand
    beside a program, or in its archive; they are read and never rewritten.
    """
    own = program.absolute()
    above = [*own.parents][: 1 + ARCHIVE_DEPTH]
    roots = [folder for folder in above if (folder / "System").is_dir()][:1]
    folders = [*(root / name for root in roots for name in FOLDERS), own.parent]
    places = (listing.named(one, name) for one in folders for name in USER_SOURCES)
    acting = (one for one in places if one and one != own and _acts(one))
    return tuple({place.name.lower(): place for place in acting}.values())


def _acts(place: Path) -> bool:
    """Return True if a source may move the arm, or set what moves need."""
    try:
        return _acts_by_text(place.name, read_input(place))
    except (OSError, ProgramError):
        return False


@lru_cache(READ_BEFORE)
def _acts_by_text(name: str, text: bytes) -> bool:
    """Return True if a source of a package does."""
    if not KrlFileName(name).is_system_source(text):
        return False
    file = read_krl(source_from_bytes(name, text))
    machine = KrlMachine(task=KrlTask([file]))
    return any(map(machine.routine_effects, machine.task.routines_by_file[0]))
