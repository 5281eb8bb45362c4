"""Points on the way of a move: LIN and CIRC before it, laid out as it is."""

from __future__ import annotations

import re
from bisect import bisect
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from postproc.arrays import Floats
from postproc.language import insert_moves, ir
from postproc.language.analysis.insert_moves import TaskSplitter
from postproc.language.krl import syntax as said
from postproc.language.krl.clones import is_of_form
from postproc.language.krl.modal_state import PLANNED
from postproc.language.krl.pose_encoding import COMPONENTS, KRL_DIALECT
from postproc.language.text.source import Source

LINES = {"lin": "LIN", "circ": "LIN", "slin": "SLIN", "scirc": "SLIN"}
_BLENDING = re.compile(r"(?:\s*\bC_\w+)+\s*$", re.I)
_WITH = re.compile(r"\bWITH\b", re.I)
_ACTUAL = re.compile(rb"\$(?:POS|AXIS)_(?:BACK|FOR|RET)\b|\$DIST_NEXT\b", re.I)
_READS = re.compile(rb"\$(?:POS|AXIS)_(?:ACT|INT)(?:_\w+)?\b|\$DISTANCE\b", re.I)
_ACTIVE = frozenset(["fdat_act", "pdat_act", "ldat_act"])
_STOPPED = "ir_stopm"  # the controller's own, in every program of an inline form
_Row = tuple[int, int]  # a file, and a statement of it


class KrlSplitter(TaskSplitter):
    """The files of a job, to put points on the ways of moves."""

    head = re.compile(r"\s*(S?LIN|S?CIRC)\b", re.I)
    kind = said.KrlMove
    unsized: str = (
        "points on its way would be passed at a distance that is not known: set "
        "$APO.CDIS before it"
    )
    keeps_aux: bool = True

    def list_problems(
        self, file: int, row: int, move: said.KrlMove
    ) -> Iterator[tuple[str, object]]:
        """Yield what may forbid points on a way, see `Splitter.list_problems`."""
        own = self.task.files[file]
        yield self._beside, self._beside
        system = "it stands in a file of the controller, which is not rewritten"
        yield system, own.is_system
        curve = "it stands in a spline block, whose curve depends on all of its points"
        yield curve, any(row in rows for rows in own.splines)
        yield "it is neither a line nor an arc to a place", move.word not in LINES
        yield "it ends at an angle (CA)", move.angle is not None
        triggered = self._triggered is None or (file, row) in self._triggered
        yield "a TRIGGER belongs to it, or to a move beside it", triggered
        in_form = is_of_form(own.text.source, own.text.line(row))
        yield "an inline form would drop the points when it is edited", in_form

    def _statements(self) -> Iterator[ir.SourceStatement]:
        """Yield the statements of the user's files, one of each form."""
        for file in self.task.files:
            if not file.is_system:
                yield from file.text.said

    @cached_property
    def _beside(self) -> str:
        """Say why no move may be split: what counts moves, or reads where they are."""
        own = [*self._statements()]
        if any(isinstance(one, said.ContinueWord) for one in own):
            return "the program runs ahead of its moves (CONTINUE)"
        texts = [one.text.source.data for one in self.task.files if not one.is_system]
        if any(map(_ACTUAL.search, texts)):
            return "the program reads where the move under way begins or ends"
        watched = any(
            isinstance(one, said.InterruptDeclared)
            and getattr(one.action, "name", "") != _STOPPED
            for one in own
        )
        if watched and any(map(_READS.search, texts)):
            return "an interrupt may read where the arm is on its way"
        return ""

    @cached_property
    def _triggered(self) -> frozenset[_Row] | None:
        """Return moves with triggers, and those beside them; None for all moves."""
        found = set[_Row]()
        for number, file in enumerate(self.task.files):
            moves, text = file.moves.tolist(), file.text
            for row in text.of_kind(lambda one: isinstance(one, said.PathTrigger)):
                at = bisect(moves, row)
                if at == len(moves) or not all(
                    isinstance(text.statement(k), said.PathTrigger | said.SplineBlock)
                    or self.is_setting(text.statement(k))
                    for k in range(row, moves[at])
                ):
                    return None  # which move it belongs to does not show
                found |= {(number, k) for k in moves[max(at - 1, 0) : at + 2]}
        return frozenset(found)

    def is_setting(self, one: ir.SourceStatement) -> bool:
        """Return True if a statement sets how moves are made, and does nothing else."""
        if isinstance(one, ir.Assignment):
            return one.target.name in PLANNED or one.target.name in _ACTIVE
        if not isinstance(one, ir.Instruction) or one.name != "bas":
            return False
        command = one.arguments[0].value if one.arguments else None
        word = command.name if isinstance(command, said.EnumValue) else "#out_"
        return not word.startswith("#out_")

    def lay_out(
        self, source: Source, start: int, code: str, head: re.Match[str]
    ) -> KrlLayout:
        """Look at a move, see `TaskSplitter.lay_out`."""
        blending = _BLENDING.search(code)
        stop = blending.start() if blending else len(code)
        with_ = _WITH.search(code, head.end(), stop)
        behind = with_.start() if with_ else stop
        first, *_ = insert_moves.split_arguments(code, head.end(), behind)
        settings = code[with_.end() : stop].strip() if with_ else ""
        indent, word = code[: head.start(1)], head[1].lower()
        via = first if code[first.start] == "{" else None
        return KrlLayout(source, start, code, indent, ";", via, word, settings)


SPLITTER = KrlSplitter


@dataclass(frozen=True)
class KrlLayout(insert_moves.MoveLayout):
    """How a move is laid out, see `MoveLayout`.

    Attributes:
        word: Of the move, in lower case.
        settings: What holds for the move alone, as it is written.
    """

    word: str
    settings: str

    def place(self, numbers: Floats, config: str) -> str:
        """Write a position, its numbers (8,); lines and arcs ignore S and T."""
        told = insert_moves.spell(numbers[:6], KRL_DIALECT.pose_decimals[:6])
        named = zip(COMPONENTS, told, strict=False)
        return f"{{{','.join(f'{name.upper()} {x}' for name, x in named)}}}"

    def move(self, end: str, via: str | None, stops: bool) -> str:
        """Write a move, see `MoveLayout.move`."""
        word = LINES[self.word] if via is None else self.word.upper()
        way = end if via is None else f"{via},{end}"
        spline = self.word.startswith("s")
        settings = self.settings
        if spline and not stops and "$APO" not in settings.upper():
            zone = f"$APO.CDIS={insert_moves.PASSED_MM}"
            settings = f"{settings},{zone}" if settings else zone
        with_ = f" WITH {settings}" if settings else ""
        blending = "" if stops else " C_SPL" if spline else " C_DIS"
        return f"{word} {way}{with_}{blending}"
