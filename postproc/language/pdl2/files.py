"""Files of PDL2: programs, their variable files, pages that they name."""

from __future__ import annotations

import re
from pathlib import PurePath
from typing import ClassVar

from postproc import _native
from postproc.files import FolderListing, base_name
from postproc.language.file_name import FileName, Named, Skip

_WORDS = (b"import", b"routine", b"call")  # what names a program begins with one
_NAMED = re.compile(
    rb"^[ \t]*(?:IMPORT[ \t]*'(?P<file>[^'\r\n]*)'"
    rb"|ROUTINE\b[^\r\n]*?\bEXPORTED[ \t]+FROM[ \t]+(?P<program>\w+)"
    rb"|CALL[ \t]+(?P<called>\w+))",
    re.IGNORECASE | re.MULTILINE,
)
OTHER_PROGRAMS = "PROGRAMS/"
_OUTSIDE = re.compile(r"[/\\:\0]|^\.*$")  # folders, drives, ``..``
_PROGRAM_ARM = re.compile(
    rb"^[ \t]*PROGRAM\b[^\r\n]*?\bPROG_ARM[ \t]*=[ \t]*(\d{1,9})\b",
    re.IGNORECASE | re.MULTILINE,
)
_TARGETS = re.compile(
    rb"^[ \t]*\w+[ \t]+A?(?:POS|XTND|JNTP|PATH)\b", re.IGNORECASE | re.MULTILINE
)


class Pdl2FileName(FileName):
    """A file by its name, as PDL2 takes it; so is any that no language knows."""

    programs: ClassVar = (".pdl",)
    variable_files: ClassVar = ".lsv"
    compiled: ClassVar = (".cod", ".var")

    def holds_targets(self, data: bytes) -> bool:
        r"""Tell whether a variable file holds positions.

        >>> Pdl2FileName("job.lsv").holds_targets(b"p1 POS Priv\n X: 1 ..")
        True
        """
        return _TARGETS.search(data) is not None

    def find_named(
        self, text: bytes, skip: Skip, listing: FolderListing
    ) -> tuple[Named, Named]:
        r"""Find what IMPORT, EXPORTED FROM and CALL name.

        A routine may call a page behind a thousand moves: all of it is looked at.

        >>> text = b"PROGRAM m\nIMPORT 'Page1'\nIMPORT '../x'\nBEGIN\nEND m"
        >>> Pdl2FileName("m.pdl").find_named(text, bool, FolderListing())
        ({'page1': 2}, {'../x': 3})
        """
        inside: Named = {}
        outside: Named = {}
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

    def name_for(self, program: PurePath) -> str:
        """Return its name in a job: that of another program, which it does not name.

        >>> Pdl2FileName("b.pdl").name_for(PurePath("a.pdl"))
        'PROGRAMS/b.pdl'
        """
        return f"{OTHER_PROGRAMS}{PurePath(self.place).name}"

    @property
    def is_apart(self) -> bool:
        """Tell by the folder that its name begins with."""
        return self.place.startswith(OTHER_PROGRAMS)

    def arm(self, head: bytes) -> int:
        r"""Read the attribute PROG_ARM.

        >>> head = b"-- PROG_ARM=3\nPROGRAM m EZ, PROG_ARM = 2, HOLD\nBEGIN\nEND m"
        >>> Pdl2FileName("m.pdl").arm(head)
        2
        """
        found = _PROGRAM_ARM.search(head)
        return int(found[1]) if found else 0


FILES = Pdl2FileName
