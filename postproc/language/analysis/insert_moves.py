"""Points on the ways of moves of a task."""

from __future__ import annotations

import re
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

from postproc.language.analysis.symbols import TaskSymbols
from postproc.language.insert_moves import MoveLayout, Splitter
from postproc.language.text.source import CloneError, Source
from postproc.language.text.statement_table import StatementText


@dataclass(frozen=True)
class TaskSplitter(Splitter):
    """The files of a task, to put points on the ways of moves.

    Attributes:
        task: The files.
        head: What a line or an arc begins with; its group is the word.
    """

    task: TaskSymbols[Any]
    head: ClassVar[re.Pattern[str]]

    @abstractmethod
    def lay_out(
        self, source: Source, start: int, code: str, head: re.Match[str]
    ) -> MoveLayout:
        """Look at a move.

        Args:
            source: Its file.
            start: Offset of its line there.
            code: Its line, without the comment.
            head: What it begins with.

        Raises:
            CloneError: It is not understood.
        """

    def find(self, file: int, line: int) -> tuple[StatementText[Any], int]:
        """Return the statements of a file, and the row of a move."""
        return self.task.files[file].text, self.task.files[file].find_move(line)

    def layout(self, file: int, line: int) -> MoveLayout:
        """Look at a move, see `Splitter.layout`."""
        text, row = self.find(file, line)
        source, (begin, end) = text.source, text.span(row)
        start = int(source.line_starts[line - 1])
        if source.text[start:begin].strip():
            raise CloneError("it does not stand alone on its line")
        code = source.text[start:end].rstrip()
        head = self.head.match(code)
        if head is None:
            raise CloneError("the move is not understood")
        return self.lay_out(source, start, code, head)
