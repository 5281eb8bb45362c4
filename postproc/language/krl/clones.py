"""Clone a point of a data list: another one with its numbers, declared behind it."""

from __future__ import annotations

import re
from collections.abc import Sequence

from postproc.language import ir
from postproc.language.analysis.assigned_points import Place
from postproc.language.analysis.clones import TaskCloner
from postproc.language.analysis.declarations import Datum
from postproc.language.krl.moves import HOMES
from postproc.language.krl.program import KrlFile
from postproc.language.krl.syntax import KrlMove
from postproc.language.language import NamedPoint
from postproc.language.text.source import CloneError, Edit, Source, insert_after

POINTS = ("e6pos", "pos", "e6axis", "axis")  # types
_FOLD = re.compile(r"\s*;\s*(END)?FOLD\b", re.I)
_FORM = re.compile(r"%\{|ILF|InlineForm", re.I)  # what the editor reads back


class KrlCloner(TaskCloner):
    """The files of a job, to clone points in them.

    Moves of inline forms keep their points: the text of the form names them too, with
    their frames, and the controller's editor reads it back.
    """

    longest_name = 24
    word = re.compile(rb"[A-Za-z_$][\w$]*")
    quiet = re.compile(r'"[^"\r\n]*"|;[^\r\n]*')

    def end_of(self, move: ir.SourceStatement, via: bool) -> ir.Operand | None:
        """Return where a move goes, or the point of its arc."""
        assert isinstance(move, KrlMove)
        return move.via if via else move.to

    def check(self, data: ir.DataObject, name: str, place: Place, datum: Datum) -> None:
        """Refuse all but points of data lists."""
        if any(isinstance(step, str) for step in data.steps):
            raise CloneError("parts of records are not cloned")
        if data.name in HOMES:
            raise CloneError("it is a home position")
        if place[2]:
            raise CloneError(f"{data.name} is declared in no data list")
        if data.name != name.partition("[")[0]:
            raise CloneError(f"{data.name} stands for {name} here")

    def check_move(self, file: int, line: int) -> None:
        """Refuse inline forms."""
        if is_of_form(self.task.files[file].text.source, line):
            raise CloneError("an inline form names its point in its own text")

    def declare(
        self, points: Sequence[NamedPoint], data: Sequence[tuple[int, Datum]], name: str
    ) -> tuple[int, Edit]:
        """Declare a clone, with all elements of an array, behind the last value."""
        files = {number for number, _ in data}
        number = files.pop() if len(files) == 1 else -1
        file, old = self.task.files[number], points[0].place[3]
        if number < 0 or file.routines or file.is_system:
            raise CloneError("it stands in no data list of the program")
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
        return number, insert_after(source, last, text)

    def _head(self, point: NamedPoint, file: KrlFile) -> tuple[str, str]:
        """Return the type of a point, and the sizes of an array as they are written."""
        name = point.place[3]
        own = [d for d in file.data if d.name == name and d.type and not d.routine]
        if len(own) != 1 or own[0].type not in POINTS:
            raise CloneError(f"{point.name} is no single point, or of no known type")
        one, text = file.text.statement(own[0].row), file.text.text(own[0].row)
        items = one.items if isinstance(one, ir.Declaration) else ()
        if not any(item.name == name and item.dimensions for item in items):
            return own[0].type, ""
        span = self.find_name(self.task.files.index(file), own[0].row, name)
        rest = text[span.end - file.text.span(own[0].row).start :]
        shape = re.match(r"\s*(\[[\d,\s]+\])", rest)
        if shape is None:
            raise CloneError(f"the size of {point.name} is no number")
        return own[0].type, shape[1]

    def _value(self, file: KrlFile, datum: Datum, name: str) -> str:
        """Return what stands behind the name where data get their value."""
        one = file.text.statement(datum.row)
        if isinstance(one, ir.Declaration) and len(one.items) != 1:
            raise CloneError("its declaration declares other data, too")
        span = self.find_name(self.task.files.index(file), datum.row, name)
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
