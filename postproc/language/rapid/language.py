"""RAPID behind the interface of all languages."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from postproc.arrays import Floats
from postproc.files import FolderListing
from postproc.language import language
from postproc.language.analysis.task_language import TaskLanguage, check_routines
from postproc.language.analysis.task_machine import follow
from postproc.language.insert_moves import Splitter
from postproc.language.measuring_program import MeasuringProgram
from postproc.language.rapid import backup
from postproc.language.rapid.clones import RapidCloner
from postproc.language.rapid.files import RapidFileName
from postproc.language.rapid.interpreter import RapidMachine
from postproc.language.rapid.pose_encoding import RAPID_DIALECT
from postproc.language.rapid.program import RapidFile, read_rapid
from postproc.language.rapid.symbols import RapidTask, other_tasks
from postproc.language.rapid.to_visits import RapidCollector
from postproc.language.text.blocks import read_once
from postproc.language.text.source import Source


class Rapid(TaskLanguage):
    """The language of ABB controllers."""

    name = "RAPID"
    controller = "abb"
    suffixes = RapidFileName.programs
    comment = "!"
    dialect = RAPID_DIALECT
    grammar = "rapid"
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

    def read(
        self,
        sources: Sequence[Source],
        start: language.Start,
        known: Sequence[RapidFile] = (),
    ) -> language.JobReading:
        """Read the modules of a task, the one with main first; see `Language.read`."""
        task, beside = _tasks(sources, start, known)
        files = [*task.files, *beside]
        machine = follow(lambda: RapidMachine.of(task, start, beside))
        visits = RapidCollector(machine).collect()
        system = frozenset(f.text.source.name for f in task.files if f.is_system)
        own = (d for file in task.files for d in file.diagnostics)
        odd = (d for d in own if d.file not in system)
        found = self.report(machine, visits, files, odd, ("main", "module"))
        return replace(found, untouched=system)

    def cloner(self, sources: Sequence[Source]) -> language.Cloner:
        """Parse the modules of a task to clone points in them."""
        task, beside = _tasks(sources, language.Start())
        cloner = RapidCloner(task)
        cloner.take_words(beside)  # data of one name may be shared with them
        return cloner

    def splitter(self, sources: Sequence[Source]) -> Splitter:
        """Parse the modules of a task to put points on the ways of its moves."""
        from postproc.language.rapid.insert_moves import RapidSplitter

        task, beside = _tasks(sources, language.Start())
        return RapidSplitter(task, tuple(beside))

    def reads(
        self,
        program: Path,
        within: Path | None = None,
        listing: FolderListing | None = None,
    ) -> tuple[Path, ...]:
        """Return the system modules of the task, and the modules of others."""
        return (*backup.system_modules(program), *backup.modules_beside(program))

    def read_archive(self, folder: Path) -> language.Archive | None:
        """Read ``MOC.cfg`` of a backup."""
        return backup.read_backup(folder)

    def list_placed_arms(self, program: Path) -> tuple[tuple[str, Floats], ...]:
        """Return the arms of a backup, and where ``MOC.cfg`` places them."""
        return tuple((arm.name, arm.pose) for arm in backup.read_mounted_arms(program))

    def write_measuring(self, program: MeasuringProgram, file: Path) -> str:
        """Write joint moves that stop, with comments ``MEASURE``."""
        from postproc.language.rapid.measuring_program import write_rapid

        return write_rapid(program)


LANGUAGE = Rapid


def _tasks(
    sources: Sequence[Source], start: language.Start, known: Sequence[RapidFile] = ()
) -> tuple[RapidTask, list[RapidFile]]:
    """Read the task of a program, and the files of the tasks beside it.

    Raises:
        ProgramError: A file of the task is none, or the first holds no routine.
    """
    own = [source for source in sources if not RapidFileName(source.name).task_beside]
    files = [read_once(source, known, read_rapid) for source in own]
    check_routines(files[0], "Give a RAPID module")
    before = {file.text.source.name: file for file in known}
    beside = []
    for source in sources[len(own) :]:
        file = before.get(source.name)
        same = file is not None and file.text.source == source
        beside.append(file if file is not None and same else read_rapid(source))
    return RapidTask(files, start.taught, other_tasks(beside)), beside
