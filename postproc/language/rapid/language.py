"""RAPID behind the interface of all languages."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from postproc.arrays import Floats
from postproc.files import FolderListing
from postproc.language.analysis.task_language import TaskLanguage
from postproc.language.rapid import backup
from postproc.language.rapid.clones import RapidCloner
from postproc.language.rapid.files import RapidFileName
from postproc.language.rapid.interpreter import RapidMachine
from postproc.language.rapid.other_modules import find_other_modules
from postproc.language.rapid.pose_encoding import RAPID_DIALECT
from postproc.language.rapid.program import RapidFile, read_rapid
from postproc.language.rapid.symbols import RapidTask
from postproc.language.rapid.to_visits import RapidCollector
from postproc.language.text.source import Source


class Rapid(TaskLanguage):
    """The language of ABB controllers."""

    name = "RAPID"
    controller = "abb"
    suffixes = RapidFileName.programs
    comment = "!"
    dialect = RAPID_DIALECT
    grammar = "rapid"
    cure = "Give a RAPID module"
    tells_system = False
    read_file = staticmethod(read_rapid)
    task = RapidTask
    machine = RapidMachine
    collector = RapidCollector
    clones = RapidCloner
    begins = re.compile(
        rb"(?:\xef\xbb\xbf)?(?:\s|![^\r\n]*[\r\n])*(?:%%%|MODULE\s)", re.I
    )
    joints = re.compile(r"[^!\"]*?\b(?:jointtarget\s|\w+AbsJ\b|\w+ExtJ\b)", re.I)
    names = (
        re.compile(
            r"\s*(?:(?:LOCAL|TASK)\s+)?(?:CONST|PERS|VAR)\s+\w+\s+([A-Za-z_]\w*)", re.I
        ),
        re.compile(r"\s*([A-Za-z_]\w*)\s*(?:\\[^,;]*,)?\s*([A-Za-z_]\w*)?"),
    )
    goes_on = True

    def name_main(self, files: Sequence[RapidFile]) -> tuple[str, str]:
        """Name the main routine, and what a file is called."""
        return "main", "module"

    def is_beside(self, source: Source) -> bool:
        """Return True for a module of another task, or of none."""
        return RapidFileName(source.name).is_apart

    def reads(self, program: Path, listing: FolderListing) -> tuple[Path, ...]:
        """Return system modules, those of other tasks, and what names shared data."""
        own = backup.system_modules(program, listing)
        others = find_other_modules(program, listing)
        return (*own, *backup.modules_beside(program, listing), *others)

    read_archive = staticmethod(backup.read_backup)

    def list_placed_arms(self, program: Path) -> tuple[tuple[str, Floats], ...]:
        """Return the arms of a backup, and where ``MOC.cfg`` places them."""
        return tuple((arm.name, arm.pose) for arm in backup.read_mounted_arms(program))


LANGUAGE = Rapid
