"""Blocks of a text: every head has its end."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from postproc.diagnostics import Code
from postproc.exceptions import ProgramError
from postproc.language import ir
from postproc.language.analysis.control_flow import ENDS, HeadedRows
from postproc.language.analysis.declarations import Datum, TaskFile, list_data
from postproc.language.text.source import Source
from postproc.language.text.statement_table import StatementText
from postproc.language.visits import Diagnostic

INNER = {end: kind for kind, end in ENDS.items()}
DIVIDED = {"elseif": "if", "else": "if", "case": "test", "default": "test"}


@dataclass(frozen=True)
class BlockWords:
    """The words that blocks of a language end with.

    Attributes:
        ends: From a word to the kind of block that it ends.
        scopes: Kinds of modules, routines and records.
        outer: Those of them that hold others.
        routines: Those that run.
    """

    ends: Mapping[str, str]
    scopes: Collection[str]
    outer: Collection[str]
    routines: Collection[str]


@dataclass
class Outline:
    """Modules, routines, records and blocks of a file, as they are met.

    Attributes:
        text: Its statements.
        words: The words of the language.
        scopes: Modules, routines and records by kind, as they end.
        data: What they declare.
        diagnostics: Blocks that do not close, and what is not understood.
    """

    text: StatementText[Any]
    words: BlockWords
    scopes: dict[str, list[HeadedRows]] = field(default_factory=dict)
    data: list[Datum] = field(default_factory=list)
    diagnostics: list[Diagnostic] = field(default_factory=list)
    _open: list[tuple[str, int, ir.SourceStatement]] = field(default_factory=list)

    def of(self, *kinds: str) -> list[HeadedRows]:
        """Return the scopes of some kinds, in the order of the file."""
        found = [scope for kind in kinds for scope in self.scopes.get(kind, [])]
        return sorted(found, key=lambda scope: scope.first)

    def name(self, *kinds: str) -> str:
        """Return the name of the innermost open scope of some kinds."""
        heads = (said for kind, _, said in reversed(self._open) if kind in kinds)
        return getattr(next(heads, None), "name", "")

    @property
    def routine(self) -> str:
        """The name of the routine that is open, "" without one."""
        return self.name(*self.words.routines)

    def take(self, row: int, one: ir.SourceStatement, module: str) -> None:
        """Take the next statement.

        Args:
            row: Its row.
            one: What it says.
            module: Name of the module that it stands in.
        """
        match one:
            case ir.Declaration():
                self.data += list_data(one, row, module, self.routine)
            case ir.ScopeHead(kind=kind) | ir.RoutineHead(kind=kind):
                self.begin(kind, row, one)
            case ir.ForLoop():
                self.open("for", row, one)
            case ir.Branch(word=word) if word in self.words.ends.values():
                self.open(word, row, one)
            case ir.Branch(word=word) | ir.BlockWord(word=word):
                self.word(word, row)
            case ir.NotUnderstood():
                self.complain(row, Code.UNKNOWN_STATEMENT, "is not understood")

    def begin(self, kind: str, row: int, said: ir.SourceStatement) -> None:
        """Open a scope: routines and records stand in outer ones only."""
        around = [one for one, _, _ in self._open if one in self.words.outer]
        self._close_until(0 if kind in self.words.outer else len(around), row - 1)
        self.open(kind, row, said)

    def open(self, kind: str, row: int, said: ir.SourceStatement) -> None:
        """Open a block."""
        self._open.append((kind, row, said))

    def word(self, word: str, row: int) -> None:
        """Divide or end a block."""
        kinds = [kind for kind, _, _ in self._open]
        if word in DIVIDED:
            if kinds[-1:] != [DIVIDED[word]]:
                text = f"stands in no {DIVIDED[word].upper()}"
                self.complain(row, Code.OPEN_BLOCK, text)
        elif word in self.words.ends:
            self._end(word, row, kinds)

    def close(self) -> None:
        """Close what the file leaves open."""
        self._close_until(0, len(self.text) - 1)

    def parts(self, moves: Sequence[int]) -> dict[str, Any]:
        """Return what every `TaskFile` holds, its moves at these rows."""
        return {
            "text": self.text,
            "routines": tuple(self.of(*self.words.routines)),
            "data": tuple(self.data),
            "moves": np.array(moves, dtype=np.int32),
            "diagnostics": tuple(sorted({*self.diagnostics})),
        }

    def _end(self, word: str, row: int, kinds: Sequence[str]) -> None:
        kind, scopes = self.words.ends[word], self.words.scopes
        last = max((k + 1 for k, own in enumerate(kinds) if own in scopes), default=0)
        inner = kinds if kind in scopes else kinds[last:]
        if kind not in inner:
            self.complain(row, Code.OPEN_BLOCK, f"ends no {kind.upper()}")
            return
        at = len(kinds) - 1 - list(reversed(kinds)).index(kind)
        self._close_until(at + 1, row - 1)
        self._close(self._open.pop(), row)

    def _close_until(self, depth: int, row: int) -> None:
        """Close what stands open deeper than a depth, with a message."""
        words = {kind: word for word, kind in self.words.ends.items()}
        while len(self._open) > depth:
            kind, begun, said = self._open.pop()
            self.complain(begun, Code.OPEN_BLOCK, f"has no {words[kind].upper()}")
            self._close((kind, begun, said), row, ended=False)

    def _close(
        self, block: tuple[str, int, ir.SourceStatement], row: int, ended: bool = True
    ) -> None:
        kind, begun, said = block
        if kind in self.words.scopes:
            scope = HeadedRows(said, begun, row, ended)
            self.scopes.setdefault(kind, []).append(scope)

    def complain(self, row: int, code: Code, what: str) -> None:
        """Say what is wrong with a statement."""
        message = f"{self.text.quote(row)} {what}"
        self.diagnostics.append(self.text.diagnostic(row, code, message))


File = TypeVar("File", bound=TaskFile)


def read_once(
    source: Source, known: Sequence[File], read: Callable[[Source], File]
) -> File:
    """Read a file, unless it was read before."""
    same = (file for file in known if file.text.source == source)
    return next(same, None) or read(source)


def check_blocks(file: TaskFile) -> None:
    """Refuse a file whose blocks do not close.

    Raises:
        ProgramError: What runs when is not known.
    """
    for found in file.diagnostics:
        if found.code == Code.OPEN_BLOCK:
            cure = "Close it: what runs when is not known without"
            raise ProgramError(found.file, found.message, cure, line=found.line)
