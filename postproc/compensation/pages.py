"""Which programs of a folder belong together: a main program and its pages.

A page is a program that exactly one other program of its folder names. What several
programs share belongs to none of them, and is taken by itself.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from pathlib import Path

from postproc.compensation.output.sidecar import sidecar_path
from postproc.files import FolderListing, read_if_readable
from postproc.language.languages import file_named
from postproc.language.outputs import HEAD, OUTPUT
from postproc.language.text.stamp import read_stamp


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

    A page belongs to the only program that leads to it, itself or by its other pages.

    >>> group_pages({"a": ["p", "q"], "p": [], "q": ["lib"], "b": ["lib"], "lib": []})
    {'a': ('p', 'q'), 'b': (), 'lib': ()}
    >>> group_pages({"a": ["p", "q"], "p": ["q"], "q": []})
    {'a': ('p', 'q')}
    """
    users: dict[str, list[str]] = {name: [] for name in named}
    for name, others in named.items():
        for other in others:
            if other in users and other != name:
                users[other].append(name)
    mains = [name for name, by in users.items() if not by]
    led = _lead(mains, users)
    mains += _list_circles(named, led)
    while joins := _list_joins(led := _lead(mains, users), users):
        mains += joins
    main_of = {name: min(leading) for name, leading in led.items()}
    ordered = (name for name in named if main_of[name] == name)
    return {main: tuple(_pages(main, named, main_of)) for main in ordered}


def _lead(
    mains: Sequence[str], users: Mapping[str, Sequence[str]]
) -> dict[str, frozenset[str]]:
    """Say which main programs lead to each one; what none leads to stays out."""
    led = {main: frozenset([main]) for main in mains}
    before = None
    while led != before:
        before = dict(led)
        for name, by in users.items():
            if name not in mains:
                found = frozenset[str]().union(*(led.get(user, ()) for user in by))
                led |= {name: found} if found else {}
    return led


def _list_joins(
    led: Mapping[str, frozenset[str]], users: Mapping[str, Sequence[str]]
) -> list[str]:
    """List programs at which the ways from several main programs meet."""
    many = [name for name, mains in led.items() if len(mains) > 1]
    ways = {name: {led.get(user) for user in users[name]} - {None} for name in many}
    return [name for name in many if len(ways[name]) > 1]


def _list_circles(named: Mapping[str, Sequence[str]], led: Container[str]) -> list[str]:
    """List programs that name each other in a circle, and that no others lead to."""
    found = []
    for name in (one for one in named if one not in led):
        seen, waiting = set[str](), [one for one in named[name] if one != name]
        while waiting:
            at = waiting.pop()
            if at not in seen and at in named:
                seen.add(at)
                waiting += named[at]
        found += [name] if name in seen else []
    return found


def _pages(
    main: str, named: Mapping[str, Sequence[str]], main_of: Mapping[str, str]
) -> list[str]:
    """List the pages of a program, and behind each those that it names first."""
    found: list[str] = []
    waiting = [p for p in reversed(named[main]) if main_of.get(p) == main]
    while waiting:
        page = waiting.pop()
        if page in found or page == main:
            continue
        found.append(page)
        waiting += [p for p in reversed(named[page]) if main_of.get(p) == main]
    return found
