"""Clone a point: other data with its numbers, declared behind it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import cast

from postproc.language import ir
from postproc.language.analysis.assigned_points import Scope
from postproc.language.language import Cloner, NamedPoint
from postproc.language.rapid import syntax as said
from postproc.language.rapid.program import Datum, MotionCall, RapidFile
from postproc.language.rapid.symbols import TARGETS, RapidTask
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

LONGEST_NAME = 32  # characters of an identifier
_WORD = re.compile(rb"[A-Za-z_]\w*")
_QUIET = re.compile(r'"[^"\r\n]*"|![^\r\n]*')  # strings and comments


@dataclass(frozen=True)
class RapidPoint:
    """Data that a move names as its destination.

    Attributes:
        file: Index of the file that declares them.
        datum: Their declaration.
        name: Their name as it is declared.
        place: File and span of the name in the move.
    """

    file: int
    datum: Datum
    name: str
    place: tuple[int, Span]

    @property
    def key(self) -> str:
        """Return a text that tells data apart."""
        return f"{self.file}:{self.datum.row}"


@dataclass
class RapidCloner(Cloner):
    """The modules of a task, to clone points in them.

    Attributes:
        task: Its modules.
        taken: All words of its files, in lower case.
    """

    task: RapidTask
    taken: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, task: RapidTask, beside: Sequence[RapidFile] = ()) -> RapidCloner:
        """Get ready to clone points of a task.

        Args:
            task: The task.
            beside: Files of other tasks: data of one name may be shared with them.
        """
        texts = (file.text.source.data for file in (*task.files, *beside))
        words = {w.decode("latin-1").lower() for t in texts for w in _WORD.findall(t)}
        return cls(task, words)

    def target(self, file: int, line: int, via: bool, name: str) -> RapidPoint:
        """Find the data that a move goes to, as far as they can be cloned."""
        move = self._move(file, line)
        operand = move.via if via else move.to
        if not isinstance(operand, ir.DataObject):
            raise CloneError("the numbers stand in the move itself, or are computed")
        if operand.steps:
            raise CloneError("elements of arrays and records are not cloned")
        scope = self._scope(file, move.row)
        found = self.task.datum(operand.name, scope)
        if found is None or operand.name != name:
            raise CloneError(f"{operand.name} is a parameter, or not declared once")
        at, datum = found
        _check(datum)
        span = self._find_name(file, move.row, operand.name)
        text = self.task.files[at].text
        start, end = self._find_name(at, datum.row, datum.declared.name)
        return RapidPoint(at, datum, text.source.text[start:end], (file, span))

    def _move(self, file: int, line: int) -> MotionCall:
        """Return the only move that begins on a line."""
        own = self.task.files[file]
        found = [m for m in own.moves if own.text.line(m.row) == line]
        if len(found) != 1:
            raise CloneError("several moves stand on its line")
        return found[0]

    def _scope(self, file: int, row: int) -> Scope:
        """Return where a move stands."""
        places = (p for found in self.task.routines.values() for p in found)
        around = (p for p in places if p[0] == file and p[2].first < row < p[2].last)
        place = next(around, None)
        if place is None:
            raise CloneError("the move stands outside of any routine")
        return self.task.scope_of(*place)

    def _find_name(self, file: int, row: int, name: str) -> Span:
        """Find the only place in a statement that names data."""
        text = self.task.files[file].text
        begin, _ = text.span(row)
        code = _quiet(text.text(row))
        found = [*re.finditer(rf"\b{re.escape(name)}\b", code, re.I)]
        if len(found) != 1:
            raise CloneError(f"{name} stands {len(found)} times in the move")
        return Span(begin + found[0].start(), begin + found[0].end())

    def find_declaration(self, named: NamedPoint) -> int:
        """Return the 1-based line that declares data."""
        point = cast(RapidPoint, named)
        return self.task.files[point.file].text.line(point.datum.row)

    def clone(
        self, literals: Literals, named: Sequence[NamedPoint], rows: Sequence[int]
    ) -> tuple[str, list[tuple[int, Edit]]]:
        """Give some moves data of their own, see `Cloner.clone`."""
        points = [cast(RapidPoint, one) for one in named]
        first = points[0]
        text = self.task.files[first.file].text
        begin, end = text.span(first.datum.row)
        for row in rows:
            starts = literals.places[row : row + 1].start[0]
            inside = all(begin <= at < end for at in starts.tolist() if at >= 0)
            if literals.file[row] != first.file or not inside:
                raise CloneError("its numbers stand in other data")
        name = find_free_name(first.name, self.taken, LONGEST_NAME)
        edits = [self._declaration(points, name)]
        for point in points:
            file, span = point.place
            source = self.task.files[file].text.source
            line = source.line_text(source.line_of(span.start))
            check_length(source, len(line) + len(name) - (span.end - span.start))
            edits.append((file, Edit(span, name.encode("latin-1"))))
        return name.lower(), edits

    def _declaration(self, points: Sequence[RapidPoint], name: str) -> tuple[int, Edit]:
        """Declare the clone behind the original, or in the module of its moves."""
        point = points[0]
        text, row = self.task.files[point.file].text, point.datum.row
        source, (begin, end) = text.source, text.span(row)
        start, stop = self._find_name(point.file, row, point.datum.declared.name)
        declared = source.text[begin:start] + name + source.text[stop:end]
        declared += "" if declared.endswith(";") else ";"
        if self.task.files[point.file].is_system:
            return self._beside(points, declared)
        first, last = source.line_of(begin), source.line_of(max(end - 1, begin))
        before = source.text[int(source.line_starts[first - 1]) : begin]
        if before.strip() or not ends_line(source, end):
            raise CloneError("its declaration shares a line with other code")
        return point.file, insert_after(source, last, before + declared)

    def _beside(self, points: Sequence[RapidPoint], declared: str) -> tuple[int, Edit]:
        """Declare a point of a system module at the head of the module of its moves."""
        files = {point.place[0] for point in points}
        if len(files) != 1:
            raise CloneError("its moves stand in several modules")
        file = files.pop()
        text, modules = self.task.files[file].text, self.task.files[file].modules
        if len(modules) != 1 or self.task.files[file].is_system:
            raise CloneError("its moves stand in no module that is rewritten")
        rows = (text.statement(row) for row in range(modules[0].first, modules[0].last))
        if any(isinstance(one, said.RecordHead | said.TypeAlias) for one in rows):
            raise CloneError("the module of its moves defines types, which stand first")
        begin, end = text.span(modules[0].first)
        if not ends_line(text.source, end):
            raise CloneError("other code stands on the line of its module")
        line = text.source.line_of(max(end - 1, begin))
        return file, insert_after(text.source, line, f"  {declared}")


def _check(datum: Datum) -> None:
    """Refuse what is no single point."""
    declared = datum.declared
    if declared.type not in TARGETS or declared.dimensions:
        raise CloneError(f"{declared.name} is no single point")


def _quiet(text: str) -> str:
    """Blank out strings and comments."""
    return _QUIET.sub(lambda found: " " * len(found.group()), text)


def ends_line(source: Source, end: int) -> bool:
    """Return True if nothing but a comment stands behind a statement on its line."""
    rest = re.match(r"[ \t]*;?[ \t]*(![^\r\n]*)?(?=[\r\n]|\Z)", source.text[end:])
    return rest is not None
