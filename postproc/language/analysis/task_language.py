"""Languages whose files are modules of tasks, behind the interface of all languages."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, ClassVar

import numpy as np

from postproc.exceptions import ProgramError
from postproc.language.analysis.declarations import TaskFile
from postproc.language.analysis.task_machine import TaskMachine
from postproc.language.language import JobReading, Language
from postproc.language.text.grammars import line_parser
from postproc.language.text.number_edits import Skeleton
from postproc.language.visits import Diagnostic, Visits, never_reached


class TaskLanguage(Language):
    """A language whose files are modules of tasks.

    Attributes:
        grammar: Name of its grammar of statements.
        begins: What its programs begin with.
        joints: What begins a line with joint angles.
        names: What lines begin with that name a point, tried in order.
        goes_on: A statement may stand on several lines.
    """

    tells_accuracy = False
    grammar: ClassVar[str]
    begins: ClassVar[re.Pattern[bytes]]
    joints: ClassVar[re.Pattern[str]]
    names: ClassVar[Sequence[re.Pattern[str]]]
    goes_on: ClassVar[bool] = False

    def recognises(self, text: bytes) -> bool:
        """Return True if a program begins there, behind comments and a header."""
        return self.begins.match(text) is not None

    def holds_joints(self, line: str) -> bool:
        """Return True if a line declares joint angles, or moves to some."""
        return self.joints.match(line) is not None

    def target_names(
        self, file: str, lines: Sequence[bytes], wanted: Sequence[int]
    ) -> Iterator[str]:
        """Name data by their declarations, and other lines by how they begin."""
        name, seen = "", 0
        for line in wanted:
            if line:
                first = seen if self.goes_on else line - 1
                before = (self._name(lines[k]) for k in range(line - 1, first - 1, -1))
                name, seen = next(filter(None, before), name * self.goes_on), line
            yield name if line else ""

    def _name(self, line: bytes) -> str:
        """Name what a line begins, "" where it goes on with what another began."""
        text = line.decode("latin-1")
        found = next(filter(None, (one.match(text) for one in self.names)), None)
        return " ".join(filter(None, found.groups())) if found else ""

    def prepare(self) -> None:
        """Load the parser of statements."""
        line_parser(self.grammar, "statement")

    def report(
        self, machine: TaskMachine, visits: Visits, files: Sequence[Any],
        odd: Iterable[Diagnostic], main: tuple[str, str],
    ) -> JobReading:  # fmt: skip
        """Put together what was found of a job.

        Args:
            machine: It has followed all ways.
            visits: Its visits.
            files: All that was read.
            odd: What is not understood.
            main: What runs first, and what a file is called.
        """
        missed = machine.find_unreached()
        machine.root.forget()
        told = never_reached(missed, *main)
        found = {*odd, *machine.diagnostics, *told}
        corrected = {visits.files[k] for k in np.unique(visits.literals.file).tolist()}
        kept = tuple(f for f in files if f.text.source.name not in corrected)
        texts = tuple(Skeleton.of(file.text) for file in files)
        return JobReading(texts, visits, tuple(sorted(found)), kept, missed)


def check_routines(file: TaskFile, cure: str) -> None:
    """Refuse a program without a routine.

    Args:
        file: The program.
        cure: What to give instead.

    Raises:
        ProgramError: It holds none.
    """
    if not file.routines:
        raise ProgramError(file.text.source.name, "the file holds no routine", cure)
