"""Where a RAPID routine goes on behind each of its statements."""

from __future__ import annotations

from dataclasses import dataclass, field

from postproc.language.rapid import syntax as said
from postproc.language.rapid.program import RapidScope
from postproc.language.rapid.statements import RapidText

HANDLERS = ("undo", "backward")


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


def flow_of(text: RapidText, routine: RapidScope) -> RoutineFlow:
    """Find the blocks of a routine."""
    rows = range(routine.first + 1, routine.last)
    outside = (k for k in rows if _is_handler(text.statement(k)))
    last = next(outside, routine.last)
    flow = RoutineFlow(routine.first + 1, last, range(last, routine.last))
    stack: list[list[int]] = []
    for row in range(flow.first, last):
        _take(flow, stack, row, text.statement(row))
    return flow


def _is_handler(one: said.RapidStatement) -> bool:
    return isinstance(one, said.ErrorHandler) or (
        isinstance(one, said.BlockWord) and one.word in HANDLERS
    )


def _take(
    flow: RoutineFlow, stack: list[list[int]], row: int, one: said.RapidStatement
) -> None:
    match one:
        case said.LabelMark(name=name):
            flow.labels[name] = row
            flow.joins.add(row)
        case said.Branch(word="if" | "while" | "test") | said.ForLoop():
            stack.append([row])
            flow.joins.add(row)
        case said.Branch() | said.BlockWord(word="else"):
            if stack:
                flow.next_branch[stack[-1][-1]] = row
                stack[-1].append(row)
        case said.BlockWord(word="endif" | "endwhile" | "endfor" | "endtest"):
            if stack:
                branches = stack.pop()
                flow.joins.add(row)
                flow.head[row] = branches[0]
                flow.end |= dict.fromkeys(branches, row)
                if one.word == "endfor":
                    flow.loops[branches[0]] = row
