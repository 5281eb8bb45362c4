"""Points on the way of a move: MOVEFLY statements before it, laid out as it is."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from postproc.arrays import Floats
from postproc.language import ir
from postproc.language.insert_moves import MoveLayout, Splitter, spell
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.clones import code_of
from postproc.language.pdl2.pose_encoding import PDL2_DIALECT
from postproc.language.pdl2.program import Program
from postproc.language.text.source import CloneError, Span
from postproc.language.text.statement_table import Statements

_EVENT = re.compile(r"\b(AT|TIME|DISTANCE|PERCENT|SEGMENT|EVENT)\b", re.I)
_ENABLE = re.compile(r"\bENABLE\b(?!\s+CONDITION\s*\[\s*\d+\s*\])", re.I)
_ENABLED = re.compile(r"\bENABLE\s+CONDITION\b", re.I)
_ADVANCE = re.compile(r"\bADVANCE\b", re.I)
_WITH = re.compile(r"\bWITH\b.*", re.I)
_VIA = re.compile(r"\bVIA\s+(POS\s*\([^()]*\))", re.I)
_HEAD = re.compile(r"(\s*)MOVE(?:FLY)?\s+(ARM\s*\[\s*\d+\s*\]\s+)?", re.I)


@dataclass(frozen=True)
class Pdl2Splitter(Splitter):
    """The program files of a job, to put points on the ways of moves.

    Attributes:
        programs: The files, parsed.
    """

    programs: Sequence[Program]
    kind = ast.Move

    def list_problems(
        self, file: int, row: int, move: ast.Move
    ) -> Iterator[tuple[str, object]]:
        """Yield what may forbid points on a way, see `Splitter.list_problems`."""
        program = self.programs[file]
        yield self._events, self._events
        yield "it ends on a condition (TIL)", move.til is not None
        yield "a condition is enabled along it (WITH CONDITION)", move.conditions
        yield "another arm moves along (SYNCMOVE)", move.sync
        yield "it does not go TO a place", move.how != "TO" or len(move.where) != 1
        code = code_of(program, program.lines.line(row))
        cut = _HEAD.match(code) is None or code.rstrip().endswith(",")
        yield "it stands on several lines", cut
        settings = _WITH.search(code)
        called = settings and "(" in settings[0]
        yield "a routine may be called for its settings (WITH)", called
        last = row + 1 == len(program.lines)
        after = None if last else program.lines.statement(row + 1)
        goes_on = _ADVANCE.search(code) and not isinstance(after, ast.Move)
        yield "the program goes on while it moves (ADVANCE)", goes_on

    def find(self, file: int, line: int) -> tuple[Statements[Any], int]:
        """Return the statements of a file, and the row of a move."""
        lines = self.programs[file].lines
        return lines, int(np.searchsorted(lines.begin_line, line))

    @cached_property
    def _events(self) -> str:
        """Why no move may be split: what may count the segments of a motion."""
        for program in self.programs:
            spans = (range(*rows) for rows in program.handlers)
            if any(_EVENT.search(_code(program, rows)) for rows in spans):
                return "a condition on events along a move may be enabled"
        for program in self.programs:
            code = _code(program, range(len(program.lines)))
            if _ENABLE.search(code) or (_ENABLED.search(code) and not program.handlers):
                return "a condition that these files do not define may be enabled"
        return ""

    def is_setting(self, one: ir.SourceStatement) -> bool:
        """Return True if motion variables are set."""
        return isinstance(one, ir.Assignment) and one.target.name in ast.NAMES["motion"]

    def layout(self, file: int, line: int) -> Pdl2Layout:
        """Look at a move, see `Splitter.layout`."""
        program = self.programs[file]
        source, code = program.lines.source, code_of(program, line).rstrip()
        head, settings = _HEAD.match(code), _WITH.search(code)
        if head is None:
            raise CloneError("the move is not understood")
        rest = f" {settings[0]}" if settings else ""
        start = int(source.line_starts[line - 1])
        way = _VIA.search(code)
        via = Span(*way.span(1)) if way else None
        return Pdl2Layout(source, start, code, head[1], "--", via, head[2] or "", rest)


@dataclass(frozen=True)
class Pdl2Layout(MoveLayout):
    """How a move is laid out, see `MoveLayout`.

    Attributes:
        arm, settings: What names the arm, and is set for the move alone.
    """

    arm: str
    settings: str

    def place(self, numbers: Floats, config: str) -> str:
        """Write a position, its numbers (6,)."""
        return (
            f"POS({', '.join(spell(numbers, PDL2_DIALECT.pose_decimals))}, '{config}')"
        )

    def move(self, end: str, via: str | None, stops: bool) -> str:
        """Write a move, see `MoveLayout.move`."""
        word, advance = ("MOVE", "") if stops else ("MOVEFLY", " ADVANCE")
        way = f"LINEAR TO {end}" if via is None else f"CIRCULAR TO {end} VIA {via}"
        return f"{word} {self.arm}{way}{advance}{self.settings}"


def _code(program: Program, rows: range) -> str:
    """Return the text of rows, without comments."""
    lines = program.lines
    if not rows:
        return ""
    first = lines.line(rows.start)
    after = lines.line(rows.stop) if rows.stop < len(lines) else None
    last = len(lines.source.line_starts) + 1 if after is None else after
    return "\n".join(code_of(program, line) for line in range(first, last))
