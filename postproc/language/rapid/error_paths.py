"""Where a RAPID program goes on when a statement raises an error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from postproc.language.analysis.call_context import Context
from postproc.language.rapid.errors import (
    ANY,
    EXIT_CYCLE,
    NO_NUMBERS,
    ErrorClause,
    Numbers,
    common,
    together,
)


@dataclass(frozen=True)
class ErrorHandlers:
    """What handles the errors of a routine.

    Attributes:
        clauses: Its error handlers.
        moves: They may move the arm, or change how moves are carried out.
    """

    clauses: tuple[ErrorClause, ...] = ()
    moves: bool = False


@dataclass(frozen=True)
class ErrorExit:
    """Where the program goes on behind an error.

    Attributes:
        numbers: The errors.
        lost: A handler on the way may have moved the arm or changed modes.
        context, row: The statement; no context: a cycle ends. Of the routine's own
            handler the row is counted from the statement that raises the error.
        restarts: The cycle ends and main begins again from where the arm stands.
        own: The handler is that of the routine itself.
    """

    numbers: Numbers
    lost: bool
    context: Context | None = None
    row: int = -1
    restarts: bool = False
    own: bool = False


def exits_of(
    context: Context, handlers: Callable[[Context], ErrorHandlers]
) -> Iterator[ErrorExit]:
    """Find where a program goes on when a statement raises an error.

    The handlers of its routine come first. Errors that no handler takes, and those
    that one raises again, go to the statement that called the routine. A handler with
    a list of errors takes them over the handlers between. Behind the first routine the
    program stops.

    Args:
        context: Where the statement stands.
        handlers: What handles the errors of a routine.
    """
    numbers, lost, row = ANY, False, 0
    at: Context | None = context
    while at is not None:
        here, raised = handlers(at), NO_NUMBERS
        lost = lost or here.moves
        for number, end in _ends(here, numbers):
            if end == "raise":
                raised = together(raised, number)
            else:
                own = at is context
                yield replace(_exit(at, row, end), numbers=number, lost=lost, own=own)
        if not all(clause.listed for clause in here.clauses):
            numbers = raised
        at, row = caller_of(at)


def _ends(here: ErrorHandlers, numbers: Numbers) -> Iterator[tuple[Numbers, str]]:
    """Yield the words with which handlers go on, and the errors that lead there."""
    for clause in here.clauses:
        taken = clause.numbers if clause.listed else numbers
        for end in clause.ends:
            reached = common(taken, end.numbers)
            if reached is None or reached:
                yield reached, end.word


def _exit(at: Context, row: int, word: str) -> ErrorExit:
    """Return where a word leads to that ends the handling of an error at a row."""
    if word in ("retry", "trynext"):
        return ErrorExit(ANY, False, at, row + (word == "trynext"))
    if word == EXIT_CYCLE:
        return ErrorExit(ANY, False, restarts=True)
    caller, called_at = caller_of(at)
    return ErrorExit(ANY, False, caller, called_at + 1)


def caller_of(context: Context) -> tuple[Context | None, int]:
    """Return where a routine was called, and the row; None for the first one."""
    call = context.call
    if call.outer.place is None:
        return None, -1
    return call.outer, call.at - call.outer.place.offset
