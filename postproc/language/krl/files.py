"""Files of KRL: sources, their data lists, submit programs, files of a controller."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path, PurePath
from typing import ClassVar

from postproc.files import FolderListing, base_name, read_if_readable
from postproc.language.file_name import FileName, Named, Skip

SHARED_LIST, ARCHIVE_DEPTH = "$config.dat", 4
OTHER_PROGRAMS = "PROGRAMS/"
USER_SOURCES = ("user_grp.src", "userspot.src")
# Sources of a controller and its packages, and routines that tell them from others.
_SYSTEM_SOURCES = {
    "bas": ("bas", "initmov", "frames"),
    "ir_stopm": ("ir_stopm",),
    "msglib": ("msgnotify",),
    "p00": ("p00",),
    "h50": ("h50",),
    "user_grp": ("user_grp",),
    "userspot": ("userspot",),
}
_CALLED = re.compile(  # a routine, alone on its line or by an interrupt
    rb"(?:^|\bDO)[ \t]*(?:GLOBAL[ \t]+)?(?:EXT[ \t]+)?(\w+)[ \t]*\(",
    re.IGNORECASE | re.MULTILINE,
)
_WORD = re.compile(rb"[A-Za-z_$]\w*")
_SHARED_POINT = re.compile(  # in a public list, declared for all programs
    rb"^[ \t]*(?:DECL[ \t]+)?GLOBAL[ \t]+(?:DECL[ \t]+)?"
    rb"(?:E6POS|POS|FRAME|E6AXIS|AXIS)[ \t]+(\w+)",
    re.IGNORECASE | re.MULTILINE,
)
_PUBLIC = re.compile(rb"^[ \t]*DEFDAT[ \t]+\w+[ \t]+PUBLIC\b", re.I | re.M)
_MOVE = re.compile(rb"^[ \t]*(?:S?(?:PTP|LIN|CIRC)|SPL|(?:PTP_)?SPLINE)\b", re.I | re.M)


class KrlFileName(FileName):
    """A file by its name, as KRL takes it."""

    programs: ClassVar = (".src",)
    data_lists: ClassVar = ".dat"
    background: ClassVar = (".sub",)

    @property
    def is_submit(self) -> bool:
        """Tell whether it is a program that runs beside the one that moves the arm."""
        return self.suffix in self.background

    @property
    def is_shared(self) -> bool:
        """Tell whether it is a list or a submit program of all programs.

        >>> [KrlFileName(f"R1/{name}").is_shared for name in ("$config.dat", "a.dat")]
        [True, False]
        """
        of_system = self.is_data_list and base_name(self.place).startswith("$")
        return of_system or self.is_submit

    def is_system(self) -> bool:
        """Tell by its name, and by the routines that it holds."""
        if base_name(self.name) not in _SYSTEM_SOURCES:
            return False
        return self.is_system_source(read_if_readable(Path(self.place)))

    def is_system_source(self, text: bytes) -> bool:
        """Tell whether it is a source of the controller or of its packages.

        >>> KrlFileName("IR_STOPM.src").is_system_source(b"DEF  IR_STOPM ( )")
        True
        >>> KrlFileName("bas.src").is_system_source(b"DEF bas( )")
        False
        """
        names = _SYSTEM_SOURCES.get(base_name(self.place), ())
        if not names or not self.is_program:
            return False
        begin = rb"(?im)^[ \t]*(?:GLOBAL[ \t]+)?DEF[ \t]+"
        own = (begin + name.encode() + rb"\b" for name in names)
        return all(re.search(pattern, text) for pattern in own)

    def find_named(
        self, text: bytes, skip: Skip, listing: FolderListing
    ) -> tuple[Named, Named]:
        """Name the data list of a source, and those sources that it may call."""
        if not self.is_program:
            return {}, {}
        found = {KrlFileName(self.data_list).key: 1}
        for call in _find_calls(text):
            called = f"{call[1].decode('latin-1').lower()}{self.programs[0]}"
            if called not in found:
                found[called] = text.count(b"\n", 0, call.start()) + 1
        return found | _name_lists(Path(self.place), text, listing), {}

    def find_shared(self, listing: FolderListing) -> tuple[Path, ...]:
        """Find what a source shares with others: ``$config.dat``, and submit programs.

        Submit programs stand beside either, or anywhere in the archive that the list
        belongs to; they may change what programs read.
        """
        folder = Path(self.place).absolute().parent
        if not self.is_program or not folder.is_dir():
            return ()
        found = find_shared_list(folder, listing)
        submits = find_in_archive(folder, self.background, listing)
        return (*(() if found is None else (found,)), *submits)

    def name_for(self, program: PurePath) -> str:
        """Return its name in a job; other programs have one with a folder.

        >>> KrlFileName("b.src").name_for(PurePath("a.src"))
        'PROGRAMS/b.src'
        """
        path = PurePath(self.place)
        apart = not (self.is_shared or path.name.lower() in USER_SOURCES)
        return f"{OTHER_PROGRAMS}{path.name}" if apart else path.name

    @property
    def is_apart(self) -> bool:
        """Tell by the folder that its name begins with."""
        return self.place.startswith(OTHER_PROGRAMS)


FILES = KrlFileName


def _find_calls(text: bytes) -> Iterator[re.Match[bytes]]:
    """Yield what may be calls; only lines with a bracket are looked at."""
    at = text.find(b"(")
    while at >= 0:
        end = text.find(b"\n", at)
        end = len(text) if end < 0 else end
        yield from _CALLED.finditer(text, text.rfind(b"\n", 0, at) + 1, end)
        at = text.find(b"(", end)


def find_in_archive(
    folder: Path, suffixes: tuple[str, ...], listing: FolderListing
) -> tuple[Path, ...]:
    """Find files by their suffixes: of a folder, and of the archive that it is in.

    One of several of a name is found, that of the folder before others.
    """
    found = find_shared_list(folder, listing)
    paths: list[Path] = []
    if found is not None and found.parent.name.lower() == "system":
        paths += listing.ending(found.parent.parent, suffixes, below=True)
    for place in dict.fromkeys([folder] if found is None else [found.parent, folder]):
        paths += listing.ending(place, suffixes)
    return tuple({path.name.lower(): path for path in paths}.values())


def find_shared_list(folder: Path, listing: FolderListing) -> Path | None:
    """Find ``$config.dat``: beside a source, or where a controller keeps it.

    In an archive programs stand in ``R1/Program``, at any depth, and the list in
    ``R1/System``.
    """
    found = listing.named(folder, SHARED_LIST)
    for above in list(folder.parents)[:ARCHIVE_DEPTH]:
        outside = listing.root and listing.root not in (above, *above.parents)
        if found is not None or outside:
            break
        found = listing.named(above / "System", SHARED_LIST)
    return found


def _name_lists(path: Path, text: bytes, listing: FolderListing) -> Named:
    """Name sources without moves whose lists declare points that a source goes to."""
    every = listing.once(path.parent, _list_public)
    public = {own: points for own, points in every.items() if _stem(own) != _stem(path)}
    if not public:
        return {}
    lines = {
        word[0].lower(): word.start() for word in reversed([*_WORD.finditer(text)])
    }
    found: Named = {}
    for own, points in public.items():
        if places := [lines[name] for name in points & lines.keys()]:
            found[KrlFileName(str(own)).key] = 1 + text.count(b"\n", 0, min(places))
    return found


def _stem(path: Path) -> str:
    return path.stem.lower()


def _list_public(folder: Path, listing: FolderListing) -> dict[Path, frozenset[bytes]]:
    """Return the points that lists of a folder declare for all programs, lower case.

    A list whose source moves belongs to that source, whoever else names its points. A
    list needs no source: it is named by that, or by itself.
    """
    found = {}
    for place in listing.ending(folder, (KrlFileName.data_lists,)):
        points = frozenset() if place.is_symlink() else _find_public(place)
        source = listing.named(folder, f"{place.stem}{KrlFileName.programs[0]}")
        if points and not (source and _MOVE.search(read_if_readable(source))):
            found[source or place] = points
    return found


def _find_public(place: Path) -> frozenset[bytes]:
    """Return the points that a list declares for all programs, in lower case."""
    text = read_if_readable(place)
    public = b"global" in text.lower() and _PUBLIC.search(text)
    points = _SHARED_POINT.findall(text) if public else ()
    return frozenset(name.lower() for name in points)
