"""What the files of a task declare: data, routines, and where they stand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from postproc.arrays import Indices
from postproc.language import ir
from postproc.language.analysis.control_flow import HeadedRows
from postproc.language.text.source import CloneError
from postproc.language.text.statement_table import StatementText
from postproc.language.visits import Diagnostic


@dataclass(frozen=True)
class Datum:
    """Data that a module or a routine declares, or an element that gets a value.

    Attributes:
        name: In lower case.
        type: As declared, "" for an element.
        row: Its statement.
        module: Name of the module, "" outside of all.
        routine: Name of the routine whose own it is, "" where it is the module's.
        value: What it is at first, None where nothing is said.
        index: Of an element, empty for the whole.
        dimensions: Of an array.
        kind, scope: As in `ir.Declaration`.
    """

    name: str
    type: str
    row: int
    module: str
    routine: str
    value: ir.Operand | None = None
    index: tuple[int, ...] = ()
    dimensions: tuple[ir.Operand, ...] = ()
    kind: str = "var"
    scope: str = ""


def list_data(
    one: ir.Declaration, row: int, module: str, routine: str
) -> Iterator[Datum]:
    """Yield the data of a declaration."""
    for item in one.items:
        yield Datum(
            item.name, one.type, row, module, routine, item.value,
            dimensions=item.dimensions, kind=one.kind, scope=one.scope,
        )  # fmt: skip


class TaskRoutine(NamedTuple):
    """A routine of a task.

    Attributes:
        file: Index of its file.
        module: Name of its module.
        rows: Its statements, from its head to its end.
    """

    file: int
    module: str
    rows: HeadedRows

    @property
    def key(self) -> tuple[int, int]:
        """What tells it apart: its file, and the row of its head."""
        return self.file, self.rows.first

    @property
    def inside(self) -> range:
        """The rows of its statements."""
        return range(self.rows.first + 1, self.rows.last)


@dataclass(frozen=True)
class TaskFile:
    """What a file of a task holds.

    Attributes:
        text: Its statements.
        routines: In the order of the file.
        data: Declared data.
        moves: Rows of statements that move, ascending, (m,).
        diagnostics: What is not understood, by line.
    """

    text: StatementText[Any]
    routines: tuple[HeadedRows, ...]
    data: tuple[Datum, ...]
    moves: Indices
    diagnostics: tuple[Diagnostic, ...]

    def find_move(self, line: int) -> int:
        """Return the only move that begins on a line.

        Raises:
            CloneError: There are others, or none.
        """
        rows = np.searchsorted(self.text.begin_line, [line, line + 1])
        found = self.moves[slice(*np.searchsorted(self.moves, rows).tolist())]
        if len(found) != 1:
            raise CloneError("no single move stands on its line")
        return int(found[0])

    def is_move(self, row: int) -> bool:
        """Return True if a statement moves."""
        at = np.searchsorted(self.moves, row)
        return bool(at < len(self.moves) and self.moves[at] == row)

    @property
    def is_system(self) -> bool:
        """Whether it is read and never rewritten."""
        return False

    @property
    def is_submit(self) -> bool:
        """Whether it runs beside the program, and moves no arm."""
        return False

    def module_of(self, routine: HeadedRows) -> str:
        """Return the name of the module that a routine stands in."""
        return ""
