"""A RAPID file: its modules, routines, data, moves, and what is not understood."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from postproc import _native
from postproc.language import ir
from postproc.language.analysis.control_flow import HeadedRows
from postproc.language.analysis.declarations import TaskFile
from postproc.language.analysis.symbols import holds_odd
from postproc.language.rapid.files import RapidFileName
from postproc.language.rapid.instructions import MOTIONS
from postproc.language.rapid.parser import parse_statement
from postproc.language.rapid.syntax import ErrorHandler
from postproc.language.text.blocks import Outline, ScopeWords
from postproc.language.text.source import Source
from postproc.language.text.statement_table import StatementText, read_text

_SYSTEM = "sysmodule"
_ROUTINES = ("proc", "func", "trap")


def begins_handler(one: ir.SourceStatement) -> bool:
    """Return True if a clause behind the statements of a routine begins."""
    return isinstance(one, ErrorHandler) or (
        isinstance(one, ir.BlockWord) and one.word in ("undo", "backward")
    )


_WORDS = ScopeWords(
    {
        "endmodule": "module", "endproc": "proc", "endfunc": "func",
        "endtrap": "trap", "endrecord": "record",
    },
    _ROUTINES, "module", begins_handler,
)  # fmt: skip


@dataclass(frozen=True)
class RapidFile(TaskFile):
    """What a RAPID file holds.

    Attributes:
        modules: In the order of the file.
    """

    modules: tuple[HeadedRows, ...]

    @cached_property
    def is_system(self) -> bool:
        """Whether it is a system module, which is read and never rewritten.

        It is one by its place in a backup, by its suffix, or by what a module says.
        """
        heads = (scope.head for scope in self.modules)
        said = any(_SYSTEM in getattr(head, "attributes", ()) for head in heads)
        return said or RapidFileName(self.text.source.name).is_named_as_system

    def module_of(self, routine: HeadedRows) -> str:
        """Return the name of the module around a routine."""
        around = (m for m in self.modules if m.first < routine.first < m.last)
        return next((m.head.name for m in around), "")


def read_statements(source: Source) -> StatementText[ir.SourceStatement]:
    """Read the statements of a RAPID file.

    A statement ends with ``;``, or where its words are complete (``ENDPROC``,
    ``IF a THEN``), whatever lines it stands on.

    Raises:
        ProgramError: A string or the header does not end.
    """
    return read_text(source, _native.scan_statements, parse_statement)


def read_rapid(source: Source) -> RapidFile:
    """Read a RAPID file.

    Raises:
        ProgramError: A string or the header does not end.
    """
    text = read_statements(source)
    outline = Outline(text, _WORDS)
    odd = text.of_kind(holds_odd)
    called = ir.Instruction | ir.CompactIf
    for row in text.of_kind(lambda s: not (isinstance(s, called) or holds_odd(s))):
        module = outline.name("module")
        if not outline.declare(row, module):
            outline.take(row, text.statement(row), module)
    outline.close()
    # Without its end, calls may stand behind a record.
    ended = (r for r in outline.of("record") if r.ended)
    within = {row for r in ended for row in range(r.first, r.last + 1)}
    moves = [row for row in text.where(is_move) if row not in within]
    few = text.where(_lacks_position)
    for rows, what in ((few, "has too few positions"), (odd, "is not understood")):
        for row in (row for row in rows if row not in within):
            outline.complain(row, what)
    return RapidFile(**outline.parts(moves), modules=tuple(outline.of("module")))


def is_move(one: ir.SourceStatement) -> bool:
    """Return True if a statement moves, also behind a condition."""
    one = ir.inside(one)
    return isinstance(one, ir.Instruction) and one.name in MOTIONS


def _lacks_position(one: ir.SourceStatement) -> bool:
    """Return True for a move that says no destination, or no point of an arc."""
    one = ir.inside(one)
    if not (isinstance(one, ir.Instruction) and is_move(one)):
        return False
    to, via = MOTIONS[one.name].operands(one.arguments)
    return to is None or (MOTIONS[one.name].via >= 0 and via is None)
