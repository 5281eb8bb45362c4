"""Points on the way of a move: MoveL and MoveC before it, laid out as it is."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

from postproc.arrays import Floats
from postproc.language import ir
from postproc.language.insert_moves import MoveLayout, Splitter, spell, split_arguments
from postproc.language.rapid.clones import ends_line
from postproc.language.rapid.pose_encoding import RAPID_DIALECT
from postproc.language.rapid.symbols import RapidTask
from postproc.language.text.source import CloneError, Span

LONGEST_STATEMENT = 400  # characters, as an arc to two written targets has them
ZONE = "z0"  # the smallest that passes a point
_HEAD = re.compile(r"\s*(Move[LC])\b", re.I)
_WORDS = {"movel": "MoveL", "movec": "MoveC"}
_KEPT = frozenset("v wobj tload z inpos".split())  # options whose moves may be split
_OPTION = re.compile(r"\\\s*(\w+)")
_IN_ZONE = frozenset("z inpos".split())
_PLAIN = frozenset("movel movej movec moveabsj".split())
_MOTION = frozenset(
    """
    accset velset worldacclim pathacclim pathresol confj confl singarea cirpathmode
    """.split()
)
_READS = re.compile(rb"\b(?:CRobT|CJointT|CPos|PathRecStart)\b", re.I)
_UNUSED = "[9E9,9E9,9E9,9E9,9E9,9E9]"


@dataclass(frozen=True)
class RapidSplitter(Splitter):
    """The modules of a task, to put points on the ways of moves.

    Attributes:
        task: Its modules.
    """

    task: RapidTask

    def hinders(self, file: int, line: int) -> str:
        """Say why a move must stay in one piece, see `Splitter.hinders`."""
        own = self.task.files[file]
        row = own.find_move(line)
        move = own.text.statement(row)
        if not isinstance(move, ir.Instruction):
            return "it does not stand alone on its line"
        options = {one.name for one in move.arguments if one.name}
        others = sorted(options - _KEPT)
        for problem, hinders in (
            (self._readers, bool(self._readers)),
            ("it stands in a system module, which is not rewritten", own.is_system),
            (f"it is {move.name}: only MoveL and MoveC get points",
             move.name not in _WORDS or move.name in self.task.routines),
            (f"{', '.join(others)} of it hold for the whole move", bool(others)),
            ("options of it are passed on to its routine",
             any(one.passed_on for one in move.arguments)),
            (f"the program declares {ZONE} itself", ZONE in self.task.declared),
            ("it stands on several lines", len(own.text.lines(row)) > 1),
        ):  # fmt: skip
            if hinders:
                return problem
        return ""

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

    def stops(self, file: int, line: int) -> bool:
        """Return True if the arm may stop once more, see `Splitter.stops`."""
        own = self.task.files[file]
        row = own.find_move(line)
        for one in map(own.text.statement, range(row - 1, -1, -1)):
            if not isinstance(one, ir.Instruction) or one.name not in _MOTION:
                return isinstance(one, ir.Instruction) and one.name in _PLAIN
        return False

    def layout(self, file: int, line: int) -> RapidLayout:
        """Look at a move, see `Splitter.layout`."""
        text = self.task.files[file].text
        source, row = text.source, self.task.files[file].find_move(line)
        start, (begin, end) = int(source.line_starts[line - 1]), text.span(row)
        if source.text[start:begin].strip() or not ends_line(source, end):
            raise CloneError("it does not stand alone on its line")
        code = source.text[start:end].rstrip().removesuffix(";")
        head = _HEAD.match(code)
        if head is None:
            raise CloneError("the move is not understood")
        skip = head.end()
        items = [Span(a + skip, b + skip) for a, b in split_arguments(code[skip:])]
        arc = _WORDS[head[1].lower()] == "MoveC"
        if len(items) != 4 + arc:
            raise CloneError("its arguments are not understood")
        zone = code[items[-2].start : items[-2].end]
        if not {name.lower() for name in _OPTION.findall(zone)} <= _IN_ZONE:
            raise CloneError("its arguments are not understood")
        indent = code[: head.start(1)]
        return RapidLayout(
            source, start, code, indent, "!", tuple(items), longest=LONGEST_STATEMENT
        )


@dataclass(frozen=True)
class RapidLayout(MoveLayout):
    """How a move is laid out, see `MoveLayout`.

    Attributes:
        items: Where its arguments stand in the line: targets, speed, zone, tool.
    """

    items: tuple[Span, ...]

    @property
    def via(self) -> Span:
        """Return where the point of an arc stands, see `MoveLayout.via`."""
        begin, end = self.items[0]
        if self.code[begin] != "[":
            raise CloneError("the point on its way does not stand in the move")
        return Span(begin, end)

    def place(self, numbers: Floats, config: str) -> str:
        """Write a robtarget, its numbers (11,)."""
        told = spell(numbers, RAPID_DIALECT.pose_decimals)
        parts = (",".join(told[k]) for k in (slice(3), slice(3, 7), slice(7, 11)))
        return f"[{','.join(f'[{part}]' for part in parts)},{_UNUSED}]"

    def move(self, end: str, via: str | None, stops: bool) -> str:
        """Write a move, see `MoveLayout.move`."""
        speed, tool = (self.code[slice(*self.items[k])] for k in (-3, -1))
        zone = "fine" if stops else ZONE
        word, way = ("MoveL", end) if via is None else ("MoveC", f"{via},{end}")
        return f"{word} {way},{speed},{zone},{tool};"
