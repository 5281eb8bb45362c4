"""Which programs of a folder belong together: a main program and its pages.

A page is a program that exactly one other program of its folder names. What several
programs share belongs to none of them, and is taken by itself.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from stat import S_ISREG

from postproc import _native
from postproc.compensation.sidecar import sidecar_path
from postproc.files import (
    KRL_PROGRAMS,
    base_name,
    data_list_of,
    find_source,
    is_data_list,
    is_module,
    program_key,
)
from postproc.language.stamp import read_stamp

HEAD = 1 << 14  # bytes: the stamp of an output stands near its first line
OUTPUT = ".compensated"  # ends the name of an output, before its suffix

_WORDS = (b"import", b"routine", b"call")  # what names a program begins with one
_NAMED = re.compile(
    rb"^[ \t]*(?:IMPORT[ \t]*'(?P<file>[^'\r\n]*)'"
    rb"|ROUTINE\b[^\r\n]*?\bEXPORTED[ \t]+FROM[ \t]+(?P<program>\w+)"
    rb"|CALL[ \t]+(?P<called>\w+))",
    re.IGNORECASE | re.MULTILINE,
)
_MAIN = re.compile(
    rb"^[ \t]*(?:LOCAL[ \t]+)?PROC[ \t]+main[ \t]*\(", re.IGNORECASE | re.MULTILINE
)
_OUTSIDE = re.compile(r"[/\\:\0]|^\.*$")  # folders, drives, ``..``


def find_named_programs(text: bytes) -> tuple[dict[str, int], dict[str, int]]:
    r"""Find the programs that a program names.

    Args:
        text: All of it: a routine may call a page behind a thousand moves.

    Returns:
        Lower-case base names, in order, each with the line that names it first; and
        likewise the names, as written, that lead out of the folder.

    >>> find_named_programs(b"PROGRAM m\nIMPORT 'Page1'\nIMPORT '../x'\nBEGIN\nEND m")
    ({'page1': 2}, {'../x': 3})
    """
    inside: dict[str, int] = {}
    outside: dict[str, int] = {}
    for line, text_of_line in _native.lines_beginning(text, _WORDS):
        found = _NAMED.match(text_of_line)
        if found is None:
            continue
        raw = next(group for group in found.groups() if group is not None)
        name = raw.decode("latin-1")
        if _OUTSIDE.search(name):
            outside.setdefault(name, line)
        else:
            inside.setdefault(base_name(name), line)
    return inside, outside


_PROGRAM_ARM = re.compile(
    rb"^[ \t]*PROGRAM\b[^\r\n]*?\bPROG_ARM[ \t]*=[ \t]*(\d{1,9})\b",
    re.IGNORECASE | re.MULTILINE,
)


def program_arm(head: bytes) -> int:
    r"""Return the arm that a program says it is for, 0 where it says none.

    Args:
        head: Its first bytes.

    >>> program_arm(b"-- PROG_ARM=3\nPROGRAM m EZ, PROG_ARM = 2, HOLD\nBEGIN\nEND m")
    2
    """
    found = _PROGRAM_ARM.search(head)
    return int(found[1]) if found else 0


def of_one_arm(program: int, page: int) -> bool:
    """Tell whether a page may be of its program's arm.

    Args:
        program: The arm that the program says, 0 for nothing: it is of arm 1 then.
        page: Likewise of the page, which is of its program's arm then.
    """
    return page in (0, program or 1)


def names_in(path: Path) -> tuple[dict[str, int], dict[str, int]]:
    """Find the programs that a file names (`find_named_programs`), none if unreadable.

    The module with the main routine of a task names all modules beside it.
    """
    text = _read(path, -1)
    if data_list_of(path.name):
        return _name_sources(path.name, text) | _name_lists(path, text), {}
    if not is_module(path.name):
        return ({}, {}) if is_data_list(path.name) else find_named_programs(text)
    found = _MAIN.search(text)
    if found is None:
        return {}, {}
    line = text.count(b"\n", 0, found.start()) + 1
    return {program_key(other.name): line for other in _modules_beside(path)}, {}


_CALLED = re.compile(  # a routine of KRL, alone on its line or by an interrupt
    rb"(?:^|\bDO)[ \t]*(?:GLOBAL[ \t]+)?(?:EXT[ \t]+)?(\w+)[ \t]*\(",
    re.IGNORECASE | re.MULTILINE,
)


def _name_sources(name: str, text: bytes) -> dict[str, int]:
    """Name the data list of a source, and those sources that it may call."""
    found = {program_key(data_list_of(name)): 1}
    for call in _CALLED.finditer(text):
        called = f"{call[1].decode('latin-1').lower()}{KRL_PROGRAMS[0]}"
        if called not in found:
            found[called] = text.count(b"\n", 0, call.start()) + 1
    return found


_WORD = re.compile(rb"[A-Za-z_$]\w*")
_SHARED_POINT = re.compile(  # in a public list, declared for all programs
    rb"^[ \t]*(?:DECL[ \t]+)?GLOBAL[ \t]+(?:DECL[ \t]+)?"
    rb"(?:E6POS|POS|FRAME|E6AXIS|AXIS)[ \t]+(\w+)",
    re.IGNORECASE | re.MULTILINE,
)
_PUBLIC = re.compile(rb"^[ \t]*DEFDAT[ \t]+\w+[ \t]+PUBLIC\b", re.I | re.M)
_MOVE = re.compile(rb"^[ \t]*(?:S?(?:PTP|LIN|CIRC)|SPL|(?:PTP_)?SPLINE)\b", re.I | re.M)


def _name_lists(path: Path, text: bytes) -> dict[str, int]:
    """Name sources without moves whose lists declare points that a source goes to."""
    found: dict[str, int] = {}
    lists = [(other, _points_for_all(other, *_state(other.stat())))
             for other in sorted(path.parent.iterdir())
             if is_data_list(other.name) and other.stem.lower() != path.stem.lower()
             and other.is_file() and not other.is_symlink()]  # fmt: skip
    if not any(points for _, points in lists):
        return found
    lines = {
        word[0].lower(): word.start() for word in reversed([*_WORD.finditer(text)])
    }
    for other, points in lists:
        places = [lines[name] for name in points & lines.keys()]
        if places:
            line = text.count(b"\n", 0, min(places)) + 1
            found[program_key(other.stem + KRL_PROGRAMS[0])] = line
    return found


def _state(status: os.stat_result) -> tuple[int, int]:
    """Return what changes with the content of a file."""
    return status.st_mtime_ns, status.st_size


@lru_cache(maxsize=8192)
def _points_for_all(path: Path, changed: int, size: int) -> frozenset[bytes]:
    """Return the points that a list declares for all programs, in lower case.

    A list whose source moves belongs to that source, whoever else names its points.
    """
    text = _read(path, -1)
    if not _PUBLIC.search(text):
        return frozenset()
    names = frozenset(name.lower() for name in _SHARED_POINT.findall(text))
    own = find_source(path) if names else None
    moves = own is None or _MOVE.search(_read(own, -1)) is not None
    return frozenset() if moves else names


def _modules_beside(path: Path) -> Iterator[Path]:
    """Yield the other modules of a folder, but for outputs and main ones."""
    for other in sorted(path.parent.iterdir()):
        if other.name == path.name or not is_module(other.name) or other.is_symlink():
            continue
        status = other.stat()
        if S_ISREG(status.st_mode) and _is_part(other, *_state(status)):
            yield other


@lru_cache(maxsize=8192)
def _is_part(path: Path, changed: int, size: int) -> bool:
    """Tell whether a module belongs to a task whose main routine is elsewhere."""
    return _MAIN.search(_read(path, -1)) is None and not is_output(path)


def is_output(path: Path) -> bool:
    """Return True if a compensation has written a file beside its source.

    Of an output in which nothing was changed, its name and its record tell.
    """
    if read_stamp(read_head(path)) is not None:
        return True
    return path.stem.endswith(OUTPUT) and sidecar_path(path).is_file()


def read_head(path: Path) -> bytes:
    """Read the first bytes of a program, nothing where it cannot be read."""
    return _read(path, HEAD)


def _read(path: Path, size: int) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(size)
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
