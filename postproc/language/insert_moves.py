"""Points on the way of a move: moves in front of it, laid out as it is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import filterfalse, islice
from typing import Any, ClassVar

from postproc.arrays import Floats
from postproc.language.ir import SourceStatement
from postproc.language.text.comment_directives import AT_APPROACH, AT_VIA, INSERTED
from postproc.language.text.source import (
    LONGEST_LINE,
    CloneError,
    Edit,
    Source,
    Span,
    check_length,
)
from postproc.language.text.statement_table import Statements

PASSED_MM = 0.3  # size of the zone of inserted points, where they have one of their own


@dataclass(frozen=True)
class MoveLayout(ABC):
    """How a move is laid out: what the moves in front of it look like.

    Attributes:
        source: Its file.
        start: Offset of its line there.
        code: Its line, without the comment.
        indent: What begins the line.
        comment: What comments of its language begin with.
        via: Where in the line the numbers of the point of an arc stand, None where they
            stand elsewhere.
        longest: Characters that a line of the language may have.
    """

    source: Source
    start: int
    code: str
    indent: str
    comment: str
    via: Span | None
    longest: int = field(default=LONGEST_LINE, kw_only=True)

    @abstractmethod
    def place(self, numbers: Floats, config: str) -> str:
        """Write a position, its numbers (w,)."""

    @abstractmethod
    def move(self, end: str, via: str | None, stops: bool) -> str:
        """Write a move to a place, along an arc where `via` is a point on its way."""

    def line(self, end: str, via: str | None, stops: bool, mark: str = "") -> str:
        """Write a line with a move."""
        move = self.move(end, via, stops)
        new = f"{self.indent}{move} {self.comment} {INSERTED}{mark}"
        check_length(self.source, len(new), self.longest)
        return new + self.source.newline.decode("ascii")

    def before(self, text: str) -> Edit:
        """Put lines in front of the move."""
        return Edit(Span(self.start, self.start), text.encode("latin-1"))


@dataclass(frozen=True)
class ArcPiece:
    """A piece of an arc that is cut, from where the piece before it ends.

    Attributes:
        end: Numbers of its end, (w,); None: as the move has them.
        via: Numbers of the point on its own way, (w,); None: it is a chord.
        at_via: Whether it ends at the point on the way of the arc.
    """

    end: Floats | None
    via: Floats | None
    at_via: bool = False


class Splitter(ABC):
    """The files of a job, to put points on the ways of its moves.

    Attributes:
        unsized: Why points stay out whose blending is not known, "" where the arm
            passes them however they are blended.
        keeps_aux: External axes stay where they are on the way to points.
        kind: Of the statements that are moves.
    """

    unsized: str = ""
    keeps_aux: bool = False
    kind: ClassVar[type[SourceStatement]]

    # What a language says. A move is named by its file and its line there.

    @abstractmethod
    def find(self, file: int, line: int) -> tuple[Statements[Any], int]:
        """Return the statements of a file, and the row of a move."""

    @abstractmethod
    def list_problems(
        self, file: int, row: int, move: Any
    ) -> Iterable[tuple[str, object]]:
        """Yield what may forbid points on the way of a move, and whether it does."""

    @abstractmethod
    def is_setting(self, one: SourceStatement) -> bool:
        """Return True if a statement sets how moves are made, and does no more."""

    def is_plain_move(self, one: SourceStatement) -> bool:
        """Return True if a statement moves, and begins no process."""
        return isinstance(one, self.kind)

    @abstractmethod
    def layout(self, file: int, line: int) -> MoveLayout:
        """Look at a move.

        Raises:
            CloneError: It is not understood.
        """

    # What follows from that.

    def hinders(self, file: int, line: int) -> str:
        """Say what in the text of a move forbids points on its way, "" for nothing."""
        text, row = self.find(file, line)
        move = text.statement(row)
        if not isinstance(move, self.kind) or text.line(row) != line:
            return "it does not stand alone on its line"
        problems = self.list_problems(file, row, move)
        return next((problem for problem, hinders in problems if hinders), "")

    def stops(self, file: int, line: int) -> bool:
        """Tell whether the arm may stop once more before a move.

        Nothing that may begin a process stands between it and the move before.
        """
        text, row = self.find(file, line)
        before = map(text.statement, range(row - 1, -1, -1))
        others = filterfalse(self.is_setting, before)
        return any(map(self.is_plain_move, islice(others, 1)))

    def points(
        self, file: int, line: int, numbers: Floats, config: str, stop: bool
    ) -> Edit:
        """Write moves to points in front of a LINEAR move, which they lead up to.

        Args:
            file: Where the move stands.
            line: Its line there.
            numbers: Of the points, one behind the other, (k, w).
            config: Their configuration flags.
            stop: The arm stops at the first of them.

        Raises:
            CloneError: They cannot be written there.
        """
        layout, text = self.layout(file, line), ""
        for number, own in enumerate(numbers):
            text += layout.line(layout.place(own, config), None, stop and number == 0)
        return layout.before(text)

    def approach(self, file: int, line: int, numbers: Floats, config: str) -> Edit:
        """Write a stop in front of a LINEAR move, from where it leads to its target.

        Args:
            file: Where the move stands.
            line: Its line there.
            numbers: Of the stop, (w,).
            config: Its configuration flags.

        Raises:
            CloneError: It cannot be written there.
        """
        layout = self.layout(file, line)
        place = layout.place(numbers, config)
        return layout.before(layout.line(place, None, True, AT_APPROACH))

    def arc(
        self,
        file: int,
        line: int,
        pieces: Sequence[ArcPiece],
        via: Floats,
        config: str,
        stop: bool,
    ) -> list[Edit]:
        """Write pieces in front of a CIRCULAR move, which becomes the last of them.

        Args:
            file: Where the move stands.
            line: Its line there.
            pieces: The pieces; one ends at the point on the way of the arc.
            via: Numbers of the point on the way that the move has from then on, (w,).
            config: Configuration flags of all points.
            stop: The arm stops where the first piece ends.

        Raises:
            CloneError: They cannot be written there.
        """
        layout, text = self.layout(file, line), ""
        if layout.via is None:
            raise CloneError("the point on its way does not stand in the move")
        begin, behind = layout.via
        old, new = layout.code[begin:behind], layout.place(via, config)
        for number, piece in enumerate(pieces):
            end = old if piece.end is None else layout.place(piece.end, config)
            way = None if piece.via is None else layout.place(piece.via, config)
            mark = AT_VIA if piece.at_via else ""
            text += layout.line(end, way, stop and number == 0, mark)
        length = len(layout.code) + len(new) - len(old)
        check_length(layout.source, length, layout.longest)
        span = Span(layout.start + begin, layout.start + behind)
        return [layout.before(text), Edit(span, new.encode("latin-1"))]


def spell(numbers: Floats, decimals: Sequence[int]) -> list[str]:
    """Write numbers with so many decimals each.

    >>> spell([1.0, -0.25], (3, 0))
    ['1.000', '-0']
    """
    return [f"{x:.{d}f}" for x, d in zip(numbers, decimals, strict=True)]


def split_arguments(code: str, begin: int, end: int | None = None) -> list[Span]:
    """Split a part of a text at its commas outside of brackets and strings.

    Args:
        code: The text.
        begin: Where the part begins.
        end: Where it ends; default: with the text.

    Returns:
        Where the pieces stand in the text, without the blanks around them.

    Raises:
        CloneError: A bracket or a string does not end.

    >>> [tuple(part) for part in split_arguments("f a(1, 2), [b,c] ", 1)]
    [(2, 9), (11, 16)]
    """
    end = len(code) if end is None else end
    depth, quoted, ends = 0, False, [begin - 1]
    for at in range(begin, end):
        sign = code[at]
        quoted ^= sign == '"'
        if not quoted:
            depth += (sign in "([{") - (sign in ")]}")
            if sign == "," and depth == 0:
                ends.append(at)
    if depth or quoted:
        raise CloneError("the move is not understood")
    found = []
    for before, behind in zip(ends, [*ends[1:], end], strict=True):
        part = code[before + 1 : behind]
        first = before + 1 + len(part) - len(part.lstrip())
        found.append(Span(first, first + len(part.strip())))
    return found
