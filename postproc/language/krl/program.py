"""A KRL file: its routines, data, moves, and what is not understood."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from postproc import _native
from postproc.files import base_name
from postproc.language import ir
from postproc.language.analysis.control_flow import HeadedRows
from postproc.language.analysis.declarations import Datum, TaskFile
from postproc.language.analysis.symbols import whole
from postproc.language.krl import syntax as said
from postproc.language.krl.files import KrlFileName
from postproc.language.krl.parser import parse_statement
from postproc.language.text.blocks import Outline, ScopeWords
from postproc.language.text.source import Source
from postproc.language.text.statement_table import StatementText, read_text

_ROUTINES = ("def", "deffct")
_RUNS = (said.KrlMove, ir.Instruction, ir.Assignment)
_WORDS = ScopeWords({"end": "def", "endfct": "deffct", "enddat": "defdat"}, _ROUTINES)


@dataclass(frozen=True)
class KrlFile(TaskFile):
    """What a KRL file holds; a data list has no routines.

    Attributes:
        name: Its base name in lower case: a source and its data list share it.
        splines: Rows of spline blocks.
    """

    name: str
    splines: tuple[range, ...]

    @property
    def _named(self) -> KrlFileName:
        return KrlFileName(self.text.source.name)

    @cached_property
    def is_system(self) -> bool:
        """Whether it is of the controller: ``$config.dat``, or of a package."""
        source = self.text.source
        return self.name.startswith("$") or self._named.is_system_source(source.data)

    @property
    def is_submit(self) -> bool:
        """Whether it runs beside the program, and moves no arm."""
        return self._named.is_submit

    def module_of(self, routine: HeadedRows) -> str:
        """Return the name of the file, which its data list shares."""
        return self.name


def read_krl(source: Source) -> KrlFile:
    """Read a KRL file.

    Raises:
        ProgramError: A string does not end.
    """
    text = read_text(source, _native.scan_krl, parse_statement)
    name = base_name(source.name)
    outline, splines, begin = Outline(text, _WORDS), list[range](), -1
    moves = text.of_kind(lambda one: isinstance(one, said.KrlMove))
    lists = any(isinstance(one, ir.ScopeHead) for one in text.said.said)
    runs = (said.KrlMove, ir.Instruction) if lists else _RUNS  # and declares nothing
    for row in text.of_kind(lambda one: not isinstance(one, runs)):
        if outline.declare(row, name):
            continue
        match one := text.statement(row):
            case said.SplineBlock(word=word):
                outline.take(row, one, name)
                ends = word == "endspline"
                splines += [range(begin, row)] if ends and begin >= 0 else []
                begin = -1 if ends else row
            case ir.Assignment(target=target, value=value):
                index = literal_index(text, row, target.steps)
                if outline.name("defdat") and index is not None:
                    own = Datum(target.name, "", row, name, "", value, index)
                    outline.data.append(own)
            case _:
                outline.take(row, one, name)
    outline.close()
    found = KrlFile(**outline.parts(moves), name=name, splines=tuple(splines))
    if not found.routines:
        return found
    first, *others = found.routines  # other files know the first one of a file
    first = replace(first, head=replace(first.head, local=False))
    return replace(found, routines=(first, *others))


def literal_index(
    text: StatementText[ir.SourceStatement],
    row: int,
    steps: Sequence[str | ir.ElementStep],
) -> tuple[int, ...] | None:
    """Return the index of an element, None where it is none that can be told."""
    if not steps:
        return ()
    if len(steps) > 1 or not isinstance(steps[0], ir.ElementStep):
        return None
    slots = [s.slot for s in steps[0].subscripts if isinstance(s, ir.Num)]
    if len(slots) < len(steps[0].subscripts):
        return None
    first = int(text.first[row])
    found = [whole(float(text.value[first + slot])) for slot in slots]
    known = tuple(k for k in found if k is not None)
    return known if len(known) == len(found) else None
