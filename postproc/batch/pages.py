"""Which programs of a folder belong together: a main program and its pages.

A page is a program that exactly one other program of its folder names. What several
programs share belongs to none of them, and is taken by itself.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from postproc.language.pdl2.job import base_name

HEAD = 1 << 18  # bytes: declarations stand before BEGIN, far from the end of a file

_NAMED = re.compile(
    rb"^[ \t]*(?:IMPORT[ \t]*'(?P<file>[^'\r\n]*)'"
    rb"|ROUTINE\b[^\r\n]*?\bEXPORTED[ \t]+FROM[ \t]+(?P<program>\w+)"
    rb"|CALL[ \t]+(?P<called>\w+))",
    re.IGNORECASE | re.MULTILINE,
)
_OUTSIDE = re.compile(r"[/\\:\0]|^\.*$")  # folders, drives, ``..``


def named_programs(head: bytes) -> tuple[list[str], list[str]]:
    r"""Find the programs that a program names.

    Args:
        head: Its first bytes.

    Returns:
        Lower-case base names, in order, each once; and the names, as written, that
        lead out of the folder and are not followed.

    >>> named_programs(b"PROGRAM m\nIMPORT 'Page1'\nIMPORT '../x'\nBEGIN\nEND m")
    (['page1'], ['../x'])
    """
    inside: dict[str, None] = {}
    outside: dict[str, None] = {}
    for found in _NAMED.finditer(head):
        raw = next(group for group in found.groups() if group is not None)
        name = raw.decode("latin-1")
        if _OUTSIDE.search(name):
            outside[name] = None
        else:
            inside[base_name(name)] = None
    return list(inside), list(outside)


def read_head(path: Path) -> bytes:
    """Read the first bytes of a program, nothing where it cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(HEAD)
    except OSError:
        return b""


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
