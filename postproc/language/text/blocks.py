"""Blocks of a text: every head has its end."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from postproc.diagnostics import Code
from postproc.exceptions import ProgramError
from postproc.language import ir
from postproc.language.analysis.control_flow import (
    ENDS,
    ControlFlow,
    FlowReader,
    HeadedRows,
    is_structural,
)
from postproc.language.analysis.declarations import Datum, TaskFile, list_data
from postproc.language.text.statement_table import StatementText
from postproc.language.text.templates import (
    alike,
    name_index,
    number_in_order,
)
from postproc.language.visits import Diagnostic


@dataclass(frozen=True)
class ScopeWords:
    """The words that modules, routines and records of a language end with.

    Attributes:
        ends: From a word to the kind that it ends.
        routines: Those kinds that run.
        outer: The one that holds others, "" where there is none.
        handles: Tells what begins a clause behind the statements of a routine.
    """

    ends: Mapping[str, str]
    routines: Collection[str]
    outer: str = ""
    handles: Callable[[ir.SourceStatement], bool] = lambda one: False


@dataclass
class Outline:
    """Modules, routines and records of a file with their blocks, as they are met.

    Attributes:
        text: Its statements.
        words: The words of the language.
        scopes: Modules, routines and records by kind, as they end.
        data: What they declare.
        diagnostics: Blocks that do not close, and what is not understood.
    """

    text: StatementText[Any]
    words: ScopeWords
    scopes: dict[str, list[HeadedRows]] = field(default_factory=dict)
    data: list[Datum] = field(default_factory=list)
    diagnostics: list[Diagnostic] = field(default_factory=list)
    _open: list[tuple[str, int, ir.SourceStatement]] = field(default_factory=list)
    _blocks: FlowReader = field(default_factory=FlowReader)
    _before: ControlFlow | None = None  # the handlers of the routine
    _declared: dict[int, tuple[Datum, str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Read blocks from the first statement on."""
        self._begin_blocks()
        self._find_declared()

    def _find_declared(self) -> None:
        """Find declarations of one name that has a digit.

        What they say is built once for all whose other names are the same.
        """
        text, shapes = self.text, self.text.shapes
        opens = np.array([*map(_declares_open, text.said.said)], dtype=bool)
        rows = np.flatnonzero(opens[text.said.form[text.shape]])
        first, behind = (shapes.first[text.shape[rows] + k] for k in (0, 1))
        kind = alike(shapes.name, first + 1, behind)  # names but the declared one
        kind, example = number_in_order(
            kind * len(opens) + text.said.form[text.shape[rows]]
        )
        data = [one for row in rows[example].tolist()
                for one in list_data(text.statement(row), row, "", "")]  # fmt: skip
        names = shapes.names.take(shapes.name[first].astype(np.int64)).lower()
        pairs = zip([data[k] for k in kind.tolist()], names, strict=True)
        self._declared = dict(zip(rows.tolist(), pairs, strict=True))

    def _begin_blocks(self) -> None:
        self._blocks = FlowReader(self.text.line, tell_open=self._tell_open)
        self._before = None

    def _tell_open(self, row: int, kind: str) -> str:
        """Say that a block, a routine or a module is not closed."""
        words = {kind: word for word, kind in self.words.ends.items()} | ENDS
        return f"{self.text.quote(row)} has no {words[kind].upper()}"

    def of(self, *kinds: str) -> list[HeadedRows]:
        """Return the scopes of some kinds, in the order of the file."""
        found = [scope for kind in kinds for scope in self.scopes.get(kind, [])]
        return sorted(found, key=lambda scope: scope.first)

    def name(self, *kinds: str) -> str:
        """Return the name of the innermost open scope of some kinds."""
        heads = (said for kind, _, said in reversed(self._open) if kind in kinds)
        return getattr(next(heads, None), "name", "")

    def declare(self, row: int, module: str) -> bool:
        """Take a declaration of a single numbered name; return False for all else."""
        if row not in self._declared:
            return False
        form, name = self._declared[row]
        self.data.append(Datum(
            name, form.type, row, module, self.name(*self.words.routines), form.value,
            dimensions=form.dimensions, kind=form.kind, scope=form.scope,
        ))  # fmt: skip
        return True

    def take(self, row: int, one: ir.SourceStatement, module: str) -> None:
        """Take the next statement.

        Args:
            row: Its row.
            one: What it says.
            module: Name of the module that it stands in.
        """
        match one:
            case ir.Declaration():
                routine = self.name(*self.words.routines)
                self.data += list_data(one, row, module, routine)
            case ir.ScopeHead(kind=kind) | ir.RoutineHead(kind=kind):
                self.begin(kind, row, one)
            case ir.BlockWord(word=word) if word in self.words.ends:
                self._end(word, row)
            case ir.NotUnderstood():
                self.complain(row, "is not understood")
            case _ if self.words.handles(one) and self._open:
                first = self._open[-1][1] + 1
                self._before = self._before or self._blocks.flow(first, row)
            case _ if is_structural(one):
                self._blocks.take(row, one)

    def begin(self, kind: str, row: int, said: ir.SourceStatement) -> None:
        """Open a scope: routines and records stand in outer ones only."""
        kinds = [kind for kind, _, _ in self._open]
        inside = kind != self.words.outer and kinds[:1] == [self.words.outer]
        self._close_until(int(inside), row - 1)
        self._find_flow(row, row)
        self._open.append((kind, row, said))

    def close(self) -> None:
        """Close what the file leaves open."""
        self._close_until(0, len(self.text) - 1)
        self._find_flow(0, len(self.text))
        self._blocks = FlowReader()  # the other one holds this outline

    def parts(self, moves: Sequence[int]) -> dict[str, Any]:
        """Return what every `TaskFile` holds, its moves at these rows."""
        return {
            "text": self.text,
            "routines": tuple(self.of(*self.words.routines)),
            "data": tuple(self.data),
            "moves": np.array(moves, dtype=np.int32),
            "diagnostics": tuple(sorted({*self.diagnostics})),
        }

    def _end(self, word: str, row: int) -> None:
        """End a scope, and what is left open within it."""
        kinds, kind = [kind for kind, _, _ in self._open], self.words.ends[word]
        if kind not in kinds:
            self._refuse(row, f"{self.text.quote(row)} ends no {kind.upper()}")
            return
        self._close_until(kinds.index(kind) + 1, row - 1)
        self._close(row)

    def _close_until(self, depth: int, row: int) -> None:
        """Close what stands open deeper than a depth, with a message."""
        while len(self._open) > depth:
            kind, begun, _ = self._open[-1]
            self._refuse(begun, self._tell_open(begun, kind))
            self._close(row, ended=False)

    def _close(self, row: int, ended: bool = True) -> None:
        """Close the innermost scope."""
        kind, begun, said = self._open.pop()
        flow = self._find_flow(begun + 1, row)
        scope = HeadedRows(said, begun, row, ended, flow)
        self.scopes.setdefault(kind, []).append(scope)

    def _find_flow(self, first: int, end: int) -> ControlFlow:
        """Return the blocks read so far: of statements, and the handlers behind."""
        flow, before = self._blocks.flow(first, end), self._before
        for row, what in flow.problems:
            self._refuse(row, what)
        self._begin_blocks()
        return replace(before, handlers=range(before.last, end)) if before else flow

    def _refuse(self, row: int, what: str) -> None:
        self.diagnostics.append(self.text.diagnostic(row, Code.OPEN_BLOCK, what))

    def complain(self, row: int, what: str) -> None:
        """Say what is wrong with a statement that is not understood."""
        text = f"{self.text.quote(row)} {what}"
        self.diagnostics.append(self.text.diagnostic(row, Code.UNKNOWN_STATEMENT, text))


def check_blocks(file: TaskFile) -> None:
    """Refuse a file whose blocks do not close.

    Raises:
        ProgramError: What runs when is not known.
    """
    for found in file.diagnostics:
        if found.code == Code.OPEN_BLOCK:
            cure = "Close it: what runs when is not known without"
            raise ProgramError(found.file, found.message, cure, line=found.line)


def _declares_open(one: ir.SourceStatement) -> bool:
    """Return True if a statement declares one name that is open, the first in it."""
    items = one.items if isinstance(one, ir.Declaration) else ()
    return len(items) == 1 and name_index(items[0].name) == 0
