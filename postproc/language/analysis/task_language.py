"""Languages whose files are modules of tasks, behind the interface of all languages."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

from postproc.exceptions import ProgramError
from postproc.language.analysis.clones import TaskCloner
from postproc.language.analysis.symbols import TaskSymbols
from postproc.language.analysis.task_machine import TaskMachine, follow
from postproc.language.analysis.to_visits import TaskCollector
from postproc.language.insert_moves import Splitter
from postproc.language.language import Cloner, JobReading, Language, Start
from postproc.language.text.blocks import check_blocks
from postproc.language.text.grammars import line_parser
from postproc.language.text.number_edits import Skeleton
from postproc.language.text.source import ParsedFiles, Source, parse_once, parse_shared
from postproc.language.visits import never_reached


class TaskLanguage(Language):
    """A language whose files are modules of tasks.

    Attributes:
        grammar: Name of its grammar of statements.
        begins: What its programs begin with.
        joints: What begins a line with joint angles.
        cure: What to give instead of a file that holds no routine.
        tells_system: What is not understood in files of the system is told, too.
        task: What the names of its files mean.
        machine: Follows a task.
        collector: Makes visits of what it has found.
        clones: Clones points of a task.
    """

    tells_accuracy = False
    grammar: ClassVar[str]
    begins: ClassVar[re.Pattern[bytes]]
    joints: ClassVar[re.Pattern[str]]
    cure: ClassVar[str]
    tells_system: ClassVar[bool] = True
    task: ClassVar[type[TaskSymbols[Any]]]
    machine: ClassVar[type[TaskMachine]]
    collector: ClassVar[type[TaskCollector]]
    clones: ClassVar[type[TaskCloner]]

    # What a language says.

    @staticmethod
    @abstractmethod
    def read_file(source: Source) -> Any:
        """Read a file.

        Raises:
            ProgramError: A string, or a header, does not end.
        """

    @abstractmethod
    def name_main(self, files: Sequence[Any]) -> tuple[str, str]:
        """Name what runs first, and what a file is called."""

    def is_beside(self, source: Source) -> bool:
        """Return True for a file of a task that runs at the same time."""
        return False

    def refuse(self, files: Sequence[Any]) -> None:
        """Refuse files that cannot be followed, or must not be corrected.

        Args:
            files: Those of the task, the one that runs first before the others.

        Raises:
            ProgramError: What is wrong.
        """

    # What follows from that.

    def recognises(self, text: bytes) -> bool:
        """Return True if a program begins there, behind comments and a header."""
        return self.begins.match(text) is not None

    def holds_joints(self, line: str) -> bool:
        """Return True if a line declares joint angles, or moves to some."""
        return self.joints.match(line) is not None

    def prepare(self) -> None:
        """Load the parser of statements."""
        line_parser(self.grammar, "statement")

    def parse(
        self,
        sources: Sequence[Source],
        start: Start,
        known: ParsedFiles | None = None,
    ) -> TaskSymbols[Any]:
        """Parse the files of a job, see `Language.read`.

        Raises:
            ProgramError: A file of the task is none, or the first holds no routine.
        """
        own = [one for one in sources if not self.is_beside(one)]
        others = [one for one in sources if self.is_beside(one)]
        files = [parse_once(known, one, self.read_file) for one in own]
        for file in files:
            check_blocks(file)
        if not files[0].routines:
            problem = "the file holds no routine"
            raise ProgramError(own[0].name, problem, self.cure)
        self.refuse(files)
        beside = [parse_shared(self.read_file, one) for one in others]
        return self.task(files, start, beside)

    def read(
        self,
        sources: Sequence[Source],
        start: Start,
        known: ParsedFiles | None = None,
    ) -> JobReading:
        """Read the files of a job and follow it, see `Language.read`."""
        task = self.parse(sources, start, known)
        machine = follow(self.machine, task)
        collector = self.collector(machine)
        visits = collector.collect()
        own = (f.moves[: 0 if f.is_system else None] for f in task.files)
        missed = collector.find_unreached(own)
        machine.root.forget()
        quiet = [f for f in task.files if f.is_system and not self.tells_system]
        odd = (d for f in task.files if f not in quiet for d in f.diagnostics)
        beside = machine.list_lines_beside() if missed else {}
        told = never_reached(missed, *self.name_main(task.files), beside)
        found = {*odd, *machine.diagnostics, *told}
        files = (*task.files, *task.files_beside)
        return JobReading(
            tuple(Skeleton.of(file.text) for file in files), visits,
            tuple(sorted(found)), missed,
            frozenset(file.text.source.name for file in quiet),
        )  # fmt: skip

    def splitter(self, sources: Sequence[Source]) -> Splitter:
        """Parse the files of a job to put points on the ways of its moves."""
        task = self.parse(sources, Start())
        found: Splitter = self.load_part("insert_moves").SPLITTER(task)
        return found

    def cloner(self, sources: Sequence[Source]) -> Cloner:
        """Parse the files of a job to clone points in them."""
        return self.clones(self.parse(sources, Start()))
