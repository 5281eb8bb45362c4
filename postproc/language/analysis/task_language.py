"""Languages whose files are modules of tasks, behind the interface of all languages."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
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
    """

    tells_accuracy = False
    grammar: ClassVar[str]
    begins: ClassVar[re.Pattern[bytes]]
    joints: ClassVar[re.Pattern[str]]

    def recognises(self, text: bytes) -> bool:
        """Return True if a program begins there, behind comments and a header."""
        return self.begins.match(text) is not None

    def holds_joints(self, line: str) -> bool:
        """Return True if a line declares joint angles, or moves to some."""
        return self.joints.match(line) is not None

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
