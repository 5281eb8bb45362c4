"""Which programs of a folder belong together: a main program and its pages.

A page is a program that exactly one other program of its folder names. What several
programs share belongs to none of them, and is taken by itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from postproc.compensation.output.sidecar import sidecar_path
from postproc.files import FolderListing, read_if_readable
from postproc.language.languages import file_named
from postproc.language.text.stamp import read_stamp

HEAD = 1 << 14  # bytes: the stamp of an output stands near its first line
OUTPUT = ".compensated"  # ends the name of an output, before its suffix


def program_arm(path: Path) -> int:
    """Return the arm that a program says it is for, 0 where it says none."""
    return file_named(path).arm(read_head(path))


def of_one_arm(program: int, page: int) -> bool:
    """Tell whether a page may be of its program's arm.

    Args:
        program: The arm that the program says, 0 for nothing: it is of arm 1 then.
        page: Likewise of the page, which is of its program's arm then.
    """
    return page in (0, program or 1)


def names_in(
    path: Path, listing: FolderListing
) -> tuple[dict[str, int], dict[str, int]]:
    """Find the programs that a file names, none if unreadable.

    See `FileName.find_named`. Outputs belong to outputs alone, and a file that has its
    output beside it to none of them.

    Args:
        path: The file.
        listing: What its folder holds.
    """
    written = is_output(path) or sidecar_path(path).is_file()
    skip = _has_output if written else is_output
    return file_named(path).find_named(read_if_readable(path), skip, listing)


def _has_output(path: Path) -> bool:
    return path.with_name(f"{path.stem}{OUTPUT}{path.suffix}").is_file()


def is_output(path: Path) -> bool:
    """Return True if a compensation has written a file beside its source.

    Of an output in which nothing was changed, its name and its record tell.
    """
    if read_stamp(read_head(path)) is not None:
        return True
    return path.stem.endswith(OUTPUT) and sidecar_path(path).is_file()


def read_head(path: Path) -> bytes:
    """Read the first bytes of a program, nothing where it cannot be read."""
    return read_if_readable(path, HEAD)


def group_pages(named: Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """Give every program that belongs to no other its pages.

    Args:
        named: For each program of a folder, by lower-case base name: those it names.

    Returns:
        Main programs and their pages, in the order in which they are named, pages of
        pages behind the page that names them.

    >>> group_pages({"a": ["p", "q"], "p": [], "q": ["lib"], "b": ["lib"], "lib": []})
    {'a': ('p', 'q'), 'b': (), 'lib': ()}
    """
    users: dict[str, list[str]] = {name: [] for name in named}
    for name, others in named.items():
        for other in others:
            if other in users and other != name:
                users[other].append(name)
    owner = {name: by[0] for name, by in users.items() if len(by) == 1}
    mains = [name for name in named if name not in owner]
    mains += _in_circles(named, owner)
    return {main: tuple(_pages(main, named, owner)) for main in mains}


def _in_circles(named: Mapping[str, Sequence[str]], owner: dict[str, str]) -> list[str]:
    """Free programs that name each other in a circle from their owners."""
    freed = []
    for name in named:
        seen, at = {name}, owner.get(name)
        while at is not None and at not in seen:
            seen.add(at)
            at = owner.get(at)
        if at == name:
            del owner[name]
            freed.append(name)
    return freed


def _pages(
    main: str, named: Mapping[str, Sequence[str]], owner: Mapping[str, str]
) -> list[str]:
    """List the pages of a program, and behind each its own."""
    found, waiting = [], [p for p in reversed(named[main]) if owner.get(p) == main]
    while waiting:
        page = waiting.pop()
        if page in found:
            continue
        found.append(page)
        waiting += [p for p in reversed(named[page]) if owner.get(p) == page]
    return found
