"""Points on the way of a move: MoveL and MoveC before it, laid out as it is."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from postproc.arrays import Floats
from postproc.language import ir
from postproc.language.analysis.insert_moves import TaskSplitter
from postproc.language.insert_moves import MoveLayout, spell, split_arguments
from postproc.language.rapid.clones import ends_line
from postproc.language.rapid.instructions import NAMES
from postproc.language.rapid.pose_encoding import RAPID_DIALECT
from postproc.language.text.source import CloneError, Source, Span

LONGEST_STATEMENT = 400  # characters, as an arc to two written targets has them
ZONE = "z0"  # the smallest that passes a point
_WORDS = {"movel": "MoveL", "movec": "MoveC"}
_KEPT = frozenset("v wobj tload z inpos".split())  # options whose moves may be split
_OPTION = re.compile(r"\\\s*(\w+)")
_IN_ZONE = frozenset("z inpos".split())
_PLAIN = frozenset("movel movej movec moveabsj".split())
_READS = re.compile(rb"\b(?:CRobT|CJointT|CPos|PathRecStart)\b", re.I)
_UNUSED = "[9E9,9E9,9E9,9E9,9E9,9E9]"


class RapidSplitter(TaskSplitter):
    """The modules of a task, to put points on the ways of moves."""

    head = re.compile(r"\s*(Move[LC])\b", re.I)
    kind = ir.Instruction

    def list_problems(
        self, file: int, row: int, move: ir.Instruction
    ) -> Iterator[tuple[str, object]]:
        """Yield what may forbid points on a way, see `Splitter.list_problems`."""
        own = self.task.files[file]
        yield self._readers, self._readers
        yield "it stands in a system module, which is not rewritten", own.is_system
        other = move.name not in _WORDS or move.name in self.task.routines
        yield f"it is {move.name}: only MoveL and MoveC get points", other
        options = sorted({one.name for one in move.arguments if one.name} - _KEPT)
        yield f"{', '.join(options)} of it hold for the whole move", options
        passed_on = any(one.passed_on for one in move.arguments)
        yield "options of it are passed on to its routine", passed_on
        yield f"the program declares {ZONE} itself", ZONE in self.task.declared
        yield "it stands on several lines", len(own.text.lines(row)) > 1

    @cached_property
    def _readers(self) -> str:
        """Say what may read where the arm is on its way, "" for nothing."""
        files = (*self.task.files, *self.task.files_beside)
        traps = any(
            getattr(routine.head, "kind", "") == "trap"
            for file in self.task.files
            for routine in file.routines
        )
        reads = any(_READS.search(file.text.source.data) for file in files)
        if reads and (traps or self.task.files_beside):
            return "a TRAP or another task may read where the arm is on its way"
        return ""

    def is_setting(self, one: ir.SourceStatement) -> bool:
        """Return True for instructions that set modes."""
        return isinstance(one, ir.Instruction) and one.name in NAMES["motion"]

    def is_plain_move(self, one: ir.SourceStatement) -> bool:
        """Return True for moves without a process."""
        return isinstance(one, ir.Instruction) and one.name in _PLAIN

    def lay_out(
        self, source: Source, start: int, code: str, head: re.Match[str]
    ) -> RapidLayout:
        """Look at a move, see `TaskSplitter.lay_out`."""
        if not ends_line(source, start + len(code)):
            raise CloneError("it does not stand alone on its line")
        code = code.removesuffix(";")
        items = split_arguments(code, head.end())
        arc = _WORDS[head[1].lower()] == "MoveC"
        if len(items) != 4 + arc:
            raise CloneError("its arguments are not understood")
        zone = code[items[-2].start : items[-2].end]
        if not {name.lower() for name in _OPTION.findall(zone)} <= _IN_ZONE:
            raise CloneError("its arguments are not understood")
        indent = code[: head.start(1)]
        via = items[0] if code[items[0].start] == "[" else None
        return RapidLayout(
            source, start, code, indent, "!", via, tuple(items[-3:]),
            longest=LONGEST_STATEMENT,
        )  # fmt: skip


SPLITTER = RapidSplitter


@dataclass(frozen=True)
class RapidLayout(MoveLayout):
    """How a move is laid out, see `MoveLayout`.

    Attributes:
        items: Where speed, zone and tool stand in the line.
    """

    items: tuple[Span, ...]

    def place(self, numbers: Floats, config: str) -> str:
        """Write a robtarget, its numbers (11,)."""
        told = spell(numbers, RAPID_DIALECT.pose_decimals)
        parts = (",".join(told[k]) for k in (slice(3), slice(3, 7), slice(7, 11)))
        return f"[{','.join(f'[{part}]' for part in parts)},{_UNUSED}]"

    def move(self, end: str, via: str | None, stops: bool) -> str:
        """Write a move, see `MoveLayout.move`."""
        speed, _, tool = (self.code[slice(*item)] for item in self.items)
        zone = "fine" if stops else ZONE
        word, way = ("MoveL", end) if via is None else ("MoveC", f"{via},{end}")
        return f"{word} {way},{speed},{zone},{tool};"
