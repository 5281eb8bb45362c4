"""Clone a point: other data with its numbers, declared behind it."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from postproc.language import ir
from postproc.language.analysis.assigned_points import Place
from postproc.language.analysis.declarations import Datum
from postproc.language.analysis.symbols import TaskSymbols
from postproc.language.language import Cloner, NamedPoint
from postproc.language.text.source import CloneError, Edit, Span, find_free_name
from postproc.language.visits import Literals


@dataclass
class TaskCloner(Cloner):
    """The files of a task, to clone points in them.

    Attributes:
        task: The files.
        taken: All words of them, in lower case.
        longest_name: Characters of an identifier.
        word: What identifiers look like.
        quiet: Strings and comments.
    """

    task: TaskSymbols[Any]
    taken: set[str] = field(default_factory=set)
    longest_name: ClassVar[int]
    word: ClassVar[re.Pattern[bytes]]
    quiet: ClassVar[re.Pattern[str]]

    def __post_init__(self) -> None:
        """Take the words of the files: data of one name may be shared by all."""
        files = (*self.task.files, *self.task.files_beside)
        texts = (file.text.source.data for file in files)
        words = (word for text in texts for word in self.word.findall(text))
        self.taken |= {word.decode("latin-1").lower() for word in words}

    @abstractmethod
    def end_of(self, move: ir.SourceStatement, via: bool) -> ir.Operand | None:
        """Return where a move goes, or the point of its arc."""

    @abstractmethod
    def check(self, data: ir.DataObject, name: str, place: Place, datum: Datum) -> None:
        """Refuse what is no point, or has no single declaration.

        Args:
            data: As the move names them.
            name: As the visit does.
            place: Where they are declared.
            datum: Their declaration.

        Raises:
            CloneError: What is wrong.
        """

    @abstractmethod
    def declare(
        self, points: Sequence[NamedPoint], data: Sequence[tuple[int, Datum]], name: str
    ) -> tuple[int, Edit]:
        """Declare a clone.

        Args:
            points: The point, as some moves name it.
            data: The files and statements that give values to it or its elements.
            name: Of the clone.
        """

    def check_move(self, file: int, line: int) -> None:
        """Refuse a move whose words must stay.

        Raises:
            CloneError: What is wrong.
        """

    def spell(self, data: ir.DataObject, place: Place, written: str) -> str:
        """Spell the name of data that a move writes in some way."""
        return written

    def target(self, file: int, line: int, via: bool, name: str) -> NamedPoint:
        """Find the data that a move goes to, as far as they can be cloned."""
        text, row = self.task.files[file].text, self.task.files[file].find_move(line)
        data = self.end_of(text.statement(row), via)
        if not isinstance(data, ir.DataObject):
            raise CloneError("the numbers stand in the move itself, or are computed")
        routine = self.task.routine_around(file, row)
        if routine is None:
            raise CloneError("the move stands outside of any routine")
        scope = self.task.scope_of(routine)
        place = self.task.place(data.name, scope)
        found = self.task.datum(data.name, scope)
        if place is None or found is None:
            raise CloneError(f"{data.name} is a parameter, or not declared once")
        self.check(data, name, place, found[1])
        self.check_move(file, line)
        span = self.find_name(file, row, data.name)
        written = text.source.text[span.start : span.end]
        return NamedPoint(place, self.spell(data, place, written), file, span)

    def find_name(self, file: int, row: int, name: str) -> Span:
        """Find the only place in a statement that names data."""
        text = self.task.files[file].text
        code = self.quiet.sub(lambda found: " " * len(found.group()), text.text(row))
        pattern = rf"(?<![\w$]){re.escape(name)}(?![\w$])"
        found = [*re.finditer(pattern, code, re.I)]
        if len(found) != 1:
            raise CloneError(f"{name} stands {len(found)} times in a statement")
        begin = text.span(row).start
        return Span(begin + found[0].start(), begin + found[0].end())

    def find_declaration(self, named: NamedPoint) -> int:
        """Return the 1-based line that declares data."""
        file, datum = next(iter(self.task.data_at(named.place).values()))
        line: int = self.task.files[file].text.line(datum.row)
        return line

    def clone(
        self, literals: Literals, named: Sequence[NamedPoint], rows: Sequence[int]
    ) -> tuple[str, list[tuple[int, Edit]]]:
        """Give some moves data of their own, see `Cloner.clone`."""
        every = self.task.data_at(named[0].place).values()
        data = [one for one in every if one[1].value is not None]
        files = {file for file, _ in data}
        spans = [self.task.files[file].text.span(one.row) for file, one in data]
        for row in rows:
            starts = literals.places[row : row + 1].start[0].tolist()
            inside = all(any(b <= at < e for b, e in spans) for at in starts if at >= 0)
            if {int(literals.file[row])} != files or not inside:
                raise CloneError("its numbers stand in other data")
        name = find_free_name(named[0].name, self.taken, self.longest_name)
        edits = [self.declare(named, data, name)]
        for one in named:
            edits.append(one.rename(self.task.files[one.file].text.source, name))
        return name.lower(), edits
