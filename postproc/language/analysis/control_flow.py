"""Where a routine goes on behind each of its statements."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from postproc.language import ir

EXIT, CURVE = "exit-loop", "spline"
ENDS = {
    "if": "endif",
    "while": "endwhile",
    "for": "endfor",
    "test": "endtest",
    "loop": "endloop",
    "repeat": "until",
    "condition": "endcondition",
    CURVE: "endspline",
}
CLOSING = frozenset(ENDS.values())
LOOPS = ("while", "loop", "repeat", "for")
CYCLE = "cycle"


@dataclass(frozen=True)
class ControlFlow:
    """Blocks of a routine, by the rows of its file.

    Attributes:
        first, last: Its first statement, and the one behind its last (its end or the
            first of its error handlers).
        handlers: Rows behind that, up to its end.
        end: From the head of a block, and from each of its divisions, to its end.
        head: From the end of a block to its head.
        divisions: From the head of a block to ELSE, CASE .. in it, in order.
        labels: Rows by name.
        joins: Rows that several ways lead to.
        loops: Of loops that count: head to end.
        exits: From a word that leaves a loop to the head of that loop.
        conditions: Heads and ends of blocks that run whenever a condition holds.
        cycle: Row from which on a program runs over and over, -1 where there is none.
        problems: Rows of what does not match, and what is wrong there.
        nowhere: Rows that lead to labels which do not exist, likewise.
    """

    first: int
    last: int
    handlers: range = range(0)
    end: Mapping[int, int] = field(default_factory=dict)
    head: Mapping[int, int] = field(default_factory=dict)
    divisions: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    labels: Mapping[str, int] = field(default_factory=dict)
    joins: frozenset[int] = frozenset()
    loops: Mapping[int, int] = field(default_factory=dict)
    exits: Mapping[int, int] = field(default_factory=dict)
    conditions: tuple[tuple[int, int], ...] = ()
    cycle: int = -1
    problems: tuple[tuple[int, str], ...] = ()
    nowhere: tuple[tuple[int, str], ...] = ()

    def behind(self, head: int) -> int:
        """Return the row behind a block, by its head or one of its divisions."""
        return self.end.get(head, self.last - 1) + 1

    def divisions_behind(self, row: int) -> tuple[int, ...]:
        """Return the divisions of a block behind its head, or behind one of them."""
        head = self.head.get(self.end.get(row, -1), row)
        return tuple(one for one in self.divisions.get(head, ()) if one > row)


@dataclass(frozen=True)
class HeadedRows:
    """A module or a routine: the statements from its head to its end.

    Attributes:
        head: What it begins with; it has a name.
        first, last: Rows of its head and of its end; of the last statement that
            can be its own where no end is.
        ended: It has its end.
        flow: The blocks of a routine.
    """

    head: Any
    first: int
    last: int
    ended: bool = True
    flow: ControlFlow = field(default=ControlFlow(0, 0), compare=False)


def word_of(one: ir.Node | None) -> str:
    """Return what a statement is to blocks: if, else, endif, .., "" for all else."""
    match one:
        case ir.ForLoop():
            return "for"
        case ir.Branch(word=word) | ir.BlockWord(word=word):
            return word
    return getattr(one, "block", "")


def is_structural(one: ir.SourceStatement) -> bool:
    """Tell whether a statement is a label, or begins, divides or ends a block."""
    jumps = isinstance(one, ir.LabelMark | ir.JumpTo) or one == ir.Leave(EXIT)
    return jumps or word_of(one) != ""


@dataclass
class FlowReader:
    """The blocks of a routine, as far as its rows have been read.

    Attributes:
        line_of: The line of a row, for messages.
        spell: How the language writes the words of blocks.
        of_else: Which blocks have an ELSE.
        tell_open: Says that a block, by its row and word, is not closed.
        problems: What does not match.
    """

    line_of: Callable[[int], int] = int
    spell: Callable[[str], str] = str.upper
    of_else: tuple[str, ...] = ("if",)
    tell_open: Callable[[int, str], str] | None = None
    problems: list[tuple[int, str]] = field(default_factory=list)
    _end: dict[int, int] = field(default_factory=dict)
    _head: dict[int, int] = field(default_factory=dict)
    _divisions: dict[int, list[int]] = field(default_factory=dict)
    _labels: dict[str, int] = field(default_factory=dict)
    _exits: dict[int, int] = field(default_factory=dict)
    _jumps: list[tuple[int, str]] = field(default_factory=list)
    _open: list[tuple[int, str]] = field(default_factory=list)
    _words: dict[int, str] = field(default_factory=dict)
    _cycle: int = -1

    def take(self, row: int, one: ir.SourceStatement) -> None:
        """Read the next row."""
        if isinstance(one, ir.LabelMark):
            self._labels[one.name] = row
            one = one.then or ir.SourceStatement()
        word = self._words[row] = word_of(one)
        self._take_behind(row, one)
        if word in ENDS:
            self._open.append((row, word))
            self._divisions[row] = []
        elif word in CLOSING:
            self._close(row, word)
        elif ir.divides(one):
            around = self._open[-1:]
            divided = {"else": self.of_else, "elseif": ("if",)}.get(word, ("test",))
            if around and around[0][1] in divided:
                self._divisions[around[0][0]].append(row)
            else:
                self._refuse(row, word)
        elif word == CYCLE:
            self._cycle = row
        elif isinstance(one, ir.JumpTo):
            self._jumps.append((row, one.name))
        elif one == ir.Leave(EXIT):
            loops = [head for head, word in self._open if word in LOOPS]
            self._exits |= {row: loops[-1]} if loops else {}

    def _take_behind(self, row: int, one: ir.SourceStatement) -> None:
        """Read what stands behind a statement on its line."""
        behind = getattr(one, "then", None)
        inner = word_of(behind)
        if inner in ENDS or inner in CLOSING:
            outer = self.spell(word_of(one)) or type(one).__name__.upper()
            text = f"this {self.spell(inner)} stands behind {outer}"
            self.problems.append((row, f"{text}: put it on a line of its own"))
        elif isinstance(behind, ir.JumpTo):
            self._jumps.append((row, behind.name))

    def _close(self, row: int, word: str) -> None:
        """Close the innermost block."""
        if not self._open or ENDS[self._open[-1][1]] != word:
            self._refuse(row, word)
            return
        head, kind = self._open.pop()
        if kind == CURVE:  # ways neither part nor meet there
            return
        for part in (head, *self._divisions[head]):
            self._end[part] = row
        self._head[row] = head

    def _refuse(self, row: int, word: str) -> None:
        text = f"this {self.spell(word)} closes or divides no block"
        if self._open:
            begin, around = self._open[-1]
            text += f" (line {self.line_of(begin)} opens {self.spell(around)})"
        self.problems.append((row, text))

    def _tell_open(self, row: int, word: str) -> str:
        return f"this {self.spell(word)} is never closed"

    def flow(self, first: int, last: int, handlers: range = range(0)) -> ControlFlow:
        """Return where ways lead, and where they meet."""
        tell = self.tell_open or self._tell_open
        never = [(row, tell(row, word)) for row, word in self._open]
        lost = [
            (row, f"label {label} does not exist")
            for row, label in self._jumps
            if label not in self._labels
        ]
        heads = {head: end for end, head in self._head.items()}
        of, cycle = self._words, {self._cycle} - {-1}
        behind = {end + 1 for head, end in heads.items() if of[head] != "if"}
        joins = {*self._labels.values(), *heads, *self._head, *behind, *cycle}
        return ControlFlow(
            first, last, handlers, {**self._end}, {**self._head},
            {row: tuple(parts) for row, parts in self._divisions.items()},
            {**self._labels}, frozenset(joins),
            {head: end for head, end in heads.items() if of[head] == "for"},
            {**self._exits},
            tuple(sorted((h, e) for h, e in heads.items() if of[h] == "condition")),
            self._cycle, (*self.problems, *never), tuple(lost),
        )  # fmt: skip
