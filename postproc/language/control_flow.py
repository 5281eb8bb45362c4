"""Where a routine goes on behind each of its statements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from postproc.language import ir as said
from postproc.language.statement_table import StatementText

OPENING = ("if", "while", "test", "loop", "repeat")
LOOPS = ("while", "loop", "repeat")
CLOSING = ("endif", "endwhile", "endfor", "endtest", "endloop")
EXIT = "exit-loop"


@dataclass
class RoutineFlow:
    """Blocks of a routine: rows are statements of its file.

    Attributes:
        first, last: Its first statement, and the one behind its last (its end or the
            first handler).
        handlers: Rows behind that, up to its end.
        next_branch: From IF, ELSEIF, CASE .. to the next branch of the same block.
        end: From the head of a block, and from each of its branches, to its end.
        head: From the end of a loop to its head.
        labels: Rows by name.
        joins: Rows that several ways lead to.
        loops: Of FOR loops: head to end.
        exits: From a word that leaves a loop to the head of that loop.
    """

    first: int
    last: int
    handlers: range
    next_branch: dict[int, int] = field(default_factory=dict)
    end: dict[int, int] = field(default_factory=dict)
    head: dict[int, int] = field(default_factory=dict)
    labels: dict[str, int] = field(default_factory=dict)
    joins: set[int] = field(default_factory=set)
    loops: dict[int, int] = field(default_factory=dict)
    exits: dict[int, int] = field(default_factory=dict)


@dataclass(frozen=True)
class HeadedRows:
    """A module or a routine: the statements from its head to its end.

    Attributes:
        head: What it begins with; it has a name.
        first, last: Rows of its head and of its end; of the last statement that
            can be its own where no end is.
        ended: It has its end.
    """

    head: Any
    first: int
    last: int
    ended: bool = True


def _nothing(one: said.SourceStatement) -> bool:
    return False


def flow_of(
    text: StatementText[said.SourceStatement],
    routine: HeadedRows,
    handles: Callable[[said.SourceStatement], bool] = _nothing,
) -> RoutineFlow:
    """Find the blocks of a routine.

    Args:
        text: The statements of its file.
        routine: Its rows.
        handles: Tells with what the handlers at its end begin.
    """
    outside = text.where(handles, routine.first + 1, routine.last)
    last = outside[0] if outside else routine.last
    flow = RoutineFlow(routine.first + 1, last, range(last, routine.last))
    stack: list[list[int]] = []
    for row in text.where(_divides, flow.first, last):
        _take(flow, stack, row, text.statement(row))
    heads = text.where(_is_loop, flow.first, last)
    for row in text.where(_leaves_loop, flow.first, last):
        around = (h for h in reversed(heads) if h < row < flow.end.get(h, -1))
        head = next(around, -1)
        if head >= 0:
            flow.exits[row] = head
    return flow


def _divides(one: said.SourceStatement) -> bool:
    """Tell whether a statement begins, divides or ends a block, or is a label."""
    kinds = said.LabelMark | said.ForLoop | said.Branch | said.BlockWord
    return isinstance(one, kinds)


def _leaves_loop(one: said.SourceStatement) -> bool:
    return isinstance(one, said.Leave) and one.word == EXIT


def _is_loop(one: said.SourceStatement) -> bool:
    return isinstance(one, said.ForLoop) or (
        isinstance(one, said.Branch) and one.word in LOOPS
    )


def _take(
    flow: RoutineFlow, stack: list[list[int]], row: int, one: said.SourceStatement
) -> None:
    match one:
        case said.LabelMark(name=name):
            flow.labels[name] = row
            flow.joins.add(row)
        case said.ForLoop():
            stack.append([row])
            flow.joins.add(row)
        case said.Branch(word=word) if word in OPENING:
            stack.append([row])
            flow.joins.add(row)
        case said.Branch(word="until"):
            _close(flow, stack, row)
        case said.Branch() | said.BlockWord(word="else"):
            if stack:
                flow.next_branch[stack[-1][-1]] = row
                stack[-1].append(row)
        case said.BlockWord(word=word) if word in CLOSING:
            branches = _close(flow, stack, row)
            if branches and word == "endfor":
                flow.loops[branches[0]] = row


def _close(flow: RoutineFlow, stack: list[list[int]], row: int) -> list[int]:
    """End the innermost block."""
    if not stack:
        return []
    branches = stack.pop()
    flow.joins.add(row)
    flow.head[row] = branches[0]
    flow.end |= dict.fromkeys(branches, row)
    return branches
