"""A RAPID file: its modules, routines, data, moves, and what is not understood."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from postproc.language.flow import HeadedRows
from postproc.language.rapid.signatures import MOTIONS, Signature, known_instructions
from postproc.language.rapid.statements import RapidText, read_statements
from postproc.language.rapid.syntax import (
    Argument,
    BlockWord,
    Branch,
    CompactIf,
    DataDeclaration,
    ForLoop,
    Instruction,
    LateCall,
    ModuleHead,
    NotUnderstood,
    Operand,
    RapidStatement,
    RecordHead,
    RoutineHead,
)
from postproc.language.source import Source
from postproc.language.visits import Diagnostic


@dataclass(frozen=True)
class Datum:
    """Data that a module or a routine declares.

    Attributes:
        declared: What the declaration says.
        row: Its statement.
        module: Name of the module, "" outside of all.
        routine: Name of the routine whose own it is, "" where it is the module's.
    """

    declared: DataDeclaration
    row: int
    module: str
    routine: str


@dataclass(frozen=True)
class MotionCall:
    """An instruction that moves.

    Attributes:
        row: Its statement.
        name: Of the instruction, in lower case.
        signature: Where its positions stand.
        to, via: Destination and point of an arc, None where one is missing.
        arguments: All of its arguments.
        condition: It runs only ``IF`` something is true.
    """

    row: int
    name: str
    signature: Signature
    to: Operand | None
    via: Operand | None
    arguments: tuple[Argument, ...]
    condition: bool


@dataclass(frozen=True)
class RapidFile:
    """What a RAPID file holds.

    Attributes:
        text: Its statements.
        modules, routines: In the order of the file.
        data: Declared data.
        moves: Statements that move.
        diagnostics: What is not understood or may move unseen, by line.
    """

    text: RapidText
    modules: tuple[HeadedRows, ...]
    routines: tuple[HeadedRows, ...]
    data: tuple[Datum, ...]
    moves: tuple[MotionCall, ...]
    diagnostics: tuple[Diagnostic, ...]


def read_rapid(source: Source) -> RapidFile:
    """Read a RAPID file.

    Raises:
        ProgramError: A string or the header does not end.
    """
    text = read_statements(source)
    outline = _Outline(text)
    for row in _rows(text, _is_outline):
        outline.take(row, text.statement(row))
    outline.close()
    routines = {scope.head.name for scope in outline.routines}
    calls = _Calls(text, routines)
    for row in _rows(text, _is_call):
        if not outline.in_record(row):
            calls.take(row, text.statement(row))
    found = sorted({*outline.diagnostics, *calls.diagnostics})
    return RapidFile(
        text,
        tuple(outline.modules),
        tuple(outline.routines),
        tuple(outline.data),
        tuple(calls.moves),
        tuple(found),
    )


def _rows(text: RapidText, test: Callable[[RapidStatement], bool]) -> list[int]:
    """List the statements whose forms pass a test."""
    rows: list[int] = np.flatnonzero(text.said.which(test)[text.shape]).tolist()
    return rows


def _is_call(said: RapidStatement) -> bool:
    return isinstance(said, Instruction | LateCall | CompactIf | NotUnderstood)


def _is_outline(said: RapidStatement) -> bool:
    heads = ModuleHead | RoutineHead | RecordHead | Branch | ForLoop
    return isinstance(said, heads | BlockWord | DataDeclaration)


# Blocks: every head has its end.

_ENDS = {
    "endmodule": "module", "endproc": "proc", "endfunc": "func", "endtrap": "trap",
    "endrecord": "record", "endif": "if", "endfor": "for", "endwhile": "while",
    "endtest": "test",
}  # fmt: skip
_WITHIN = {"elseif": "if", "else": "if", "case": "test", "default": "test"}
_SCOPES = ("module", "proc", "func", "trap", "record")


@dataclass
class _Outline:
    """Modules, routines, records and blocks of a file, as they are met."""

    text: RapidText
    modules: list[HeadedRows] = field(default_factory=list)
    routines: list[HeadedRows] = field(default_factory=list)
    data: list[Datum] = field(default_factory=list)
    diagnostics: list[Diagnostic] = field(default_factory=list)
    _open: list[tuple[str, int, RapidStatement]] = field(default_factory=list)
    _record_rows: list[range] = field(default_factory=list)

    def take(self, row: int, said: RapidStatement) -> None:
        """Take the next statement that opens or closes something, or declares."""
        match said:
            case DataDeclaration():
                module, routine = self._name("module"), self._name(*_SCOPES[1:4])
                self.data.append(Datum(said, row, module, routine))
            case ModuleHead():
                self._begin("module", row, said)
            case RoutineHead(kind=kind):
                self._begin(kind, row, said)
            case RecordHead():
                self._begin("record", row, said)
            case ForLoop():
                self._open.append(("for", row, said))
            case Branch(word=word) | BlockWord(word=word):
                self._word(word, row, said)

    def close(self) -> None:
        """Close what the file leaves open."""
        self._close_until(0, len(self.text) - 1)

    def in_record(self, row: int) -> bool:
        """Tell whether a statement is a component of a record's declaration."""
        return any(row in rows for rows in self._record_rows)

    def _name(self, *kinds: str) -> str:
        """Return the name of the innermost open scope of some kinds."""
        heads = (said for kind, _, said in reversed(self._open) if kind in kinds)
        return getattr(next(heads, None), "name", "")

    def _begin(self, kind: str, row: int, said: RapidStatement) -> None:
        """Open a scope: routines and records stand in modules only."""
        kinds = [kind for kind, _, _ in self._open]
        if kind == "module":
            self._close_until(0, row - 1)
        elif any(one != "module" for one in kinds):
            self._close_until(kinds.count("module"), row - 1)
        self._open.append((kind, row, said))

    def _word(self, word: str, row: int, said: RapidStatement) -> None:
        kinds = [kind for kind, _, _ in self._open]
        if word in ("if", "while", "test"):
            self._open.append((word, row, said))
        elif word in _WITHIN:
            if kinds[-1:] != [_WITHIN[word]]:
                self._complain(row, f"stands in no {_WITHIN[word].upper()}")
        elif word in _ENDS:
            self._end(_ENDS[word], row, kinds)

    def _end(self, kind: str, row: int, kinds: Sequence[str]) -> None:
        inner = kinds if kind in _SCOPES else kinds[_last_scope(kinds) :]
        if kind not in inner:
            self._complain(row, f"ends no {kind.upper()}")
            return
        at = len(kinds) - 1 - list(reversed(kinds)).index(kind)
        self._close_until(at + 1, row - 1)
        if kind == "record":  # without its end, calls may stand behind it
            self._record_rows.append(range(self._open[-1][1], row + 1))
        self._closed(self._open.pop(), row)

    def _close_until(self, depth: int, row: int) -> None:
        """Close what stands open deeper than a depth, with a message."""
        while len(self._open) > depth:
            kind, begun, said = self._open.pop()
            self._complain(begun, f"has no END{kind.upper()}")
            self._closed((kind, begun, said), row)

    def _closed(self, block: tuple[str, int, RapidStatement], row: int) -> None:
        _, begun, said = block
        if isinstance(said, ModuleHead):
            self.modules.append(HeadedRows(said, begun, row))
        elif isinstance(said, RoutineHead):
            self.routines.append(HeadedRows(said, begun, row))

    def _complain(self, row: int, what: str) -> None:
        message = f"{self.text.shown(row)} {what}"
        self.diagnostics.append(self.text.diagnostic(row, "open-block", message))


def _last_scope(kinds: Sequence[str]) -> int:
    """Return the place behind the innermost module, routine or record."""
    return max((k + 1 for k, kind in enumerate(kinds) if kind in _SCOPES), default=0)


# Calls: what moves, what does not, and what nobody can tell.


@dataclass
class _Calls:
    """Instructions of a file, as they are met.

    Attributes:
        own: Names of its routines.
    """

    text: RapidText
    own: set[str]
    moves: list[MotionCall] = field(default_factory=list)
    diagnostics: list[Diagnostic] = field(default_factory=list)

    def take(self, row: int, said: RapidStatement, condition: bool = False) -> None:
        """Take the next statement that may move."""
        match said:
            case CompactIf(statement=inside):
                self.take(row, inside, condition=True)
            case Instruction(name=name, arguments=arguments):
                self._instruction(row, name, arguments, condition)
            case LateCall():
                what = "calls a procedure whose name shows when it runs: it may move"
                self._complain(row, "late-binding", what)
            case NotUnderstood():
                self._complain(row, "unknown-statement", "is not understood")

    def _instruction(
        self, row: int, name: str, arguments: tuple[Argument, ...], condition: bool
    ) -> None:
        signature = MOTIONS.get(name)
        if signature is not None:
            to, via = signature.operands(arguments)
            self.moves.append(
                MotionCall(row, name, signature, to, via, arguments, condition)
            )
            if to is None or (signature.via >= 0 and via is None):
                self._complain(row, "unknown-statement", "has too few positions")
        elif name not in known_instructions() and name not in self.own:
            what = "is neither a known instruction nor a routine here: it may move"
            self._complain(row, "unknown-instruction", what)

    def _complain(self, row: int, code: str, what: str) -> None:
        message = f"{self.text.shown(row)} {what}"
        self.diagnostics.append(self.text.diagnostic(row, code, message))
