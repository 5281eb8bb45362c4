"""Clone a point of RAPID: other data with its numbers, declared behind it."""

from __future__ import annotations

import re
from collections.abc import Sequence

from postproc.language import ir
from postproc.language.analysis.assigned_points import Place
from postproc.language.analysis.clones import TaskCloner
from postproc.language.analysis.declarations import Datum
from postproc.language.language import NamedPoint
from postproc.language.rapid import syntax as said
from postproc.language.rapid.instructions import MOTIONS
from postproc.language.text.source import CloneError, Edit, Source, insert_after

TARGETS = ("robtarget", "jointtarget")


class RapidCloner(TaskCloner):
    """The modules of a task, to clone points in them."""

    longest_name = 32
    word = re.compile(rb"[A-Za-z_]\w*")
    quiet = re.compile(r'"[^"\r\n]*"|![^\r\n]*')

    def end_of(self, move: ir.SourceStatement, via: bool) -> ir.Operand | None:
        """Return where a move goes, or the point of its arc."""
        move = ir.inside(move)
        assert isinstance(move, ir.Instruction)
        return MOTIONS[move.name].operands(move.arguments)[via]

    def check(self, data: ir.DataObject, name: str, place: Place, datum: Datum) -> None:
        """Refuse all but single points."""
        if data.steps:
            raise CloneError("elements of arrays and records are not cloned")
        if data.name != name:
            raise CloneError(f"{data.name} is a parameter, or not declared once")
        if datum.type not in TARGETS or datum.dimensions:
            raise CloneError(f"{datum.name} is no single point")

    def spell(self, data: ir.DataObject, place: Place, written: str) -> str:
        """Spell a name as it is declared."""
        file, datum = self.task.data_at(place)[()]
        start, end = self.find_name(file, datum.row, datum.name)
        declared: str = self.task.files[file].text.source.text[start:end]
        return declared

    def declare(
        self, points: Sequence[NamedPoint], data: Sequence[tuple[int, Datum]], name: str
    ) -> tuple[int, Edit]:
        """Declare the clone behind the original, or in the module of its moves."""
        ((file, datum),) = data
        text, row = self.task.files[file].text, datum.row
        source, (begin, end) = text.source, text.span(row)
        start, stop = self.find_name(file, row, datum.name)
        declared = source.text[begin:start] + name + source.text[stop:end]
        declared += "" if declared.endswith(";") else ";"
        if self.task.files[file].is_system:
            return self._beside(points, declared)
        first, last = source.line_of(begin), source.line_of(max(end - 1, begin))
        before = source.text[int(source.line_starts[first - 1]) : begin]
        if before.strip() or not ends_line(source, end):
            raise CloneError("its declaration shares a line with other code")
        return file, insert_after(source, last, before + declared)

    def _beside(self, points: Sequence[NamedPoint], declared: str) -> tuple[int, Edit]:
        """Declare a point of a system module at the head of the module of its moves."""
        files = {point.file for point in points}
        if len(files) != 1:
            raise CloneError("its moves stand in several modules")
        file = files.pop()
        text, modules = self.task.files[file].text, self.task.files[file].modules
        if len(modules) != 1 or self.task.files[file].is_system:
            raise CloneError("its moves stand in no module that is rewritten")
        inside = range(modules[0].first + 1, modules[0].last)
        types = ir.ScopeHead | said.TypeAlias
        if any(isinstance(text.statement(row), types) for row in inside):
            raise CloneError("the module of its moves defines types, which stand first")
        begin, end = text.span(modules[0].first)
        if not ends_line(text.source, end):
            raise CloneError("other code stands on the line of its module")
        line = text.source.line_of(max(end - 1, begin))
        return file, insert_after(text.source, line, f"  {declared}")


def ends_line(source: Source, end: int) -> bool:
    """Return True if nothing but a comment stands behind a statement on its line."""
    rest = re.match(r"[ \t]*;?[ \t]*(![^\r\n]*)?(?=[\r\n]|\Z)", source.text[end:])
    return rest is not None
