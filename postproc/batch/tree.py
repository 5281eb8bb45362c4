"""What a source tree holds: programs with all that belongs to them, and the rest."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PurePosixPath

from postproc.batch.plan import BatchPlan, Unit
from postproc.compensation.output.sidecar import SUFFIX
from postproc.compensation.pages import (
    group_pages,
    names_in,
    of_one_arm,
    program_arm,
)
from postproc.exceptions import OutputError, ProgramError
from postproc.files import (
    LARGEST,
    TEMPORARY,
    FolderListing,
    base_name,
)
from postproc.language.languages import file_named, language_of

# The files of a tree, sorted folder by folder.

_STALE = "is compiled from the uncompensated program: translate it again"


@dataclass(frozen=True)
class Tree:
    """A source tree, by paths below its root with ``/``.

    Attributes:
        root: Its folder.
        units: Programs that are compensated together, those of a setup behind each
            other.
        copies: Everything else, to be copied as it is.
        refused: What will not be in the target tree, and why.
        notes: What a person should know: path and text.
        size: Bytes of all files.
    """

    root: Path
    units: tuple[Unit, ...]
    copies: tuple[str, ...]
    refused: Mapping[str, str]
    notes: tuple[tuple[str, str], ...]
    size: int


def scan(root: Path, plan: BatchPlan) -> Tree:
    """List a source tree.

    Raises:
        ProgramError: It is no folder, or holds a folder that cannot be read.
    """
    if not root.is_dir():
        raise ProgramError(root, "is no folder", "Give the folder of the programs")
    folders: dict[str, list[str]] = defaultdict(list)
    refused: dict[str, str] = {}
    sizes: dict[str, int] = {}
    for place, entry in _walk(root):
        if entry.is_symlink() or not entry.is_file(follow_symlinks=False):
            kind = "a symbolic link" if entry.is_symlink() else "no regular file"
            refused[place] = f"is {kind}: it is not followed; put the file itself here"
            continue
        file = file_named(place)
        size = entry.stat(follow_symlinks=False).st_size
        if size > LARGEST and (file.is_program or file.is_variables):
            refused[place] = f"is longer than {LARGEST} bytes: is it a program?"
            continue
        folders[place.rpartition("/")[0]].append(place)
        sizes[place] = size
    listing = FolderListing(root.absolute())
    found = [_sort(root, names, plan, listing) for names in folders.values()]
    units = [unit for part in found for unit in part.units]
    read = {
        (place, PurePosixPath(unit.program).parent)
        for unit in units
        for place in unit.reads
    }
    only_read = {place for place, by in read if not _is_program_by_itself(place, by)}
    kept = [p for unit in units if unit.program in only_read for p in unit.own]
    units = [unit for unit in units if unit.program not in only_read]
    others = {unit: why for unit in units if (why := _other_arm(root, unit, plan))}
    refused |= {place: why for unit, why in others.items() for place in unit.own}
    units = [unit for unit in units if unit not in others]
    # The largest first: no worker is left alone with one at the end.
    units.sort(key=lambda u: (u.setup, -sum(sizes[f] for f in u.files), u.program))
    return Tree(
        root,
        tuple(units),
        tuple(copy for part in found for copy in part.copies) + tuple(kept),
        refused | {k: v for part in found for k, v in part.refused.items()},
        tuple(note for part in found for note in part.notes),
        sum(sizes.values()),
    )


def _other_arm(root: Path, unit: Unit, plan: BatchPlan) -> str:
    """Return why the arm of a unit is not that of its cell, "" where it is."""
    cell = plan.setups[unit.setup].cell
    try:
        file = file_named(root / unit.program)
        file.refuse_other_arm(cell.arm_number, str(cell.path))
    except ProgramError as exc:
        return str(exc)
    return ""


def _is_program_by_itself(place: str, folder: PurePosixPath) -> bool:
    """Tell whether a file that programs of a folder read is one by itself."""
    name = file_named(place).name_for(folder / "program")
    return file_named(name).is_apart


def _walk(root: Path) -> Iterator[tuple[str, os.DirEntry[str]]]:
    """Yield all entries below a folder that are not folders, in order of their paths.

    Raises:
        ProgramError: A folder cannot be read.
    """
    waiting = [""]
    while waiting:
        folder = waiting.pop()
        try:
            with os.scandir(root / folder) as entries:
                found = sorted(entries, key=lambda entry: entry.name)
        except OSError as exc:
            problem = f"cannot be read ({exc.strerror})"
            raise ProgramError(root / folder, problem, "Check its rights") from None
        for entry in found:
            place = f"{folder}/{entry.name}".lstrip("/")
            if entry.is_dir(follow_symlinks=False):
                waiting.append(place)
            elif not entry.name.endswith(TEMPORARY):
                yield place, entry


@dataclass
class _Folder:
    """What one folder holds, being sorted."""

    units: list[Unit]
    copies: list[str]
    refused: dict[str, str]
    notes: list[tuple[str, str]]


def _sort(
    root: Path, places: Sequence[str], plan: BatchPlan, listing: FolderListing
) -> _Folder:
    """Sort the files of one folder into programs, what belongs to them, and others."""
    part = _Folder([], [], {}, [])
    system = {p for p in places if file_named(root / p).is_system()}
    files = {p: file_named(p) for p in places}
    lists = {f.data_list.lower() for p, f in files.items() if p not in system}
    ours = [p for p, f in files.items() if f.is_program or p.lower() in lists]
    ours = [p for p in ours if p not in system]
    lone = {p for p, f in files.items() if f.is_data_list and not f.is_shared}
    lone.difference_update(ours, (files[p].data_list for p in system))
    ours += [p for p in files if p in lone]
    programs = _by_base(ours, lambda place: files[place].key, part)
    values = (p for p, f in files.items() if f.is_variables)
    variables = _by_base(values, base_name, part)
    records = {place + SUFFIX for place in programs.values()}
    for place in places:
        if place in records or place in part.refused:
            continue  # a record of an earlier output would be taken for ours
        if files[place].is_variables and base_name(place) not in programs:
            _lone_variables(root, place, part)
        elif not (place in ours or files[place].is_variables):
            part.copies.append(place)
            if files[place].is_compiled and base_name(place) in programs:
                part.notes.append((place, _STALE))
    named, arms = {}, {}
    for base, place in programs.items():
        named[base], outside = names_in(root / place, listing)
        arms[base] = program_arm(root / place)
        part.notes += [
            (place, f"{n!r} is outside of its folder: not followed") for n in outside
        ]
    for main, pages in _assign_pages(named, variables, arms).items():
        if programs[main] in lone:  # and no program's alone
            part.copies.append(programs[main])
            continue
        setup = plan.setup_of(programs[main], arms[main])
        own = [programs[page] for page in pages]
        reads = _find_shared(root, programs[main], listing)
        reads = tuple(place for place in reads if place not in own)
        _add_unit(programs[main], own, reads, variables, setup, part)
    return part


def _find_shared(root: Path, program: str, listing: FolderListing) -> tuple[str, ...]:
    """Return the places of what a program shares with others, and only reads."""
    root = root.absolute()
    found = language_of(program).reads(root / program, listing)
    return tuple(filter(None, (_place_below(root, one) for one in found)))


@lru_cache(8192)
def _place_below(root: Path, path: Path) -> str:
    """Return the place of a file below a folder, "" where it is not there."""
    inside = root in path.parents
    return path.relative_to(root).as_posix() if inside else ""


def _by_base(
    places: Iterable[str], key: Callable[[str], str], part: _Folder
) -> dict[str, str]:
    """Index files of one kind by a name; refuse those that differ in case only."""
    found: dict[str, str] = {}
    for place in places:
        first = found.setdefault(key(place), place)
        if first != place:
            part.refused[place] = f"has the name of {first} but for upper case"
    return found


def _assign_pages(
    named: Mapping[str, Iterable[str]],
    variables: Mapping[str, str],
    arms: Mapping[str, int],
) -> dict[str, tuple[str, ...]]:
    """Join pages to their programs, but for pages that have variables of their own.

    Only the main program's variable file is read with it. A program of another arm is
    none of its pages either: it belongs to another cell and model.
    """
    keep = {
        name: [
            other
            for other in others
            if other not in variables and of_one_arm(arms[name], arms.get(other, 0))
        ]
        for name, others in named.items()
    }
    return group_pages(keep)


def _add_unit(
    program: str,
    pages: Sequence[str],
    reads: tuple[str, ...],
    variables: Mapping[str, str],
    setup: int | None,
    part: _Folder,
) -> None:
    """Add a program, or refuse it where no rule of the plan fits.

    Args:
        program: Its place.
        pages: Places of its pages.
        reads: Places of what it reads, and others too.
        variables: Places of variable files, by base name.
        setup: Index of its setup, None where no rule fits.
        part: Where it is added.
    """
    values = variables.get(file_named(program).key)
    if setup is not None:
        part.units.append(Unit(program, tuple(pages), values, setup, reads))
        return
    for place in (program, *pages, *([values] if values else [])):
        part.refused[place] = "no rule of the plan fits: add one, or --cell and --model"


def _lone_variables(root: Path, place: str, part: _Folder) -> None:
    """Refuse a variable file that holds targets of a program which is not there."""
    try:
        data = (root / place).read_bytes()
    except OSError as exc:
        part.refused[place] = f"cannot be read ({exc.strerror})"
        return
    if file_named(place).holds_targets(data):
        part.refused[place] = "holds targets, and its program is not beside it"
    else:
        part.copies.append(place)


def refuse_overlap(source: Path, target: Path) -> None:
    """Refuse a target tree inside of the source tree, or around it.

    Raises:
        OutputError: They overlap.
    """
    a, b = source.resolve(), target.resolve()
    if a == b or a in b.parents or b in a.parents:
        raise OutputError(
            target, "overlaps the source tree", "Give a folder beside it as DST"
        )
