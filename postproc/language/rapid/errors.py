"""Errors of RAPID: what may raise them, and where a handler goes on behind them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise

from postproc.language import ir
from postproc.language.analysis.call_context import At, Context
from postproc.language.analysis.control_flow import CLOSING, ControlFlow
from postproc.language.rapid import syntax as said
from postproc.language.rapid.program import begins_handler
from postproc.language.rapid.symbols import SHIFTS
from postproc.language.text.statement_table import StatementText

Numbers = frozenset[str] | None
"""Names of error numbers; None: any."""

ANY: Numbers = None
NO_NUMBERS: Numbers = frozenset()
EVERY_JUMP = "long_jmp_all_err"
LARGEST_OWN = 90.0  # numbers up to here are the program's own
LEAVES = ("retry", "trynext", "return", "raise")
EXIT_CYCLE = "exitcycle"

# Beginnings of the instructions and functions that can raise an error. Errors that are
# not named here may come of any statement.
RAISED_BY: Mapping[str, tuple[str, ...]] = {
    "err_wait_maxtime": ("wait",),
    "err_waitsync": ("waitsynctask", "syncmove"),
    "err_gowaitlim": ("waitgo", "waitgi"),
    "err_aowaitlim": ("waitao", "waitai"),
    "err_whlsearch": ("search", "path"),
    "err_sigsupsearch": ("search",),
    "err_tp_maxtime": ("tpread", "ui"),
    "err_tp_dibreak": ("tpread", "ui"),
    "err_tp_dobreak": ("tpread", "ui"),
    "err_tp_persboolbreak": ("tpread", "ui"),
    "err_tp_no_client": ("tpread", "ui"),
    "err_sock_timeout": ("socket",),
    "err_sock_closed": ("socket",),
    "err_filenotfnd": ("open", "load", "startload", "copyfile", "renamefile", "remove"),
    "err_fileopen": ("open", "load", "startload"),
    "err_fileacc": ("read", "write", "open", "copyfile", "clear", "pack"),
    "err_fileeof": ("read", "unpack"),
    "err_rcvdata": ("read", "rmq", "socket"),
    "err_loaded": ("load", "startload", "waitload"),
    "err_unload": ("unload", "waitload"),
    "err_modulename": ("load", "waitload", "startload"),
    "err_ioenable": ("ioenable", "iodisable"),
    "err_iodisable": ("ioenable", "iodisable"),
}
PATH_ERRORS = frozenset(["err_path_stop", "err_coll_stop", "err_motsup"])


HandlerEnd = tuple[Numbers, str]
"""The errors with which a word is reached with which an error handler goes on.

That is retry, trynext, return, raise or exitcycle.
"""


@dataclass(frozen=True)
class ErrorClause:
    """An error handler of a routine.

    Attributes:
        numbers: Errors that it takes; any where it has no list.
        listed: It has a list: errors jump to it over handlers between.
        ends: How it goes on; where it does not, the program stops.
    """

    numbers: Numbers
    listed: bool
    ends: tuple[HandlerEnd, ...]


def common(one: Numbers, other: Numbers) -> Numbers:
    """Return the errors that two sets share."""
    if one is None or other is None:
        return other if one is None else one
    return one & other


def together(one: Numbers, other: Numbers) -> Numbers:
    """Return the errors of two sets."""
    return None if one is None or other is None else one | other


def key_of(operand: ir.Operand | None, value: float) -> str:
    """Name an error number, "" where it is not known.

    Args:
        operand: What stands for it.
        value: Its value, NaN where it is not known before the program runs.
    """
    if value > 0.0:
        return f"{value:g}" if value <= LARGEST_OWN else ""
    if isinstance(operand, ir.DataObject) and not operand.steps:
        return operand.name
    return ""


def numbers_of(
    operands: Iterable[ir.Operand | None], read: Callable[[ir.Operand | None], str]
) -> Numbers:
    """Name error numbers, any where one of them is not known."""
    names = frozenset(read(one) for one in operands)
    return ANY if "" in names or EVERY_JUMP in names else names


@dataclass(frozen=True)
class HandlerReader:
    """Reads the error handlers of a routine.

    Attributes:
        text: The statements of its file.
        name: Names an error number that stands in a row, "" where it is not known.
    """

    text: StatementText[ir.SourceStatement]
    name: Callable[[ir.Operand | None, int], str]

    def clauses(self, flow: ControlFlow) -> tuple[ErrorClause, ...]:
        """Read those of a routine with these blocks."""
        found, rows = list[ErrorClause](), flow.handlers
        starts = [k for k in rows if begins_handler(self.text.statement(k))]
        for first, behind in pairwise([*starts, rows.stop]):
            head = self.text.statement(first)
            if isinstance(head, said.ErrorHandler):
                numbers = self._name_all(head.numbers, first) if head.numbers else ANY
                ends = tuple(self._ends(range(first + 1, behind)))
                found.append(ErrorClause(numbers, bool(head.numbers), ends))
        return tuple(found)

    def _name_all(self, operands: Iterable[ir.Operand | None], row: int) -> Numbers:
        return numbers_of(operands, lambda operand: self.name(operand, row))

    def _ends(self, rows: range) -> Iterator[HandlerEnd]:
        """Find how a handler goes on, and with which errors each word is reached."""
        blocks: list[tuple[Numbers, bool]] = []  # each with whether it tests ERRNO
        for row in rows:
            match one := self.text.statement(row):
                case ir.Branch(word="if", values=(condition, *_)):
                    blocks.append((self._find_errors(condition, row), False))
                case ir.Branch(word="elseif", values=(condition, *_)) if blocks:
                    blocks[-1] = self._find_errors(condition, row), False
                case ir.Branch(word="test", values=(value, *_)):
                    blocks.append((NO_NUMBERS, _is_errno(value)))
                case ir.Branch(word="case", values=values) if blocks:
                    tested = blocks[-1][1]
                    blocks[-1] = self._name_all(values, row) if tested else ANY, tested
                case ir.Branch(word="default") | ir.BlockWord(word="else") if blocks:
                    blocks[-1] = ANY, blocks[-1][1]
                case ir.Branch() | ir.ForLoop():
                    blocks.append((ANY, False))
                case ir.BlockWord(word=word) if word in CLOSING and blocks:
                    blocks.pop()
                case _:
                    numbers = reduce(common, (numbers for numbers, _ in blocks), ANY)
                    yield from self._end(one, row, numbers)

    def _end(
        self, one: ir.SourceStatement, row: int, numbers: Numbers
    ) -> Iterator[HandlerEnd]:
        """Yield the word with which a statement of a handler goes on."""
        while isinstance(one, ir.CompactIf):
            numbers = common(numbers, self._find_errors(one.condition, row))
            one = one.statement
        if isinstance(one, ir.Leave) and one.word in LEAVES:
            yield numbers, one.word
        elif isinstance(one, ir.Instruction) and one.name == EXIT_CYCLE:
            yield numbers, EXIT_CYCLE
        elif isinstance(one, ir.JumpTo | ir.NotUnderstood):  # that is not followed
            yield from ((ANY, word) for word in LEAVES)

    def _find_errors(self, condition: ir.Operand, row: int) -> Numbers:
        """Return the errors for which a condition can hold."""
        match condition:
            case ir.Operation(operator="=", operands=(left, right)):
                if _is_errno(left) or _is_errno(right):
                    return self._name_all([right if _is_errno(left) else left], row)
            case ir.Operation(operator="OR" | "AND" as word, operands=operands):
                one, other = (self._find_errors(part, row) for part in operands)
                return (together if word == "OR" else common)(one, other)
        return ANY


def _is_errno(operand: ir.Operand | None) -> bool:
    return isinstance(operand, ir.DataObject) and operand.name == "errno"


def may_raise(
    one: ir.SourceStatement,
    numbers: Numbers,
    routines: Collection[str],
    declared: Collection[str],
) -> bool:
    """Return True if a statement can raise one of some errors by itself.

    Args:
        one: The statement; ``RAISE`` is not asked for.
        numbers: The errors.
        routines: Names of the routines of the task.
        declared: Names of the data of the task.
    """
    if isinstance(one, ir.LabelMark | ir.BlockWord | ir.JumpTo):
        return False
    if numbers is None:
        return True
    functions = [call.name for call in ir.calls_in(one)]
    if any(name in routines for name in functions):
        return bool(numbers)
    one = ir.inside(one)
    name = one.name if isinstance(one, ir.Instruction) else ""
    if name in RAISING:
        return bool(numbers)
    called, known = [name, *functions], {k for k in numbers if not k[:1].isdigit()}
    starts = (RAISED_BY.get(k) for k in known.difference(declared))
    return any(s is None or any(one.startswith(s) for one in called) for s in starts)


def may_be_skipped(one: ir.SourceStatement) -> bool:
    """Return True if an error may keep an instruction from being carried out.

    Plain moves, and instructions that set modes, raise none: but for an index or a
    function among their operands, and for what waits or couples.
    """
    one = ir.inside(one)
    if not isinstance(one, ir.Instruction):
        return False
    concurrent = any(argument.name == "conc" for argument in one.arguments)
    asks = any(call.name not in SHIFTS for call in ir.calls_in(one))
    indexed = any(map(_is_indexed, one.values))
    return concurrent or asks or indexed or one.name in COUPLING


def _is_indexed(operand: ir.Operand | None) -> bool:
    """Return True if an operand holds an element whose index is no number."""
    found = (part for part in ir.walk(operand) if isinstance(part, ir.ElementStep))
    indices = (index for step in found for index in step.subscripts)
    return not all(isinstance(index, ir.Num) for index in indices)


COUPLING = ("syncmoveoff", "syncmoveundo", "dropwobj", "corrdiscon", "softdeact")
"""Instructions that end a coupling, and can fail."""
RAISING = ("errraise", "raisetouser", "procerrrecovery")
"""Instructions that raise any error."""


# Where a program goes on behind an error.


@dataclass(frozen=True)
class ErrorHandlers:
    """What handles the errors of a routine.

    Attributes:
        clauses: Its error handlers.
        moves: They may move the arm, or change how moves are carried out.
        sets: They may do the latter.
    """

    clauses: tuple[ErrorClause, ...] = ()
    moves: bool = False
    sets: bool = False


@dataclass(frozen=True)
class ErrorExit:
    """Where the program goes on behind an error.

    Attributes:
        numbers: The errors.
        moves, sets: What a handler on the way may have done, as `ErrorHandlers`.
        at: The statement, None where a cycle ends. Of the routine's own handler the row
            is counted from the statement that raises the error.
        restarts: The cycle ends and main begins again from where the arm stands.
        own: The handler is that of the routine itself.
    """

    numbers: Numbers
    moves: bool
    sets: bool
    at: At | None
    restarts: bool
    own: bool

    def beside(self, at: At) -> At | None:
        """Return the statement where it is one of the routine that raises the error.

        Args:
            at: The statement that raises it.
        """
        if self.own and self.at is not None and self.at.context is at.context:
            return at.to(at.row + self.at.row)
        return None


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
    numbers, moves, sets = ANY, False, False
    at: At | None = At(context, 0)
    while at is not None:
        here, raised = handlers(at.context), NO_NUMBERS
        moves, sets = moves or here.moves, sets or here.sets
        for number, end in _list_ends(here, numbers):
            if end == "raise":
                raised = together(raised, number)
            else:
                own, to = at.context is context, _find_exit(at, end)
                yield ErrorExit(number, moves, sets, to, end == EXIT_CYCLE, own)
        if not all(clause.listed for clause in here.clauses):
            numbers = raised
        at = caller_of(at.context)


def _list_ends(here: ErrorHandlers, numbers: Numbers) -> Iterator[HandlerEnd]:
    """Yield the words with which handlers go on, and the errors that lead there."""
    for clause in here.clauses:
        taken = clause.numbers if clause.listed else numbers
        for own, word in clause.ends:
            reached = common(taken, own)
            if reached is None or reached:
                yield reached, word


def _find_exit(at: At, word: str) -> At | None:
    """Return where a word leads to that ends the handling of an error at a row."""
    if word in ("retry", "trynext"):
        return at.behind if word == "trynext" else at
    caller = None if word == EXIT_CYCLE else caller_of(at.context)
    return caller and caller.behind


def caller_of(context: Context) -> At | None:
    """Return where a routine was called, None for the first one."""
    call = context.call
    return None if call.outer.place is None else call.begun_at
