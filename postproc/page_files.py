"""The pages of a program on the disk: programs beside it that only it names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from postproc.batch.tree import group_pages, named_programs, read_head
from postproc.files import PROGRAM, VARIABLES, base_of, suffix_of
from postproc.language.stamp import read_stamp


@dataclass(frozen=True)
class Pages:
    """What belongs to a program.

    Attributes:
        paths: Its pages, in the order in which they are named.
        notes: What it names and what is not followed, and why.
    """

    paths: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()


def find_pages(program: Path) -> Pages:
    """Find the programs that IMPORT, CALL or EXPORTED FROM name, in the same folder.

    A program that others name too is theirs as well, and one with a variable file of
    its own is a program by itself: neither is followed. Earlier outputs and symbolic
    links do not count.
    """
    wanted, outside = named_programs(read_head(program))
    notes = [f"{name!r} leads out of the folder: not followed" for name in outside]
    main = base_of(program.name)
    if not set(wanted) - {main} or not program.parent.is_dir():
        return Pages((), tuple(notes))
    files = [p for p in sorted(program.parent.iterdir()) if not p.is_symlink()]
    values = {base_of(p.name) for p in files if suffix_of(p.name) == VARIABLES}
    programs = {base_of(p.name): p for p in files if _is_source(p)} | {main: program}
    named = {base: _named(path, main) for base, path in programs.items()}
    alone = {
        base: [other for other in others if other not in values]
        for base, others in named.items()
    }
    pages = group_pages(alone).get(main, ())
    notes += _left_out(programs, named, (main, *pages), values)
    return Pages(tuple(programs[page] for page in pages), tuple(notes))


def _is_source(path: Path) -> bool:
    """Tell whether a file is a program, and no output of ours."""
    if suffix_of(path.name) != PROGRAM or not path.is_file():
        return False
    return read_stamp(read_head(path)) is None


def _named(path: Path, main: str) -> list[str]:
    """List the programs that a program names, but for the main one."""
    return [name for name in named_programs(read_head(path))[0] if name != main]


def _left_out(
    programs: Mapping[str, Path],
    named: Mapping[str, Sequence[str]],
    followed: Sequence[str],
    values: set[str],
) -> list[str]:
    """Say which programs are there and named, and not followed."""
    notes = []
    for other in dict.fromkeys(name for base in followed for name in named[base]):
        if other in followed or other not in programs:
            continue
        why = "it has a variable file of its own"
        if other not in values:
            users = [base for base in named if other in named[base] and base != other]
            why = f"{' and '.join(programs[user].name for user in users)} name it"
        notes.append(f"{programs[other].name} is not followed: {why}")
    return notes
