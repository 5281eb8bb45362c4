"""Clone a point of a data list: another one with its numbers, declared behind it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import cast

from postproc.language import ir
from postproc.language.krl import syntax as said
from postproc.language.krl.moves import HOMES
from postproc.language.krl.program import KrlDatum, KrlFile
from postproc.language.krl.symbols import KrlTask
from postproc.language.language import Cloner, NamedPoint
from postproc.language.text.source import (
    CloneError,
    Edit,
    Source,
    Span,
    check_length,
    find_free_name,
    insert_after,
)
from postproc.language.visits import Literals

LONGEST_NAME = 24  # characters of an identifier
POINTS = ("e6pos", "pos", "e6axis", "axis")  # types
_WORD = re.compile(rb"[A-Za-z_$][\w$]*")
_QUIET = re.compile(r'"[^"\r\n]*"|;[^\r\n]*')  # strings and comments
_FOLD = re.compile(r"\s*;\s*(END)?FOLD\b", re.I)
_FORM = re.compile(r"%\{|ILF|InlineForm", re.I)  # what the editor reads back


@dataclass(frozen=True)
class KrlPoint:
    """Data that a move names as its destination.

    Attributes:
        place: File and routine that declare them, and their name in lower case.
        name: Their name as the move writes it.
        file: Index of the move's file.
        span: Of the name in the move.
    """

    place: tuple[str, str, str]
    name: str
    file: int
    span: Span

    @property
    def key(self) -> str:
        """Return a text that tells data apart."""
        return ":".join(self.place)


@dataclass
class KrlCloner(Cloner):
    """The files of a job, to clone points in them.

    Moves of inline forms keep their points: the text of the form names them too, with
    their frames, and the controller's editor reads it back.

    Attributes:
        task: The files.
        taken: All words of them, in lower case.
    """

    task: KrlTask
    taken: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, task: KrlTask) -> KrlCloner:
        """Get ready to clone points of a job."""
        texts = (file.text.source.data for file in task.files)
        words = {w.decode("latin-1").lower() for t in texts for w in _WORD.findall(t)}
        return cls(task, words)

    def target(self, file: int, line: int, via: bool, name: str) -> KrlPoint:
        """Find the data that a move goes to, as far as they can be cloned."""
        row, move = self._move(file, line)
        operand = move.via if via else move.to
        if not isinstance(operand, ir.DataObject):
            raise CloneError("the numbers stand in the move itself, or are computed")
        if any(isinstance(step, str) for step in operand.steps):
            raise CloneError("parts of records are not cloned")
        if operand.name in HOMES:
            raise CloneError("it is a home position")
        module, routine = self._place(file, row, operand.name)
        if operand.name != name.partition("[")[0]:
            raise CloneError(f"{operand.name} stands for {name} here")
        source = self.task.files[file].text.source
        if is_of_form(source, line):
            raise CloneError("an inline form names its point in its own text")
        span = self._find_name(file, row, operand.name)
        spelt = source.text[span.start : span.end]
        return KrlPoint((module, routine, operand.name), spelt, file, span)

    def _move(self, file: int, line: int) -> tuple[int, said.KrlMove]:
        """Return the only move on a line, and its row."""
        text = self.task.files[file].text
        found = [row for row in self.task.files[file].moves if text.line(row) == line]
        move = text.statement(found[0]) if len(found) == 1 else None
        if not isinstance(move, said.KrlMove):
            raise CloneError("no single move stands on its line")
        return found[0], move

    def _place(self, file: int, row: int, name: str) -> tuple[str, str]:
        """Return the file whose data list declares a point."""
        own = self.task.files[file]
        around = (r for r in own.routines if r.first < row < r.last)
        routine = next(around, None)
        if routine is None:
            raise CloneError("the move stands outside of any routine")
        found = self.task.place(name, self.task.scope_of(file, own.name, routine))
        if found is None or found[1]:
            raise CloneError(f"{name} is a parameter, or declared in no data list")
        return found

    def _find_name(self, file: int, row: int, name: str) -> Span:
        """Find the only place in a statement that names data."""
        text = self.task.files[file].text
        code = _QUIET.sub(lambda found: " " * len(found.group()), text.text(row))
        pattern = rf"(?<![\w$]){re.escape(name)}(?![\w$])"
        found = [*re.finditer(pattern, code, re.I)]
        if len(found) != 1:
            raise CloneError(f"{name} stands {len(found)} times in a statement")
        begin, _ = text.span(row)
        return Span(begin + found[0].start(), begin + found[0].end())

    def find_declaration(self, named: NamedPoint) -> int:
        """Return the 1-based line that declares data."""
        file, datum = next(iter(self._data(named).values()))
        return self.task.files[file].text.line(datum.row)

    def _data(
        self, named: NamedPoint
    ) -> Mapping[tuple[int, ...], tuple[int, KrlDatum]]:
        return self.task.declared(cast(KrlPoint, named).place)

    def clone(
        self, literals: Literals, named: Sequence[NamedPoint], rows: Sequence[int]
    ) -> tuple[str, list[tuple[int, Edit]]]:
        """Give some moves data of their own, see `Cloner.clone`."""
        points = [cast(KrlPoint, one) for one in named]
        first = points[0]
        data = [one for one in self._data(first).values() if one[1].value is not None]
        files = {file for file, _ in data}
        file = self.task.files[files.pop()] if len(files) == 1 else None
        if file is None or file.routines or file.is_system:
            raise CloneError("it stands in no data list of the program")
        spans = [file.text.span(datum.row) for _, datum in data]
        for row in rows:
            starts = literals.places[row : row + 1].start[0].tolist()
            inside = all(any(b <= at < e for b, e in spans) for at in starts if at >= 0)
            if literals.file[row] != data[0][0] or not inside:
                raise CloneError("its numbers stand in other data")
        name = find_free_name(first.name, self.taken, LONGEST_NAME)
        edits = [(data[0][0], self._declaration(points, file, data, name))]
        for point in points:
            source = self.task.files[point.file].text.source
            line = source.line_text(source.line_of(point.span.start))
            check_length(source, len(line) + len(name) - len(first.name))
            edits.append((point.file, Edit(point.span, name.encode("latin-1"))))
        return name.lower(), edits

    def _declaration(
        self,
        points: Sequence[KrlPoint],
        file: KrlFile,
        data: Sequence[tuple[int, KrlDatum]],
        name: str,
    ) -> Edit:
        """Declare a clone, with all elements of an array, behind the last value."""
        old = points[0].place[2]
        type_, shape = self._head(points[0], file)
        abroad = any(self.task.files[p.file].name != file.name for p in points)
        head = f"DECL {'GLOBAL ' if abroad else ''}{type_.upper()} {name}{shape}"
        values = [self._value(file, datum, old) for _, datum in data]
        lines = [head, *(f"{name}{value}" for value in values)]
        if not shape:
            lines = [head + values[0]]
        last = max(file.text.line(datum.row) for _, datum in data)
        source = file.text.source
        text = source.newline.decode("latin-1").join(lines)
        return insert_after(source, last, text)

    def _head(self, point: KrlPoint, file: KrlFile) -> tuple[str, str]:
        """Return the type of a point, and the sizes of an array as they are written."""
        name = point.place[2]
        own = [d for d in file.data if d.name == name and d.type and not d.routine]
        if len(own) != 1 or own[0].type not in POINTS:
            raise CloneError(f"{point.name} is no single point, or of no known type")
        one, text = file.text.statement(own[0].row), file.text.text(own[0].row)
        items = one.items if isinstance(one, said.KrlDeclaration) else ()
        if not any(item.name == name and item.dimensions for item in items):
            return own[0].type, ""
        span = self._find_name(self.task.files.index(file), own[0].row, name)
        rest = text[span.end - file.text.span(own[0].row).start :]
        shape = re.match(r"\s*(\[[\d,\s]+\])", rest)
        if shape is None:
            raise CloneError(f"the size of {point.name} is no number")
        return own[0].type, shape[1]

    def _value(self, file: KrlFile, datum: KrlDatum, name: str) -> str:
        """Return what stands behind the name where data get their value."""
        one = file.text.statement(datum.row)
        if isinstance(one, said.KrlDeclaration) and len(one.items) != 1:
            raise CloneError("its declaration declares other data, too")
        span = self._find_name(self.task.files.index(file), datum.row, name)
        end = file.text.span(datum.row).end
        return file.text.source.text[span.end : end].rstrip()


def is_of_form(source: Source, line: int) -> bool:
    """Return True if a line stands in a fold that an inline form has written."""
    open_ = 0
    for number in range(line - 1, 0, -1):
        text = source.line_text(number)
        fold = _FOLD.match(text)
        if fold is None:
            continue
        if fold[1]:
            open_ += 1
        elif open_:
            open_ -= 1
        elif _FORM.search(text) or _FORM.search(source.line_text(number + 1)):
            return True
    return False
